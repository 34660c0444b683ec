"""The story of a run: episodes are found, told with their reason, and fit into thirty lines."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedMessage, RecordedRun
from navfw.report.run_story import EPISODES, LINES, StoryLine, headline, read_story

PLACES = {"hall": (0.0, 0.0), "door": (3.0, 0.0), "lab": (6.0, 0.0)}
RULE = "IF bearing IS left THEN turn IS left"
RESULT: dict[str, Any] = {
    "outcome": "timeout",
    "reason": "time limit of 9 s",
    "cause": "vetoed",
    "cause_seen": "the robot was held back before door",
    "sim_time_s": 9.0,
    "contacts": [{"time": 4.0, "x": 1.0, "y": 2.0, "body": "table"}],
    "config": {
        "mission": {"goals": [{"place": "lab", "x": 6.0, "y": 0.0}], "robot": {"max_v": 0.5}}
    },
}


@dataclass
class Drive:
    """Stands for a recording: rows of what is commanded every tenth of a second."""

    path: Path = Path("run.mcap")
    rows: list[dict[str, Any]] = field(default_factory=list)
    complete: bool = True

    def go(self, seconds: float, v: float = 0.5, w: float = 0.0, **said: Any) -> "Drive":
        said = {"leader": "go_to_xy", "reason": "goal ahead", "held": "", "lost": False, **said}
        self.rows += [{"v": v, "w": w, "slower": "", **said} for _ in range(round(10 * seconds))]
        return self

    def messages(self, *wanted: str) -> Iterator[RecordedMessage]:
        assert topics.RULES in wanted
        x = 0.0
        for number, row in enumerate(self.rows):
            time, x = 0.1 * number, x + 0.1 * row["v"]
            at = Message(pose=Message(position=Message(x=x, y=0.0)))
            fired = {row["leader"]: {"rules": [{"rule": RULE, "strength": 0.75}]}}
            driven = Message(twist=Message(linear=Message(x=row["v"])))
            yield RecordedMessage(topics.TWIST, time, driven)
            yield RecordedMessage(topics.POSE, time, at)
            yield RecordedMessage(topics.COMMAND, time, row)
            yield RecordedMessage(topics.RULES, time, {"behaviors": fired})


def told(
    drive: Drive, begin: float = 0.0, end: float = math.inf, places: Any = PLACES
) -> Sequence[StoryLine]:
    return read_story(cast(RecordedRun, drive), RESULT, places, begin, end)


def test_each_kind_of_episode_is_told_with_time_place_and_reason() -> None:
    drive = Drive().go(2.0).go(1.0, 0.0, held="too close ahead").go(1.0)
    drive.go(2.0, 0.0, leader="give_way", reason="a walker crosses").go(1.0)
    drive.go(1.5, 0.0, 0.8).go(1.0).go(1.0, -0.1, leader="escape").go(1.0).go(2.0, 0.1)
    drive.go(1.0).go(1.0, 0.4, 0.5, leader="avoid").go(1.0).go(0.5, 0.0, lost=True).go(1.0)
    episodes = {line.kind: line for line in told(drive) if line.kind in EPISODES}
    assert list(episodes) == [
        *("held", "gave way", "turned", "backed", "slow", "aside", "lost"),
    ]
    assert episodes["held"].text == "near hall (1.0, 0.0): held for 1.0 s: too close ahead"
    assert episodes["held"].time == pytest.approx(2.0)
    assert episodes["gave way"].text.endswith(f"gave way for 2.0 s; give_way: {RULE} (0.75)")
    assert "turned left on the spot by 69 degrees; go_to_xy: IF" in episodes["turned"].text
    assert "slowed to 0.10 m/s for 2.0 s; go_to_xy" in episodes["slow"].text
    assert "did not know where it was for 0.5 s" in episodes["lost"].text


def test_the_story_begins_with_the_goal_and_ends_with_the_outcome() -> None:
    lines = told(Drive().go(9.0))
    assert lines[0].text == "at hall (0.1, 0.0): wanted lab"
    assert lines[-1].text.endswith("timeout, time limit of 9 s")
    assert [line.text for line in lines if line.kind == "passed"] == ["passed door"]
    assert [line.text for line in lines if line.kind == "contact"] == ["(1.0, 2.0): touched table"]
    assert told(Drive().go(2.0), places={})[0].text == "(0.1, 0.0): wanted lab"


def test_the_first_line_of_a_failure_says_why() -> None:
    assert headline(RESULT) == (
        "timeout after 9.0 s because the robot was held back before door: time limit of 9 s"
    )
    assert headline({"outcome": "reached", "reason": "stopped at 'lab'"}) == (
        "reached: stopped at 'lab'"
    )
    assert "because sensor failed" in headline({"outcome": "fault", "cause": "sensor_failed"})
    result = {**RESULT, "objections": ["behavior own failed in 35 of 56 calls"]}
    assert headline(result).endswith("time limit of 9 s; behavior own failed in 35 of 56 calls")


def test_a_recording_that_is_cut_off_ends_nowhere() -> None:
    drive = Drive().go(2.0)
    drive.complete = False
    texts = {line.kind: line.text for line in told(drive)}
    assert texts["cut"] == "here the recording ends, before its run did"
    assert texts["end"] == "timeout, time limit of 9 s"


def test_a_part_tells_the_places_that_the_whole_tells() -> None:
    drive = Drive().go(9.0)
    (passed,) = [line for line in told(drive) if line.kind == "passed"]
    assert passed in told(drive, passed.time - 0.5, passed.time + 0.5)


def test_a_part_is_told_in_more_detail() -> None:
    drive = Drive().go(3.0).go(0.5, 0.0).go(3.0)
    assert not [line for line in told(drive) if line.kind == "stood"]
    part = told(drive, 2.0, 5.0)
    assert [line.kind for line in part if line.kind in EPISODES] == ["stood"]
    assert all(2.0 <= line.time <= 5.0 for line in part)


def test_a_quiet_part_is_one_line() -> None:
    (line,) = told(Drive().go(9.0), 6.0, 6.5)
    assert line.text == "drove on at 0.50 m/s, led by go_to_xy"


STEPS = st.tuples(
    st.floats(0.1, 3.0),
    st.sampled_from([-0.1, 0.0, 0.1, 0.5]),
    st.sampled_from([-0.8, 0.0, 0.8]),
    st.sampled_from(["go_to_xy", "avoid", "give_way"]),
    st.sampled_from(["", "too close"]),
)


@given(st.lists(STEPS, max_size=60))
def test_any_drive_is_told_in_order_and_in_thirty_lines(steps: list[Any]) -> None:
    drive = Drive()
    for seconds, v, w, leader, held in steps:
        drive.go(seconds, v, w, leader=leader, held=held)
    lines = told(drive)
    assert 2 <= len(lines) <= LINES
    assert [line.time for line in lines] == sorted(line.time for line in lines)
    assert len({(line.time, line.text) for line in lines}) == len(lines)
