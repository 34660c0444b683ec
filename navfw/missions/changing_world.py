"""The parts of a world that change during a run: what moves, and what exists for a time only."""

from __future__ import annotations

import numpy as np

from navfw.signals import Array
from navfw.sim.floorplan import FloorPlan
from navfw.sim.movers import MoverTrack
from navfw.sim.world_changes import ChangeTrack


class CombinedClearance:
    """Clearances to the nearest of several sets of moving or temporary bodies."""

    def __init__(self, *parts: MoverTrack | ChangeTrack | None) -> None:
        self._parts = [part for part in parts if part is not None]

    def clearances(self, points: Array, times: Array) -> Array:
        """Clearances (n,) [m] of ``points`` (n, 2) at ``times`` (n,) [s]; inf without bodies."""
        nearest = np.full(len(points), np.inf)
        for part in self._parts:
            np.minimum(nearest, part.clearances(points, times), out=nearest)
        return nearest


def permanent_plan(plan: FloorPlan, changes: ChangeTrack | None) -> FloorPlan:
    """The plan of the solids that existed during the whole run."""
    if changes is None or not changes.names:
        return plan
    return FloorPlan(plan.bounds, tuple(s for s in plan.solids if s.name not in changes.names))
