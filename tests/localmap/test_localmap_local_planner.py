"""The local planner: cost-to-go, descent, the local goal; and whether the legs ahead are open."""

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localmap_samples import ORIGIN, ROBOT, grid_with

from navfw.localmap import LocalMap, OccupancyGrid
from navfw.localmap.cost_kernels import cost_to_go, descend
from navfw.localmap.local_planner import LocalPlanner, LocalPlannerParams
from navfw.localmap.traversability import TraversabilityCheck
from navfw.numerics import Array
from navfw.signals import Belief, OccupiedDisc, Odometry, PassageQuery, Pose, Twist


def test_cost_to_go_in_the_open_is_the_distance() -> None:
    n = 61
    value = np.full((n, n), np.inf)
    value[30, 30] = 0.0
    cost_to_go(np.ones((n, n)), value, 24)
    rows, columns = np.indices((n, n))
    true = np.hypot(rows - 30, columns - 30)
    assert np.all(value >= true - 1e-6)
    # first order: the error at the source is of the order of a cell and does not grow much
    assert np.max(value - true) < 2.0


def test_the_local_goal_leads_round_an_obstacle() -> None:
    box = (0.8, 1.1, -0.5, 0.9)
    goal = LocalPlanner().plan(grid_with(box), ORIGIN, 2.0, 0.0)
    assert goal.reachable
    assert goal.bearing < -0.2  # the way on the right is shorter
    assert 0.6 < goal.distance < 1.0
    assert goal.detour > 1.05


@pytest.mark.parametrize("yaw", [0.9, -0.9])
def test_of_two_equal_ways_the_one_that_the_robot_faces(yaw: float) -> None:
    box = (0.5, 0.9, -0.45, 0.45)
    goal = LocalPlanner().plan(grid_with(box), Pose(0, 0, yaw), 2.0, 0.0)
    assert goal.reachable
    assert abs(goal.bearing) < 0.6
    # a slightly longer way on that side does not make the robot turn round
    longer = (0.5, 0.9, -0.45 - 0.1 * (yaw < 0), 0.45 + 0.1 * (yaw > 0))
    assert abs(LocalPlanner().plan(grid_with(longer), Pose(0, 0, yaw), 2.0, 0.0).bearing) < 0.6
    # a much longer way does not save a turn
    longer = (0.5, 0.9, -0.45 - 2.05 * (yaw < 0), 0.45 + 2.05 * (yaw > 0))
    goal = LocalPlanner().plan(grid_with(longer), Pose(0, 0, yaw), 2.0, 0.0)
    assert goal.bearing * yaw < -0.5


def test_the_way_of_the_last_plan_is_left_only_where_that_pays() -> None:
    planner = LocalPlanner()
    on_the_left = planner.plan(grid_with((0.8, 1.2, -0.7, 0.45)), ORIGIN, 2.0, 0.0)
    shorter_right = grid_with((0.8, 1.2, -0.5, 0.6))
    assert planner.plan(shorter_right, ORIGIN, 2.0, 0.0).bearing > 0.2
    assert on_the_left.bearing > 0.2 > LocalPlanner().plan(shorter_right, ORIGIN, 2.0, 0.0).bearing
    barred = grid_with((0.8, 1.2, -0.5, 2.9))
    assert planner.plan(barred, ORIGIN, 2.0, 0.0).bearing < -0.2
    assert planner.plan(shorter_right, ORIGIN, 2.0, 0.0).bearing < -0.2
    planner.reset()
    assert planner.plan(grid_with((0.8, 1.2, -0.7, 0.45)), ORIGIN, 2.0, 0.0) == on_the_left


@pytest.mark.parametrize("bearing", np.radians(np.arange(-180, 180, 30)))
@pytest.mark.parametrize("distance", [2.0, 30.0])
def test_the_local_goal_is_toward_the_target_on_every_side(bearing: float, distance: float) -> None:
    # 30 m are beyond the border of the grid
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    goal = LocalPlanner().plan(grid_with(), Pose(0, 0, bearing), x, y)
    assert goal.reachable
    assert goal.bearing == pytest.approx(0.0, abs=0.12)
    assert goal.distance == pytest.approx(0.8, abs=0.06)
    assert goal.detour == pytest.approx(1.0, abs=0.08)
    assert goal.cost == pytest.approx(distance, abs=0.25)


def test_the_local_goal_is_as_far_as_the_parameter_says_or_a_target_nearby() -> None:
    for distance in (0.3, 0.6):
        goal = LocalPlanner().plan(grid_with(), ORIGIN, 0.0, distance)
        assert (goal.x, goal.y) == pytest.approx((0.0, distance), abs=0.11)
    planner = LocalPlanner(LocalPlannerParams(distance=1.5))
    assert planner.plan(grid_with(), ORIGIN, 3.0, 0.0).distance == pytest.approx(1.5, abs=0.06)


