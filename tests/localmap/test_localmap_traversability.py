"""Traversability of the legs ahead: open, closed, unknown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap import LocalMap, OccupancyGrid, TraversabilityCheck
from navfw.robot import RobotModel
from navfw.signals import Belief, Odometry, PassageQuery, Pose, Twist

ROBOT = RobotModel()
FREE, OCCUPIED = -1.0, 2.0
HERE = Pose(0, 0, 0)


def corridor(pose: Pose = HERE, half: float = 0.5, ahead: float = 3.0) -> OccupancyGrid:
    """A corridor along x of the pose's frame, walls at both sides, all of it observed."""
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(pose, 0.0)
    paint(occupancy, pose, (-0.5, ahead), (-half, half), FREE)
    for wall in ((-half - 0.1, -half), (half, half + 0.1)):
        paint(occupancy, pose, (-0.5, ahead), wall, OCCUPIED)
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


@pytest.mark.parametrize(
    ("half", "obstacle", "status"),
    [
        (0.5, None, "open"),
        (0.5, ((1.2, 1.4), (-0.5, 0.5)), "closed"),
        (0.8, ((1.2, 1.4), (-0.2, 0.8)), "open"),  # beside the way
    ],
)
def test_a_corridor_is_open_unless_an_obstacle_is_across_it(
    half: float, obstacle: tuple[tuple[float, float], tuple[float, float]] | None, status: str
) -> None:
    occupancy = corridor(half=half)
    legs = queries_along((0, 0), (2, 0), width=2.0 * half)
    if obstacle is not None:
        paint(occupancy, HERE, *obstacle, OCCUPIED)
    assert statuses(occupancy, legs) == [status]
    assert statuses(occupancy, legs, sigma=0.5) == [], "nothing from an uncertain position"


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
