"""Missions with movers: the cause of a collision, and clearance at the right time."""

from __future__ import annotations

from pathlib import Path

import pytest

from navfw.missions import MissionResult, Outcome, prepare

WORLD = """\
name: hall
x: [-6, 6]
y: [-6, 6]
movers:
  - {name: anna, path: [[2, 0], [-4, 0]], speed: 0.6, yields: false}
"""
MISSION = """\
start: [0, 0, 1.5708]
goals: [{x: 0, y: 5}]
timeout: 20
robot: {max_v: %s}
"""


def run(folder: Path, top_speed: float, world: str = WORLD) -> MissionResult:
    (folder / "missions").mkdir()
    (folder / "world.yaml").write_text(world, encoding="utf-8")
    (folder / "missions" / "up.yaml").write_text(MISSION % top_speed, encoding="utf-8")
    return prepare(folder, "up", overrides=["mission.timeout=3"]).run()


def test_a_robot_hit_by_a_mover_is_not_the_cause(tmp_path: Path) -> None:
    # a robot that hardly moves, and a mover from its right
    result = run(tmp_path, 0.02)
    assert result.outcome is Outcome.COLLIDED
    assert result.collision_cause == "mover"
    assert result.summary()["collision_cause"] == "mover"
    # the static plan alone, which is empty, would give an infinite clearance
    assert result.metrics.min_clearance_m == pytest.approx(0.0, abs=0.02)


def test_without_collision_there_is_no_cause(tmp_path: Path) -> None:
    result = run(tmp_path, 0.02, WORLD.replace("yields: false", "yields: true"))
    assert result.outcome is Outcome.TIMEOUT
    assert result.collision_cause is None
    assert 0.5 < result.metrics.min_clearance_m < 0.7
