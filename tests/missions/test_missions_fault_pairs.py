"""Two tolerable faults at once: the robot touches nothing, and the run ends with a reason."""

from __future__ import annotations

import pytest
from fault_pairs import pairs, session_of, survivable_entries

from navfw.missions import Outcome
from navfw.plugins import default_registry
from navfw.suite import EntrySpec

ENDS = {Outcome.REACHED, Outcome.STUCK, Outcome.LOST, Outcome.TIMEOUT, Outcome.FAULT}
PAIRS = pairs()


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
    result = session_of(entry, default_registry()).run()
    verdict = result.run.verdict
    assert result.metrics.collisions == 0, verdict.reason
    assert verdict.outcome in ENDS
    assert verdict.reason
    assert verdict.trace == "", "an exception ended the run"
    assert result.uninvited_faults == []
