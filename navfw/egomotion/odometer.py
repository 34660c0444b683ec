"""Dead reckoning: way from the wheels, heading from the gyro, gyro bias from standing still."""

from __future__ import annotations

import math

from navfw.robot import RobotModel
from navfw.signals import Encoders, Inertial, Odometry, Pose, Twist, wrap_angle

__all__ = ["Odometer"]

#: The wheels must have rested this long before the robot counts as still [s].
REST = 0.3
#: A resting wheel may flicker between two neighbouring encoder ticks.
FLICKER = 1
#: A still robot's gyro shows its bias; anything faster is somebody turning the robot [rad/s].
LARGEST_BIAS = 0.15
#: Standing still for longer than this says no more about a slowly drifting bias [s].
BIAS_MEMORY = 10.0
#: Time constant that smooths encoder steps out of the measured speed [s].
SPEED_SMOOTHING = 0.05


class Odometer:
    """Integrates wheel encoders and yaw gyro at control rate (midpoint rule).

    The pose starts at the origin of ``odom``. The gyro's bias is the running mean of its readings
    while the wheels rest; a robot that has not turned a wheel since it was switched on rests from
    the first reading. While it rests its heading is held. A gyro reading is taken as the mean rate
    since the last one (rate gyros filter and sum over their sampling time); one that is not finite
    is replaced by what the wheels say of the turn.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._way_per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next reading is taken at the origin."""
        self._last: tuple[Encoders, float] | None = None
        self._pose = Pose(0.0, 0.0, 0.0)
        self._speed = 0.0
        self._bias = 0.0
        self._bias_time = 0.0
        self._rest_ticks = (0, 0)
        self._rest_since = -math.inf

    def update(self, inertial: Inertial, encoders: Encoders) -> Odometry:
        """Advance by one more reading of gyro and encoders, both taken at the same time."""
        if self._last is None:
            self._rest_ticks = (encoders.left, encoders.right)
            rate = inertial.yaw_rate if math.isfinite(inertial.yaw_rate) else 0.0
            self._last = encoders, rate
            return Odometry(encoders.time, self._pose, Twist(0.0, 0.0), self._bias, still=True)
        previous, previous_rate = self._last
        dt = encoders.time - previous.time
        if dt <= 0.0:
            # the same reading once more: nothing moved meanwhile
            return self._odometry(encoders.time, previous_rate - self._bias)
        left = (encoders.left - previous.left) * self._way_per_tick
        right = (encoders.right - previous.right) * self._way_per_tick
        rate = inertial.yaw_rate
        if not math.isfinite(rate):
            rate = (right - left) / (self._robot.track * dt) + self._bias
        self._last = encoders, rate
        self._watch_rest(encoders)
        way = 0.5 * (left + right)
        self._speed += (way / dt - self._speed) * -math.expm1(-dt / SPEED_SMOOTHING)
        if self._resting(encoders.time) and abs(rate) <= LARGEST_BIAS:
            self._learn_bias(rate, dt)
            turn = 0.0
        else:
            turn = (rate - self._bias) * dt
        self._advance(way, turn)
        return self._odometry(encoders.time, rate - self._bias)

    def _odometry(self, time: float, yaw_rate: float) -> Odometry:
        still = self._resting(time)
        speed = 0.0 if still else self._speed
        turning = 0.0 if still and abs(yaw_rate) <= LARGEST_BIAS else yaw_rate
        return Odometry(time, self._pose, Twist(speed, turning), self._bias, still)

    def _advance(self, way: float, turn: float) -> None:
        """Move the pose along an arc of length ``way`` [m] that turns by ``turn`` [rad]."""
        pose = self._pose
        heading = pose.yaw + 0.5 * turn
        self._pose = Pose(
            pose.x + way * math.cos(heading),
            pose.y + way * math.sin(heading),
            wrap_angle(pose.yaw + turn),
        )

    def _resting(self, time: float) -> bool:
        return time - self._rest_since >= REST

    def _watch_rest(self, encoders: Encoders) -> None:
        moved = max(
            abs(encoders.left - self._rest_ticks[0]), abs(encoders.right - self._rest_ticks[1])
        )
        if moved > FLICKER:
            self._rest_ticks = (encoders.left, encoders.right)
            self._rest_since = encoders.time

    def _learn_bias(self, rate: float, dt: float) -> None:
        """Average over the time spent still, slowly forgetting because a bias drifts."""
        self._bias_time = min(self._bias_time + dt, BIAS_MEMORY)
        self._bias += (rate - self._bias) * min(1.0, dt / self._bias_time)
