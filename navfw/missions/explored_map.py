"""The map of what an exploration observed: places, doors and passages, over its floor plan."""

from __future__ import annotations

import numpy as np

from navfw.localmap.cell_arrays import distances
from navfw.papfis.known_ground import without_specks
from navfw.signals import GrownGrid, Pose
from navfw.topomap import TopoMap
from navfw.topomap.clearance_grid import ClearanceGrid
from navfw.topomap.map_builder import build_map
from navfw.topomap.occupancy_map import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyMap

_SPECK = 0.06
"""Area [m^2] of unseen ground amid free ground that counts as free."""
_FAR = 10.0
"""Clearance [m] where no wall is near."""


def explored_map(name: str, grid: GrownGrid) -> TopoMap:
    """The map ``name`` of the free ground of ``grid``, with its floor plan; unseen is not free.

    Raises:
        MapError: no ground is free for the robot.

    """
    free = without_specks(grid.free, grid.occupied, _SPECK / grid.cell**2)
    cells: Cells = np.full(free.shape, UNKNOWN, np.int8)
    cells[free], cells[grid.occupied] = FREE, OCCUPIED
    x, y = (first - 0.5 * grid.cell for first in grid.origin)
    plan = OccupancyMap(cells, grid.cell, Pose(x, y, 0.0))
    away = distances(~np.pad(free, 1), grid.cell, _FAR)[1:-1, 1:-1] - 0.5 * grid.cell
    made = build_map(name, ClearanceGrid(grid.origin, grid.cell, away))
    return TopoMap(name, made.places.values(), made.passages, floor_plan=plan)
