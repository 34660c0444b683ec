"""Dead reckoning: distance from the wheels, heading from the gyro, whose bias is estimated.

A wheel encoder has failed where the drive is commanded to move and the count stands still.

The pitch of a body that rocks on its wheels' axle follows from the gyro's roll and pitch rates. The
axle keeps the roll near zero. The pitch rate gives changes of the pitch; in a turn the roll rate
shows the pitch itself, since the axis about which the body turns is then not its own z axis.
Between turns a pitch that lasts is forgotten, so that errors of the bias do not accumulate.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from operator import attrgetter

from navfw.robot import RobotModel
from navfw.signals import Encoders, Inertial, Odometry, Pose, Twist, YawCorrection, wrap_angle

_LEVEL_MEMORY = 15.0  # chosen
"""Time constant after which a pitch that lasts counts as level [s]."""

_BIAS_TIME = 30.0  # chosen
"""Time [s] that sets how fast it counts as bias of the pitch rate: by 1 / _BIAS_TIME^2."""

_TURN_GAIN = 2.0  # chosen
"""Rate [1/s] at which the pitch follows the roll rate in a turn, per squared rate of turning."""

_REST_MEMORY, _KNOWN_AFTER = 10.0, 2.0  # chosen
"""Time over which biases are averaged at rest, and after which they are known [s]."""

_MAX_REST_RATE = 0.02  # chosen
"""Largest rate [rad/s] beside the bias that is averaged: a body may rock on its wheels at rest."""

_SWING, _NOTICED = 2.0, math.radians(0.4)  # derived
"""Time [s] within which a body rocks, and the least change in it [rad] that counts as rocking:
0.5 px of a 160 px image, and more than the bias feigns."""

_KEPT = 30.0  # chosen
"""Time constant with which the amplitude of rocking is forgotten [s]."""

_MAX_PITCH = 0.2  # chosen
"""Bound of the pitch [rad]: a body that leans further has fallen, or the rates are wrong."""


class RockingFilter:
    """Estimates the pitch of a rocking body from the rates of the gyro.

    ``pitch`` [rad] is nose down, ``rocking`` [rad] the amplitude of the last half minute; both are
    0 for a body that does not rock.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Return to the initial state: level, biases unknown."""
        self.pitch = self.rocking = 0.0
        self._pitch = self._swing = 0.0
        self._biases = [0.0, 0.0]
        self._rested = 0.0
        self._amplitude = 0.0

    def update(self, inertial: Inertial, turning: float, dt: float, still: bool) -> None:
        """Integrate the mean rates of the last ``dt`` [s].

        ``turning`` [rad/s] is the yaw rate; ``still`` is true if the wheels rest. Rates that are
        not finite, of a gyro with one axis, leave the pitch as it is.
        """
        rates = (inertial.roll_rate, inertial.pitch_rate)
        if not all(map(math.isfinite, rates)):
            return
        if still:
            self._average(rates, dt)
        roll_rate, pitch_rate = rates[0] - self._biases[0], rates[1] - self._biases[1]
        shown = _TURN_GAIN * turning * turning
        follow = 1.0 / _LEVEL_MEMORY + shown
        pitch = self._pitch + pitch_rate * dt
        off = -_TURN_GAIN * roll_rate * turning / follow - pitch
        pitch += off * -math.expm1(-follow * dt)
        self._biases[1] -= off * dt / _BIAS_TIME**2
        self._pitch = min(max(pitch, -_MAX_PITCH), _MAX_PITCH)
        self._swing = (self._swing + pitch_rate * dt) * math.exp(-dt / _SWING)
        self._amplitude = max(self._amplitude * math.exp(-dt / _KEPT), abs(self._swing))
        rocks = self._amplitude > _NOTICED
        self.pitch, self.rocking = (self._pitch, self._amplitude) if rocks else (0.0, 0.0)

    def _average(self, rates: tuple[float, float], dt: float) -> None:
        """Average the biases at rest, from anew after a motion before they are known."""
        off = [rate - bias for rate, bias in zip(rates, self._biases, strict=True)]
        if self._rested == 0.0:
            self._biases = list(rates)
        elif max(map(abs, off)) < _MAX_REST_RATE:
            share = dt / (self._rested + dt)
            self._biases = [b + share * o for b, o in zip(self._biases, off, strict=True)]
        elif self._rested < _KNOWN_AFTER:
            self._rested = 0.0
            return
        self._rested = min(self._rested + dt, _REST_MEMORY)


#: Time [s] for which odometry is kept. An older frame is assigned the oldest entry.
_MEMORY = 3.0  # chosen


class OdometryHistory:
    """The odometry of the last 3 seconds, queried by time."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Delete all entries."""
        self._past: deque[Odometry] = deque()

    def add(self, odometry: Odometry) -> None:
        """Append the newest odometry and delete entries older than 3 s."""
        self._past.append(odometry)
        while odometry.time - self._past[0].time > _MEMORY:
            self._past.popleft()

    def at(self, time: float) -> Odometry:
        """Return the newest odometry not later than ``time`` [s]; the oldest one if all are later.

        Raises:
            IndexError: the history is empty.

        """
        index = bisect_right(self._past, time + 1e-9, key=attrgetter("time"))
        return self._past[max(index - 1, 0)]


