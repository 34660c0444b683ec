"""Joining of two maps of one building, if they certainly overlap.

The second map is searched for in the first as a robot with an unknown start searches itself; then
its key poses have to match those of the first one by one.
"""

from __future__ import annotations

import numpy as np

from navfw.localization.plan_field import PlanField
from navfw.localization.plan_search import PlanSearch
from navfw.mapping.growing_map import GrowingMap
from navfw.mapping.loop_closing import relation_of
from navfw.mapping.map_making import cleaned_grid
from navfw.mapping.matching import LocalPlan, free_ground, plan_of
from navfw.mapping.pose_graph import Relation
from navfw.numerics import Array
from navfw.signals import Pose

_MATCHES = 4  # chosen
"""Key poses that must match for two maps to be of one building."""

_MIN_KEYS = 5  # chosen
"""Key poses within 8 m for a search."""

_REACH = 4.0  # chosen
"""Distance [m] of the key poses of the first map to which one of the second is matched."""

_LOOSE: Array = np.diag([0.2**-2, 0.2**-2, 0.05**-2])  # chosen
"""Information of a pose that was found: odometry has drifted in both maps."""

_PARTS = 10_000  # chosen
"""Largest number of parts of one search; a search has at most some hundred."""


def join(first: GrowingMap, second: GrowingMap) -> bool:
    """Add the key poses of ``second`` to ``first``; return False if they do not surely overlap."""
    grid = first.grid
    plan = plan_of(cleaned_grid(grid))
    search = PlanSearch(plan, PlanField(plan, surfaces=True), first.robot.radius, _MIN_KEYS)
    for key, cloud in zip(second.keys, second.clouds, strict=True):
        if not len(cloud.points):
            continue
        search.add(key.path, key.pose, cloud)
        search.begin()
        frame = None
        for _ in range(_PARTS):
            if not search.searching:
                break
            frame = search.go_on(1.0)
        if frame is None:
            continue
        relations = _relations(first, second, frame, grid.cell)
        if len(relations) >= _MATCHES:
            first.join(second, frame, relations)
            return True
    return False


def _relations(first: GrowingMap, second: GrowingMap, frame: Pose, cell: float) -> list[Relation]:
    """Match the key poses of ``second``, placed by ``frame``, to the map of the ``first``."""
    relations = []
    for index, (key, cloud) in enumerate(zip(second.keys, second.clouds, strict=True)):
        start = frame.compose(key.pose)
        plan = LocalPlan.around(start, first.keys, _REACH, cell)
        if plan is None or not len(cloud.points):
            continue
        match = plan.match(cloud, free_ground([key], cell), start, _LOOSE)
        if match is not None:
            count = len(first.keys)
            relations.append(relation_of(first.keys, range(count), match, count + index))
    return relations
