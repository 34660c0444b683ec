"""Traversability of the legs ahead: open, closed, unknown; and where the floor is missing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap import (
    CERTAIN,
    CLEAR_VOTES,
    INTERVAL,
    SPOT,
    DropMap,
    LocalMap,
    OccupancyGrid,
    TraversabilityCheck,
)
from navfw.robot import RobotModel
from navfw.signals import Belief, Label, Odometry, PassageQuery, Percept, Pose, Twist

ROBOT = RobotModel()
FREE, OCCUPIED = -1.0, 2.0
HERE = Pose(0, 0, 0)


def corridor(pose: Pose = HERE, half: float = 0.5, ahead: float = 3.0) -> OccupancyGrid:
    """A corridor along x of the pose's frame, walls at both sides, all of it observed."""
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(pose, 0.0)
    paint(occupancy, pose, (-0.5, ahead), (-half, half), FREE)
    for side in (-1, 1):
        paint(
            occupancy,
            pose,
            (-0.5, ahead),
            tuple(sorted((side * half, side * (half + 0.1)))),
            OCCUPIED,
        )
    return occupancy


def paint(
    occupancy: OccupancyGrid, pose: Pose, x: tuple[float, ...], y: tuple[float, ...], value: float
) -> None:
    """Set the log-odds of a rectangle given in the pose's frame [m]."""
    for ahead in np.arange(x[0], x[1] + 1e-9, 0.02):
        for left in np.arange(y[0], y[1] + 1e-9, 0.02):
            occupancy.log_odds[occupancy.index(*pose.to_parent(float(ahead), float(left)))] = value
    occupancy.update(pose, 0.0)  # what is derived from the log-odds is computed anew


def queries_along(*points: tuple[float, float], width: float = 1.0) -> list[PassageQuery]:
    """Queries for the legs between the points."""
    names = [f"p{i}" for i in range(len(points))]
    return [
        PassageQuery((names[i], names[i + 1]), points[i], points[i + 1], width)
        for i in range(len(points) - 1)
    ]


def belief(pose: Pose, sigma: float = 0.05) -> Belief:
    return Belief(0.0, pose, np.diag([sigma**2, sigma**2, 0.01]))


def statuses(
    occupancy: OccupancyGrid, queries: list[PassageQuery], sigma: float = 0.05
) -> list[str]:
    judged = TraversabilityCheck().check(occupancy, queries, HERE, belief(HERE, sigma), 1.0)
    assert [query for query, _ in judged] == queries[: len(judged)]
    return [status for _, status in judged]


def test_an_observed_corridor_is_open() -> None:
    assert statuses(corridor(), queries_along((0, 0), (2, 0))) == ["open"]


def test_an_obstacle_across_it_closes_it() -> None:
    occupancy = corridor()
    paint(occupancy, HERE, (1.2, 1.4), (-0.5, 0.5), OCCUPIED)
    assert statuses(occupancy, queries_along((0, 0), (2, 0))) == ["closed"]


def test_an_obstacle_beside_the_way_does_not() -> None:
    occupancy = corridor(half=0.8)
    paint(occupancy, HERE, (1.2, 1.4), (-0.2, 0.8), OCCUPIED)
    assert statuses(occupancy, queries_along((0, 0), (2, 0), width=1.6)) == ["open"]


def test_an_unobserved_leg_is_unknown() -> None:
    occupancy = corridor(ahead=1.0)
    assert statuses(occupancy, queries_along((0, 0), (2, 0))) == ["unknown"]
    paint(occupancy, HERE, (1.2, 1.4), (-0.5, 0.0), OCCUPIED)  # half of a barrier
    assert statuses(occupancy, queries_along((0, 0), (2, 0))) == ["unknown"]


def test_the_closed_leg_is_the_last_one_judged() -> None:
    occupancy = corridor()
    paint(occupancy, HERE, (1.6, 1.8), (-0.5, 0.5), OCCUPIED)
    legs = queries_along((0, 0), (1, 0), (2, 0), (2.4, 0))
    assert statuses(occupancy, legs) == ["open", "closed"]


def test_legs_out_of_range_are_not_judged() -> None:
    occupancy = corridor()
    paint(occupancy, HERE, (2.8, 2.9), (-0.5, 0.5), OCCUPIED)
    assert statuses(occupancy, queries_along((0, 0), (4, 0))) == ["open"]  # as far as 2.5 m
    assert statuses(occupancy, queries_along((3, 0), (4, 0))) == []


def test_nothing_is_judged_from_an_uncertain_position() -> None:
    occupancy = corridor()
    paint(occupancy, HERE, (1.2, 1.4), (-0.5, 0.5), OCCUPIED)
    assert statuses(occupancy, queries_along((0, 0), (2, 0)), sigma=0.5) == []