#: Least commanded rim speed [m/s] that counts as evidence: friction may stop a slower wheel.
_MIN_SPEED = 0.03  # chosen
#: Commanded travel of the rim [m] without a tick after which an encoder counts as silent.
_SILENT = 0.03  # chosen


class EncoderFaultDetector:
    """Compares the commanded motion of each wheel with the ticks of its encoder.

    A count that does not change while the wheel is commanded to turn means a failed encoder or a
    blocked wheel; the gyro can distinguish the two. A single tick clears the fault.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Return to the initial state: no command and no reading yet."""
        self._unanswered = [0.0, 0.0]
        self._last: Encoders | None = None

    def update(self, encoders: Encoders, commanded: Twist) -> None:
        """Process a new reading; ``commanded`` is the twist executed since the previous one."""
        last, self._last = self._last, encoders
        if last is None:
            return
        dt = encoders.time - last.time
        counted = (encoders.left - last.left, encoders.right - last.right)
        for index, speed in enumerate(self._robot.wheel_speeds(commanded)):
            distance = abs(speed) * self._robot.wheel_radius
            if counted[index] != 0:
                self._unanswered[index] = 0.0
            elif distance >= _MIN_SPEED and math.isfinite(distance):
                self._unanswered[index] += distance * dt

    @property
    def silent(self) -> tuple[bool, bool]:
        """Whether the encoders (left, right) have failed to count a commanded motion."""
        left, right = self._unanswered
        return left >= _SILENT, right >= _SILENT


#: Time for which the wheels must have rested before the robot counts as still [s].
_REST = 0.3  # chosen
#: Change of an encoder at rest [ticks]: it may flicker between two neighbouring ticks.
_FLICKER = 1  # chosen
#: Time [s] for which a reading at rest waits to be averaged if no commands are known: a turn begins
#: before an encoder counts, and a reading of it would spoil the bias of the whole drive.
_UNCERTAIN = 0.2  # chosen
#: Largest bias of the gyro [rad/s]; a higher rate at rest is an external turn of the robot.
_MAX_BIAS = 0.15  # chosen
#: Time over which the bias is averaged at rest [s]; it drifts, so a longer mean is no better.
_BIAS_MEMORY = 10.0  # chosen
#: Time constant that smooths encoder steps out of the measured speed [s].
_SPEED_SMOOTHING = 0.05  # chosen
#: Age of a gyro reading from which it is stale [s].
_STALE = 0.1  # chosen
#: Time constant of the mean gyro residual [s].
_RESIDUAL_MEMORY = 1.5  # chosen
#: Spread of turning rates [rad/s] below which bias and scale error cannot be distinguished.
_RATE_FLOOR = 0.02  # chosen
#: Mean gyro residual [rad/s] from which it is significant: the bias has changed.
_SIGNIFICANT = 0.003  # chosen
#: Mean gyro residual [rad/s] down to which the bias is then corrected.
_SETTLED = 0.0005  # chosen
#: Largest turn per distance [rad/m] of wheels that seem to roll straight: 2 % unequal radii.
_MAX_SKEW = 0.08  # chosen
#: Smallest divisor [m] of a correction of the skew.
_MIN_DISTANCE = 0.04  # chosen
#: Share of the mean gyro residual that corrects the bias at every pair of frames.
_GAIN = 0.1  # chosen


