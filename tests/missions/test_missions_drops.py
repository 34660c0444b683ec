"""Missions with drops, stairs and closing doors: detection and avoidance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from navfw.errors import InputError
from navfw.missions import MissionResult, Outcome, prepare
from navfw.sim import drop_rectangle

DROP = "{name: shaft, x: [3, 4], y: [1.2, 2.4], depth: 0.8}"
MISSION = """\
start: [1, 1.7, 0]
goals: [{x: 5.2, y: 1.7}]
tolerance: 0.3
drops:
  - %s
"""
WORLD = """\
name: hall
x: [0, 6.4]
y: [0, 3.6]
walls:
  - {name: wall, points: [[0.05, 0.05], [6.35, 0.05], [6.35, 3.55], [0.05, 3.55], [0.05, 0.05]]}
"""


def hall(folder: Path, drop: str = DROP) -> tuple[Path, Path]:
    (folder / "world.yaml").write_text(WORLD)
    (folder / "mission.yaml").write_text(MISSION % drop)
    return folder / "world.yaml", folder / "mission.yaml"


def office(mission: str, seed: int = 0) -> MissionResult:
    return prepare("office", mission, seed=seed).run()


def test_a_mission_s_drop_is_in_its_world_and_on_no_path(tmp_path: Path) -> None:
    session = prepare(*hall(tmp_path))
    assert [drop.name for drop in session.world.drops] == ["shaft"]
    assert session.plan.clearance(3.5, 1.8) < 0.0
    assert session.shortest > 4.3
    assert session.task.drops == {"shaft"}


@pytest.mark.parametrize(
    ("drop", "message"),
    [
        (DROP.replace("0.8", "0"), r"mission.yaml:5: drops\[0\].depth: expected a number >= 0.05"),
        (DROP.replace("[3, 4]", "[3, 9]"), r"mission.yaml:5: drops\[0\].x: 'shaft' extends beyond"),
        (
            DROP.replace("[3, 4]", "[0, 1.5]"),
            r"mission.yaml:5: drops\[0\].x: 'wall' would have no",
        ),
        (DROP.replace("[3, 4]", "[0.5, 1.5]"), r"mission.yaml:1: start: .*'shaft'"),
    ],
)
def test_a_wrong_drop_is_named_with_line_and_key(tmp_path: Path, drop: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        prepare(*hall(tmp_path, drop))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_drop_is_detected_at_its_position_and_avoided(tmp_path: Path, seed: int) -> None:
    session = prepare(*hall(tmp_path), seed=seed)
    result = session.run()
    assert result.outcome is Outcome.REACHED, result.reason
    points = np.array(session.stack.local_map.drops.points())
    assert len(points) >= 3
    # odometry starts at the origin: the start is (1, 1.7), heading along x
    truth = drop_rectangle(session.world.drops[0]).distance(np.add(points, (1.0, 1.7)))
    assert truth.max() < 0.25


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_unmapped_stairs_are_avoided(seed: int) -> None:
    result = office("stairs", seed)
    assert result.outcome is Outcome.REACHED, result.reason


@pytest.mark.slow
def test_mapped_stairs_are_avoided_from_the_start() -> None:
    result = office("stairs-mapped")
    assert result.outcome is Outcome.REACHED, result.reason
    rim = np.hypot(result.run.log.true[:, 0] - 11.0, result.run.log.true[:, 1] - 5.0)
    assert rim.min() > 0.9


@pytest.mark.slow
def test_another_route_is_taken_when_a_door_closes() -> None:
    result = office("door-closes")
    assert result.outcome is Outcome.REACHED, result.reason


@pytest.mark.slow
def test_a_closed_only_door_ends_stuck_and_is_named() -> None:
    result = office("only-door-closes")
    assert result.outcome is Outcome.STUCK
    assert "office-a-door - office-a-entrance" in result.reason
    (event,) = result.run.events
    assert result.run.log.time[-1] - event.began < 60.0 + 3.0
