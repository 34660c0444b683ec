"""Conflict prediction."""

import itertools
import math
from functools import partial

import numpy as np
import pytest

from navfw.context import CommandGrid
from navfw.movers import ConflictPredictor
from navfw.movers.conflict_prediction import ConflictParams
from navfw.movers.tracking import Track
from navfw.robot import RobotModel
from navfw.signals import Conflicts, Odometry, Pose, Twist

ROBOT = RobotModel()
COMMANDS = CommandGrid(ROBOT)
CERTAIN = ConflictParams(uncertainty=0.0)
STANDING = Twist(0.0, 0.0)
ORIGIN = Pose(0.0, 0.0, 0.0)
RADIUS = 0.25
TOUCH = RADIUS + ROBOT.radius
"""Distance [m] of the centres at contact."""


def track(x: float, y: float, vx: float, vy: float) -> Track:
    """A confirmed track of a person at (x, y) [m] with velocity (vx, vy) [m/s], at time 0."""
    return Track(np.array([x, y, vx, vy]), 0.01 * np.eye(4), RADIUS, 0.0, 5)


def conflicts(
    *tracks: Track,
    twist: Twist = STANDING,
    time: float = 0.0,
    params: ConflictParams = CERTAIN,
    pose: Pose = ORIGIN,
    robot: RobotModel = ROBOT,
) -> Conflicts:
    odometry = Odometry(time, pose, twist, 0.0, still=False)
    predicted = ConflictPredictor(robot, params).predict(tracks, odometry, COMMANDS.v, COMMANDS.w)
    assert predicted is not None
    return predicted


def closest(predicted: Conflicts, v: float, w: float) -> tuple[float, float]:
    """Distance [m] and time [s] at closest approach of the command nearest to (v, w)."""
    index = COMMANDS.nearest(Twist(v, w))
    return float(predicted.distance[index]), float(predicted.time[index])


def test_without_tracks_there_are_no_conflicts() -> None:
    odometry = Odometry(0.0, ORIGIN, STANDING, 0.0, still=False)
    predictor = ConflictPredictor(ROBOT, CERTAIN)
    assert predictor.predict((), odometry, COMMANDS.v, COMMANDS.w) is None


def test_a_standing_robot_is_reached_at_the_time_that_geometry_gives() -> None:
    predicted = conflicts(track(1.2, 0.2, -0.5, 0.0))
    distance, time = closest(predicted, 0.0, 0.0)
    assert distance == pytest.approx(0.2 - TOUCH, abs=0.02)
    contact = (1.2 - math.sqrt(TOUCH**2 - 0.2**2)) / 0.5
    assert time == pytest.approx(contact, abs=0.11)
    assert predicted.nearest == pytest.approx(math.hypot(1.2, 0.2) - TOUCH)
    # half a second later the contact is that much nearer
    obstacle = track(1.2 - 0.5 * 0.5, 0.2, -0.5, 0.0)
    obstacle.time = 0.5
    later = conflicts(obstacle, time=0.5)
    assert closest(later, 0.0, 0.0)[1] == pytest.approx(contact - 0.5, abs=0.11)


def test_waiting_lets_a_crossing_obstacle_pass_and_driving_on_does_not() -> None:
    # the obstacle is straight ahead by the time the robot gets there
    predicted = conflicts(track(0.9, -0.9, 0.0, 0.45), twist=Twist(0.45, 0.0))
    assert closest(predicted, 0.5, 0.0)[0] < 0.0
    assert closest(predicted, 0.0, 0.0)[0] > 0.15
    assert closest(predicted, -0.15, 0.0)[0] > closest(predicted, 0.0, 0.0)[0]


def test_turning_aside_clears_an_oncoming_obstacle() -> None:
    predicted = conflicts(track(1.8, 0.0, -0.4, 0.0), twist=Twist(0.4, 0.0))
    straight, left, right = (closest(predicted, 0.4, w)[0] for w in (0.0, 1.2, -1.2))
    assert straight < 0.0
    assert min(left, right) > 0.1
    assert left == pytest.approx(right, abs=1e-6)


def test_the_prediction_accounts_for_the_braking_distance() -> None:
    predicted = conflicts(track(0.85, 0.0, 0.0, 0.0), twist=Twist(0.5, 0.0))
    # 0.5 m/s at 1.2 m/s^2: a tenth of a metre until standstill
    assert closest(predicted, 0.0, 0.0)[0] == pytest.approx(0.85 - TOUCH - 0.104, abs=0.03)


def test_after_a_turn_on_the_spot_the_robot_drives_off() -> None:
    obstacle = track(1.6, 0.0, -0.45, 0.0)
    leaving = conflicts(obstacle)
    staying = conflicts(obstacle, params=ConflictParams(uncertainty=0.0, onward_speed=0.0))
    assert closest(leaving, 0.0, 1.2)[0] > closest(staying, 0.0, 1.2)[0] + 0.2
    assert closest(leaving, 0.0, 0.0) == closest(staying, 0.0, 0.0)