@settings(max_examples=25, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_map_and_odom_may_differ_by_any_motion(
    x: float, y: float, yaw: float, map_x: float, map_yaw: float
) -> None:
    """The queries are in the map frame, the grid is in odom."""
    in_odom, in_map = Pose(x, y, yaw), Pose(map_x, 2.0, map_yaw)
    occupancy = corridor(in_odom)
    queries = queries_along(in_map.to_parent(0, 0), in_map.to_parent(2, 0))
    check = TraversabilityCheck()
    judged = check.check(occupancy, queries, in_odom, belief(in_map), 1.0)
    assert judged[0] == (queries[0], "open")
    paint(occupancy, in_odom, (1.2, 1.4), (-0.55, 0.55), OCCUPIED)
    judged = check.check(occupancy, queries, in_odom, belief(in_map), 2.0)
    assert judged[0] == (queries[0], "closed")


def test_checks_keep_their_interval() -> None:
    local_map = LocalMap(ROBOT)

    def reported(time: float) -> bool:
        odometry = Odometry(time, HERE, Twist(0.0, 0.0), 0.0, still=True)
        local_map.update(odometry, (), None, HERE)
        return local_map.passage_report([], odometry, belief(HERE)) is not None

    assert sum(reported(0.1 * k) for k in range(11)) == 3
    local_map.reset()
    assert reported(0.0)


def floor_percept(time: float, label: Label, depth: float = 1.0) -> Percept:
    """One cell whose ray meets the floor ``depth`` [m] before the camera."""
    row = ROBOT.camera.mount_height / depth * ROBOT.camera.focal
    one = np.ones((1, 1))
    return Percept(
        time=time,
        points=np.array([[[0.0, row]]]),
        nearness=one,
        sigma=0.02 * one,
        confidence=one,
        height=0.0 * one,
        label=np.full((1, 1), label, np.int8),
        obstacles={},
        quadrants={},
        planes={},
        slopes={},
        situations={},
        floor_in_front=0.0,
        sentence="",
    )


def test_many_points_below_the_floor_make_a_drop_where_the_rays_pass_it() -> None:
    drops = DropMap(ROBOT)
    pose = Pose(1.0, 2.0, math.pi / 2)
    for k in range(CERTAIN - 1):
        drops.integrate(floor_percept(INTERVAL * k, Label.DROP), pose)
    assert drops.points() == []
    drops.integrate(floor_percept(INTERVAL * CERTAIN, Label.DROP), pose)
    ((x, y),) = drops.points()
    assert math.dist((x, y), (1.0, 2.0 + ROBOT.camera.mount_forward + 1.0)) < 0.2


@pytest.mark.parametrize("aside", [-0.5, 0.5])
@pytest.mark.parametrize("pitch", [0.0, 0.9])
def test_a_drop_aside_is_where_its_rays_meet_the_floor(aside: float, pitch: float) -> None:
    robot = RobotModel.model_validate({"camera": {"pitch": pitch}})
    camera, ahead = robot.camera, 1.4
    right, down, depth = camera.base_from_camera.T @ (ahead, aside, -camera.mount_height)
    point = np.array([[[right, down]]]) * camera.focal / depth
    percept = replace(floor_percept(0.0, Label.DROP), points=point, nearness=np.full((1, 1), 0.5))
    drops = DropMap(robot)
    for k in range(CERTAIN):
        drops.integrate(replace(percept, time=INTERVAL * k), HERE)
    ((x, y),) = drops.points()
    assert x == pytest.approx(camera.mount_forward + ahead, abs=0.51 * SPOT)
    assert y == pytest.approx(aside, abs=0.51 * SPOT)


def test_clear_observations_make_a_drop_sooner_and_it_is_occupied() -> None:
    drops = DropMap(ROBOT)
    clear = replace(floor_percept(0.0, Label.DROP), nearness=np.full((1, 1), 0.5))
    for k in range(CERTAIN // CLEAR_VOTES):
        assert drops.discs() == ()
        drops.integrate(replace(clear, time=INTERVAL * k), HERE)
    ((x, y),) = drops.points()
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(HERE, 0.0)
    before = occupancy.occupied.copy()
    occupancy.set_obstacles(drops.discs())
    row, column = occupancy.index(x, y)
    assert occupancy.occupied[row, column]
    assert not before.any()
    assert occupancy.clearance[row, column] == 0.0
    assert occupancy.clearance[occupancy.index(x - 0.6, y)] == pytest.approx(0.45, abs=0.1)


@pytest.mark.parametrize(
    ("depth", "share", "sigma", "clear"),
    [
        # a point is clear below 0.85 of the floor's nearness ...
        (0.6, 0.83, 0.02, True),
        (0.6, 0.87, 0.02, False),
        (1.0, 0.83, 0.02, True),
        (1.0, 0.87, 0.02, False),
        # ... and five sigma of it, which are 0.1 1/m at least
        (1.4, 0.84, 0.001, True),
        (1.4, 0.84, 0.025, False),
        (0.6, 0.5, 0.16, True),
        (0.6, 0.5, 0.17, False),
    ],
)
def test_points_far_below_the_floor_are_clear(
    depth: float, share: float, sigma: float, clear: bool
) -> None:
    one = floor_percept(0.0, Label.DROP, depth)
    percept = replace(one, nearness=np.full((1, 1), share / depth), sigma=np.full((1, 1), sigma))
    drops = DropMap(ROBOT)
    for k in range(CERTAIN // CLEAR_VOTES):
        drops.integrate(replace(percept, time=INTERVAL * k), HERE)
    assert bool(drops.points()) is clear


@pytest.mark.parametrize(
    ("cells", "confidence", "observations"),
    [
        ("DDF", (1.0, 1.0, 1.0), CERTAIN),
        ("DF", (1.0, 1.0), None),
        ("DFF", (1.0, 1.0, 1.0), None),
        ("DFF", (1.0, 0.1, 0.2), CERTAIN),
        ("CCD", (1.0, 1.0, 1.0), CERTAIN // CLEAR_VOTES),
        ("CDD", (1.0, 1.0, 1.0), CERTAIN),
        ("CCFFF", (1.0, 1.0, 1.0, 1.0, 1.0), None),
    ],
)
def test_a_spot_follows_the_majority_of_its_confident_cells(
    cells: str, confidence: tuple[float, ...], observations: int | None
) -> None:
    one = floor_percept(0.0, Label.DROP)
    shape = (1, len(cells))
    percept = replace(
        one,
        # so near to each other that all of them meet the floor in one spot
        points=np.array([[[0.01 * k, one.points[0, 0, 1]] for k in range(len(cells))]]),
        label=np.array([[Label.FLOOR if c == "F" else Label.DROP for c in cells]], np.int8),
        nearness=np.array([[0.5 if c == "C" else 1.0 for c in cells]]),
        sigma=np.full(shape, 0.02),
        confidence=np.array([confidence]),
        height=np.zeros(shape),
    )
    drops = DropMap(ROBOT)
    needed = None
    for k in range(3 * CERTAIN):
        drops.integrate(replace(percept, time=INTERVAL * k), Pose(0.0, 0.05, 0.0))
        if needed is None and drops.points():
            needed = k + 1
    assert needed == observations


def test_no_drop_is_found_far_away_or_above_the_horizon() -> None:
    drops = DropMap(ROBOT)
    for k in range(2 * CERTAIN):
        drops.integrate(floor_percept(2 * k * INTERVAL, Label.DROP, depth=1.8), HERE)
        drops.integrate(floor_percept((2 * k + 1) * INTERVAL, Label.DROP, depth=-1.0), HERE)
    assert drops.points() == []


def test_floor_observed_for_long_delays_a_drop_little() -> None:
    drops = DropMap(ROBOT)
    for k in range(50):
        drops.integrate(floor_percept(INTERVAL * k, Label.FLOOR), HERE)
    clear = replace(floor_percept(0.0, Label.DROP), nearness=np.full((1, 1), 0.5))
    for k in range(3):
        drops.integrate(replace(clear, time=INTERVAL * (50 + k)), HERE)
    assert drops.points()


def test_observations_of_the_same_flow_are_one_vote() -> None:
    drops = DropMap(ROBOT)
    for k in range(10 * CERTAIN):
        drops.integrate(floor_percept(0.001 * k, Label.DROP), HERE)
    assert drops.points() == []


@pytest.mark.parametrize("label", [Label.FLOOR, Label.OBSTACLE])
def test_floor_votes_against_a_drop_and_obstacles_do_not_vote(label: Label) -> None:
    drops = DropMap(ROBOT)
    for k in range(2 * CERTAIN):
        drops.integrate(floor_percept(2 * k * INTERVAL, Label.DROP), HERE)
        other = floor_percept((2 * k + 1) * INTERVAL, label)
        drops.integrate(replace(other, time=(2 * k + 1) * INTERVAL), HERE)
    assert bool(drops.points()) is (label is Label.OBSTACLE)
    drops.reset()
    assert drops.points() == []
