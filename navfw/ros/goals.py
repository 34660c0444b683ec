"""Goals that a stack is given by name."""

from __future__ import annotations

from navfw.signals import Waypoint
from navfw.topomap import TopoMap

TOLERANCE = 0.3
"""Distance [m] at which a goal that was sent is reached."""


def goal_at(topo_map: TopoMap, name: str, tolerance: float = TOLERANCE) -> Waypoint:
    """The place called ``name`` of the map, as a goal.

    Raises:
        UnknownNameError: there is no such place.

    """
    place = topo_map.place(name)
    return Waypoint(place.x, place.y, tolerance, name, "goal", final=True)