def test_approach_is_the_way_toward_a_close_obstacle_within_a_moment() -> None:
    # 0.2 m before the rim; at 0.3 m/s the robot covers 0.15 m in half a second
    predicted = conflicts(track(0.63, 0.0, 0.0, 0.0), twist=Twist(0.3, 0.0))
    ahead = predicted.approach[COMMANDS.nearest(Twist(0.3, 0.0))]
    assert ahead == pytest.approx(0.15, abs=0.02)
    away = predicted.approach[COMMANDS.nearest(Twist(-0.15, 0.0))]
    assert away < ahead
    standing = conflicts(track(0.63, 0.0, 0.0, 0.0))
    assert standing.approach[COMMANDS.v <= 0.0].max() == 0.0
    # an obstacle half a metre off is not close
    far = conflicts(track(1.0, 0.0, -0.5, 0.0), twist=Twist(0.3, 0.0))
    assert far.approach.max() == 0.0


def test_a_close_obstacle_that_leaves_faster_than_the_robot_follows_is_not_approached() -> None:
    for speed, approached in ((0.5, False), (-0.2, True)):
        predicted = conflicts(track(0.63, 0.0, speed, 0.0), twist=Twist(0.3, 0.0))
        assert (predicted.approach[COMMANDS.nearest(Twist(0.3, 0.0))] > 0.02) == approached
        assert predicted.approach[COMMANDS.nearest(STANDING)] < 0.05


def test_an_obstacle_that_is_not_detected_again_may_be_anywhere_near() -> None:
    seen, lost = track(1.5, 1.0, 0.0, 0.0), track(1.5, 1.0, 0.0, 0.0)
    seen.time = 2.0
    near, nearer = (conflicts(one, time=2.0).nearest for one in (seen, lost))
    assert nearer == pytest.approx(near - 2.0 * 0.2)


def test_driving_on_counts_as_well_as_stopping_after_a_second() -> None:
    # it crosses 1.2 m ahead: straight on meets it, but there is time to stop before
    crossing = track(1.2, -1.0, 0.0, 0.4)
    on, _ = closest(conflicts(crossing, twist=Twist(0.3, 0.0)), 0.3, 0.0)
    assert on > 0.1
    assert distance_on_way((1.2, -1.0, 0.0, 0.4), 0.3, 0.0, twist=Twist(0.3, 0.0)) < 0.05


def test_the_best_duration_of_a_turn_on_the_spot_counts() -> None:
    # an oncoming obstacle: driving off to the side keeps farther away than driving back past it
    predicted = conflicts(track(1.6, 0.0, -0.4, 0.0))
    slow, fast = (closest(predicted, 0.0, w)[0] for w in (0.48, 1.2))
    assert fast > 0.1
    # a slow turn does not leave the obstacle's way in time, but is better than standing in it
    assert closest(predicted, 0.0, 0.0)[0] < slow < fast


def distance_on_way(
    moving: tuple[float, ...],
    v: float,
    w: float,
    turn_time: float = CERTAIN.turn_time,
    *,
    twist: Twist = STANDING,
    v_turning: float | None = None,
    dt: float = 0.005,
) -> float:
    """Distance [m] at closest approach of a robot that drives ``twist``, and is to drive (v, w).

    It turns by ``w`` for ``turn_time`` [s], then drives straight on, within the limits of the
    drive, integrated in steps of ``dt`` [s]; while it turns its speed is ``v_turning``, or ``v``.
    ``moving`` is x, y, vx, vy of the obstacle.
    """
    least, x, y, yaw = math.inf, 0.0, 0.0, 0.0
    speed, rate = twist.v, twist.w
    for step in range(round(CERTAIN.horizon / dt)):
        t = step * dt
        off = moving[0] + moving[2] * t - x, moving[1] + moving[3] * t - y
        least = min(least, math.hypot(*off) - TOUCH)
        turning = t < turn_time
        wanted = v_turning if turning and v_turning is not None else v
        limit = ROBOT.max_accel if abs(wanted) > abs(speed) else ROBOT.max_brake
        speed += min(max(wanted - speed, -limit * dt), limit * dt)
        spin = ROBOT.max_turn_accel * dt
        rate += min(max((w if turning else 0.0) - rate, -spin), spin)
        yaw += rate * dt
        x, y = x + speed * dt * math.cos(yaw), y + speed * dt * math.sin(yaw)
    return least


