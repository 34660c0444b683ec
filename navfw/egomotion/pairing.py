"""Selection of frame pairs by baseline, which decides the accuracy of depth (METHOD 2.7, 2.12).

The camera's motion between two poses of the robot is exact, with lever arm and pitch.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from navfw.interfaces import Params
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Odometry, Pose, wrap_angle

MIN_BASELINE = 0.02  # chosen
"""Smallest baseline of a pair [m]."""
MAX_AGE = 2.0  # chosen
"""Largest time between the frames [s]."""
MIN_STEP = 0.002  # chosen
"""Least distance driven since the last pair [m]."""

#: Standard deviation of the gyro's error once its bias is removed, a constant rate [rad/s].
YAW_RATE_SIGMA = 0.003  # chosen
#: Standard deviation of the wheels' slip, relative to the distance driven.
SLIP = 0.03  # chosen
#: Standard deviation of the shortest baseline [m]: encoder resolution and play in the wheels.
_TRANSLATION_FLOOR = 5e-4  # chosen

#: One standard deviation of a turn measured by the wheels, through slip and unequal radii [rad/m].
_WHEELS_YAW_SIGMA = 0.1  # chosen


def yaw_rotation(angle: float) -> Array:
    """Return the rotation (3, 3) by ``angle`` [rad] about base_link's z, counter-clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def pitch_rotation(pitch: float) -> Array:
    """Return the rotation (3, 3) of base_link's axes into level ones; ``pitch`` [rad] nose down."""
    c, s = math.cos(pitch), math.sin(pitch)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def camera_place(robot: RobotModel, pitch: float) -> Array:
    """Return the camera's place (3,) [m]: ahead and left of base_link, above its usual height.

    In level axes, while the body is pitched about the axle of its wheels by ``pitch`` [rad].
    """
    ahead, above = robot.camera.mount_forward, robot.camera.mount_height - robot.wheel_radius
    if pitch == 0.0:
        return np.array([ahead, 0.0, 0.0])
    c, s = math.cos(pitch), math.sin(pitch)
    return np.array([c * ahead + s * above, 0.0, (c - 1.0) * above - s * ahead])


def camera_motion(
    robot: RobotModel,
    past: Pose,
    now: Pose,
    dt: float,
    *,
    yaw_rate_sigma: float = YAW_RATE_SIGMA,
    slip: float = SLIP,
    places: tuple[Array, Array] | None = None,
) -> CameraMotion:
    """Compute the motion of ``robot``'s camera while its base moves from ``past`` to ``now``.

    Both poses are in one frame (``odom``). The camera is mounted ``mount_forward`` ahead of the
    axle, so a turn also moves it sideways, and its pitch maps yaw into rotation about two of its
    own axes (METHOD 2.1, 2.2, here without the small-angle approximation). ``dt`` [s] is the time
    between the poses; ``yaw_rate_sigma`` [rad/s] and ``slip`` (relative to the distance driven) are
    the standard deviations of the gyro's and the wheels' errors; that of the point about which the
    robot turns is ``robot.skid``. ``places``, past and now, are those of the camera
    (``camera_place``) of a body that rocks; its images are taken to be level.
    """
    turn = wrap_angle(now.yaw - past.yaw)
    # the camera's displacement in the axes of base_link now; the lever arm turned with the robot
    lever_past, lever = places or (camera_place(robot, 0.0),) * 2
    x, y = now.to_local(past.x, past.y)
    now_from_past = yaw_rotation(-turn)
    displacement = np.array([-x, -y, 0.0]) + lever - product(now_from_past, lever_past)
    base_from_camera = robot.camera.base_from_camera
    translation = product(base_from_camera.T, displacement)
    distance = math.sqrt(product(translation, translation))
    skid = robot.skid * abs(turn)
    return CameraMotion(
        rotation=product(base_from_camera.T, now_from_past, base_from_camera),
        translation=translation,
        dt=dt,
        yaw_sigma=yaw_rate_sigma * abs(dt),
        translation_sigma=math.hypot(_TRANSLATION_FLOOR, slip * distance, skid),
        skid_sigma=skid,
    )