class Odometer:
    """Integrates wheel encoders and yaw gyro at control rate (midpoint rule).

    The pose starts at the origin of ``odom``. The gyro's bias is the running mean of its readings
    while the wheels rest and no motion is commanded, from the first reading on; the heading is held
    meanwhile. A gyro reading is taken as the mean rate since the last one (rate gyros filter and
    sum over their sampling time); if it is not finite or stale, the turn of the wheels replaces it.
    If a wheel's encoder is silent, the other wheel and the gyro replace it; without these, the
    commanded speed, and the odometry is marked ``silent``.
    Yaw corrections by the flow (``correct``) follow a bias that changes during the drive.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._wheels = EncoderFaultDetector(robot)
        self._way_per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
        self._rocking = RockingFilter()
        self.reset()

    def reset(self) -> None:
        """Return to the start: the next reading is taken at the origin."""
        self._wheels.reset()
        self._rocking.reset()
        self._last: tuple[Encoders, float] | None = None
        self._silent = False
        self._stale = False
        self._residual = _GyroResidual()
        self._correcting = False
        self._skew = 0.0
        self._pose = Pose(0.0, 0.0, 0.0)
        self._speed = 0.0
        self._bias = 0.0
        self._bias_time = 0.0
        self._at_rest: deque[tuple[float, float]] = deque()
        self._rest_ticks = (0, 0)
        self._rest_since = -math.inf

    def update(
        self, inertial: Inertial, encoders: Encoders, commanded: Twist | None = None
    ) -> Odometry:
        """Integrate a reading of gyro and encoders, taken at the same time; return the odometry.

        ``commanded`` is the twist given to the drive since the last reading, if it is known.
        """
        wait = _UNCERTAIN if commanded is None else 0.0
        commanded = commanded or Twist(0.0, 0.0)
        self._stands = commanded == Twist(0.0, 0.0)
        self._wheels.update(encoders, commanded)
        if self._last is None:
            self._rest_ticks = (encoders.left, encoders.right)
            rate = inertial.yaw_rate if math.isfinite(inertial.yaw_rate) else 0.0
            self._last = encoders, rate
            return Odometry(encoders.time, self._pose, Twist(0.0, 0.0), self._bias, still=True)
        previous, previous_rate = self._last
        dt = encoders.time - previous.time
        if dt <= 0.0:
            # the same reading once more: no motion in between
            return self._odometry(encoders.time, previous_rate - self._bias)
        rate = inertial.yaw_rate
        self._stale = not math.isfinite(rate) or encoders.time - inertial.time > _STALE
        left, right = self._distances(previous, encoders, dt, rate, commanded)
        if self._stale:
            # wheels of unequal radius turn the robot in proportion to the distance
            turn = (right - left) / self._robot.track + self._skew * 0.5 * (left + right)
            rate = turn / dt + self._bias
        self._last = encoders, rate
        self._watch_rest(encoders)
        if not self._stale:
            still = self._resting(encoders.time)
            self._rocking.update(inertial, rate - self._bias, dt, still)
        distance = 0.5 * (left + right)
        self._speed += (distance / dt - self._speed) * -math.expm1(-dt / _SPEED_SMOOTHING)
        if self._resting(encoders.time) and abs(rate) <= _MAX_BIAS:
            turn = 0.0
            self._at_rest.append((rate, dt))
            if len(self._at_rest) * dt > wait:
                # its mean over the time at rest, with a fading memory as the bias drifts
                reading, time = self._at_rest.popleft()
                self._bias_time = min(self._bias_time + time, _BIAS_MEMORY)
                self._bias += (reading - self._bias) * min(1.0, time / self._bias_time)
        else:
            turn = (rate - self._bias) * dt
            self._at_rest.clear()
        self._advance(distance, turn)
        return self._odometry(encoders.time, rate - self._bias)

    def correct(self, correction: YawCorrection) -> None:
        """Correct the gyro's bias by the error of the measured yaw that the flow found.

        Only a significant mean residual corrects the bias: it has changed since the robot last
        stood still. A residual in proportion to the turning rate does not: that is a scale error,
        of the camera's focal length for example. While the gyro is stale, the residual is the
        wheels' and corrects their skew.
        """
        motion = correction.motion
        if motion.dt <= 0.0:
            return
        if self._stale:
            skew = self._skew + _GAIN * correction.yaw / max(motion.baseline, _MIN_DISTANCE)
            self._skew = min(max(skew, -_MAX_SKEW), _MAX_SKEW)
            return
        r = motion.rotation
        # y points down in camera axes: counter-clockwise from above is negative about it
        rate = 0.5 * (r[0, 2] - r[2, 0]) / motion.dt
        mean = self._residual.update(correction.yaw / motion.dt, rate, motion.dt)
        self._correcting = abs(mean) > _SIGNIFICANT or (self._correcting and abs(mean) > _SETTLED)
        if self._correcting:
            self._bias -= _GAIN * mean

    def _distances(
        self, before: Encoders, now: Encoders, dt: float, rate: float, commanded: Twist
    ) -> tuple[float, float]:
        """How far the wheels (left, right) have rolled [m], from encoders, gyro or command."""
        left = (now.left - before.left) * self._way_per_tick
        right = (now.right - before.right) * self._way_per_tick
        silent = self._wheels.silent
        self._silent = all(silent) or (any(silent) and self._stale)
        if self._silent:
            radius = self._robot.wheel_radius
            expected = [speed * radius * dt for speed in self._robot.wheel_speeds(commanded)]
            return (expected[0] if silent[0] else left), (expected[1] if silent[1] else right)
        apart = 0.0 if self._stale else self._robot.track * (rate - self._bias) * dt
        if silent[0]:
            left = right - apart
        elif silent[1]:
            right = left + apart
        return left, right

    def _odometry(self, time: float, yaw_rate: float) -> Odometry:
        still = self._resting(time)
        speed = 0.0 if still else self._speed
        turning = 0.0 if still and abs(yaw_rate) <= _MAX_BIAS else yaw_rate
        twist = Twist(speed, turning)
        return Odometry(
            time,
            self._pose,
            twist,
            self._bias,
            still,
            self._silent,
            self._stale,
            pitch=self._rocking.pitch,
            rocking=self._rocking.rocking,
        )

    def _advance(self, distance: float, turn: float) -> None:
        """Move the pose along an arc of length ``distance`` [m] that turns by ``turn`` [rad]."""
        pose = self._pose
        heading = pose.yaw + 0.5 * turn
        self._pose = Pose(
            pose.x + distance * math.cos(heading),
            pose.y + distance * math.sin(heading),
            wrap_angle(pose.yaw + turn),
        )

    def _resting(self, time: float) -> bool:
        return self._stands and time - self._rest_since >= _REST

    def _watch_rest(self, encoders: Encoders) -> None:
        moved = max(
            abs(encoders.left - self._rest_ticks[0]), abs(encoders.right - self._rest_ticks[1])
        )
        if moved > _FLICKER:
            self._rest_ticks = (encoders.left, encoders.right)
            self._rest_since = encoders.time


class _GyroResidual:
    """A fading regression of the gyro residual on the turning rate: bias and scale error."""

    def __init__(self) -> None:
        self._mean = self._rate = self._both = self._square = 0.0

    def update(self, residual: float, rate: float, dt: float) -> float:
        """Add one ``residual`` [rad/s] at turning ``rate``; the part that is not a scale error."""
        share = -math.expm1(-dt / _RESIDUAL_MEMORY)
        self._mean += share * (residual - self._mean)
        self._rate += share * (rate - self._rate)
        self._both += share * (residual * rate - self._both)
        self._square += share * (rate * rate - self._square)
        spread = self._square - self._rate**2 + _RATE_FLOOR**2
        return self._mean - (self._both - self._mean * self._rate) / spread * self._rate
