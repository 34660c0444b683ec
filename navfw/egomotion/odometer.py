"""Dead reckoning: way from the wheels, heading from the gyro, gyro bias from standing still."""

from __future__ import annotations

import math
from dataclasses import replace

from navfw.egomotion.encoder_fault import EncoderFaultDetector
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Encoders, Inertial, Odometry, Pose, Twist, wrap_angle

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
#: A gyro's word older than this [s] says nothing of the present.
STALE = 0.1
#: Time constant over which what the flow says of the gyro is averaged [s].
DOUBT_MEMORY = 1.5
#: Turning rates [rad/s] that differ less than this do not tell a bias from a factor.
TELLING = 0.02
#: A mean contradiction of the flow larger than this [rad/s] is no chance: the bias has changed.
CONTRADICTION = 0.003
#: Once doubted, the bias is corrected until the mean contradiction is below this [rad/s].
SETTLED = 0.0005
#: Turn by way [rad/m] that wheels may seem to make when they roll straight on: 2 % unequal radii.
LARGEST_SKEW = 0.08
#: What the wheels' rotation may be off by [rad/m], through slip and unequal radii.
WHEELS_YAW_SIGMA = 0.1
#: Baselines shorter than this [m] are taken for as long, lest a small turn weigh much.
LEAST_WAY = 0.04
#: Share of the mean contradiction by which the bias is corrected at every pair of frames.
CORRECTION = 0.1


class Odometer:
    """Integrates wheel encoders and yaw gyro at control rate (midpoint rule).

    The pose starts at the origin of ``odom``. The gyro's bias is the running mean of its readings
    while the wheels rest; a robot that has not turned a wheel since it was switched on rests from
    the first reading. While it rests its heading is held. A gyro reading is taken as the mean rate
    since the last one (rate gyros filter and sum over their sampling time); one that is not finite
    or stale is replaced by what the wheels say of the turn. A wheel whose encoder is silent is
    replaced by what the other and the gyro say; without these, by what it was told, and the
    odometry says so. A gyro that the flow contradicts for long has another bias (``contradict``).
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._wheels = EncoderFaultDetector(robot)
        self._way_per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next reading is taken at the origin."""
        self._wheels.reset()
        self._last: tuple[Encoders, float] | None = None
        self._silent = False
        self._stale = False
        self._contradiction = _Contradiction()
        self._doubted = False
        self._skew = 0.0
        self._pose = Pose(0.0, 0.0, 0.0)
        self._speed = 0.0
        self._bias = 0.0
        self._bias_time = 0.0
        self._rest_ticks = (0, 0)
        self._rest_since = -math.inf

    def update(
        self, inertial: Inertial, encoders: Encoders, asked: Twist | None = None
    ) -> Odometry:
        """Advance by one more reading of gyro and encoders, both taken at the same time.

        ``asked`` is the twist that the drive was told meanwhile, where that is known.
        """
        asked = Twist(0.0, 0.0) if asked is None else asked
        self._wheels.update(encoders, asked)
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
        rate = inertial.yaw_rate
        self._stale = not math.isfinite(rate) or encoders.time - inertial.time > STALE
        left, right = self._ways(previous, encoders, dt, rate, asked)
        if self._stale:
            # wheels of unequal size turn a robot in proportion to the way
            turn = (right - left) / self._robot.track + self._skew * 0.5 * (left + right)
            rate = turn / dt + self._bias
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

    def trusted(self, motion: CameraMotion) -> CameraMotion:
        """``motion`` with the doubt that is due while wheels stand in for a stale gyro."""
        if not self._stale:
            return motion
        sigma = max(motion.yaw_sigma, WHEELS_YAW_SIGMA * motion.baseline)
        return replace(motion, yaw_sigma=sigma)

    def contradict(self, turn: float, motion: CameraMotion) -> None:
        """The flow says that the robot turned by ``turn`` [rad] more than ``motion`` says.

        A lasting contradiction is a bias that has changed since the robot last stood still. One in
        proportion to the turning is not: it is a camera that is not what it is believed to be.
        While the gyro is stale, the contradiction is the wheels'.
        """
        if motion.dt <= 0.0:
            return
        if self._stale:
            skew = self._skew + CORRECTION * turn / max(motion.baseline, LEAST_WAY)
            self._skew = min(max(skew, -LARGEST_SKEW), LARGEST_SKEW)
            return
        r = motion.rotation
        # y points down in camera axes: counter-clockwise from above is negative about it
        rate = 0.5 * (r[0, 2] - r[2, 0]) / motion.dt
        off = self._contradiction.hear(turn / motion.dt, rate, motion.dt)
        self._doubted = abs(off) > CONTRADICTION or (self._doubted and abs(off) > SETTLED)
        if self._doubted:
            self._bias -= CORRECTION * off

    def _ways(
        self, before: Encoders, now: Encoders, dt: float, rate: float, asked: Twist
    ) -> tuple[float, float]:
        """How far the wheels (left, right) have rolled [m], as far as anything tells."""
        left = (now.left - before.left) * self._way_per_tick
        right = (now.right - before.right) * self._way_per_tick
        silent = self._wheels.silent
        self._silent = all(silent) or (any(silent) and self._stale)
        if self._silent:
            radius = self._robot.wheel_radius
            told = [speed * radius * dt for speed in self._robot.wheel_speeds(asked)]
            return (told[0] if silent[0] else left), (told[1] if silent[1] else right)
        apart = 0.0 if self._stale else self._robot.track * (rate - self._bias) * dt
        if silent[0]:
            left = right - apart
        elif silent[1]:
            right = left + apart
        return left, right

    def _odometry(self, time: float, yaw_rate: float) -> Odometry:
        still = self._resting(time)
        speed = 0.0 if still else self._speed
        turning = 0.0 if still and abs(yaw_rate) <= LARGEST_BIAS else yaw_rate
        return Odometry(time, self._pose, Twist(speed, turning), self._bias, still, self._silent)

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
        return time - self._rest_since >= REST and not self._wheels.doubtful

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


class _Contradiction:
    """A fading regression of the flow's contradiction on the turning rate: bias and factor."""

    def __init__(self) -> None:
        self._off = self._rate = self._both = self._square = 0.0

    def hear(self, off: float, rate: float, dt: float) -> float:
        """Take note of a contradiction ``off`` [rad/s]; the part that no turning explains."""
        share = -math.expm1(-dt / DOUBT_MEMORY)
        self._off += share * (off - self._off)
        self._rate += share * (rate - self._rate)
        self._both += share * (off * rate - self._both)
        self._square += share * (rate * rate - self._square)
        spread = self._square - self._rate**2 + TELLING**2
        return self._off - (self._both - self._off * self._rate) / spread * self._rate
