"""``navfw demo``: drives one after the other, on one live page; nothing is written."""

from functools import partial
from pathlib import Path

import pytest
from cli_calls import invoke

import navfw
from navfw.cli import demo
from navfw.missions import prepare, session_setup

SHORT = ("empty", "straight", "nothing in the way")


def test_the_demo_drives_on_one_page_and_says_how_it_went(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "DRIVES", (SHORT, SHORT))
    monkeypatch.chdir(tmp_path)
    ended = invoke("demo", "--port", 0, "--speed", 50)
    assert ended.exit_code == 0, ended.output
    assert ended.stderr.count("live: http://127.0.0.1:") == 1
    assert "2 of 2: nothing in the way (empty straight)" in ended.stderr
    expected = navfw.run("empty", "straight")
    rows = [line for line in ended.stdout.splitlines() if "empty straight" in line]
    assert len(rows) == 2
    for part in ("reached", f"{expected.path_length_m:.2f}", expected.command_hash[:8]):
        assert all(part in row for row in rows)
    assert list(tmp_path.iterdir()) == []


def test_a_goal_that_is_not_reached_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    short = partial(prepare, overrides=["mission.timeout=2"])
    monkeypatch.setattr(demo, "DRIVES", (SHORT,))
    monkeypatch.setattr(session_setup, "prepare", short)
    ended = invoke("demo", "--port", 0, "--speed", 50, "--quiet")
    assert ended.exit_code == 1, ended.output
    assert "timeout" in ended.stdout


def test_the_missions_of_the_demo_are_there() -> None:
    assert len(demo.DRIVES) == 5
    for world, mission, _ in demo.DRIVES:
        assert prepare(world, mission).mission.goals
