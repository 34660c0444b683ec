"""Conflicts: how near every command brings movers, followed through the next seconds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfw.mofis.command_grid import CommandGrid
from navfw.movers.conflict_prediction import ConflictParams, Conflicts, predict_conflicts
from navfw.movers.tracking import Track
from navfw.robot import RobotModel
from navfw.signals import Pose, Twist

ROBOT = RobotModel()
COMMANDS = CommandGrid(ROBOT)
SURE = ConflictParams(doubt=0.0)
STANDING = Twist(0.0, 0.0)


def walker(x: float, y: float, vx: float, vy: float) -> Track:
    return Track(np.array([x, y, vx, vy]), 0.01 * np.eye(4), 0.25, 0.0, 5)


def encounters(
    *tracks: Track, twist: Twist = STANDING, time: float = 0.0, params: ConflictParams = SURE
) -> Conflicts:
    met = predict_conflicts(tracks, ROBOT, COMMANDS, Pose(0, 0, 0), twist, time, params)
    assert met is not None
    return met


def at(met: Conflicts, v: float, w: float) -> tuple[float, float]:
    index = COMMANDS.nearest(Twist(v, w))
    return float(met.gap[index]), float(met.after[index])


def test_without_movers_there_is_none() -> None:
    assert predict_conflicts((), ROBOT, COMMANDS, Pose(0, 0, 0), STANDING, 0.0, SURE) is None


def test_a_robot_that_stands_is_met_when_geometry_says() -> None:
    met = encounters(walker(1.2, 0.2, -0.5, 0.0))
    gap, after = at(met, 0.0, 0.0)
    assert gap == pytest.approx(0.2 - 0.43, abs=0.02)
    touch = (1.2 - math.sqrt(0.43**2 - 0.2**2)) / 0.5
    assert after == pytest.approx(touch, abs=0.11)
    assert met.nearest == pytest.approx(math.hypot(1.2, 0.2) - 0.43)
    # half a second later it is that much nearer
    assert at(encounters(walker(1.2, 0.2, -0.5, 0.0), time=0.5), 0.0, 0.0)[1] == pytest.approx(
        touch - 0.5, abs=0.11
    )


def test_waiting_lets_pass_who_crosses_and_driving_on_does_not() -> None:
    # would be straight ahead when the robot is there
    met = encounters(walker(0.9, -0.9, 0.0, 0.45), twist=Twist(0.45, 0.0))
    assert at(met, 0.5, 0.0)[0] < 0.0
    assert at(met, 0.0, 0.0)[0] > 0.15
    assert at(met, -0.15, 0.0)[0] > at(met, 0.0, 0.0)[0]


def test_turning_aside_clears_who_comes_straight_on() -> None:
    met = encounters(walker(1.8, 0.0, -0.4, 0.0), twist=Twist(0.4, 0.0))
    straight, left, right = (at(met, 0.4, w)[0] for w in (0.0, 1.2, -1.2))
    assert straight < 0.0
    assert min(left, right) > 0.1
    assert left == pytest.approx(right, abs=1e-6)


def test_brakes_and_engine_take_their_time() -> None:
    met = encounters(walker(0.85, 0.0, 0.0, 0.0), twist=Twist(0.5, 0.0))
    # 0.5 m/s at 1.2 m/s^2: a tenth of a metre until it stands
    assert at(met, 0.0, 0.0)[0] == pytest.approx(0.85 - 0.43 - 0.104, abs=0.03)


def test_what_comes_later_is_less_sure() -> None:
    track = walker(2.0, 0.8, -0.5, 0.0)
    sure, doubtful = encounters(track), encounters(track, params=ConflictParams(doubt=0.1))
    assert (doubtful.gap <= sure.gap + 1e-12).all()
    assert at(doubtful, 0.0, 0.0)[0] < at(sure, 0.0, 0.0)[0] - 0.1


def test_turning_on_the_spot_is_the_beginning_of_driving_off_that_way() -> None:
    track = walker(1.6, 0.0, -0.45, 0.0)
    met = encounters(track)
    staying = encounters(track, params=ConflictParams(doubt=0.0, onward=0.0))
    assert at(met, 0.0, 1.2)[0] > at(staying, 0.0, 1.2)[0] + 0.2
    assert at(met, 0.0, 0.0) == at(staying, 0.0, 0.0)


def test_closing_is_how_much_nearer_one_drives_to_who_is_at_hand() -> None:
    # stands 0.2 m before the rim; a robot at 0.3 m/s goes on so for half a second
    met = encounters(walker(0.63, 0.0, 0.0, 0.0), twist=Twist(0.3, 0.0))
    ahead = met.closing[COMMANDS.nearest(Twist(0.3, 0.0))]
    assert ahead == pytest.approx(0.15, abs=0.02)
    away = met.closing[COMMANDS.nearest(Twist(-0.15, 0.0))]
    assert away < ahead
    standing = encounters(walker(0.63, 0.0, 0.0, 0.0))
    assert standing.closing[COMMANDS.v <= 0.0].max() == 0.0
    # half a metre off nobody is at hand
    assert encounters(walker(1.0, 0.0, -0.5, 0.0), twist=Twist(0.3, 0.0)).closing.max() == 0.0


def test_turns_on_the_spot_last_as_long_as_suits() -> None:
    # straight on at a robot that faces him: off to the side is farther than back past him
    met = encounters(walker(1.6, 0.0, -0.4, 0.0))
    slow, fast = (at(met, 0.0, w)[0] for w in (0.48, 1.2))
    assert fast > 0.1
    # too slow a turn does not lead off his way in time, but farther than standing in it
    assert at(met, 0.0, 0.0)[0] < slow < fast