def test_a_gap_is_given_up_until_it_is_wider_but_not_while_somebody_is_near() -> None:
    def ahead(half: float, plans: int, *people: OccupiedDisc) -> float:
        # the way ahead is a gap; another one leads round the wall on the left
        grid = grid_with((0.7, 0.9, -5.0, -half), (0.7, 0.9, half, 0.9))
        goals = [planner.plan(grid, ORIGIN, 2.0, 0.0, people) for _ in range(plans)]
        assert all(goal.reachable for goal in goals)
        return abs(goals[-1].bearing)

    planner = LocalPlanner()
    assert ahead(0.28, 39, OccupiedDisc(-1.0, 0.0, 0.2)) < 0.2
    assert ahead(0.28, 39) < 0.2
    assert ahead(0.28, 3) > 0.5, "after 4 s the robot goes round"
    assert ahead(0.5, 1) < 0.4, "it is wider"
    assert ahead(0.28, 1) < 0.4, "and forgotten"


def test_a_target_within_an_obstacle_is_still_headed_for() -> None:
    goal = LocalPlanner().plan(grid_with((1.8, 2.2, 0.3, 0.7)), ORIGIN, 2.0, 0.5)
    assert goal.bearing == pytest.approx(math.atan2(0.5, 2.0), abs=0.1)
    assert goal.distance == pytest.approx(0.8, abs=0.06)


def test_without_a_way_the_local_goal_is_straight_toward_the_target() -> None:
    cage = [(-1, 1, 0.9, 1), (-1, 1, -1, -0.9), (0.9, 1, -1, 1), (-1, -0.9, -1, 1)]
    pose = Pose(0.1, 0.0, 0.4)
    for target, distance in (((2.0, 1.0), 0.8), ((0.1, 2.0), 0.8)):
        goal = LocalPlanner().plan(grid_with(*cage), pose, *target)
        expected = pose.to_local(*target)
        assert not goal.reachable
        assert goal.bearing == pytest.approx(math.atan2(expected[1], expected[0]))
        assert goal.distance == pytest.approx(distance)
        assert goal.cost == goal.detour == math.inf


def test_a_robot_that_is_too_close_to_an_obstacle_drives_off() -> None:
    # 0.12 m from the robot's centre to the box on its right
    goal = LocalPlanner().plan(grid_with((-0.5, 0.5, -0.3, -0.12)), ORIGIN, 2.0, 0.0)
    assert goal.reachable
    assert goal.y > 0.02
    assert goal.x > 0.3
    assert 2.0 < goal.cost < 3.5


def test_moving_obstacles_bar_the_way_of_one_plan_alone() -> None:
    occupancy = grid_with((0.8, 1.1, -0.5, 0.9))
    planner = LocalPlanner()
    alone = planner.plan(occupancy, ORIGIN, 2.0, 0.0)
    person = OccupiedDisc(0.9, -0.8, 0.3)
    assert alone.bearing < -0.2
    assert planner.plan(occupancy, ORIGIN, 2.0, 0.0, (person,)).bearing > 0.2
    planner.reset()
    assert planner.plan(occupancy, ORIGIN, 2.0, 0.0) == alone


def test_observed_floor_is_cheaper_than_unobserved_floor() -> None:
    occupancy = grid_with((0.7, 1.3, -0.4, 0.4))
    for side in (1.0, -1.0):
        occupancy.log_odds[occupancy.log_odds < 0.0] = -1.0
        rows, columns = np.nonzero(occupancy.log_odds < 0.0)
        y = occupancy.origin[1] + occupancy.params.cell * rows
        unobserved = side * y > 0.2
        occupancy.log_odds[rows[unobserved], columns[unobserved]] = 0.0
        occupancy.update(ORIGIN, 0.0)
        planner = LocalPlanner(LocalPlannerParams(unobserved_price=2.0))
        assert planner.plan(occupancy, ORIGIN, 2.2, 0.0).bearing * side < -0.1
        occupancy.log_odds[rows, columns] = -1.0


# --- kernels --------------------------------------------------------------------------------------


def distance_to(row: float, column: float, n: int = 41) -> Array:
    """(n, n) distance [cells] of each cell from (row, column)."""
    rows, columns = np.indices((n, n))
    return np.asarray(np.hypot(rows - row, columns - column))


@given(st.floats(3.0, 37.0), st.floats(3.0, 37.0))
def test_descent_leads_straight_to_the_source(row: float, column: float) -> None:
    path = np.empty((200, 2))
    count = descend(distance_to(20, 20), row, column, 200, path)
    start = math.hypot(row - 20, column - 20)
    if start < 1.5:
        return
    steps = np.diff(np.vstack([[row, column], path[:count]]), axis=0)
    assert np.hypot(*steps.T) == pytest.approx(np.full(count, 0.5))
    # it ends at the minimum, without turning back
    assert math.hypot(*(path[count - 1] - 20.0)) < 0.8
    assert count == pytest.approx(2.0 * start, abs=2.0)
    # the last steps are around the minimum
    offset = (path[: count - 3] - 20.0) @ [-(column - 20.0), row - 20.0] / start
    assert np.abs(offset).max(initial=0.0) < 0.3
    # as many steps as asked for, and no more
    assert descend(distance_to(20, 20), row, column, 3, np.empty((3, 2))) == min(3, count)


