"""Pairs of tolerable faults: entries of the suite ``faults`` that expect arrival, two by two."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

from navfw.config import find
from navfw.missions import Session
from navfw.plugins import Registry
from navfw.suite import Case, EntrySpec, load_suite

SEED = 0
_FAMILIES = ("corridors", "rooms")
"""The first that one of a pair names is driven: faults of corridors need their length."""


def survivable_entries() -> list[EntrySpec]:
    """The entries with a fault with which the robot has to arrive."""
    entries = load_suite("faults").spec.entries
    return [entry for entry in entries if entry.expect == "arrival" and entry.events]


def pairs() -> list[EntrySpec]:
    """An entry for each two of ``survivable_entries``, with the events of both.

    It is driven in the world of the first that names one, else in a family of one of them.
    """
    return [_merged(*pair) for pair in combinations(survivable_entries(), 2)]


def _merged(one: EntrySpec, other: EntrySpec) -> EntrySpec:
    place = next((entry for entry in (one, other) if entry.world), None)
    if place is None:
        families = {entry.family: entry for entry in (other, one)}
        place = next(families[family] for family in _FAMILIES if family in families)
    events = (*(one.events or ()), *(other.events or ()))
    changed = {**other.set, **one.set}
    return place.model_copy(
        update={"name": f"{one.title} + {other.title}", "events": events, "set": changed}
    )


def session_of(entry: EntrySpec, registry: Registry) -> Session:
    """The session of ``entry`` with ``SEED``."""
    stack = str(find("stack", entry.stack)) if entry.stack else ""
    case = Case(0, entry.title, SEED, stack, "", "", "cross", entry.overrides)
    if entry.world is not None:
        (mission,) = entry.missions or ()
        return replace(case, world=entry.world, mission=mission).session(registry)
    assert isinstance(entry.difficulty, float)
    case = replace(case, family=str(entry.family), world_name=f"{entry.family}-{SEED}")
    return replace(case, difficulty=entry.difficulty).session(registry)
