"""A recording and a live viewer show what the stack saw and decided; the run stays the same."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from navfw.missions import MissionResult, prepare
from navfw.missions.session import Session
from navfw.recording import RunRecorder
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun

TIME = 4.0
Driven = tuple[MissionResult, RecordedRun]


def session(seconds: float) -> Session:
    overrides = [f"mission.timeout={seconds}"]
    return prepare("paper-room", "through-the-door", seed=3, overrides=overrides)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    result = session(TIME).run(record=True)
    assert result.recorder is not None
    path = tmp_path_factory.mktemp("channels") / "run.mcap"
    result.recorder.save(path)
    return result, RecordedRun(path)


def at_end(run: RecordedRun, topic: str) -> Any:
    return list(run.messages(topic))[-1].content


def test_recording_changes_no_command_and_has_the_resolved_configuration(driven: Driven) -> None:
    result, run = driven
    plain = result.session.run()
    assert plain.log.command_hash == result.log.command_hash
    assert plain.faults == result.faults == ()
    assert (run.metadata["world"], run.metadata["seed"]) == ("paper-room", "3")
    config = json.loads(run.metadata["config"])
    assert config["mission"]["timeout"] == TIME
    assert "avoid" in config["stack"]["behaviors"]


def test_all_channels_have_their_schema_rate_and_simulated_time(driven: Driven) -> None:
    _, run = driven
    times: dict[str, list[float]] = {}
    for message in run.messages():
        times.setdefault(message.topic, []).append(message.time)
    unused = {topics.LANDMARK_IMAGE, *topics.SIDE_IMAGES, topics.TRUE_OBSTACLES}
    used = [info for info in topics.CHANNELS if info not in unused]
    assert set(times) == set(used)
    for info in used:
        assert run.topics[info] == info.schema
        stamps = times[info]
        assert stamps == sorted(stamps)
        assert stamps[-1] <= TIME + 1e-6
        if len(stamps) > 1:
            rate = (len(stamps) - 1) / (stamps[-1] - stamps[0])
            assert rate == pytest.approx(float(info.rate.split()[0]), rel=0.1), info


def test_the_command_is_that_of_the_run_with_reasons_and_rules(driven: Driven) -> None:
    result, run = driven
    log = result.log
    numbers = zip(log.time.tolist(), log.leader, strict=True)
    leaders = {round(time, 6): log.leaders[number] for time, number in numbers}
    shown = list(run.messages(topics.COMMAND))
    assert shown
    for message in shown:
        assert message.content["leader"] == leaders[round(message.time, 6)]
        assert set(message.content["reasons"]) == set(message.content["applicability"])
    rules = at_end(run, topics.RULES)["behaviors"]
    assert any("IF" in rule["rule"] for behavior in rules.values() for rule in behavior["rules"])


def test_poses_have_covariances_and_agree_with_the_transforms(driven: Driven) -> None:
    result, run = driven
    belief = result.session.stack.state.belief
    assert belief is not None
    estimated = at_end(run, topics.POSE)
    assert estimated.pose.position.x == belief.pose.x
    covariance = np.reshape(estimated.pose_covariance, (6, 6))
    assert np.array_equal(covariance[np.ix_((0, 1, 5), (0, 1, 5))], belief.covariance)
    moved = [0.0, 0.0, 0.0]
    for stamped in at_end(run, topics.TRANSFORMS).transforms[:2]:
        yaw, transform = moved[2], stamped.transform
        x, y = transform.translation.x, transform.translation.y
        moved[0] += math.cos(yaw) * x - math.sin(yaw) * y
        moved[1] += math.sin(yaw) * x + math.cos(yaw) * y
        moved[2] += 2.0 * math.atan2(transform.rotation.z, transform.rotation.w)
    assert moved[:2] == pytest.approx([belief.pose.x, belief.pose.y])
    assert math.cos(moved[2] - belief.pose.yaw) == pytest.approx(1.0)
    true = at_end(run, topics.TRUE_POSE).pose.position
    assert math.hypot(true.x - belief.pose.x, true.y - belief.pose.y) < 0.3


def grid_of(message: Any) -> Mapping[str, np.ndarray[Any, Any]]:
    count = len(message.fields)
    cells = np.frombuffer(message.data, np.uint8).reshape(-1, message.column_count, count)
    return {field.name: cells[..., field.offset] for field in message.fields}


def test_the_grids_are_those_of_the_stack(driven: Driven) -> None:
    result, run = driven
    stack = result.session.stack
    percent = grid_of(at_end(run, topics.LOCAL_MAP))["occupancy"]
    assert percent.shape == stack.local_map.occupancy.log_odds.shape
    assert set(np.unique(percent)) - {50}, "something has been seen"
    assert percent.max() > 70
    assert percent.min() < 30
    rated = grid_of(at_end(run, topics.PROPOSALS))
    assert {name.split(".")[0] for name in rated} == set(stack.mofis.behaviors)
    shape = (len(stack.mofis.commands.w), len(stack.mofis.commands.v))
    assert all(layer.shape == shape for layer in rated.values())
    assert rated["go_to_xy.desirability"].max() > 100


def test_the_flow_and_cells_lie_in_the_image(driven: Driven) -> None:
    _, run = driven
    for topic in (topics.FLOW, topics.CELLS):
        points = [(p.x, p.y) for group in at_end(run, topic).points for p in group.points]
        assert len(points) > 50
        assert all(-40.0 < x < 200.0 and -40.0 < y < 160.0 for x, y in points)
    assert at_end(run, topics.PERCEPT)["sentence"].startswith("Layer1")


def test_a_plugin_that_cannot_explain_itself_is_no_fault_of_the_run() -> None:
    short = session(2.5)
    composite = short.stack.mofis.composite
    object.__setattr__(composite, "explain", Mock(side_effect=RuntimeError("no words")))
    assert short.run(record=True).faults == ()


def test_a_saved_recording_is_the_same_when_saved_again(tmp_path: Path) -> None:
    recorder = RunRecorder()
    for name in "ab":
        recorder.save(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert (tmp_path / "a").read_bytes()[:5] == b"\x89MCAP"
