"""Missions in the office, with the ``mission`` marker."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.testing import MissionRun

MORE_SEEDS = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 10)]


@pytest.mark.mission(world="office", mission="lobby-to-lab", seeds=[1, *MORE_SEEDS])
def test_the_robot_drives_from_the_lobby_to_the_lab(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert mission.metrics.collisions == 0
    assert mission.metrics.path_length_m >= 15.0
    through_lobby_door = np.hypot(mission.path[:, 0] - 3.2, mission.path[:, 1] - 4.2) < 0.5
    through_lab_door = np.hypot(mission.path[:, 0] - 14.4, mission.path[:, 1] - 5.8) < 0.5
    assert through_lobby_door.any()
    assert through_lab_door.any()


@pytest.mark.mission(world="office", mission="lobby-to-lab", seeds=[1])
def test_commands_keep_the_robot_s_limits(mission: MissionRun) -> None:
    robot = mission.session.mission.spec.robot
    v, w = mission.commands[:, 1], mission.commands[:, 2]
    assert v.max() <= robot.max_v
    assert v.min() >= -robot.max_reverse
    assert np.abs(w).max() <= robot.max_w
    assert np.abs(v * w).max() <= robot.max_lateral + 1e-6


@pytest.mark.slow
@pytest.mark.mission(
    world="office",
    mission=["lab-to-lobby", "meeting-to-kitchen", "workshop-to-office-a", "kitchen-tour"],
    seeds=range(5),
)
def test_the_other_missions_of_the_office(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
