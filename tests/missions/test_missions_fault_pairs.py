"""Two tolerable faults at once: the robot touches nothing, and the run ends with a reason."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import pytest

from navfw.config import find
from navfw.missions import Outcome, Session
from navfw.plugins import default_registry
from navfw.suite import Case, EntrySpec, load_suite

FAMILIES = ("corridors", "rooms")
"""The first that one of a pair names is driven: faults of corridors need their length."""


def survivable_entries() -> list[EntrySpec]:
    """The entries with a fault with which the robot has to arrive."""
    entries = load_suite("faults").spec.entries
    return [entry for entry in entries if entry.expect == "arrival" and entry.events]


def merged(one: EntrySpec, other: EntrySpec) -> EntrySpec:
    """An entry with the events of both.

    It is driven in the world of the first that names one, else in a family of one of them.
    """
    place = next((entry for entry in (one, other) if entry.world), None)
    if place is None:
        families = {entry.family: entry for entry in (other, one)}
        place = next(families[family] for family in FAMILIES if family in families)
    events = (*(one.events or ()), *(other.events or ()))
    changed = {**other.set, **one.set}
    return place.model_copy(
        update={"name": f"{one.title} + {other.title}", "events": events, "set": changed}
    )


def session_of(entry: EntrySpec) -> Session:
    """The session of ``entry`` with seed 0."""
    registry = default_registry()
    stack = str(find("stack", entry.stack)) if entry.stack else ""
    case = Case(0, entry.title, 0, stack, "", "", "cross", entry.overrides)
    if entry.world is not None:
        (mission,) = entry.missions or ()
        return replace(case, world=entry.world, mission=mission).session(registry)
    assert isinstance(entry.difficulty, float)
    case = replace(case, family=str(entry.family), world_name=f"{entry.family}-0")
    return replace(case, difficulty=entry.difficulty).session(registry)


ENDS = {Outcome.REACHED, Outcome.STUCK, Outcome.LOST, Outcome.TIMEOUT, Outcome.FAULT}
PAIRS = [merged(*pair) for pair in combinations(survivable_entries(), 2)]


def test_every_two_tolerable_faults_are_a_pair() -> None:
    singles = survivable_entries()
    assert len(singles) > 20
    assert len(PAIRS) == len(singles) * (len(singles) - 1) // 2
    assert len({entry.title for entry in PAIRS}) == len(PAIRS)
    for entry in PAIRS:
        one, other = (s for s in singles if s.title in entry.title.split(" + "))
        assert entry.events == (*(one.events or ()), *(other.events or ()))
        assert (entry.world, entry.family) in {(s.world, s.family) for s in (one, other)}


@pytest.mark.slow
@pytest.mark.parametrize("entry", PAIRS, ids=[entry.title for entry in PAIRS])
def test_a_pair_of_faults_ends_without_contact(entry: EntrySpec) -> None:
    result = session_of(entry).run()
    verdict = result.run.verdict
    assert result.metrics.collisions == 0, verdict.reason
    assert verdict.outcome in ENDS
    assert verdict.reason
    assert verdict.trace == "", "an exception ended the run"
    assert result.uninvited_faults == []
