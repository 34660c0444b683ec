"""The floor plan of a world as a grid of cells: what a robot may know, and ROS can read."""

from __future__ import annotations

import numpy as np

from navfw.errors import InputError
from navfw.signals import Pose
from navfw.sim.floorplan import FloorPlan
from navfw.sim.worldspec import WorldSpec
from navfw.topomap.occupancy_map import FREE, MAX_CELLS, OCCUPIED, OccupancyMap

RESOLUTION = 0.05
"""Edge of a cell [m]: the usual one of maps for Nav2."""


def exported_plan(
    world: WorldSpec, resolution: float = RESOLUTION, *, walls_only: bool = False
) -> OccupancyMap:
    """The plan of ``world``: the cells whose centre is in a solid, or over a drop, are occupied.

    With ``walls_only`` it has neither furniture nor drops, and all doors are open: an architect's
    plan, while the other one is what a robot would have mapped.

    Raises:
        InputError: ``resolution`` is out of range, or the plan would have too many cells.

    """
    if not 0.001 <= resolution <= 10.0:
        raise InputError(f"expected 0.001 to 10 m, got {resolution:g}", key="resolution")
    width, depth = world.x[1] - world.x[0], world.y[1] - world.y[0]
    if width * depth / resolution**2 > MAX_CELLS:
        raise InputError(
            f"the world has {width:g} x {depth:g} m, more than {MAX_CELLS} cells of "
            f"{resolution:g} m; choose a larger resolution",
        )
    plan = FloorPlan.from_world(world)
    if walls_only:
        walls = tuple(solid for solid in plan.solids if solid.kind == "wall")
        plan = FloorPlan(plan.bounds, walls)
    grid = plan.configuration_space(cell=resolution)
    cells = np.where(grid.occupied, OCCUPIED, FREE).astype(np.int8)
    return OccupancyMap(cells, resolution, Pose(*grid.origin, 0.0))
