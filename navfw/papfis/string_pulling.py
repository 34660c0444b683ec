"""String pulling: the farthest point of the route that the robot may head for in a straight line.

Places of a map lie in the middle of rooms and corridors; who drives from one to the next goes
round. A straight line is used where it is free, by what the local map has observed, by the floor
plan, or within the width of the route's passages; and where it is no dearer than the route: the
fuzzy costs of the edges decide how much clearance is worth a metre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from navfw.numerics import Array
from navfw.papfis.routes import Router
from navfw.signals import SightLines, Waypoint

MIN_ROOM = 0.1  # chosen
"""Least clearance [m] of a straight line from the body's rim."""
NARROW_PRICE = 0.5  # chosen
"""Extra price of a line's metre that is "narrow" in the rules of the costs of edges."""
SURE_SIGHT = 1.5  # chosen
"""Distance [m] up to which the local map is surer than the map."""
MAX_HALF_WIDTH = 1.0  # chosen
"""Half width [m] up to which a passage is taken to be free where nothing was observed."""

Point = tuple[float, float]


class StringPuller:
    """Chooses the straight line to the farthest point of a route, by ``router``'s costs."""

    def __init__(self, router: Router, radius: float) -> None:
        self._router = router
        self._radius = radius
        self._plan = plan = router.topo_map.floor_plan
        if plan is not None:
            free = cv2.distanceTransform(plan.free.astype(np.uint8), cv2.DIST_L2, 5)
            self._plan_room = (free.astype(np.float64) - 0.5) * plan.resolution - radius

    def farthest(
        self, lines: SightLines, at: Point, ahead: Sequence[Waypoint], last: int
    ) -> tuple[int, Point] | None:
        """Return the leg's index and the point (x, y) [m, map]; None without a straight line.

        ``ahead`` are the ends of the route's legs, the first of which begins ``at`` the robot; no
        line leads beyond the leg ``last``.
        """
        shares = np.linspace(0.0, 1.0, lines.clearance.shape[1] + 1)[1:, None]
        points = at + shares * (lines.ends - at)[:, None]
        lengths = np.hypot(*(lines.ends - at).T)
        room = self._room(points, shares[:, 0] * lengths[:, None], lines, ahead)
        narrow = self._router.costs.narrowness(room).mean(axis=1)
        usable = (room.min(axis=1) >= MIN_ROOM) & (lines.legs <= last)
        usable &= lengths * (1.0 + NARROW_PRICE * narrow) <= _lengths_along(lines, at, ahead)
        if not usable.any():
            return None
        best = int(np.flatnonzero(usable)[-1])
        return int(lines.legs[best]), (float(lines.ends[best, 0]), float(lines.ends[best, 1]))

    def _room(
        self, points: Array, away: Array, lines: SightLines, ahead: Sequence[Waypoint]
    ) -> Array:
        """Return the clearance (m, n) [m] at ``points`` (m, n, 2), ``away`` (m, n) [m]; or -inf.

        Far away the map is surer than what the camera saw of a door's posts.
        """
        known = self._mapped(points, ahead[: int(lines.legs.max()) + 1])
        seen = np.where(lines.observed | (known >= 0.0), lines.clearance, -math.inf)
        if self._plan is not None:
            near, far = np.minimum(seen, known), known
        else:  # a passage says how far it is free, not where the walls are
            near, far = seen, np.maximum(seen, known)
        return np.where((away > SURE_SIGHT) & (known >= 0.0), far, near)

    def _mapped(self, points: Array, legs: Sequence[Waypoint]) -> Array:
        """Return the clearance (m, n) [m] at ``points`` by the floor plan, or the legs' widths."""
        known = np.full(points.shape[:2], -math.inf)
        if self._plan is not None:
            cells = self._plan.cells_at(points.reshape(-1, 2))
            inside = np.all((cells >= 0) & (cells < self._plan_room.shape), axis=1)
            known.ravel()[inside] = self._plan_room[tuple(cells[inside].T)]
            return known
        places = self._router.topo_map.places
        for waypoint in legs:
            if waypoint.passage is None:
                continue
            a, b = (np.array((places[name].x, places[name].y)) for name in waypoint.passage)
            length = max(float(np.sum((b - a) ** 2)), 1e-9)
            share = np.clip(np.sum((points - a) * (b - a), axis=-1) / length, 0.0, 1.0)
            aside = np.hypot(*np.moveaxis(points - a - share[..., None] * (b - a), -1, 0))
            half = min(0.5 * waypoint.width, MAX_HALF_WIDTH)
            np.maximum(known, half - aside - self._radius, out=known)
        return known


def _lengths_along(lines: SightLines, at: Point, ahead: Sequence[Waypoint]) -> Array:
    """Return the length (m,) [m] of the route from the robot to each line's end."""
    lengths = np.empty(len(lines.legs))
    start, total = at, 0.0
    for i, waypoint in enumerate(ahead[: int(lines.legs.max()) + 1]):
        on_leg = lines.legs == i
        lengths[on_leg] = total + np.hypot(*(lines.ends[on_leg] - start).T)
        total += math.dist(start, (waypoint.x, waypoint.y))
        start = waypoint.x, waypoint.y
    return lengths
