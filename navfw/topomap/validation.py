"""What makes places, passages and landmarks impossible as a map, said for a person to repair it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from navfw.errors import did_you_mean
from navfw.topomap.elements import Landmark, Passage, Place

__all__ = ["MapViolation", "map_violations"]

LENGTH_ROUNDING = 0.005
"""How much shorter than the straight line a length may be [m]: people write two decimals."""

Where: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class MapViolation:
    """One thing that cannot be; ``where`` is its path in a map file's structure.

    ``first`` is the path of what was there before, where two things exclude each other.
    """

    where: Where
    message: str
    first: Where | None = None

    def __str__(self) -> str:
        return ".".join(map(str, self.where)) + ": " + self.message


def map_violations(
    places: Sequence[Place], passages: Sequence[Passage], landmarks: Sequence[Landmark] = ()
) -> list[MapViolation]:
    """Everything that is wrong, in the order of the map; empty for a sound map."""
    if not places:
        return [MapViolation(("places",), "expected at least one place, got none")]
    return [
        *_in_places(places),
        *_in_passages(places, passages),
        *_in_landmarks(landmarks),
    ]


def _in_places(places: Iterable[Place]) -> Iterator[MapViolation]:
    seen: set[str] = set()
    for place in places:
        where: Where = ("places", place.name)
        if place.name in seen:
            yield MapViolation(where, f"a second place {place.name!r}; give it another name")
        seen.add(place.name)
        if not (math.isfinite(place.x) and math.isfinite(place.y)):
            yield MapViolation(where, f"expected finite x and y [m], got ({place.x}, {place.y})")


def _in_passages(places: Sequence[Place], passages: Sequence[Passage]) -> Iterator[MapViolation]:
    known = {place.name: place for place in places}
    seen: dict[frozenset[str], int] = {}
    for index, passage in enumerate(passages):
        where: Where = ("edges", index)
        unknown = [(key, end) for key, end in _named_ends(passage) if end not in known]
        for key, end in unknown:
            yield MapViolation(
                (*where, key), f"there is no place {end!r}; {did_you_mean(end, known)}"
            )
        if passage.a == passage.b:
            yield MapViolation(where, f"leads from {passage.a!r} to itself; name two places")
        elif passage.ends in seen:
            yield MapViolation(
                where,
                f"{passage} is the same passage as edges.{seen[passage.ends]}: passages hold both "
                "ways; remove one, or put a place on the second way",
                first=("edges", seen[passage.ends]),
            )
        seen.setdefault(passage.ends, index)
        if not unknown:
            yield from _in_numbers(where, passage, known[passage.a], known[passage.b])


def _named_ends(passage: Passage) -> tuple[tuple[str, str], tuple[str, str]]:
    return ("from", passage.a), ("to", passage.b)


def _in_numbers(where: Where, passage: Passage, a: Place, b: Place) -> Iterator[MapViolation]:
    straight = a.distance(b.x, b.y)
    if not (passage.length > 0.0 and math.isfinite(passage.length)):
        remedy = "leave it out for the straight distance" if straight > 0.0 else "move a place"
        yield MapViolation(
            (*where, "length"), f"expected more than 0 m, got {passage.length:g}; {remedy}"
        )
    elif passage.length < straight - LENGTH_ROUNDING:
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


def _in_landmarks(landmarks: Sequence[Landmark]) -> Iterator[MapViolation]:
    names: set[str] = set()
    seen: dict[str, str] = {}
    for mark in landmarks:
        where: Where = ("landmarks", mark.name)
        if mark.name in names:
            yield MapViolation(where, f"a second landmark {mark.name!r}; give it another name")
        elif mark.identity in seen:
            yield MapViolation(
                (*where, "id"),
                f"a second {mark.identity}: {seen[mark.identity]!r} has that id; detections could "
                "not tell them apart, so give each landmark of a kind its own id",
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
