"""A* search over the topological map with precomputed costs."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

from navfw.signals import Array
from navfw.topomap import Passage, TopoMap


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The places on the cheapest path, in order, and its total cost with entry and exit."""

    places: tuple[str, ...]
    cost: float


class CostGraph:
    """The map's graph as adjacency lists with one cost per passage.

    ``costs`` (passages,) is in the order of ``topo_map.passages``; infinite means impassable. Each
    cost must be at least the straight distance between its places: that keeps the straight-line
    heuristic admissible and consistent, so the first arrival at a place is the cheapest.
    """

    def __init__(self, topo_map: TopoMap, costs: Array) -> None:
        self._points = {place.name: (place.x, place.y) for place in topo_map.places.values()}
        self._neighbors: dict[str, dict[str, float]] = {name: {} for name in self._points}
        for passage, cost in zip(topo_map.passages, costs.tolist(), strict=True):
            self.set_cost(passage, cost)

    def set_cost(self, passage: Passage, cost: float) -> None:
        """Set the cost of one passage, at least its straight distance; infinite closes it."""
        for start, end in ((passage.a, passage.b), (passage.b, passage.a)):
            if math.isfinite(cost):
                self._neighbors[start][end] = cost
            else:
                self._neighbors[start].pop(end, None)

    def cheapest_path(
        self, entries: Mapping[str, float], exits: Mapping[str, float], goal: tuple[float, float]
    ) -> SearchResult | None:
        """The cheapest path from one of ``entries`` to one of ``exits``; None without one.

        Both map places to costs: from the start to the place, and from the place to the goal. The
        ``goal`` is at (x, y) [m]; no exit costs less than the straight distance to it.
        """
        points, neighbors, hypot = self._points, self._neighbors, math.hypot
        goal_x, goal_y = goal
        order = itertools.count()  # breaks ties: of equal costs the first pushed is popped first
        came_from: dict[str, str | None] = {}
        queue: list[tuple[float, int, float, str | None, str | None]] = []
        best: dict[str, float] = {}
        for entry, cost in entries.items():
            x, y = points[entry]
            best[entry] = cost
            queue.append((cost + hypot(x - goal_x, y - goal_y), next(order), cost, entry, None))
        heapq.heapify(queue)
        while queue:
            _, _, cost, name, previous = heapq.heappop(queue)
            if name is None:  # the goal itself
                return SearchResult(_trace(came_from, previous), cost)
            if name in came_from:
                continue
            came_from[name] = previous
            if name in exits:
                total = cost + exits[name]
                heapq.heappush(queue, (total, next(order), total, None, name))
            for neighbor, step in neighbors[name].items():
                reached = cost + step
                if neighbor not in came_from and reached < best.get(neighbor, math.inf):
                    best[neighbor] = reached
                    x, y = points[neighbor]
                    estimate = reached + hypot(x - goal_x, y - goal_y)
                    heapq.heappush(queue, (estimate, next(order), reached, neighbor, name))
        return None


def _trace(came_from: Mapping[str, str | None], last: str | None) -> tuple[str, ...]:
    places = []
    while last is not None:
        places.append(last)
        last = came_from[last]
    return tuple(reversed(places))
