"""The search for another way to the goal, when the map has none: over the ground seen so far.

Ground that was not seen counts as passable at a price, which depends on what the map's floor plan
shows there. The cheapest path leads past what was seen occupied, to the nearest place where there
may be a way to the goal. What the robot sees there changes the path, until it is at the goal, or
nothing is left that might lead to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from navfw.errors import MapError
from navfw.papfis.known_ground import KnownGround, UnseenGround, steady
from navfw.papfis.routes import Endpoint, Router
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Waypoint
from navfw.topomap import Passage, Place
from navfw.topomap.occupancy_map import OccupancyMap

Point = tuple[float, float]

_REPLAN = 1.0  # chosen
"""Time [s] between two plans."""
_LOOKAHEAD = 2.5  # chosen
"""Largest distance [m] of the waypoint."""
_MOVED, _PATIENCE = 0.4, 12.0  # chosen
"""A robot that moves by less [m] in this time [s] while it searches shuns where it heads."""
_SHUN, _SHUNNED = 0.4, 15.0  # chosen
"""Distance [m] around a waypoint that was not reached, in which cells cost this much more."""
_GAP = 1.5  # chosen
"""Time [s] between two updates beyond which nothing is known of the robot."""
_LIMIT = 120.0  # chosen
"""Time [s] of searching after which a goal is given up: the walls around it have been looked at."""
_TRACK, _STRAIGHT = 0.25, 0.2  # chosen
"""Spacing [m] of the points of the track that are kept; how far it may be from a straight line."""
_SPARE = 0.08  # chosen
"""Room [m] beside the body on ways that were driven: it was kept from what was seen."""
_FOUND = "found-"  # defined
"""Begin of the names of places on ways that were found."""


class Standstill:
    """Says when the robot has hardly moved for ``patience`` [s]: it does not get through."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._at: Point | None = None
        self._last = self._stood = 0.0

    def update(self, at: Point, time: float) -> bool:
        """Take in the position ``at`` (x, y) [m]; return whether it has lasted too long again."""
        self._stood += min(time - self._last, _GAP)
        self._last = time
        if self._at is None or math.dist(at, self._at) >= _MOVED:
            self._at, self._stood = at, 0.0
        if self._stood < self._patience:
            return False
        self._stood = 0.0
        return True


class WaySearch:
    """Searches a way to one goal after another; ``waypoint`` is where to head, None without a way.

    ``spent`` [s] is the time of searching for the present goal; up to _LIMIT there is a waypoint.
    ``cost`` [m] is that of the path ahead, with the prices of ground that was not seen. ``track``
    are points (x, y) [m] that the robot has driven over since the search for this goal began.
    """

    def __init__(self, robot: RobotModel, plan: OccupancyMap | None) -> None:
        self._robot, self._plan = robot, plan
        self.spent = 0.0
        self.end()

    def end(self) -> None:
        """Forget the search: there is a route, or the goal was reached."""
        self.waypoint: Waypoint | None = None
        self.path: list[Waypoint] = []
        self.cost = math.inf
        self.track: list[Point] = []
        self._planned = -math.inf
        self._standstill = Standstill(_PATIENCE)
        self._shunned: list[Point] = []

    def update(self, grid: GrownGrid, at: Point, goal: Waypoint, time: float) -> None:
        """Search from ``at`` (x, y) [m] to ``goal`` on ``grid``, if a plan is due."""
        if not self.track or math.dist(at, self.track[-1]) >= _TRACK:
            self.track.append(at)
        if time - self._planned < _REPLAN - 1e-6:
            return
        self.spent += min(time - self._planned, _GAP)
        self._planned = time
        if self._standstill.update(at, time) and self.waypoint is not None:
            self._shunned.append((self.waypoint.x, self.waypoint.y))
            self.waypoint = None
        hopes = UnseenGround((goal.x, goal.y), self._plan)
        ground = KnownGround.of(grid, self._robot, at, hopes)
        self._shun(ground)
        costs = ground.costs_from(*at)
        path = ground.path_to(costs, goal.x, goal.y)
        self.cost = ground.length_at(costs, goal.x, goal.y) * ground.cell
        if not len(path) or self.spent > _LIMIT:
            self.waypoint, self.path, self.cost = None, [], math.inf
            return
        self.path = ground.way(path, at, goal, _LOOKAHEAD)
        self.waypoint = steady(self.waypoint, self.path[0], at)

    def _shun(self, ground: KnownGround) -> None:
        rows, columns = ground.price.shape
        y, x = np.ogrid[:rows, :columns]
        for px, py in self._shunned:
            away = np.hypot(
                ground.origin[0] + ground.cell * x - px, ground.origin[1] + ground.cell * y - py
            )
            ground.price[away <= _SHUN] += _SHUNNED


@dataclass(frozen=True, slots=True)
class FoundWay:
    """A way from one place of the map to another, along ``track`` (x, y) [m], that it has not."""

    places: tuple[Place, ...]
    passages: tuple[Passage, ...]
    track: tuple[Point, ...]

    def __str__(self) -> str:
        return f"way from {self.passages[0].a} to {self.passages[-1].b}"


def found_way(router: Router, track: Sequence[Point], radius: float) -> FoundWay | None:
    """Return the way along ``track`` (x, y) [m], which a body of ``radius`` [m] has driven.

    None if the map connects its ends in another way.
    """
    ends = [Endpoint(*track[0]), Endpoint(*track[-1])]
    try:
        router.route(*ends)
    except MapError:
        pass
    else:
        return None
    known = list(router.topo_map.places)
    access = [router.access(end).costs for end in ends]
    first, last = (min(costs, key=lambda name: (costs[name], name)) for costs in access)
    if first == last:
        return None
    line = cv2.approxPolyDP(np.array(track, np.float32)[:, None], _STRAIGHT, closed=False)
    number = sum(name.startswith(_FOUND) for name in known)
    places = tuple(
        Place(f"{_FOUND}{number + k}", round(float(x), 2), round(float(y), 2))
        for k, (x, y) in enumerate(line[:, 0].tolist(), 1)
    )
    ways = [router.topo_map.places[first], *places, router.topo_map.places[last]]
    width = round(2.0 * (radius + _SPARE), 2)
    passages = tuple(
        Passage(a.name, b.name, max(a.distance(b.x, b.y), 0.01), width) for a, b in pairwise(ways)
    )
    return FoundWay(places, passages, tuple(track))
