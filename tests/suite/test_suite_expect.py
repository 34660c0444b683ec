"""Entries with events, and what passes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import suite_samples as samples

from navfw.errors import ConfigError, InputError
from navfw.plugins import default_registry
from navfw.suite import Expect, load_suite, plan_runs, summarize

EVENTS = """\
entries:
  - {name: black, family: clutter, difficulty: 0.1, expect: stop,
     events: [{at: 8, camera: black}]}
  - {name: usual, family: clutter, difficulty: 0.1, expect: arrival}
"""


def suite_file(folder: Path, text: str) -> Path:
    file = folder / "failing.yaml"
    file.write_text(text)
    return file


def test_events_of_an_entry_apply_to_its_missions(tmp_path: Path) -> None:
    plan = plan_runs(load_suite(suite_file(tmp_path, EVENTS)), range(2), default_registry())
    assert plan.expect == {"black": "stop", "usual": "arrival"}
    black, _, usual, _ = plan.cases
    session = black.session(default_registry())
    (event,) = session.mission.spec.events
    assert (event.at, event.key) == (8.0, "camera")
    assert len(session.events) == 1
    assert usual.session(default_registry()).events == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("camera: black", "camera: blak", "failing.yaml:3: entries[0].events[0].camera: "),
        ("at: 8", "at: -8", "failing.yaml:3: entries[0].events[0].at: "),
        ("expect: stop", "expect: stopp", "did you mean 'stop'?"),
        ("camera: black", "behavior: {name: avod, does: hangs}", "did you mean 'avoid'?"),
    ],
)
def test_wrong_events_are_located_in_the_suite(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises((ConfigError, InputError)) as caught:
        plan_runs(
            load_suite(suite_file(tmp_path, EVENTS.replace(old, new))), range(1), default_registry()
        )
    assert message in str(caught.value)
    assert "failing.yaml" in str(caught.value)


def passes(expect: Expect, **changes: Any) -> bool:
    rows = [samples.row(seed) for seed in range(9)]
    rows.append(samples.row(9, **changes))
    entry = rows[0].entry
    summary = summarize(rows, {entry: expect})
    found = summary["by_entry"][entry]
    assert found["expect"] == expect
    assert found["passed"] >= 9
    return bool(found["passes"])


def test_nine_arrivals_of_ten_pass() -> None:
    assert passes("arrival", outcome="collided", collisions=1)
    rows = [samples.row(seed, outcome="reached" if seed < 8 else "stuck") for seed in range(10)]
    summary = summarize(rows, {rows[0].entry: "arrival"})
    assert not summary["by_entry"][rows[0].entry]["passes"]
    assert not summarize([], {"none": "arrival"})["by_entry"]["none"]["passes"]


@pytest.mark.parametrize(
    ("changes", "passed"),
    [
        ({"outcome": "fault", "cause": "sensor_failed", "collisions": 0}, True),
        ({"outcome": "fault", "cause": "nothing_seen", "collisions": 0}, True),
        ({"outcome": "stuck", "collisions": 0}, True),
        ({"outcome": "fault", "cause": "exception", "collisions": 0}, False),
        ({"outcome": "fault", "cause": "bad_command", "collisions": 0}, False),
        ({"outcome": "collided", "collisions": 1}, False),
    ],
)
def test_every_stop_has_to_be_without_collision_and_for_a_known_reason(
    changes: dict[str, object], passed: bool
) -> None:
    assert passes("stop", **changes) == passed
