"""The elements of a topological map as plain data, and the violations that make them unusable.

Places, passages and landmarks (METHOD 4.1); lengths in metres, angles in radians, positions in the
``map`` frame (REP-105). Violations are checked whenever a map is built; ``map_check`` has the
further checks of a valid map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from navfw.errors import did_you_mean

PlaceKind = Literal["room", "door", "corridor", "junction", "corner", "danger"]

PLACE_KINDS: tuple[PlaceKind, ...] = get_args(PlaceKind)


@dataclass(frozen=True, slots=True)
class Place:
    """A named point x, y [m, map] to drive to; the planner avoids those of kind ``danger``."""

    name: str
    x: float
    y: float
    kind: PlaceKind = "room"

    def distance(self, x: float, y: float) -> float:
        """Return the straight distance [m] to the point (x, y) [m, map]."""
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
        """Return the name of the end that is not ``place``."""
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
        """Identity in detections: kind and id, as in ``aruco-7``."""
        return f"{self.kind}-{self.id}"


_LENGTH_ROUNDING = 0.005  # chosen
"""Tolerance [m] of a length below the straight distance: map files round to two decimals."""

KeyPath: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class MapViolation:
    """One error in a map; ``where`` is the path of keys to it in a map file.

    ``first`` is the path to the earlier entry if two entries exclude each other.
    """

    where: KeyPath
    message: str
    first: KeyPath | None = None

    def __str__(self) -> str:
        return ".".join(map(str, self.where)) + ": " + self.message


def map_violations(
    places: Sequence[Place], passages: Sequence[Passage], landmarks: Sequence[Landmark] = ()
) -> list[MapViolation]:
    """Check the elements of a map; return all violations in their order, none if it is valid.

    The other bounds of numbers are those of a map file (``mapspec``).
    """
    if not places:
        return [MapViolation(("places",), "expected at least one place, got none")]
    return [
        *_place_violations(places),
        *_passage_violations(places, passages),
        *_landmark_violations(landmarks),
    ]


def _place_violations(places: Iterable[Place]) -> Iterator[MapViolation]:
    seen: set[str] = set()
    for place in places:
        if place.name in seen:
            where = ("places", place.name)
            yield MapViolation(where, f"a second place {place.name!r}; give it another name")
        seen.add(place.name)


def _passage_violations(
    places: Sequence[Place], passages: Sequence[Passage]
) -> Iterator[MapViolation]:
    place_of = {place.name: place for place in places}
    seen: dict[frozenset[str], int] = {}
    for index, passage in enumerate(passages):
        where: KeyPath = ("edges", index)
        ends = (("from", passage.a), ("to", passage.b))
        unknown = [(key, end) for key, end in ends if end not in place_of]
        for key, end in unknown:
            yield MapViolation(
                (*where, key), f"there is no place {end!r}; {did_you_mean(end, place_of)}"
            )
        if passage.a == passage.b:
            yield MapViolation(where, f"connects {passage.a!r} to itself; name two places")
        elif passage.ends in seen:
            yield MapViolation(
                where,
                f"{passage} is the same passage as edges.{seen[passage.ends]}: passages are "
                "two-way; remove one, or put a place on the second",
                first=("edges", seen[passage.ends]),
            )
        seen.setdefault(passage.ends, index)
        if not unknown:
            yield from _number_violations(where, passage, place_of[passage.a], place_of[passage.b])


def _number_violations(
    where: KeyPath, passage: Passage, a: Place, b: Place
) -> Iterator[MapViolation]:
    straight = a.distance(b.x, b.y)
    if not (passage.length > 0.0 and math.isfinite(passage.length)):
        remedy = "leave it out for the straight distance" if straight > 0.0 else "move a place"
        yield MapViolation(
            (*where, "length"), f"expected more than 0 m, got {passage.length:g}; {remedy}"
        )
    elif passage.length < straight - _LENGTH_ROUNDING:
        yield MapViolation(
            (*where, "length"),
            f"{passage.length:g} m is shorter than the straight line between {a.name!r} and "
            f"{b.name!r} ({straight:.2f} m); leave it out for the straight distance",
        )
    if not passage.width > 0.0:
        yield MapViolation((*where, "width"), f"expected more than 0 m, got {passage.width:g}")


def _landmark_violations(landmarks: Sequence[Landmark]) -> Iterator[MapViolation]:
    names: set[str] = set()
    seen: dict[str, str] = {}
    for mark in landmarks:
        where: KeyPath = ("landmarks", mark.name)
        if mark.name in names:
            yield MapViolation(where, f"a second landmark {mark.name!r}; give it another name")
        elif mark.identity in seen:
            yield MapViolation(
                (*where, "id"),
                f"a second {mark.identity}: {seen[mark.identity]!r} has that id; detections cannot "
                "distinguish them, so give each landmark of a kind its own id",
                first=("landmarks", seen[mark.identity], "id"),
            )
        names.add(mark.name)
        seen.setdefault(mark.identity, mark.name)
