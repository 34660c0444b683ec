"""Conflict prediction: closest approach to moving obstacles, for every command.

A static obstacle bars an arc at any time; a moving obstacle only for a while. So the robot on each
command and all tracks at constant velocity are moved on together, step by step, and the distance
and time at closest approach are kept. Paths that pass behind a moving obstacle, or wait for it,
come out as free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba
import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.movers.tracking import Track, TrackerParams
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Conflicts, Odometry

_STEP = 0.1  # chosen
"""Time step of the prediction [s]."""
_TURN_DURATIONS = 1.0, 1.5, 2.0  # chosen
"""Candidate durations of a turn on the spot before driving off [s]; the best of them counts."""
_CLOSE = 0.4  # chosen
"""Distance [m] below which a moving obstacle counts as close by: reachable within _MOMENT."""
_MOMENT = 0.5  # chosen
"""Time over which the approach to close obstacles is taken [s]."""
_GROWTH = 0.2  # chosen
"""Growth of the radius of an obstacle that is not detected again [m/s]: it may have turned."""


class ConflictParams(StrictModel):
    """How far ahead the motion of robot and moving obstacles is predicted."""

    horizon: float = Field(6.0, gt=0.0, le=10.0, description="prediction horizon [s]")
    turn_time: float = Field(
        1.0, ge=0.0, le=10.0, description="duration of a turn while driving [s]"
    )
    onward_speed: float = Field(
        0.35, ge=0.0, le=2.0, description="speed after a turn on the spot [m/s]"
    )
    uncertainty: float = Field(
        0.06, ge=0.0, le=1.0, description="growth of the uncertainty of distances [m/s]"
    )


class MoverParams(StrictModel):
    """Whether moving objects are detected, and how they are tracked and predicted."""

    detect: bool = Field(False, description="detect moving objects")
    tracking: TrackerParams = TrackerParams()
    conflicts: ConflictParams = ConflictParams()


class ConflictPredictor:
    """Predicts how near each command would bring a robot to moving obstacles."""

    def __init__(self, robot: RobotModel, params: ConflictParams | None = None) -> None:
        p = self.params = params or ConflictParams()
        self._radius = robot.reach
        self._limits = np.array([robot.max_accel, robot.max_brake, robot.max_turn_accel])
        self._ahead = np.array([p.horizon, p.turn_time, p.uncertainty, p.onward_speed])

    def predict(
        self, tracks: Sequence[Track], odometry: Odometry, speeds: Array, turns: Array
    ) -> Conflicts | None:
        """Predict the closest approach of every command to ``tracks``; None without tracks.

        Commands are all pairs of ``speeds`` (n_v,) [m/s] and ``turns`` (n_w,) [rad/s]; the robot
        starts with pose, twist and time of ``odometry``, the tracks keep their velocity.
        """
        if not tracks:
            return None
        pose, twist, time = odometry.pose, odometry.twist, odometry.time
        moving = np.array(
            [[*track.predict(time), *track.velocity, track.radius] for track in tracks]
        )
        moving[:, 4] += _GROWTH * (time - np.array([track.time for track in tracks]))
        distance, when, approach = np.empty((3, speeds.size, turns.size))
        _predict(
            moving,
            speeds,
            turns,
            np.array([pose.x, pose.y, pose.yaw, twist.v, twist.w]),
            self._limits,
            self._radius,
            self._ahead,
            distance,
            when,
            approach,
        )
        away = np.hypot(moving[:, 0] - pose.x, moving[:, 1] - pose.y) - moving[:, 4] - self._radius
        return Conflicts(distance, when, approach, float(away.min()))


@numba.njit(cache=True)
def _predict(
    moving: Array,
    speeds: Array,
    turns: Array,
    state: Array,
    limits: Array,
    radius: float,
    ahead: Array,
    distance: Array,
    when: Array,
    approach: Array,
) -> None:
    """Fill ``distance``, ``when`` and ``approach`` for all commands (``speeds`` x ``turns``).

    ``moving`` (k, 5) is x, y, vx, vy, radius of each track, ``state`` (x, y, yaw, v, w) of the
    robot, ``limits`` its accelerations, ``ahead`` the parameters.
    """
    horizon, turn_time, uncertainty, onward_speed = ahead
    steps = int(horizon / _STEP)
    ways = _ways(speeds, state[3], limits[0], limits[1], math.inf, 0.0, steps)
    stopping = _ways(speeds, state[3], limits[0], limits[1], turn_time, 0.0, steps)
    headings = _headings(turns, state[2], state[4], limits[2], turn_time, steps)
    for i in range(speeds.size):
        for j in range(turns.size):
            approach[i, j] = _approach(moving, state[:2], ways[i], headings[j], radius)
            distance[i, j], when[i, j] = -math.inf, 0.0
            if speeds[i] == 0.0 and turns[j] != 0.0:
                continue  # the best of the turns below replaces it
            # a command is only a beginning: the robot may stop after it
            for way in (ways[i], stopping[i]):
                least, at = _follow(moving, state[:2], way, headings[j], radius, uncertainty)
                if least > distance[i, j]:
                    distance[i, j], when[i, j] = least, at
    # a turn on the spot makes room only if the robot then drives off
    for duration in _TURN_DURATIONS:
        leaving = _ways(np.zeros(1), state[3], limits[0], limits[1], duration, onward_speed, steps)
        headings = _headings(turns, state[2], state[4], limits[2], duration, steps)
        for i in range(speeds.size):
            for j in range(turns.size):
                if speeds[i] != 0.0 or turns[j] == 0.0:
                    continue
                least, at = _follow(moving, state[:2], leaving[0], headings[j], radius, uncertainty)
                if least > distance[i, j]:
                    distance[i, j], when[i, j] = least, at


@numba.njit(cache=True)
def _follow(
    moving: Array, start: Array, way: Array, heading: Array, radius: float, uncertainty: float
) -> tuple[float, float]:
    """Return distance [m] and time [s] at closest approach on one path; of a contact, its time."""
    x, y = start
    least, when = math.inf, 0.0
    for k in range(way.size):
        t = k * _STEP
        for m in range(moving.shape[0]):
            dx = moving[m, 0] + moving[m, 2] * t - x
            dy = moving[m, 1] + moving[m, 3] * t - y
            away = math.sqrt(dx * dx + dy * dy) - moving[m, 4] - radius - uncertainty * t
            if away < least:
                when = t if least > 0.0 else when
                least = away
        x += way[k] * heading[k, 0]
        y += way[k] * heading[k, 1]
    return least, when


@numba.njit(cache=True)
def _approach(moving: Array, start: Array, way: Array, heading: Array, radius: float) -> float:
    """Return the largest approach [m] by the robot to a close moving obstacle within _MOMENT."""
    x, y = start
    for k in range(int(_MOMENT / _STEP)):
        x += way[k] * heading[k, 0]
        y += way[k] * heading[k, 1]
    most = 0.0
    for m in range(moving.shape[0]):
        before = math.hypot(moving[m, 0] - start[0], moving[m, 1] - start[1])
        if before - moving[m, 4] - radius < _CLOSE:
            later_x = moving[m, 0] + moving[m, 2] * _MOMENT
            later_y = moving[m, 1] + moving[m, 3] * _MOMENT
            standing = math.hypot(later_x - start[0], later_y - start[1])
            most = max(most, min(before, standing) - math.hypot(later_x - x, later_y - y))
    return most


@numba.njit(cache=True)
def _ways(
    speeds: Array,
    v: float,
    accel: float,
    brake: float,
    turn_time: float,
    onward_speed: float,
    steps: int,
) -> Array:
    """Compute the length [m] of each step (n_v, steps + 1), speeding from ``v`` to ``speeds``.

    After ``turn_time`` [s] each speed becomes ``onward_speed`` [m/s].
    """
    ways = np.empty((speeds.size, steps + 1))
    for i in range(speeds.size):
        now = v
        for k in range(steps + 1):
            wanted = onward_speed if k * _STEP >= turn_time else speeds[i]
            change = accel if abs(wanted) > abs(now) else brake
            now += min(max(wanted - now, -change * _STEP), change * _STEP)
            ways[i, k] = now * _STEP
    return ways


@numba.njit(cache=True)
def _headings(
    turns: Array, yaw: float, w: float, turn_accel: float, turn_time: float, steps: int
) -> Array:
    """Compute unit directions (n_w, steps + 1, 2) of all steps; turns last ``turn_time`` [s]."""
    headings = np.empty((turns.size, steps + 1, 2))
    for j in range(turns.size):
        direction, now = yaw, w
        for k in range(steps + 1):
            wanted = turns[j] if k * _STEP < turn_time else 0.0
            now += min(max(wanted - now, -turn_accel * _STEP), turn_accel * _STEP)
            direction += 0.5 * now * _STEP
            headings[j, k, 0], headings[j, k, 1] = math.cos(direction), math.sin(direction)
            direction += 0.5 * now * _STEP
    return headings
