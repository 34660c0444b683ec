"""The local map as a whole: memory, planning, drops; no room where nothing is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from param_ranges import check_ranges

from navfw.localmap import (
    LocalGoal,
    LocalMap,
    LocalMapParams,
    LocalPlannerParams,
    OccupancyParams,
    Ranges,
    TraversabilityParams,
)
from navfw.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import Belief, Label, Odometry, Percept, Pose, Twist
from navfw.testing.behavior_scenes import wall_flow

ROBOT = RobotModel()
ORIGIN = Pose(0.0, 0.0, 0.0)
TARGET = (3.0, 1.0)
AHEAD = Twist(0.3, 0.0)


def local_map(**params: object) -> LocalMap:
    """A local map in which one frame is enough for an occupied cell."""
    chosen = {"occupancy": {"hit": 1.5, "miss": 0.7}, **params}
    return LocalMap(ROBOT, LocalMapParams.model_validate(chosen))


def wall_percept(time: float, ahead: float) -> Percept:
    return Offis(ROBOT).perceive(wall_flow(ROBOT, time, ahead, 20.0, 20.0), Twist(0.2, 0.0))


def update(local_map: LocalMap, time: float, ahead: float | None) -> LocalMap:
    """Update from the origin by a frame that shows a wall ``ahead`` [m], or nothing new."""
    odometry = Odometry(time, ORIGIN, Twist(0.2, 0.0), 0.0, still=False)
    percepts = [] if ahead is None else [wall_percept(time, ahead)]
    local_map.update(odometry, percepts, None, odometry.pose)
    local_map.set_obstacles(())
    return local_map


def ranges(local_map: LocalMap, time: float, ahead: float | None) -> Ranges:
    return update(local_map, time, ahead).ranges(ORIGIN)


def test_without_memory_the_map_holds_the_newest_frame_alone() -> None:
    with_memory, without = local_map(), local_map(memory=False)
    for chosen in (with_memory, without):
        assert ranges(chosen, 1.0, 0.8).front < 0.8, "the wall is in the map"
    assert ranges(with_memory, 1.1, None).front < 0.8
    assert ranges(without, 1.1, None).front > 2.5
    assert ranges(without, 1.2, 0.8).front < 0.8


def test_without_memory_free_distances_are_those_of_the_newest_frame() -> None:
    without = update(local_map(memory=False), 1.0, 0.8)
    assert without.free_distance(ORIGIN, AHEAD).contact < 0.75
    update(without, 1.1, None)
    free = without.free_distance(ORIGIN, AHEAD)
    assert free.contact == 1.0
    assert free.unobserved < 0.3, "floor that is not in view is unobserved: the robot creeps"


def goal_of(local_map: LocalMap) -> LocalGoal:
    return update(local_map, 1.0, 0.8).local_goal(ORIGIN, TARGET)


def test_without_planning_the_local_goal_is_the_waypoint_itself() -> None:
    straight = goal_of(local_map(planning=False))
    assert straight.bearing == pytest.approx(math.atan2(1.0, 3.0))
    assert straight.cost == pytest.approx(math.hypot(3.0, 1.0))
    assert straight.reachable
    assert goal_of(local_map()).cost > straight.cost


# --- nothing is known -----------------------------------------------------------------------------


def all_free() -> LocalMap:
    """A local map around the origin whose floor is all observed free."""
    chosen = update(local_map(), 0.0, None)
    chosen.occupancy.log_odds[:] = -1.0
    return chosen


@pytest.mark.parametrize("twist", [AHEAD, Twist(-0.1, 0.2), Twist(0.0, 1.0)])
def test_there_is_no_room_before_the_first_update_and_after_a_reset(twist: Twist) -> None:
    assert LocalMap(ROBOT).free_distance(ORIGIN, twist) == (0.0, 0.0)
    chosen = all_free()
    assert chosen.free_distance(ORIGIN, twist) == (1.0, 1.0)
    chosen.reset()
    assert chosen.free_distance(ORIGIN, twist) == (0.0, 0.0)


@pytest.mark.parametrize("side", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_there_is_no_room_outside_the_grid(side: tuple[float, float]) -> None:
    chosen = all_free()
    cell, size = chosen.params.occupancy.cell, chosen.occupancy.size
    inward = math.atan2(-side[1], -side[0])
    for cells, inside in ((size // 2, True), (size // 2 + 1, False)):
        pose = Pose(side[0] * cells * cell, side[1] * cells * cell, inward)
        free = chosen.free_distance(pose, AHEAD)
        assert (free.contact > 0.0) == inside
        assert free.contact == (1.0 if inside else 0.0)


def belief(pose: Pose) -> Belief:
    return Belief(0.0, pose, np.diag([0.01, 0.01, 0.01]))


def test_there_is_no_passage_report_before_the_first_update() -> None:
    chosen = LocalMap(ROBOT)
    odometry = Odometry(0.0, ORIGIN, AHEAD, 0.0, still=False)
    assert chosen.passage_report([], odometry, belief(ORIGIN)) is None
    assert update(chosen, 0.0, None).passage_report([], odometry, belief(ORIGIN)) is not None
    chosen.reset()
    assert chosen.passage_report([], odometry, belief(ORIGIN)) is None


# --- drops ----------------------------------------------------------------------------------------


def drop_percept(time: float) -> Percept:
    """One cell that is clearly below the floor 1 m before the camera."""
    one = np.ones((1, 1))
    return Percept(
        time=time,
        points=np.array([[[0.0, ROBOT.camera.mount_height * ROBOT.camera.focal]]]),
        nearness=0.5 * one,
        sigma=0.02 * one,
        confidence=one,
        height=-one,
        label=np.full((1, 1), Label.DROP, np.int8),
        obstacles={},
        quadrants={},
        planes={},
        slopes={},
        situations={},
        floor_in_front=0.0,
        sentence="",
    )


def with_drop(**params: object) -> LocalMap:
    """A local map that has observed missing floor ahead of the origin."""
    chosen = local_map(**params)
    for k in range(3):
        odometry = Odometry(0.1 * k, ORIGIN, AHEAD, 0.0, still=False)
        chosen.update(odometry, [drop_percept(0.1 * k)], None, ORIGIN)
    return chosen


def test_missing_floor_is_occupied_unless_there_is_no_memory() -> None:
    for memory in (True, False):
        chosen = with_drop(memory=memory)
        ((x, y),) = chosen.drops.points()
        chosen.set_obstacles(())
        assert chosen.occupancy.occupied[chosen.occupancy.index(x, y)] == memory
    chosen.reset()
    assert chosen.drops.points() == []


def test_a_passage_report_gives_missing_floor_in_the_map_frame() -> None:
    chosen = with_drop()
    in_map = Pose(2.0, -1.0, 0.5 * math.pi)
    odometry = Odometry(0.2, ORIGIN, AHEAD, 0.0, still=False)
    report = chosen.passage_report([], odometry, belief(in_map))
    assert report is not None
    assert report.time == 0.2
    ((x, y),) = report.drops
    distance = ROBOT.camera.mount_forward + 1.0
    assert (x, y) == pytest.approx((2.0, -1.0 + distance), abs=0.2)


# --- parameters -----------------------------------------------------------------------------------


def test_parameters_are_within_their_ranges() -> None:
    metres = "[0, 5]"
    check_ranges(LocalMapParams, {"margin": "[0, 0.3]"})
    check_ranges(
        OccupancyParams,
        {
            "extent": "(0, 30]",
            "cell": "[0.02, 0.2]",
            "hit": "(0, 100]",
            "miss": "(0, 100]",
            "clamp_min": "[-100, 0)",
            "clamp_max": "(0, 100]",
            "occupied": "(0, 100]",
            "observed_free": "[-100, 0)",
            "range": "(0, 100]",
            "hit_width": "(0, 3]",
            "decay": "(0, 100]",
            "view_decay": "(0, 100]",
            "min_confidence": "[0, 1]",
            "over_weight": "[0, 1]",
            "drop_weight": "[0, 1]",
            "max_height": "(0, 100]",
        },
    )
    check_ranges(
        LocalPlannerParams,
        {
            "distance": "(0.1, 3]",
            "clear": "[0, 1]",
            "narrow_price": "[0, 50]",
            "unobserved_price": "[0, 20]",
            "turn_price": "[0, 2]",
            "margin": "[0, 0.3]",
        },
    )
    check_ranges(
        TraversabilityParams,
        {
            "range": "(0.3, 10]",
            "slack": metres,
            "max_sigma": metres,
            "max_half_width": metres,
            "interval": "[0, 60]",
        },
    )


@pytest.mark.parametrize("share", [(0.3, 0.3), (0.4, 0.3), (-0.1, 0.3), (0.1, 1.1)])
def test_the_probabilities_of_a_hit_have_to_rise(share: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="cell_share"):
        OccupancyParams(cell_share=share)
