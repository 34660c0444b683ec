"""Joins two maps of one building, if they certainly overlap.

The second map is searched for in the first as a robot with an unknown start searches for itself;
then its key poses have to match those of the first one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Self

import numpy as np

from navfw.localization.plan_field import PlanField
from navfw.localization.plan_search import PlanSearch
from navfw.mapping.evidence_grid import KeyPose
from navfw.mapping.growing_map import GrowingMap
from navfw.mapping.loop_closing import relation_of
from navfw.mapping.map_making import cleaned_grid
from navfw.mapping.matching import LocalPlan, free_ground, plan_of
from navfw.mapping.pose_graph import Relation
from navfw.numerics import Array
from navfw.signals import Pose

_MATCHES = 4  # chosen
"""Number of key poses that must match for two maps to be of one building."""

_MIN_KEYS = 5  # chosen
"""Number of key poses within 8 m that a search needs."""

_REACH = 4.0  # chosen
"""Largest distance [m] of key poses of the first map to which one of the second is matched."""

_LOOSE: Array = np.diag([0.2**-2, 0.2**-2, 0.05**-2])  # chosen
"""Information of a pose that was found: odometry has drifted in both maps."""

_SHORT, _OWN = 1.5, 3.0  # chosen
"""Length [m] of the shortest drive that is joined, and of the shortest that is kept unjoined."""

_PARTS = 10_000  # chosen
"""Largest number of parts of one search; a search has at most some hundred."""


@dataclass(eq=False, slots=True)
class JoinedMap:
    """The map ``growing`` made of several maps with a total path of ``path`` [m].

    ``spans`` are the ranges of the key poses of each map, by its number.
    """

    growing: GrowingMap
    path: float
    spans: dict[int, tuple[int, int]]

    @classmethod
    def of(cls, number: int, growing: GrowingMap) -> Self:
        """Make a joined map of the single map with that ``number``."""
        path = growing.keys[-1].path if growing.keys else 0.0
        return cls(growing, path, {number: (0, len(growing.keys))})

    def keys(self, number: int) -> Sequence[KeyPose]:
        """Return the key poses of the map with that ``number``, as they have been corrected."""
        return self.growing.keys[slice(*self.spans[number])]


def key_at(keys: Iterable[KeyPose], time: float) -> KeyPose:
    """Return that of the ``keys`` nearest to ``time`` [s]; there must be one."""
    return min(keys, key=lambda key: abs(key.submap.time - time))


def free_names(name: str, is_taken: Callable[[str], bool]) -> Iterator[str]:
    """Yield ``name``, then names for further maps: ``name``-2 and so on that are not taken."""
    yield name
    yield from (other for n in count(2) if not is_taken(other := f"{name}-{n}"))


def join_all(growing_maps: Iterable[GrowingMap]) -> list[JoinedMap]:
    """Join those maps that certainly overlap; the later one is added to the earlier one.

    Maps of short drives are left out; none is returned if all are too short to be joined.
    """
    apart: list[JoinedMap] = []
    for number, growing in enumerate(growing_maps):
        newest, joined = JoinedMap.of(number, growing), False
        if newest.path < _SHORT:
            continue
        for other in tuple(apart):
            first, second = (newest, other) if joined else (other, newest)
            keys = len(first.growing.keys)
            if join(first.growing, second.growing):
                first.spans |= {n: (a + keys, b + keys) for n, (a, b) in second.spans.items()}
                first.path += second.path
                newest, joined = first, True
                apart = [one for one in apart if one is not second]
        apart += [] if joined else [newest]
    longest = max((one.path for one in apart), default=0.0)
    return [one for one in apart if one.path >= min(_OWN, longest)]


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