def test_descent_begins_at_the_border_and_not_outside_nor_on_a_plain() -> None:
    path = np.empty((90, 2))
    for place in ((0.0, 20.0), (20.0, 0.0), (40.0, 20.0), (20.0, 40.0), (40.0, 40.0)):
        count = descend(distance_to(20, 20), *place, 90, path)
        assert math.hypot(*(path[count - 1] - 20.0)) < 0.8
    for outside in ((-2.0, 20.0), (20.0, -2.0), (43.0, 20.0), (20.0, 43.0)):
        assert descend(distance_to(20, 20), *outside, 90, path) == 0
    assert descend(np.ones((41, 41)), 20.3, 20.3, 90, path) == 0


def test_descent_leads_along_a_barred_area_and_out_of_it() -> None:
    value = distance_to(20, 35)
    value[10:31, 18:22] = np.inf
    path = np.empty((10, 2))
    # within the barred area: to the nearest passable cell
    assert descend(value, 20.0, 21.0, 2, path) == 2
    assert (path[0, 0], path[0, 1]) == pytest.approx((20.0, 21.5))
    assert descend(value, 20.0, 18.0, 2, path) == 2
    assert (path[0, 0], path[0, 1]) == pytest.approx((20.0, 17.5))
    # beside it: to the lowest cell around
    assert descend(value, 12.0, 17.0, 1, path) == 1
    assert not np.isinf(value[round(path[0, 0]), round(path[0, 1])])
    # deep within it there is none
    value[10:31, 10:30] = np.inf
    assert descend(value, 20.0, 20.0, 2, path) == 0


# --- traversability of the legs ahead: open, closed, unknown --------------------------------------

FREE, OCCUPIED = -1.0, 2.0
Area = tuple[tuple[float, float], tuple[float, float]]


def corridor(pose: Pose = ORIGIN, half: float = 0.5, ahead: float = 3.0) -> OccupancyGrid:
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
    return [
        PassageQuery((f"p{i}", f"p{i + 1}"), start, end, width)
        for i, (start, end) in enumerate(pairwise(points))
    ]


def belief(pose: Pose, sigma: float = 0.05) -> Belief:
    return Belief(0.0, pose, np.diag([sigma**2, sigma**2, 0.01]))


def statuses(occupancy: OccupancyGrid, legs: list[PassageQuery], sigma: float = 0.05) -> list[str]:
    judged = TraversabilityCheck().check(occupancy, legs, ORIGIN, belief(ORIGIN, sigma), 1.0)
    assert [query for query, _ in judged] == legs[: len(judged)]
    return [status for _, status in judged]


ACROSS = (-0.5, 0.5)
JUDGED: Mapping[str, tuple[float, float, Area | None, tuple[float, ...], list[str]]] = {
    "open": (0.5, 3.0, None, (0, 2), ["open"]),
    "across the way": (0.5, 3.0, ((1.2, 1.4), ACROSS), (0, 2), ["closed"]),
    "beside the way": (0.8, 3.0, ((1.2, 1.4), (-0.2, 0.8)), (0, 2), ["open"]),
    "unobserved": (0.5, 1.0, None, (0, 2), ["unknown"]),
    "half of a barrier": (0.5, 1.0, ((1.2, 1.4), (-0.5, 0.0)), (0, 2), ["unknown"]),
    "closed is the last": (0.5, 3.0, ((1.6, 1.8), ACROSS), (0, 1, 2, 2.4), ["open", "closed"]),
    "up to 2.5 m": (0.5, 3.0, ((2.8, 2.9), ACROSS), (0, 4), ["open"]),
    "out of range": (0.5, 3.0, ((2.8, 2.9), ACROSS), (3, 4), []),
}
"""Half width and length [m] of a corridor, what is in it, ends of the legs, how they are judged."""


@pytest.mark.parametrize("case", JUDGED)
def test_legs_are_open_unless_they_are_barred_or_not_observed(case: str) -> None:
    half, ahead, obstacle, ends, expected = JUDGED[case]
    occupancy = corridor(half=half, ahead=ahead)
    legs = queries_along(*((x, 0.0) for x in ends), width=2.0 * half)
    if obstacle is not None:
        paint(occupancy, ORIGIN, *obstacle, OCCUPIED)
    assert statuses(occupancy, legs) == expected
    assert statuses(occupancy, legs, sigma=0.5) == [], "nothing from an uncertain position"


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
        odometry = Odometry(time, ORIGIN, Twist(0.0, 0.0), 0.0, still=True)
        local_map.update(odometry, (), None, ORIGIN)
        return local_map.passage_report(tuple, odometry, belief(ORIGIN)) is not None

    assert sum(reported(0.1 * k) for k in range(11)) == 3
    local_map.reset()
    assert reported(0.0)
