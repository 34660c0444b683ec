"""Visual odometry: wheels and gyro, corrected by the floor's motion in the images.

The state is (x [m], y [m], yaw [rad], k, b [rad/s]): the pose since a key frame, in the key frame's
base_link; the share k of the wheels' distance that the robot does not cover (mean slip, radius
error); and the gyro's bias b. Wheels and gyro predict it, with the errors of their data sheets. The
registration of the floor between key frame and present frame measures the pose, and through its
correlation with the pose the two calibrations (Kalman filter with a state that is reset at each
key frame; relative measurements as in Roumeliotis and Burdick 2002). While too many of the floor's
motions contradict wheels and gyro, none is believed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navfw.egomotion.floor_registration import FloorImage, FloorRegistration, FloorStep
from navfw.egomotion.pairing import YAW_RATE_SIGMA
from navfw.numerics import Array
from navfw.numerics.linear_systems import solve
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Frame, Odometry, Pose, Twist, YawCorrection, wrap_angle

_KEY_DISTANCE = 0.12  # chosen
"""Distance [m] from the key frame at which the present frame becomes the next one."""

_KEY_TURN = math.radians(8.0)  # chosen
"""Turn [rad] from the key frame at which the present frame becomes the next one."""

_LOST_DISTANCE = 0.3  # chosen
"""Distance [m] at which a key frame is given up that no frame could be registered to."""

_GATE = 16.0  # derived
"""Largest squared Mahalanobis distance of a measurement, of 3 degrees of freedom (0.1 %)."""

_WIDENED = 4.0  # chosen
"""Factor on the predicted covariance within which the floor's motion is searched."""

_MIN_SEARCH_SIGMA = np.array([5e-4, 2e-4, 5e-4])  # chosen
"""Least standard deviations of that search: x, y [m], yaw [rad]."""

_SLIPPED = 0.3  # chosen
"""Standard deviation of the wheels' distance, as a part of it, where they are found slipping."""

_CLEAR_SHARE, _CLEAR_EXPLAINED = 0.85, 0.985  # chosen
"""Least share of agreeing pixels, and of the variance that they explain, of an image that shows the
floor so clearly that it is believed against the wheels."""

_SURPRISE = 16.0  # chosen
"""Squared ratio of a yaw correction to its standard deviation above which the bias has jumped."""

_CONVINCED = 3  # chosen
"""Number of such frames in a row after which the wheels count as slipping."""

_FLOW_SHARE = 0.5  # measured
"""Error of the yaw by the whole flow field, as a part of the standard deviation that comes with it,
which allows for errors that neighbours share (measured on drives through the office)."""

_DOUBT_MEMORY = 15.0  # chosen
"""Number of frames over which contradictions are averaged."""

_DOUBTED, _TRUSTED = 0.4, 0.15  # chosen
"""Mean share of contradictions, slip apart, above which the floor is not believed, and below
which it is believed again."""

_CALIBRATION = 0.02  # chosen
"""Prior standard deviation of k: slip and tyres of a data sheet that is only about right."""

_CALIBRATION_WALK = 5e-4  # chosen
"""Random walk of k [per root of m]: floors differ."""

_BIAS_MARGIN = 1.5  # chosen
"""Factor on the data sheet's random walk of the gyro's bias."""


@dataclass(frozen=True, slots=True)
class _KeyFrame:
    """An image made ready, and the corrected pose of the robot at its time."""

    image: FloorImage
    pose: Pose


