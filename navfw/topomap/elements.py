"""The elements of a topological map as plain data: places, passages and landmarks (METHOD 4.1).

Lengths in metres, angles in radians, positions in the ``map`` frame (REP-105).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

PlaceKind = Literal["room", "door", "corridor", "junction", "corner", "danger"]

PLACE_KINDS: tuple[PlaceKind, ...] = get_args(PlaceKind)


@dataclass(frozen=True, slots=True)
class Place:
    """A named point x, y [m] that a robot can drive to; it avoids ``danger`` places."""

    name: str
    x: float
    y: float
    kind: PlaceKind = "room"

    def distance(self, x: float, y: float) -> float:
        """Straight distance [m] to the point (x, y)."""
        return math.hypot(self.x - x, self.y - y)


@dataclass(frozen=True, slots=True)
class Passage:
    """An edge of the map: passable in both directions between the places ``a`` and ``b``.

    ``length`` [m] is at least the straight distance, and a passage of that length is straight;
    ``width`` [m] is the free width at the narrowest point. ``danger`` (0 none, 1 stairs or an
    obstacle), ``doorness`` (1: through a door) and ``uncertainty`` (1: may be open or closed) are
    in [0, 1].
    """

    a: str
    b: str
    length: float
    width: float = math.inf
    danger: float = 0.0
    doorness: float = 0.0
    uncertainty: float = 0.0

    @property
    def ends(self) -> frozenset[str]:
        """The names of both places, unordered: the passage's identity in a map."""
        return frozenset((self.a, self.b))

    def other(self, place: str) -> str:
        """The end that is not ``place``."""
        return self.b if place == self.a else self.a

    def __str__(self) -> str:
        return f"{self.a} - {self.b}"


@dataclass(frozen=True, slots=True)
class Landmark:
    """A flat upright square that a camera can recognise.

    Its centre is at x, y [m] and ``z`` [m] above the floor, its side is ``size`` [m] long, and its
    normal points to ``yaw`` [rad, counter-clockwise from x]. ``id`` is the number that recognition
    gives it, unique among those of its ``kind``.
    """

    name: str
    kind: str
    id: int
    x: float
    y: float
    yaw: float
    z: float = 0.5
    size: float = 0.25

    @property
    def identity(self) -> str:
        """The identity in detections: kind and id, as in ``aruco-7``."""
        return f"{self.kind}-{self.id}"
