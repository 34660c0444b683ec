"""The safety monitor: it never adds speed, and stops where room or the drive ends."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from localmap_samples import CART, grid_with
from safety_samples import ORIGIN, ROBOT, monitor_with

from navfw.localmap import LocalMap
from navfw.safety import SafetyMonitor
from navfw.signals import Odometry, Pose, Twist

ANY = st.floats(allow_nan=True, allow_infinity=True)
MONITOR = monitor_with()


@given(ANY, ANY)
def test_every_twist_is_within_the_limits_of_the_drive(v: float, w: float) -> None:
    twist = MONITOR.limit(Twist(v, w), 0.0, ORIGIN).twist
    assert -ROBOT.max_reverse <= twist.v <= ROBOT.max_v
    assert abs(twist.w) <= ROBOT.max_w
    assert math.isfinite(twist.v) and math.isfinite(twist.w)


def test_reversing_ends_where_the_free_distance_behind_ends() -> None:
    back, gap = Twist(-0.1, 0.4), monitor_with().params.gap
    rim = ROBOT.radius + gap
    for free in ((gap + 0.02, 10.0), (10.0, rim + 0.02)):
        assert monitor_with(*free).limit(back, 0.0, ORIGIN).twist == back
    for near in ((gap + 0.005, 10.0), (10.0, rim + 0.005)):
        v = monitor_with(*near).limit(back, 0.0, ORIGIN).twist.v
        distance = -v * monitor_with().params.latency + v**2 / (2.0 * ROBOT.max_brake)
        assert distance == pytest.approx(0.005)
    for blocked in ((gap, 10.0), (10.0, rim)):  # an obstacle; unobserved floor
        verdict = monitor_with(*blocked).limit(back, 0.0, ORIGIN)
        assert verdict.twist == Twist(0.0, 0.4)
        assert verdict.reason == "no observed free space behind"
        assert not verdict.stopped, "only a forward speed counts as stopped"


def test_unobserved_space_is_entered_slowly() -> None:
    monitor = monitor_with(2.0, 0.03)
    verdict = monitor.limit(Twist(0.4, 0.0), 0.0, ORIGIN)
    assert verdict.twist.v == monitor.params.creep
    assert "unobserved" in verdict.reason


# --- without a local map --------------------------------------------------------------------------


def observed_floor() -> LocalMap:
    """A local map around the origin whose floor is all observed free."""
    local_map = LocalMap(ROBOT)
    local_map.update(Odometry(0.0, ORIGIN, Twist(0.0, 0.0), 0.0, still=True), (), None, ORIGIN)
    local_map.occupancy.log_odds[:] = -1.0
    return local_map


FLOOR = observed_floor()


@given(v=st.floats(-0.15, 0.5), w=st.floats(-1.6, 1.6))
def test_without_a_local_map_the_robot_turns_at_most(v: float, w: float) -> None:
    never_updated, reset = LocalMap(ROBOT), observed_floor()
    reset.reset()
    half = 0.5 * reset.params.occupancy.extent
    outside = (Pose(half + 0.1, 0.0, 0.0), Pose(0.0, -half - 0.1, 3.0))
    cases = [(never_updated, ORIGIN), (reset, ORIGIN), *((FLOOR, pose) for pose in outside)]
    for local_map, pose in cases:
        assert local_map.free_distance(pose, Twist(v, w)) == (0.0, 0.0)
        verdict = SafetyMonitor(ROBOT, local_map).limit(Twist(v, w), 0.0, pose)
        assert verdict.twist == Twist(0.0, w)
        assert verdict.stopped == (v > 0.0)
        assert bool(verdict.reason) == (v != 0.0)


def test_over_observed_floor_the_robot_drives_both_ways() -> None:
    for v in (0.4, -0.1):
        assert SafetyMonitor(ROBOT, FLOOR).limit(Twist(v, 0.0), 0.0, ORIGIN).twist.v == v


def test_a_turn_is_slowed_to_what_the_room_allows() -> None:
    local_map = LocalMap(CART)
    local_map.occupancy = grid_with((-1.0, 1.5, 0.22, 0.4), robot=CART)
    monitor = SafetyMonitor(CART, local_map)
    verdict = monitor.limit(Twist(0.0, 1.0), 0.0, ORIGIN)
    assert verdict.reason == "no room to turn"
    fastest = verdict.twist.w
    room = local_map.free_turn(ORIGIN, 1.0) - monitor.params.gap / CART.reach
    stopping = fastest * monitor.params.latency + fastest**2 / (2.0 * CART.max_turn_accel)
    assert 0.0 < fastest < 1.0
    assert stopping == pytest.approx(room)
    assert monitor.limit(Twist(0.0, -1.0), 0.1, ORIGIN).twist.w == -1.0


# --- thresholds -----------------------------------------------------------------------------------


@given(st.floats(0.0, 0.6), st.floats(0.0, ROBOT.max_v))
def test_full_braking_ends_the_gap_before_the_obstacle(room: float, wanted: float) -> None:
    monitor = monitor_with(room)
    p = monitor.params
    verdict = monitor.limit(Twist(wanted, 0.5), 0.0, ORIGIN)
    v = verdict.twist.v
    distance = v * p.latency + v**2 / (2.0 * ROBOT.max_brake)
    assert distance <= max(room - p.gap, 0.0) + 1e-9
    if v != wanted:
        assert v < wanted
        assert distance == pytest.approx(max(room - p.gap, 0.0), abs=1e-9)
    assert verdict.reason == ("no room to stop" if v < wanted else "")
    assert verdict.stopped == (wanted > 0.0 and room <= p.gap)
    assert verdict.twist.w == 0.5


def test_braking_before_unobserved_space_is_as_hard_as_before_an_obstacle() -> None:
    ahead = Twist(ROBOT.max_v, 0.0)
    obstacle = monitor_with(0.15, 10.0).limit(ahead, 0.0, ORIGIN).twist.v
    unobserved = monitor_with(10.0, 0.15).limit(ahead, 0.0, ORIGIN)
    assert obstacle > monitor_with().params.creep
    assert unobserved.twist.v == obstacle
    assert unobserved.reason == "unobserved space ahead"


@pytest.mark.parametrize(
    ("wanted", "driven"),
    [
        (Twist(9.0, 0.0), Twist(ROBOT.max_v, 0.0)),
        (Twist(-9.0, 0.0), Twist(-ROBOT.max_reverse, 0.0)),
        (Twist(0.0, 9.0), Twist(0.0, ROBOT.max_w)),
        (Twist(0.0, -9.0), Twist(0.0, -ROBOT.max_w)),
        (Twist(math.nan, 0.0), None),
        (Twist(0.3, math.inf), None),
    ],
)
def test_commands_beyond_the_drive_are_clipped_and_those_that_are_not_finite_stop(
    wanted: Twist, driven: Twist | None
) -> None:
    verdict = monitor_with().limit(wanted, 0.0, ORIGIN)
    assert verdict.twist == (driven or Twist(0.0, 0.0))
    expected = "the command exceeds the drive's limits" if driven else "the command is not finite"
    assert (verdict.reason, verdict.stopped) == (expected, driven is None)