class FloorOdometry:
    """Corrects an odometer by the floor's motion; call ``observe`` with each camera frame."""

    def __init__(self, robot: RobotModel) -> None:
        self._registration = FloorRegistration(robot)
        sheet = robot.odometry
        self._slip = sheet.slip**2 * sheet.slip_time
        self._skid = robot.skid**2 * _KEY_TURN  # keeps its value within a key frame
        self._gyro = sheet.gyro_noise**2 / robot.control_rate
        self._walk = (_BIAS_MARGIN * sheet.gyro_bias_walk) ** 2
        self._bias_prior = sheet.gyro_noise**2 / robot.control_rate + sheet.gyro_bias_walk**2
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first odometry."""
        self._key: _KeyFrame | None = None
        self._raw: Odometry | None = None
        self._shift = Pose(0.0, 0.0, 0.0)
        self._state = np.zeros(5)
        self._covariance = np.zeros((5, 5))
        self._covariance[3, 3] = _CALIBRATION**2
        self._used_until = -math.inf
        self._disagreed = 0
        self._contradicted = 0.0
        self._doubting = False
        self._registered_last = False

    @property
    def slipping(self) -> bool:
        """Whether the last frames clearly showed the floor moving otherwise than the wheels."""
        return self._disagreed >= _CONVINCED

    @property
    def doubt(self) -> str:
        """Reason why the floor's motion is not believed at present; empty if it is."""
        share = f"{self._contradicted:.0%} of its motions contradict wheels and gyro"
        return f"the floor in the images is not believed: {share}" if self._doubting else ""

    @property
    def calibration(self) -> tuple[float, float]:
        """Share k of the wheels' distance that the robot does not cover, and gyro bias [rad/s]."""
        return float(self._state[3]), float(self._state[4])

    def corrected(self, raw: Odometry) -> Odometry:
        """Return ``raw`` odometry with pose, twist and bias corrected by all frames so far."""
        if self._raw is None:
            return raw
        share, bias = self.calibration
        turn = 0.0 if raw.still else raw.yaw_bias - bias
        twist = Twist((1.0 - share) * raw.twist.v, raw.twist.w + turn)
        return replace(
            raw,
            pose=self._shift.compose(raw.pose),
            twist=twist,
            yaw_bias=bias,
            by_floor=self._registered_last,
            doubt=self.doubt,
        )

    def observe(self, frame: Frame, raw: Odometry) -> None:
        """Correct by a camera frame; ``raw`` is the odometer's result at the frame's time."""
        image = self._registration.prepare(frame.image, raw.pitch, raw.rocking)
        if self._raw is None or self._key is None:
            self._state[4] = raw.yaw_bias
            self._covariance[4, 4] = YAW_RATE_SIGMA**2
            self._raw = raw
            self._key = _KeyFrame(image, self._shift.compose(raw.pose))
            return
        self._predict(self._raw, raw)
        self._raw = raw
        if raw.still:
            return
        self._registered_last = used = self._measure(self._key.image, image)
        pose = self._key.pose.compose(Pose(*self._state[:3].tolist()))
        self._shift = pose.frame_of(raw.pose)
        distance = math.hypot(*self._state[:2])
        beyond = distance > _KEY_DISTANCE or abs(self._state[2]) > _KEY_TURN
        if beyond and (used or distance > _LOST_DISTANCE or abs(self._state[2]) > 2.0 * _KEY_TURN):
            self._key = _KeyFrame(image, pose)
            self._state[:3] = 0.0
            self._covariance[:3, :] = 0.0
            self._covariance[:, :3] = 0.0

    def correct(self, correction: YawCorrection) -> None:
        """Correct the gyro's bias by the yaw error that the whole flow field found.

        Pairs of frames overlap; only those are used that share no time with the last one used.
        """
        dt = correction.motion.dt
        if self._raw is None or dt <= 0.0 or self._raw.time - dt < self._used_until - 1e-6:
            return
        self._used_until = self._raw.time
        column = self._covariance[:, 4].copy()
        spread = float(column[4]) * dt + self._gyro + (_FLOW_SHARE * correction.sigma) ** 2 / dt
        surplus = correction.yaw**2 / dt - _SURPRISE * spread
        if surplus > 0.0:  # the bias has jumped
            self._covariance[4, 4] += surplus / dt
            column[4] += surplus / dt
            spread += surplus
        self._state = self._state - column * (correction.yaw / spread)
        self._covariance -= np.outer(column, column) * (dt / spread)

    def _predict(self, last: Odometry, now: Odometry) -> None:
        """Move the state by the wheels and the gyro since ``last``."""
        dt = now.time - last.time
        if dt <= 0.0:
            return
        if now.still:
            # the odometer knows the bias of a robot at rest
            self._state[4] = now.yaw_bias
            self._covariance[4, :] = self._covariance[:, 4] = 0.0
            self._covariance[4, 4] = self._bias_prior
            return
        moved = last.pose.relative(now.pose)
        x, y, yaw, share, bias = self._state.tolist()
        turn = moved.yaw + (now.yaw_bias - bias) * dt
        c, s = math.cos(yaw), math.sin(yaw)
        covered = 1.0 - share
        dx, dy = covered * (c * moved.x - s * moved.y), covered * (s * moved.x + c * moved.y)
        self._state[:3] = x + dx, y + dy, wrap_angle(yaw + turn)
        jacobian = np.eye(5)
        jacobian[0, 2], jacobian[1, 2] = -dy, dx
        jacobian[0, 3], jacobian[1, 3] = -dx / covered, -dy / covered
        jacobian[2, 4] = -dt
        self._covariance = product(jacobian, self._covariance, jacobian.T)
        distance = math.hypot(dx, dy)
        along = self._slip * max(abs(now.twist.v), 0.1) * distance
        if now.silent:
            along += (_SLIPPED * distance) ** 2
        ux, uy = (dx / distance, dy / distance) if distance > 0.0 else (c, s)
        self._covariance[:2, :2] += along * np.outer((ux, uy), (ux, uy)) + 1e-9 * np.eye(2)
        aside = self._skid * abs(moved.yaw)
        self._covariance[:2, :2] += aside * np.outer((-s, c), (-s, c))
        self._covariance[2, 2] += self._gyro * dt + (1e-3 * moved.yaw) ** 2
        self._covariance[3, 3] += _CALIBRATION_WALK**2 * distance
        self._covariance[4, 4] += self._walk * dt

    def _measure(self, past: FloorImage, now: FloorImage) -> bool:
        """Correct the state by the floor's motion from ``past`` to ``now``; whether it was used."""
        search_covariance = _WIDENED * self._covariance[:3, :3] + np.diag(_MIN_SEARCH_SIGMA**2)
        step = self._registered(past, now, search_covariance)
        if step is None:
            return False
        if self._distance(step) <= _GATE:
            self._disagreed = 0
            self._watch(0.0)
            if not self._doubting:
                self._update(step)
            return not self._doubting
        # either this is no floor, or the wheels slip: then only the distance ahead is wrong
        c, s = math.cos(self._state[2]), math.sin(self._state[2])
        sigma = _SLIPPED * math.hypot(*self._state[:2])
        slip = sigma**2 * np.outer((c, s, 0.0), (c, s, 0.0))
        step = self._registered(past, now, search_covariance + slip)
        clear = step and step.share >= _CLEAR_SHARE and step.explained >= _CLEAR_EXPLAINED
        # a body that rocks moves the camera otherwise than its wheels
        if step is None or not clear or step.rocking:
            self._watch(1.0)
            return False
        self._disagreed += 1
        if not self.slipping:
            return False
        self._covariance[:3, :3] += slip
        self._update(step)
        return True

    def _watch(self, contradiction: float) -> None:
        """Average the contradictions, and stop or begin to believe the floor accordingly.

        What such a floor said of the wheels is forgotten.
        """
        self._contradicted += (contradiction - self._contradicted) / _DOUBT_MEMORY
        self._doubting = self._contradicted > (_TRUSTED if self._doubting else _DOUBTED)
        if self._doubting:
            self._state[3] = self._covariance[3, :] = self._covariance[:, 3] = 0.0
            self._covariance[3, 3] = _CALIBRATION**2

    def _registered(self, past: FloorImage, now: FloorImage, covariance: Array) -> FloorStep | None:
        guess = Pose(*self._state[:3].tolist())
        return self._registration.register(past, now, guess, covariance)

    def _distance(self, step: FloorStep) -> float:
        """Squared Mahalanobis distance of ``step`` from the state."""
        off = self._offset(step)
        return float(product(off, solve(self._covariance[:3, :3] + step.covariance, off)))

    def _offset(self, step: FloorStep) -> Array:
        x, y, yaw = self._state[:3].tolist()
        pose = step.pose
        return np.array([pose.x - x, pose.y - y, wrap_angle(pose.yaw - yaw)])

    def _update(self, step: FloorStep) -> None:
        spread = self._covariance[:3, :3] + step.covariance
        gain = solve(spread, self._covariance[:3, :]).T
        if step.rocking:
            gain[3] = 0.0  # its scale says nothing of the wheels
        self._state = self._state + product(gain, self._offset(step))
        keep = np.eye(5)
        keep[:, :3] -= gain
        noise = product(gain, step.covariance, gain.T)
        self._covariance = product(keep, self._covariance, keep.T) + noise
