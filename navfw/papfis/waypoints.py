"""Waypoints of a route, and when each of them has been passed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from navfw.papfis.access import AT_PLACE
from navfw.papfis.routes import Route
from navfw.signals import Waypoint
from navfw.topomap import Passage, TopoMap

Point = tuple[float, float]

_MAX_TURN = math.radians(120.0)  # chosen
"""Largest turn at a waypoint for which its bisector decides whether it is passed [rad]."""

FULL_TOLERANCE_CLEARANCE = 0.27  # chosen
"""Free width [m] between the body and each post of a door above which the tolerance beside it is
the whole one: a wide robot that comes from aside does not fit through."""

MIN_SHARE = 0.3  # chosen
"""Least share of the tolerance beside a door."""


@dataclass(frozen=True, slots=True)
class PassingTolerances:
    """Distances [m] within which a waypoint counts as passed: in the open, in and beside a door.

    A waypoint left behind counts as passed within ``reach`` [m] too, except a door passed outside
    its gap. Beside a door in whose width a robot of the radius ``body`` [m] about its turning
    centre can turn, the tolerance is smaller for wide robots; another robot could not comply.
    """

    open: float = 0.6
    door: float = 0.25
    beside_door: float = 0.35
    reach: float = 1.0
    body: float = 0.0

    def tolerances(self, kinds: Sequence[str], widths: Sequence[float]) -> list[float]:
        """Return the tolerances [m] at a route's places of these ``kinds`` and ``widths`` [m]."""
        return [
            self._tolerance(kind, [widths[k] for k in (i - 1, i + 1) if _is_door(kinds, k)])
            for i, kind in enumerate(kinds)
        ]

    def _tolerance(self, kind: str, doors: Sequence[float]) -> float:
        """Return the tolerance [m] at a place of that kind, beside doors of these widths [m]."""
        if kind == "door":
            return self.door
        if not doors:
            return self.open
        free = 0.5 * min(doors) - self.body
        if free <= 0.0:
            return self.beside_door
        return self.beside_door * min(max(free / FULL_TOLERANCE_CLEARANCE, MIN_SHARE), 1.0)


def _is_door(kinds: Sequence[str], index: int) -> bool:
    return 0 <= index < len(kinds) and kinds[index] == "door"


def waypoints_of(
    route: Route, goal: Waypoint, topo_map: TopoMap, passing: PassingTolerances
) -> list[Waypoint]:
    """Convert ``route`` to waypoints, the goal last.

    A door's width is that of the narrower passage at it. A first place where the route starts is
    left out, and so is a last place within the goal's tolerance, unless it is a door.
    """
    places = [topo_map.places[name] for name in route.places]
    kinds = [place.kind for place in places]
    widths = list(route.widths[: len(places)])
    for i, place in enumerate(places):
        if place.kind == "door":
            widths[i] = min(widths[i], *(p.width for p in topo_map.passages_at(place.name)))
    waypoints = [
        Waypoint(
            place.x,
            place.y,
            tolerance,
            place.name,
            place.kind,
            final=False,
            width=width,
            passage=_ends(leg),
        )
        for place, tolerance, width, leg in zip(
            places, passing.tolerances(kinds, widths), widths, route.legs, strict=False
        )
    ]
    last = route.legs[-1]
    if places and kinds[-1] != "door" and places[-1].distance(goal.x, goal.y) <= goal.tolerance:
        del waypoints[-1]
        last = route.legs[-2]
    if waypoints and places[0].distance(*route.start.point) <= AT_PLACE:
        del waypoints[0]
    width, passage = route.widths[-1], _ends(last)
    final = replace(goal, kind="goal", final=True, width=width, passage=passage)
    return [*waypoints, final]


def _ends(passage: Passage | None) -> tuple[str, str] | None:
    return None if passage is None else (passage.a, passage.b)


def has_passed(
    at: Point,
    came_from: Point,
    waypoint: Waypoint,
    after: Waypoint | None,
    passing: PassingTolerances,
) -> bool:
    """Return whether a robot ``at`` (x, y) [m], on its leg from ``came_from``, passed ``waypoint``.

    It has if it is within the tolerance, or has crossed the line through the waypoint that bisects
    the turn from this leg to the next (towards ``after``), at most ``passing.reach`` from it (a
    door: within the gap). A final waypoint must be reached.
    """
    dx, dy = at[0] - waypoint.x, at[1] - waypoint.y
    if math.hypot(dx, dy) <= waypoint.tolerance:
        return True
    if waypoint.final or after is None or math.hypot(dx, dy) > passing.reach:
        return False
    forward = _bisector(came_from, (waypoint.x, waypoint.y), (after.x, after.y))
    if forward is None or dx * forward[0] + dy * forward[1] < 0.0:
        return False
    aside = abs(dx * forward[1] - dy * forward[0])
    return waypoint.kind != "door" or aside <= 0.5 * waypoint.width


def distance_to_leg(at: Point, start: Point, end: Point) -> float:
    """Return the distance [m] from ``at`` to the straight leg from ``start`` to ``end``."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    squared = dx * dx + dy * dy
    share = 0.0
    if squared > 0.0:
        share = ((at[0] - start[0]) * dx + (at[1] - start[1]) * dy) / squared
        share = min(max(share, 0.0), 1.0)
    return math.hypot(at[0] - start[0] - share * dx, at[1] - start[1] - share * dy)


def _bisector(before: Point, corner: Point, after: Point) -> Point | None:
    """Return the unit direction halfway between the legs to and from ``corner``.

    None for turns beyond ``_MAX_TURN``.
    """
    leg_in = _unit(corner[0] - before[0], corner[1] - before[1])
    leg_out = _unit(after[0] - corner[0], after[1] - corner[1])
    if leg_in is None or leg_out is None:
        return leg_in or leg_out
    x, y = leg_in[0] + leg_out[0], leg_in[1] + leg_out[1]
    if math.hypot(x, y) < 2.0 * math.cos(0.5 * _MAX_TURN):
        return None
    return _unit(x, y)


def _unit(x: float, y: float) -> Point | None:
    length = math.hypot(x, y)
    return None if length < 1e-9 else (x / length, y / length)
