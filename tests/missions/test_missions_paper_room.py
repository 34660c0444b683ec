"""The paper's room: round and square objects, corners, a door."""

from __future__ import annotations

import pytest

from navfw.testing import MissionRun

MORE_SEEDS = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 10)]


@pytest.mark.mission(world="paper-room", mission="through-the-door", seeds=[0, 1, *MORE_SEEDS])
def test_the_robot_finds_out_through_the_door(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert mission.metrics.min_clearance_m > 0.05
    assert mission.path[-1, 0] > 6.0, "it should stand beyond the partition"


@pytest.mark.mission(world="paper-room", mission="around-objects", seeds=[0, *MORE_SEEDS])
def test_objects_are_passed_without_contact(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert mission.metrics.collisions == 0
    assert mission.metrics.spl > 0.6


@pytest.mark.slow
@pytest.mark.mission(world="paper-room", mission="into-the-room", seeds=range(10))
def test_the_robot_finds_in_through_the_door(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