def with_yaw_sigma(flow: FlowField, odometry: Odometry) -> FlowField:
    """Widen the yaw sigma of ``flow`` if its yaw is the wheels', for want of a fresh gyro."""
    if not odometry.gyro_stale:
        return flow
    sigma = max(flow.motion.yaw_sigma, _WHEELS_YAW_SIGMA * flow.motion.baseline)
    return replace(flow, motion=replace(flow.motion, yaw_sigma=sigma))


Length = Annotated[float, Field(gt=0.0, le=1.0)]

_BASELINE_SHARE = 0.9  # chosen
"""Share of the largest baseline that successive frames may be apart: commands and poses vary."""

_MAX_HEIGHTS = 0.32  # derived
"""Largest desired baseline in heights of the camera: beyond, the motion of near floor between the
frames exceeds the flow's range (METHOD 2.7)."""


class PairingParams(Params):
    """Limits on the pairs of frames, and the errors of their camera motion."""

    baseline: Length = Field(
        0.08, description="desired baseline of a pair, less for a low camera [m]"
    )
    max_baseline: Length = Field(0.16, description="largest baseline of a pair [m]")
    short: bool = Field(
        False, description="also form a pair over the short baseline, for very near surfaces"
    )
    short_baseline: Length = Field(0.035, description="desired baseline of the short pair [m]")
    max_rotation: float = Field(
        math.radians(4.0), gt=0.0, le=0.5, description="largest rotation between the frames [rad]"
    )
    yaw_rate_sigma: float = Field(
        YAW_RATE_SIGMA, ge=0.0, le=0.5, description="gyro error once its bias is removed [rad/s]"
    )
    slip: float = Field(
        SLIP, ge=0.0, le=0.5, description="error of the distance driven, relative to it"
    )

    @model_validator(mode="after")
    def _ordered(self) -> PairingParams:
        if not MIN_BASELINE <= self.baseline <= self.max_baseline:
            raise ValueError(
                f"baseline {self.baseline} m is not between {MIN_BASELINE} m "
                f"and max_baseline {self.max_baseline} m"
            )
        if self.short and not MIN_BASELINE <= self.short_baseline < self.baseline:
            raise ValueError(
                f"short_baseline {self.short_baseline} m is not between "
                f"{MIN_BASELINE} m and baseline {self.baseline} m"
            )
        return self


@dataclass(frozen=True, slots=True)
class PosedFrame:
    """A frame with the ``pose`` of the base and the ``camera_position`` (x, y) [m] in ``odom``.

    ``place`` (3,) [m] is the camera's place on the body (``camera_place``).
    """

    frame: Frame
    pose: Pose
    camera_position: tuple[float, float]
    place: Array

    @classmethod
    def from_odometry(cls, frame: Frame, odometry: Odometry, robot: RobotModel) -> PosedFrame:
        """Make a posed ``frame`` from ``odometry`` of about the same time.

        The pose is extrapolated by the measured twist from ``odometry.time`` to the frame's time.
        """
        pose = _pose_at(frame.time, odometry)
        place = camera_place(robot, odometry.pitch)
        return cls(frame, pose, pose.to_parent(float(place[0]), float(place[1])), place)

    def baseline(self, past: PosedFrame) -> float:
        """Return the distance [m] between the camera positions of ``past`` and this frame."""
        return math.dist(self.camera_position, past.camera_position)

    def age(self, past: PosedFrame) -> float:
        """Return the time [s] from ``past`` to this frame."""
        return self.frame.time - past.frame.time

    def turn(self, past: PosedFrame) -> float:
        """Return the absolute rotation [rad] of the robot between ``past`` and this frame."""
        return abs(wrap_angle(self.pose.yaw - past.pose.yaw))

    def pair(self, past: PosedFrame, robot: RobotModel, params: PairingParams) -> FramePair:
        """Pair ``past`` with this frame and the motion of ``robot``'s camera between them."""
        motion = camera_motion(
            robot,
            past.pose,
            self.pose,
            self.age(past),
            yaw_rate_sigma=params.yaw_rate_sigma,
            slip=params.slip,
            places=(past.place, self.place),
        )
        return FramePair(past.frame, self.frame, motion)


