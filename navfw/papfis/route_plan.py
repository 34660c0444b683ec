"""One plan by itself, without a mission: a way through a map, explained rule by rule.

>>> from navfw.topomap import Passage, Place, TopoMap
>>> hall, door = Place("hall", 0.0, 0.0), Place("door", 3.0, 0.0, "door")
>>> office = TopoMap("office", [hall, door], [Passage("hall", "door", 3.0, width=0.9)])
>>> make_plan(office, "hall", "door").route.places
('hall', 'door')
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from navfw.errors import MapError, UnknownNameError
from navfw.papfis.edge_costs import CostParams
from navfw.papfis.routes import Route, Router, Spot
from navfw.robot import RobotModel
from navfw.topomap import Passage, TopoMap

__all__ = ["Plan", "make_plan", "passage_named", "spot_named"]

MAX_OFF_MAP = 8.0
"""Start and goal may be so far off the map [m]."""

_NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
_POINT = re.compile(_NUMBER + "," + _NUMBER)


@dataclass(frozen=True, slots=True)
class Plan:
    """A route, and the costs by which it was chosen."""

    route: Route
    router: Router

    def explain(self) -> dict[str, Any]:
        """Where the way leads and what each passage costs, rule by rule, as plain data."""
        route = self.route
        closed = (p for p in self.router.topo_map.passages if self.router.costs.closed(p))
        return {
            "start": [route.start.x, route.start.y],
            "goal": [route.goal.x, route.goal.y],
            "places": list(route.places),
            "cost": route.cost,
            "length": route.length,
            "entry_cost": route.entry_cost,
            "exit_cost": route.exit_cost,
            "passages": self.router.explain(route),
            "closed": [[passage.a, passage.b] for passage in closed],
        }


def make_plan(
    topo_map: TopoMap,
    start: str | Spot,
    goal: str | Spot,
    *,
    avoid: Sequence[str | Passage] = (),
    robot: RobotModel | None = None,
    params: CostParams | None = None,
) -> Plan:
    """The cheapest way from ``start`` to ``goal`` that takes none of the passages to ``avoid``.

    Places may be given by name or as ``x,y`` [m], passages as ``PLACE:PLACE``.

    Raises:
        UnknownNameError: there is no place of that name.
        MapError: there is no such passage, no way is left, or a point is far off the map.

    """
    begin, end = (spot_named(topo_map, at) if isinstance(at, str) else at for at in (start, goal))
    shut = [passage_named(topo_map, p) if isinstance(p, str) else p for p in avoid]
    router = Router(topo_map, robot or RobotModel(), params)
    for passage in shut:
        router.close(passage)
    for spot, what in ((begin, "start"), (end, "goal")):
        router.check_near(spot, what, MAX_OFF_MAP)
    return Plan(router.route(begin, end), router)


def spot_named(topo_map: TopoMap, text: str) -> Spot:
    """A place by its name, or a point ``x,y`` [m].

    Raises:
        UnknownNameError: it is neither.

    """
    if text not in topo_map.places and (point := _POINT.fullmatch(text)):
        return Spot(float(point[1]), float(point[2]))
    place = topo_map.place(text)
    return Spot(place.x, place.y, place.name)


def passage_named(topo_map: TopoMap, text: str) -> Passage:
    """The passage ``PLACE:PLACE`` of the map, in either order.

    Raises:
        MapError: ``text`` is not of that form, or there is no passage between the two.
        UnknownNameError: one of the places does not exist.

    """
    parts = text.split(":")
    # names may hold colons themselves: whichever split names two places
    for cut in range(1, len(parts)):
        a, b = ":".join(parts[:cut]), ":".join(parts[cut:])
        if a in topo_map.places and b in topo_map.places:
            return topo_map.passage(a, b)
    if len(parts) < 2:
        raise MapError(f"expected a passage as PLACE:PLACE, got {text!r}", file=topo_map.file)
    unknown = next(name for name in (parts[0], parts[-1]) if name not in topo_map.places)
    raise UnknownNameError("place", unknown, topo_map.places, file=topo_map.file)
