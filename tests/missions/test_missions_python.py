"""Missions from Python: ``navfw.run``, ``navfw.open_session``, and tables of results."""

from importlib.util import find_spec
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from cli_calls import refusal
from processes import printed

import navfw
from navfw.errors import InputError, MissingExtraError
from navfw.missions import prepare

SHORT = {"mission.timeout": 2.5}


@pytest.fixture(scope="module")
def result() -> navfw.MissionResult:
    return navfw.run("empty", "straight", seed=2, set=SHORT)


def test_importing_navfw_imports_nothing_heavy() -> None:
    code = (
        "import sys, navfw; navfw.__all__; print({'numpy', 'pydantic', 'cv2'} & set(sys.modules))"
    )
    assert printed(code) == "set()"


def test_a_run_is_that_of_the_command(result: navfw.MissionResult) -> None:
    session = prepare("empty", "straight", seed=2, overrides=["mission.timeout=2.5"])
    assert result.log.command_hash == session.run().log.command_hash
    assert result.outcome == navfw.Outcome.TIMEOUT
    with pytest.raises(InputError, match="did you mean 'straight'"):
        navfw.run("empty", "straigth")


def test_a_stepped_session_drives_the_same_commands(result: navfw.MissionResult) -> None:
    with navfw.open_session("empty", "straight", seed=2, set=SHORT) as session:
        with pytest.raises(InputError, match="has not ended"):
            _ = session.result
        ticks = list(session)
        assert session.ended
        assert session.step() is None
    log = session.result.log
    assert log.command_hash == result.log.command_hash
    assert session.result.path_length_m == result.path_length_m
    assert np.array_equal([tick.true_pose for tick in ticks], log.true)
    assert np.array_equal([tick.twist for tick in ticks], log.commands)
    shown = [tick for tick in ticks if tick.image is not None]
    last: Any = shown[-1]  # all its parts are there
    assert len(shown) == 26
    assert last.image.shape == (120, 160)
    assert last.flow.vectors.shape == (*last.percept.nearness.shape, 2)
    assert last.leader in last.proposals
    assert last.command is not None
    assert np.hypot(*(last.estimated_pose - last.true_pose)[:2]) < 0.1
    assert session.explain()["leader"] == last.leader


def test_a_session_left_early_is_closed() -> None:
    with navfw.open_session("empty", "straight") as session:
        assert session.step() is not None
    with pytest.raises(InputError, match="not open"):
        session.step()
    assert not session.ended


def test_a_failing_plugin_ends_a_stepped_session_as_a_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with navfw.open_session("empty", "straight") as session:
        fail = Mock(side_effect=RuntimeError("broken"))
        monkeypatch.setattr(session.session.stack, "step", fail)
        assert session.step() is None
    assert session.result.outcome == "fault"
    assert "broken" in session.result.reason


def test_the_log_as_columns(result: navfw.MissionResult) -> None:
    log = result.log
    columns = log.columns()
    assert {len(column) for column in columns.values()} == {log.ticks}
    assert np.array_equal(columns["true_yaw"], log.true[:, 2])
    assert columns["leader"][-1] == log.leaders[log.leader[-1]]
    if find_spec("pandas") is None:
        with pytest.raises(MissingExtraError, match=r"navfw\[pandas\]"):
            log.to_pandas()
    else:
        table = log.to_pandas()
        assert list(table.columns) == list(columns)
        assert table["v"].to_numpy().tolist() == log.commands[:, 0].tolist()


def test_a_point_is_a_goal_from_the_start_of_the_first_mission() -> None:
    session = prepare("office", (13.0, 8.0))
    assert session.mission_name == "to-13,8"
    assert (session.mission.goals[0].x, session.mission.goals[0].y) == (13.0, 8.0)
    assert session.mission.start == prepare("office", "door-closes").mission.start
    assert session.mission.spec.events == ()
    assert session.config["mission"]["description"] == "To (13, 8) from the start of door-closes."
    changed = prepare("office", (13.0, 8.0), overrides=["mission.timeout=9"])
    assert changed.mission.spec.timeout == 9.0
    # a start that is not known does not count
    assert prepare("hospital", (3.0, 10.0)).mission.start_known


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--goal", "99,1"), "--goal 99,1: the goal (99, 1) must lie on the floor"),
        (("--goal", "3.95,1"), "--goal 3.95,1: the goal (3.95, 1) is 0.12 m from 'lobby-sofa'"),
        (("--goal", "1,x"), "--goal: expected X,Y"),
        (("--goal", "1"), "--goal 1: unknown place '1'"),
        (("--goal", "labb"), "--goal labb: unknown place 'labb': did you mean 'lab'?"),
        (("--map", "hospital"), "--map: needs --goal"),
        (("lab-to-lobby", "--goal", "1,1"), "give a mission or a goal, not both"),
        ((), "give --goal, or one of the missions of office: door-closes"),
    ],
)
def test_wrong_goals(words: tuple[str, ...], message: str) -> None:
    assert message in refusal("run", "office", *words)
