"""Baseline stacks in short missions; the truth for oracle stacks; rounds."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from navfw_benchmarks.plugins.navground import surroundings

from navfw.errors import WorldError
from navfw.flow.grid_flow import above_horizon
from navfw.missions import MissionResult, SimulatorTruth, prepare
from navfw.missions.missionfile import load_mission
from navfw.robot import RobotModel
from navfw.signals import Odometry, Pose, Twist
from navfw.sim import SceneGeometry, Simulation, WorldSpec
from navfw.testing.behavior_scenes import wall_flow


def drive(stack: str, *changes: str) -> MissionResult:
    overrides = ["mission.timeout=40", *changes]
    return prepare("empty", "straight", seed=2, stack=stack, overrides=overrides).run()


@pytest.mark.thorough
@pytest.mark.parametrize("stack", ["paper", "balance", "divergence", "oracle", "patrol", "search"])
def test_every_stack_gets_to_a_goal_in_the_open(stack: str) -> None:
    result = drive(stack)
    assert result.outcome == "reached", result.reason
    assert result.faults == ()
    assert result.summary()["oracle"] is (stack == "oracle")


def test_navground_drives_the_robot() -> None:
    pytest.importorskip("navground", reason="the extra navground is not installed")
    result = drive("navground")
    assert result.outcome == "reached", result.reason
    assert result.summary()["oracle"] is True
    assert set(result.log.leaders) <= {"", "navground"}


@pytest.mark.parametrize(
    "override", ["derotate=false", "floor_model=false", "local_map.planning=false", "refine=false"]
)
def test_parts_of_the_stack_can_be_disabled(override: str) -> None:
    result = drive("default", override, "mission.timeout=6")
    assert result.outcome == "timeout"
    assert result.faults == ()
    usual = drive("default", "mission.timeout=6")
    assert result.log.command_hash != usual.log.command_hash


def test_an_unlocalised_robot_turns_and_explores() -> None:
    result = drive("search", "search.sigma=0.03", "mission.timeout=25")
    led = set(result.log.leaders)
    assert {"look_around", "explore"} <= led
    turned = np.abs(np.diff(np.unwrap(result.log.true[:, 2]))).sum()
    assert turned > 2.0 * math.pi


# --- the truth -----------------------------------------------------------------------------------

WORLD = {
    "name": "things",
    "x": [-6, 6],
    "y": [-6, 6],
    "boxes": [{"name": "box", "at": [2.0, 0.0], "size": [0.4, 0.8, 1.0]}],
    "cylinders": [
        {"name": "post", "at": [0.0, 1.5], "radius": 0.2},
        {"name": "far", "at": [5.0, 5.0], "radius": 0.2},
    ],
    "movers": [
        {"name": "walker", "path": [[-1.5, -3.0], [-1.5, 3.0]], "speed": 0.4, "yields": False}
    ],
}


def test_true_surroundings_are_in_base_link() -> None:
    world = WorldSpec.model_validate(WORLD)
    with Simulation(world, RobotModel(), Pose(0.0, 0.0, math.pi / 2.0), seed=0) as simulation:
        edges, discs, walkers = surroundings(SimulatorTruth(simulation), 3.5)
    # the robot faces along y: the box to the east is on its right
    ends = np.reshape(edges, (-1, 2))
    assert ends.min(axis=0) == pytest.approx([-0.4, -2.2], abs=0.01)
    assert ends.max(axis=0) == pytest.approx([0.4, -1.8], abs=0.01)
    assert len(edges) == 4
    assert [end for _, end in edges] == [edges[at - 3][0] for at in range(4)], "closed"
    assert np.array(discs) == pytest.approx(np.array([[1.5, 0.0, 0.2]]), abs=0.01)
    walker = walkers[0]
    assert walker[:3] == pytest.approx([-3.0, 1.5, 0.25], abs=0.05)
    assert walker[3:] == pytest.approx([0.4, 0.0], abs=0.01), "it walks the way the robot looks"


SCREEN = {"boxes": [{"name": "screen", "at": [-0.8, -2.8], "size": [0.1, 1.5, 1.0]}]}


@pytest.mark.parametrize(
    ("changed", "yaw", "share"), [({}, math.pi, 0.75), ({}, 0.0, 0.0), (SCREEN, math.pi, 0.0)]
)
def test_who_walks_in_view_is_noticed_at_times(
    changed: dict[str, Any], yaw: float, share: float
) -> None:
    world = WorldSpec.model_validate(WORLD | changed)
    with Simulation(world, RobotModel(), Pose(0.0, -2.6, yaw), seed=0) as simulation:
        truth, frame = SimulatorTruth(simulation), simulation.read().frame
        assert frame is not None
        still = Odometry(0.0, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), 0.0, still=True)
        seen = [truth.moving_objects(frame, still) for _ in range(400)]
    found = [one for at_once in seen for one in at_once]
    assert len(found) / 400 == pytest.approx(share, abs=0.07)
    if found:
        ahead = 1.5 - RobotModel().camera.mount_forward
        assert np.mean([one.bearing for one in found]) == pytest.approx(
            math.atan2(0.4, ahead), 0.03
        )
        speeds = np.mean([one.velocity(usual=10.0) for one in found], axis=0)
        assert speeds == pytest.approx([0.0, -0.4], abs=0.03)


def test_without_a_floor_model_flow_below_the_horizon_is_unknown() -> None:
    robot = RobotModel()
    flow = wall_flow(robot, 1.0, 2.0, 20.0, 20.0)
    kept = above_horizon(flow, robot.camera).confidence
    above = flow.points[..., 1] < 0.0
    assert np.array_equal(kept[above], flow.confidence[above])
    assert not kept[~above].any()


# --- rounds --------------------------------------------------------------------------------------

TRIANGLE = """\
start: [0, 0, 0]
goals: [{x: 2, y: 0}, {x: 2, y: 2}, {x: 0, y: 0}]
rounds: 3
"""


def test_rounds_repeat_the_goals(tmp_path: Path) -> None:
    file = tmp_path / "round.yaml"
    file.write_text(TRIANGLE)
    mission = load_mission(file)
    assert [(goal.x, goal.y) for goal in mission.goals] == [(2, 0), (2, 2), (0, 0)] * 3
    plan = SceneGeometry((-5.0, -5.0, 5.0, 5.0), ())
    assert mission.check(plan) == pytest.approx(3 * (4.0 + math.sqrt(8.0)), rel=0.02)
    file.write_text(TRIANGLE.replace("{x: 2, y: 2}", "{x: 2, y: 9}"))
    with pytest.raises(WorldError, match=r"round\.yaml:2: goals\[1\]"):
        load_mission(file).check(plan)


def test_the_map_of_goals_closes_the_round(tmp_path: Path) -> None:
    file = tmp_path / "round.yaml"
    file.write_text("start: [0, 0, 0]\ngoals: [{x: 2, y: 0}, {x: 2, y: 2}]\nrounds: 2\n")
    topo_map = load_mission(file).topo_map
    assert len(topo_map.places) == 3
    passages = {frozenset((p.a, p.b)) for p in topo_map.passages}
    assert passages == {frozenset(("start", "goal-1")), frozenset(("goal-1", "goal-2"))}
