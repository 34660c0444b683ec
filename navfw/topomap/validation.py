"""Map validation: violations that make places, passages and landmarks unusable as a map.

Checked whenever a map is built. ``map_check`` has the further checks of a valid map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from navfw.errors import did_you_mean
from navfw.topomap.elements import Landmark, Passage, Place

_LENGTH_ROUNDING = 0.005
"""Tolerance [m] of a length below the straight distance: map files round to two decimals."""

KeyPath: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class MapViolation:
    """One error in a map; ``where`` is its path in a map file's structure.

    ``first`` is the path of the earlier entry, where two entries exclude each other.
    """

    where: KeyPath
    message: str
    first: KeyPath | None = None

    def __str__(self) -> str:
        return ".".join(map(str, self.where)) + ": " + self.message


def map_violations(
    places: Sequence[Place], passages: Sequence[Passage], landmarks: Sequence[Landmark] = ()
) -> list[MapViolation]:
    """All violations, in the order of the map; empty for a valid map."""
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
        where: KeyPath = ("places", place.name)
        if place.name in seen:
            yield MapViolation(where, f"a second place {place.name!r}; give it another name")
        seen.add(place.name)
        if not (math.isfinite(place.x) and math.isfinite(place.y)):
            yield MapViolation(where, f"expected finite x and y [m], got ({place.x}, {place.y})")


def _passage_violations(
    places: Sequence[Place], passages: Sequence[Passage]
) -> Iterator[MapViolation]:
    known = {place.name: place for place in places}
    seen: dict[frozenset[str], int] = {}
    for index, passage in enumerate(passages):
        where: KeyPath = ("edges", index)
        unknown = [(key, end) for key, end in _keyed_ends(passage) if end not in known]
        for key, end in unknown:
            yield MapViolation(
                (*where, key), f"there is no place {end!r}; {did_you_mean(end, known)}"
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
            yield from _number_violations(where, passage, known[passage.a], known[passage.b])


def _keyed_ends(passage: Passage) -> tuple[tuple[str, str], tuple[str, str]]:
    return ("from", passage.a), ("to", passage.b)


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
    for key in ("danger", "doorness", "uncertainty"):
        value = getattr(passage, key)
        if not 0.0 <= value <= 1.0:
            yield MapViolation((*where, key), f"expected 0 to 1, got {value:g}")


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
        numbers = (mark.x, mark.y, mark.z, mark.yaw, mark.size)
        if not all(map(math.isfinite, numbers)):
            yield MapViolation(where, f"expected finite numbers, got {numbers}")
        elif not mark.size > 0.0:
            yield MapViolation((*where, "size"), f"expected more than 0 m, got {mark.size:g}")
        if mark.id < 0:
            yield MapViolation((*where, "id"), f"expected 0 or more, got {mark.id}")