@pytest.mark.parametrize(
    ("best", "w", "moving"),
    [
        (1.0, 1.08, (-0.40, -1.74, 0.22, 0.30)),
        (1.5, 1.08, (-0.23, -1.88, 0.17, 0.43)),
        (2.0, 1.20, (1.63, -1.46, -0.19, 0.39)),
    ],
)
def test_turns_on_the_spot_of_each_duration_are_tried(
    best: float, w: float, moving: tuple[float, float, float, float]
) -> None:
    # driving off sooner or later than after ``best`` seconds leads nearer to the obstacle
    durations = (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.2, 2.5)
    way = partial(distance_on_way, moving, CERTAIN.onward_speed, w, v_turning=0.0, dt=0.002)
    *_, second, expected = sorted(map(way, durations))
    assert expected == way(best)
    assert second < expected - 0.05
    distance, _ = closest(conflicts(track(*moving)), 0.0, w)
    assert distance == pytest.approx(expected, abs=0.025)


# --- properties -----------------------------------------------------------------------------------


def scattered(rng: np.random.Generator, count: int) -> list[Track]:
    """Tracks within 2 m of the origin, with speeds up to 0.7 m/s per axis."""
    return [
        track(*rng.uniform((-2.0, -2.0, -0.5, -0.5), (2.0, 2.0, 0.5, 0.5)).tolist())
        for _ in range(count)
    ]


@pytest.mark.parametrize("frame", [Pose(2.0, -1.0, 0.0), Pose(-0.3, 0.8, 2.5)])
@pytest.mark.parametrize("twist", [STANDING, Twist(0.4, -0.5)])
def test_the_prediction_is_the_same_wherever_odoms_origin_is(frame: Pose, twist: Twist) -> None:
    here = scattered(np.random.default_rng(1), 3)
    there = []
    for one in here:
        x, y, vx, vy = one.state.tolist()
        ahead = Pose(0.0, 0.0, frame.yaw).to_parent(vx, vy)
        there.append(track(*frame.to_parent(x, y), *ahead))
    expected = conflicts(*here, twist=twist)
    found = conflicts(*there, twist=twist, pose=frame)
    np.testing.assert_allclose(found.distance, expected.distance, atol=1e-9)
    np.testing.assert_allclose(found.approach, expected.approach, atol=1e-9)
    assert found.nearest == pytest.approx(expected.nearest)
    # a time may fall on the next step by rounding
    assert np.mean(np.abs(found.time - expected.time) > 1e-9) < 0.02


def test_of_several_obstacles_the_closest_counts() -> None:
    two = scattered(np.random.default_rng(2), 2)
    moving = COMMANDS.v != 0.0  # of the turns on the spot the best one counts: other durations
    both, *each = conflicts(*two), conflicts(two[0]), conflicts(two[1])
    least = np.minimum(each[0].distance, each[1].distance)
    np.testing.assert_allclose(both.distance[moving], least[moving])
    np.testing.assert_allclose(both.approach, np.maximum(each[0].approach, each[1].approach))
    assert both.nearest == min(each[0].nearest, each[1].nearest)


@pytest.mark.parametrize("seed", range(4))
def test_the_way_of_a_command_is_that_of_its_drive(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (obstacle,) = scattered(rng, 1)
    twist = Twist(rng.uniform(-0.1, 0.5), rng.uniform(-1.0, 1.0))
    predicted = conflicts(obstacle, twist=twist)
    compared = 0
    for v, w in itertools.product(COMMANDS.v[::2].tolist(), COMMANDS.w[::2].tolist()):
        if v == 0.0 and w != 0.0:
            continue
        moving = tuple(obstacle.state.tolist())
        drives_on = distance_on_way(moving, v, w, twist=twist)
        stops = distance_on_way(moving, 0.0, w, twist=twist, v_turning=v)
        expected = max(drives_on, stops)
        assert closest(predicted, v, w)[0] == pytest.approx(expected, abs=0.08)
        compared += 1
    assert compared > 20


def test_contact_is_at_the_time_of_the_first_touch() -> None:
    # numbers whose sums are exact: a distance is zero, not nearly so
    robot = RobotModel(radius=0.25)
    index = COMMANDS.nearest(STANDING)
    for x, vx, time in (
        (0.5, -0.25, 0.0),  # touches, and comes closer
        (0.4, -0.1, 0.0),  # overlaps from the start
        (0.5, 0.25, 0.0),  # goes away: never closer than now
        (1.0, 0.0, 0.0),  # stands: as close at once as later
        (1.0, -0.25, 2.0),
    ):
        predicted = conflicts(track(x, 0, vx, 0), robot=robot)
        assert predicted.time[index] == pytest.approx(time, abs=1e-9), (x, vx)


def test_distances_shrink_with_time_by_the_uncertainty() -> None:
    standing = track(2.0, 0.0, 0.0, 0.0)
    for uncertainty in (0.0, 0.05, 0.2):
        params = ConflictParams(uncertainty=uncertainty, horizon=4.0)
        distance, _ = closest(conflicts(standing, params=params), 0.0, 0.0)
        assert distance == pytest.approx(2.0 - TOUCH - 4.0 * uncertainty, abs=1e-9)
