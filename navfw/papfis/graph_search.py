"""A* over the topological map with costs that were worked out beforehand."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

from navfw.signals import Array
from navfw.topomap import Passage, TopoMap

__all__ = ["Found", "RoadNetwork"]


@dataclass(frozen=True, slots=True)
class Found:
    """The places on the cheapest path, in order, and its whole cost with entry and exit."""

    places: tuple[str, ...]
    cost: float


class RoadNetwork:
    """The map's graph with one cost per passage laid out for the search.

    ``costs`` (passages,) is in the order of ``topo_map.passages``; infinite means impassable. Each
    cost must be at least the straight distance between its places: that keeps the straight-line
    heuristic admissible and consistent, and so the first arrival at a place the cheapest.
    """

    def __init__(self, topo_map: TopoMap, costs: Array) -> None:
        self._points = {place.name: (place.x, place.y) for place in topo_map.places.values()}
        self._roads: dict[str, dict[str, float]] = {name: {} for name in self._points}
        for passage, cost in zip(topo_map.passages, costs.tolist(), strict=True):
            self.set_cost(passage, cost)

    def set_cost(self, passage: Passage, cost: float) -> None:
        """Give one passage another cost, at least its straight distance; infinite to close it."""
        for start, end in ((passage.a, passage.b), (passage.b, passage.a)):
            if math.isfinite(cost):
                self._roads[start][end] = cost
            else:
                self._roads[start].pop(end, None)

    def cheapest(
        self, entries: Mapping[str, float], exits: Mapping[str, float], aim: tuple[float, float]
    ) -> Found | None:
        """The cheapest way in at one of ``entries`` and out at one of ``exits``; None without one.

        Both give a cost by place: of getting there from the start, and from there to the goal. The
        goal is at ``aim`` (x, y) [m], and no exit costs less than the straight way to it.
        """
        points, roads, hypot = self._points, self._roads, math.hypot
        aim_x, aim_y = aim
        order = itertools.count()  # breaks ties, so that equal costs are served first come first
        came_from: dict[str, str | None] = {}
        queue: list[tuple[float, int, float, str | None, str | None]] = []
        best: dict[str, float] = {}
        for entry, cost in entries.items():
            x, y = points[entry]
            best[entry] = cost
            queue.append((cost + hypot(x - aim_x, y - aim_y), next(order), cost, entry, None))
        heapq.heapify(queue)
        while queue:
            _, _, cost, name, previous = heapq.heappop(queue)
            if name is None:  # the goal itself
                return Found(_trace(came_from, previous), cost)
            if name in came_from:
                continue
            came_from[name] = previous
            if name in exits:
                total = cost + exits[name]
                heapq.heappush(queue, (total, next(order), total, None, name))
            for neighbor, step in roads[name].items():
                reached = cost + step
                if neighbor not in came_from and reached < best.get(neighbor, math.inf):
                    best[neighbor] = reached
                    x, y = points[neighbor]
                    estimate = reached + hypot(x - aim_x, y - aim_y)
                    heapq.heappush(queue, (estimate, next(order), reached, neighbor, name))
        return None


def _trace(came_from: Mapping[str, str | None], last: str | None) -> tuple[str, ...]:
    places = []
    while last is not None:
        places.append(last)
        last = came_from[last]
    return tuple(reversed(places))