class FrameBuffer:
    """Keeps recent frames with their odometry and pairs the newest with the most useful past one.

    Frames are paired by baseline, whether the robot drives forwards or backwards. There is no pair
    while the robot only turns, since pure rotation shows no depth, nor until it has moved since the
    last pair. Moving objects need frames a fixed time apart: see ``navfw.movers.multi_view``.
    """

    def __init__(self, robot: RobotModel, params: PairingParams | None = None) -> None:
        self.params = PairingParams() if params is None else params
        self._robot = robot
        low = _MAX_HEIGHTS * robot.camera.mount_height
        self._desired = max(min(self.params.baseline, low), MIN_BASELINE)
        self.reset()

    def reset(self) -> None:
        """Delete all frames and pairs."""
        self._frames: deque[PosedFrame] = deque()
        self._pairs: tuple[FramePair, ...] = ()
        self._last_paired: Pose | None = None

    def add(self, frame: Frame, odometry: Odometry) -> None:
        """Add the newest ``frame``, with the odometry of about the same time, and pair it."""
        posed = PosedFrame.from_odometry(frame, odometry, self._robot)
        while self._frames and posed.age(self._frames[0]) > MAX_AGE:
            self._frames.popleft()
        self._pairs = tuple(self._make_pairs(posed))
        if self._pairs:
            self._last_paired = posed.pose
        self._frames.append(posed)

    def pairs(self) -> tuple[FramePair, ...]:
        """Return pairs of the newest frame with past ones: none, the long, or the long and short.

        The long pair is the one whose baseline is nearest to the desired one. The short pair exists
        only if ``params.short`` is set and its baseline is well below that of the long one.
        """
        return self._pairs

    def _make_pairs(self, now: PosedFrame) -> Iterable[FramePair]:
        last = self._last_paired
        if last is not None and self._nearly_same_pose(last, now.pose):
            return
        # of equal baselines the newer frame: less gyro drift and less motion in the scene
        allowed = list(self._allowed(now))[::-1]
        if not allowed:
            return
        long_way, long = min(allowed, key=lambda past: abs(past[0] - self._desired))
        yield now.pair(long, self._robot, self.params)
        if self.params.short:
            target = self.params.short_baseline
            short_way, short = min(allowed, key=lambda past: abs(past[0] - target))
            if short_way < 0.7 * long_way:
                yield now.pair(short, self._robot, self.params)

    def _nearly_same_pose(self, last: Pose, now: Pose) -> bool:
        step = math.hypot(now.x - last.x, now.y - last.y)
        turn = abs(wrap_angle(now.yaw - last.yaw))
        return step < MIN_STEP and turn < 0.1 * self.params.max_rotation

    def _allowed(self, now: PosedFrame) -> Iterator[tuple[float, PosedFrame]]:
        """The past frames that form an allowed pair with ``now``, each with its baseline [m]."""
        least, most = MIN_BASELINE, self.params.max_baseline
        for past in self._frames:
            baseline = now.baseline(past)
            if least <= baseline <= most and now.turn(past) <= self.params.max_rotation:
                yield baseline, past


def seeing_speed(robot: RobotModel, params: PairingParams) -> float:
    """Return the top speed [m/s] at which successive frames of ``robot``'s camera form a pair.

    At higher speed, no two frames are near enough to each other to show any depth.
    """
    return _BASELINE_SHARE * params.max_baseline * robot.camera.rate


def _pose_at(time: float, odometry: Odometry) -> Pose:
    dt = time - odometry.time
    if dt == 0.0:
        return odometry.pose
    distance, turn = odometry.twist.v * dt, odometry.twist.w * dt
    step = Pose(distance * math.cos(0.5 * turn), distance * math.sin(0.5 * turn), turn)
    return odometry.pose.compose(step)
