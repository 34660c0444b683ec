"""A single route plan, without a mission: a route through a map, explained rule by rule.

>>> from navfw.topomap import Passage, Place, TopoMap
>>> hall, door = Place("hall", 0.0, 0.0), Place("door", 3.0, 0.0, "door")
>>> office = TopoMap("office", [hall, door], [Passage("hall", "door", 3.0, width=0.9)])
>>> plan_route(office, "hall", "door").route.places
('hall', 'door')
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from navfw.errors import MapError, UnknownNameError
from navfw.papfis.edge_costs import CostParams
from navfw.papfis.routes import Endpoint, Route, Router
from navfw.robot import RobotModel
from navfw.topomap import Passage, TopoMap

_MAX_OFF_MAP = 8.0  # chosen
"""Largest distance of start and goal from the map [m]."""

_NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
_POINT = re.compile(_NUMBER + "," + _NUMBER)


@dataclass(frozen=True, slots=True)
class RoutePlan:
    """A planned route, and the router whose costs decided for it."""

    route: Route
    router: Router

    def explain(self) -> dict[str, Any]:
        """Return the route and the cost of each passage, rule by rule, as plain data."""
        route = self.route
        return {
            "start": [route.start.x, route.start.y],
            "goal": [route.goal.x, route.goal.y],
            "places": list(route.places),
            "cost": route.cost,
            "length": route.length,
            "entry_cost": route.entry_cost,
            "exit_cost": route.exit_cost,
            "passages": self.router.explain(route),
            "closed": [[passage.a, passage.b] for passage in self.router.closed],
        }


def plan_route(
    topo_map: TopoMap,
    start: str | Endpoint,
    goal: str | Endpoint,
    *,
    avoid: Sequence[str | Passage] = (),
    robot: RobotModel | None = None,
    params: CostParams | None = None,
) -> RoutePlan:
    """Plan the cheapest route from ``start`` to ``goal`` without the passages in ``avoid``.

    Start and goal may be a place's name or ``x,y`` [m] as text, passages ``PLACE:PLACE``.

    Raises:
        UnknownNameError: there is no place of that name.
        MapError: there is no such passage, no route, or a point is far off the map.

    """
    begin, end = (
        parse_endpoint(topo_map, at) if isinstance(at, str) else at for at in (start, goal)
    )
    closed = [parse_passage(topo_map, p) if isinstance(p, str) else p for p in avoid]
    router = Router(topo_map, robot or RobotModel(), params)
    for passage in closed:
        router.close(passage)
    for point, what in ((begin, "start"), (end, "goal")):
        router.check_near(point, what, _MAX_OFF_MAP)
    return RoutePlan(router.route(begin, end), router)


def parse_endpoint(topo_map: TopoMap, text: str) -> Endpoint:
    """Parse an endpoint of a route: a place's name or ``x,y`` [m].

    Raises:
        UnknownNameError: ``text`` is neither.

    """
    if text not in topo_map.places and (point := _POINT.fullmatch(text)):
        return Endpoint(float(point[1]), float(point[2]))
    place = topo_map.place(text)
    return Endpoint(place.x, place.y, place.name)


def parse_passage(topo_map: TopoMap, text: str) -> Passage:
    """Find the passage ``PLACE:PLACE`` of the map, in either order.

    Raises:
        MapError: ``text`` is not of that form, or there is no passage between the two.
        UnknownNameError: one of the places does not exist.

    """
    words = text.split(":")
    # names may contain colons: use the split that gives two places
    for cut in range(1, len(words)):
        a, b = ":".join(words[:cut]), ":".join(words[cut:])
        if a in topo_map.places and b in topo_map.places:
            return topo_map.passage(a, b)
    if len(words) < 2:
        raise MapError(f"expected a passage as PLACE:PLACE, got {text!r}", file=topo_map.file)
    unknown = next(name for name in (words[0], words[-1]) if name not in topo_map.places)
    raise UnknownNameError("place", unknown, topo_map.places, file=topo_map.file)
