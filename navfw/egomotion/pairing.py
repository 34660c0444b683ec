"""Which two frames to compare: the baseline decides how well depth is seen (METHOD 2.7, 2.12)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, model_validator

from navfw.egomotion.camera_motion import SLIP, YAW_RATE_SIGMA, camera_motion
from navfw.interfaces import Params
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Odometry, Pose, wrap_angle

__all__ = ["FrameBuffer", "PairingParams", "PosedFrame"]

Length = Annotated[float, Field(gt=0.0, le=1.0)]


class PairingParams(Params):
    """When two frames make a useful pair."""

    baseline: Annotated[Length, Field(description="sought between the frames of a pair [m]")] = 0.08
    min_baseline: Annotated[Length, Field(description="no pair below this baseline [m]")] = 0.02
    max_baseline: Annotated[Length, Field(description="no pair above this baseline [m]")] = 0.16
    short: Annotated[
        bool, Field(description="also give a pair over the short baseline, for what is very near")
    ] = False
    short_baseline: Annotated[Length, Field(description="sought for the short pair [m]")] = 0.035
    max_rotation: Annotated[
        float, Field(gt=0.0, le=0.5, description="largest turn between the frames [rad]")
    ] = math.radians(4.0)
    max_age: Annotated[
        float, Field(gt=0.0, le=10.0, description="largest time between the frames [s]")
    ] = 2.0
    min_step: Annotated[
        float,
        Field(ge=0.0, le=0.1, description="way since the last pair below which nothing is new [m]"),
    ] = 0.002
    yaw_rate_sigma: Annotated[
        float, Field(ge=0.0, le=0.5, description="gyro error left beside its bias [rad/s]")
    ] = YAW_RATE_SIGMA
    slip: Annotated[
        float, Field(ge=0.0, le=0.5, description="relative error of way driven by the wheels")
    ] = SLIP

    @model_validator(mode="after")
    def _ordered(self) -> PairingParams:
        if not self.min_baseline <= self.baseline <= self.max_baseline:
            raise ValueError(
                f"baseline {self.baseline} m is not between min_baseline {self.min_baseline} m "
                f"and max_baseline {self.max_baseline} m"
            )
        if self.short and not self.min_baseline <= self.short_baseline < self.baseline:
            raise ValueError(
                f"short_baseline {self.short_baseline} m is not between min_baseline "
                f"{self.min_baseline} m and baseline {self.baseline} m"
            )
        return self


@dataclass(frozen=True, slots=True)
class PosedFrame:
    """A frame, the base's pose when it was taken, and where the camera was then (x, y) [m]."""

    frame: Frame
    pose: Pose
    camera_position: tuple[float, float]

    @classmethod
    def from_odometry(cls, frame: Frame, odometry: Odometry, robot: RobotModel) -> PosedFrame:
        """``frame`` with the odometry of (about) the same time.

        One taken a little before or after ``odometry.time`` is placed by the measured twist.
        """
        pose = _pose_at(frame.time, odometry)
        return cls(frame, pose, pose.to_parent(robot.camera.mount_forward, 0.0))

    def baseline(self, past: PosedFrame) -> float:
        """How far [m] the camera has come since ``past``."""
        return math.dist(self.camera_position, past.camera_position)

    def age(self, past: PosedFrame) -> float:
        """How long [s] before this one ``past`` was taken."""
        return self.frame.time - past.frame.time

    def turn(self, past: PosedFrame) -> float:
        """By how much [rad] the robot has turned since ``past``, whichever way."""
        return abs(wrap_angle(self.pose.yaw - past.pose.yaw))

    def pair(self, past: PosedFrame, robot: RobotModel, params: PairingParams) -> FramePair:
        """The frame with a ``past`` one, and how ``robot``'s camera moved between them."""
        motion = camera_motion(
            robot,
            past.pose,
            self.pose,
            self.age(past),
            yaw_rate_sigma=params.yaw_rate_sigma,
            slip=params.slip,
        )
        return FramePair(past.frame, self.frame, motion)


class FrameBuffer:
    """Keeps recent frames with their odometry and pairs the newest with the most useful past one.

    Driving backwards pairs as well as driving forwards. A robot that only turns sees no depth, and
    one that has not moved since its last pair sees nothing new: both get no pair. What moves by
    itself shows over time instead: see ``RecentFrames``.
    """

    def __init__(self, robot: RobotModel, params: PairingParams | None = None) -> None:
        self.params = PairingParams() if params is None else params
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._views: deque[PosedFrame] = deque()
        self._pairs: tuple[FramePair, ...] = ()
        self._last_paired: Pose | None = None

    def add(self, frame: Frame, odometry: Odometry) -> None:
        """Take in the newest ``frame`` with the odometry of (about) the same time."""
        view = PosedFrame.from_odometry(frame, odometry, self._robot)
        while self._views and view.age(self._views[0]) > self.params.max_age:
            self._views.popleft()
        self._pairs = tuple(self._make_pairs(view))
        if self._pairs:
            self._last_paired = view.pose
        self._views.append(view)

    def pairs(self) -> tuple[FramePair, ...]:
        """Pairs of the newest frame with past ones: none, the long one, or the long and the short.

        The long pair's baseline is the one nearest to ``params.baseline``; the short one is there
        only when ``params.short`` asks for it and its baseline is well below the long one's.
        """
        return self._pairs

    def _make_pairs(self, now: PosedFrame) -> Iterable[FramePair]:
        last = self._last_paired
        if last is not None and self._nothing_new(last, now.pose):
            return
        # among equals the younger one: less time for the gyro to drift and the scene to move
        useful = list(self._useful(now))[::-1]
        if not useful:
            return
        long_way, long = min(useful, key=lambda past: abs(past[0] - self.params.baseline))
        yield now.pair(long, self._robot, self.params)
        if self.params.short:
            target = self.params.short_baseline
            short_way, short = min(useful, key=lambda past: abs(past[0] - target))
            if short_way < 0.7 * long_way:
                yield now.pair(short, self._robot, self.params)

    def _nothing_new(self, last: Pose, now: Pose) -> bool:
        step = math.hypot(now.x - last.x, now.y - last.y)
        turn = abs(wrap_angle(now.yaw - last.yaw))
        return step < self.params.min_step and turn < 0.1 * self.params.max_rotation

    def _useful(self, now: PosedFrame) -> Iterator[tuple[float, PosedFrame]]:
        """The past frames that make a useful pair with ``now``, each with the baseline [m]."""
        least, most = self.params.min_baseline, self.params.max_baseline
        for past in self._views:
            way = now.baseline(past)
            # whether the robot has turned little enough for the two to be compared
            if least <= way <= most and now.turn(past) <= self.params.max_rotation:
                yield way, past


def _pose_at(time: float, odometry: Odometry) -> Pose:
    dt = time - odometry.time
    if dt == 0.0:
        return odometry.pose
    way, turn = odometry.twist.v * dt, odometry.twist.w * dt
    step = Pose(way * math.cos(0.5 * turn), way * math.sin(0.5 * turn), turn)
    return odometry.pose.compose(step)
