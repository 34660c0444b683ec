"""Doors that were found beside the place that the map has for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from navfw.signals import Waypoint
from navfw.topomap import TopoMap

Point = tuple[float, float]

_BESIDE_DOOR = 1.0  # chosen
"""Distance [m] up to which the places before and after a door move along with it."""


class FoundDoors:
    """Moves doors of ``topo_map`` to where openings were seen; ``notes`` says where, by door."""

    def __init__(self, topo_map: TopoMap) -> None:
        self._topo_map = topo_map
        self._moved: dict[str, Point] = {}
        self._before: set[Point] = set()
        self.notes: dict[str, str] = {}

    def __contains__(self, place: str) -> bool:
        return place in self._moved

    def normal(self, waypoint: Waypoint) -> Point | None:
        """Return the unit direction through a door; None for another place, or if unclear."""
        is_door = waypoint.kind == "door"
        return (
            self._topo_map.door_normal(self._topo_map.places[waypoint.place]) if is_door else None
        )

    def as_found(self, waypoint: Waypoint) -> Waypoint:
        """Return ``waypoint`` where its place was moved to."""
        x, y = self._moved.get(waypoint.place, (waypoint.x, waypoint.y))
        return replace(waypoint, x=x, y=y)

    def slide(self, ahead: list[Waypoint], openings: Mapping[Point, Point], at: Point) -> bool:
        """Move each door ``ahead`` to the opening [m] that two reports in a row have for its place.

        The places beside it move with it, so that the robot, now ``at`` (x, y) [m], crosses the
        wall at a right angle. Returns whether a door was moved.
        """
        moved = [w for w in ahead if (w.x, w.y) in openings and (w.x, w.y) in self._before]
        self._before = set(openings)
        for door in moved:
            index, (x, y) = ahead.index(door), openings[door.x, door.y]
            for i in range(max(index - 1, 0), min(index + 2, len(ahead))):
                near = ahead[i]
                apart = math.dist((near.x, near.y), (door.x, door.y))
                is_beside = not near.final and near.kind != "door" and apart <= _BESIDE_DOOR
                if i == index or is_beside:
                    self._moved[near.place] = near.x + x - door.x, near.y + y - door.y
                    ahead[i] = self.as_found(near)
            place = self._topo_map.places[door.place]
            dx, dy = x - place.x, y - place.y
            side = "left" if (place.x - at[0]) * dy > (place.y - at[1]) * dx else "right"
            off = f"{math.hypot(dx, dy):.1f} m to the {side} of the map's"
            self.notes[door.place] = f"{door.place} is {off}"
        return bool(moved)
