"""Submaps: what the local map has observed since the last key pose, as compact evidence.

The local map's evidence decays, and most of it was in the last submap as well. A cell belongs to a
submap only if its log-odds have changed by more than decay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from navfw.localmap import LocalMap
from navfw.localmap.cell_arrays import bounds, shifted
from navfw.localmap.low_layer import with_low_things
from navfw.localmap.occupancy_grid import OccupancyParams
from navfw.numerics import Array, Mask
from navfw.signals import OccupiedDisc, Pose
from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, SCALE, Evidence

_CHANGED = 0.02  # chosen
"""Change of log-odds, besides decay, above which a cell has been observed."""

_CERTAIN = 64  # chosen
"""Evidence of cells that other layers of the local map show as occupied: low things, drops."""

_AROUND_MOVER = 0.15  # chosen
"""Distance [m] beyond a moving obstacle's disc up to which observations are not kept."""


@dataclass(frozen=True, slots=True)
class Submap:
    """Evidence (rows, columns) around a key pose, on the axes of ``odom``.

    The centre of cell (i, j) is at ``corner`` + (j, i) * cell [m, odom]. ``key`` is the robot's
    pose in ``odom`` at ``time`` [s], ``drops`` (n, 2) [m, odom] are spots whose floor is missing.
    """

    time: float
    key: Pose
    corner: tuple[float, float]
    evidence: Evidence
    drops: Array


class SubmapCutter:
    """Cuts submaps out of one local map, each with what was observed since the last one."""

    def __init__(self) -> None:
        self._before: tuple[float, tuple[float, float], Array] | None = None

    def reset(self) -> None:
        """Forget the last submap: the next one has all that the local map knows."""
        self._before = None

    def cut(
        self, local_map: LocalMap, key: Pose, time: float, moving: Sequence[OccupiedDisc] = ()
    ) -> Submap:
        """Return what ``local_map`` has observed since the last cut, around odom pose ``key``.

        ``time`` [s] is that of ``key``. Cells under ``moving`` obstacles (odom) are left out.
        """
        submap = self.observed(local_map, key, time, moving)
        grid = local_map.occupancy
        self._before = time, grid.origin, grid.log_odds.copy()
        return submap

    def observed(
        self, local_map: LocalMap, key: Pose, time: float, moving: Sequence[OccupiedDisc] = ()
    ) -> Submap:
        """Return the submap that ``cut`` would cut, without cutting it."""
        grid = local_map.occupancy
        low = with_low_things(grid.log_odds >= grid.params.occupied, grid.low)
        evidence = np.rint(SCALE * grid.log_odds)
        evidence[~self._fresh(grid.log_odds, grid.origin, time, grid.params)] = 0.0
        evidence[low & (grid.log_odds < grid.params.occupied)] = _CERTAIN
        drops = local_map.drops.points()
        for x, y, radius, value in (
            *((d.x, d.y, d.radius, _CERTAIN) for d in local_map.drops.discs()),
            *((m.x, m.y, m.radius + _AROUND_MOVER, 0) for m in moving),
        ):
            row, column = grid.index(x, y)
            cv2.circle(evidence, (column, row), round(radius / grid.params.cell), value, cv2.FILLED)
        weak = (evidence > FREE_BELOW) & (evidence < OCCUPIED_FROM)
        evidence[weak] = 0.0
        rows, columns = bounds(evidence != 0.0)
        x, y = grid.origin
        corner = x + columns.start * grid.params.cell, y + rows.start * grid.params.cell
        kept = evidence[rows, columns].astype(np.int8)
        return Submap(time, key, corner, kept, np.array(drops, dtype=np.float64).reshape(-1, 2))

    def _fresh(
        self, log_odds: Array, origin: tuple[float, float], time: float, p: OccupancyParams
    ) -> Mask:
        """Return which cells (n, n) have been observed since the last cut."""
        if self._before is None:
            return np.asarray(log_odds != 0.0)
        then, at, before = self._before
        moved = [round((now - was) / p.cell) for now, was in zip(origin, at, strict=True)]
        decayed = shifted(before, *moved) * math.exp((then - time) / p.decay)
        return np.asarray(np.abs(log_odds - decayed) > _CHANGED)
