"""Fakes for tests: a kinematic simulator, and pilots that drive without perception.

They implement the protocols of ``navfw.missions.pilot``, take microseconds per tick, and are
exact: errors in a test come from the tested part alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    Encoders,
    Frame,
    Inertial,
    Pose,
    SensorReading,
    Twist,
    Waypoint,
    wrap_angle,
)
from navfw.stack.stack_state import StackState


@dataclass(frozen=True, slots=True)
class Post:
    """A round obstacle of a ``FakeSimulator``: name, centre and radius [m]."""

    name: str
    x: float
    y: float
    radius: float = 0.1


class FakeSimulator:
    """A robot with ideal wheels and sensors among round posts.

    Camera images are seeded noise, so that frames differ from each other and between seeds. A post
    gives a contact, but does not stop the robot.
    """

    def __init__(
        self,
        start: Pose,
        robot: RobotModel | None = None,
        posts: Iterable[Post] = (),
        seed: int = 0,
    ) -> None:
        self.robot = robot or RobotModel()
        self.posts = tuple(posts)
        self.time = 0.0
        self.contacts: tuple[str, ...] = ()
        self._random = np.random.default_rng(seed)
        self._pose = start
        self._turned = [0.0, 0.0]
        self._wheels = (0.0, 0.0)
        self._next_frame = 0.0

    def read(self) -> SensorReading:
        """Exact gyro and encoders; a frame whenever the camera is due."""
        twist = self.robot.twist(*self._wheels)
        frame = None
        if self.time >= self._next_frame - 1e-9:
            self._next_frame += 1.0 / self.robot.camera.rate
            size = (self.robot.camera.height, self.robot.camera.width)
            frame = Frame(self.time, self._random.integers(0, 256, size, dtype=np.uint8))
        left, right = (
            round(angle / (2.0 * math.pi) * self.robot.ticks_per_turn) for angle in self._turned
        )
        return SensorReading(
            time=self.time,
            inertial=Inertial(self.time, 0.0, 0.0, twist.w),
            encoders=Encoders(self.time, left, right),
            frame=frame,
        )

    def drive(self, left: float, right: float) -> None:
        """Set the wheel speeds [rad/s]; they apply immediately."""
        self._wheels = (left, right)

    def advance(self, dt: float) -> None:
        """Move along the arc of the wheel speeds for ``dt`` [s]."""
        twist = self.robot.twist(*self._wheels)
        middle = self._pose.yaw + 0.5 * twist.w * dt
        # the chord of the arc: exact for constant wheel speeds
        half = 0.5 * twist.w * dt
        chord = twist.v * dt * (math.sin(half) / half if half else 1.0)
        self._pose = Pose(
            self._pose.x + chord * math.cos(middle),
            self._pose.y + chord * math.sin(middle),
            wrap_angle(self._pose.yaw + twist.w * dt),
        )
        self._turned = [a + s * dt for a, s in zip(self._turned, self._wheels, strict=True)]
        self.time += dt
        self.contacts = tuple(
            post.name
            for post in self.posts
            if math.hypot(post.x - self._pose.x, post.y - self._pose.y)
            <= post.radius + self.robot.radius
        )

    def true_pose(self) -> Pose:
        """The robot's pose."""
        return self._pose


class ScriptedPilot:
    """Drives a list of twists, one per tick, then is finished (or stuck for the reason given).

    It is ``unsure`` of its position at the end if wanted.
    """

    def __init__(
        self, twists: Iterable[Twist], stuck: str | None = None, *, unsure: bool = False
    ) -> None:
        self.state = StackState(0.0)
        self._script = list(twists)
        self._stuck = stuck
        self._unsure = unsure
        self._tick = 0

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Restart the script; the goals become the path and have no other effect."""
        self._tick = 0
        pose = pose or Pose(0.0, 0.0, 0.0)
        self.state = StackState(0.0, path=tuple(goals), belief=Belief(0.0, pose, np.zeros((3, 3))))

    def step(self, reading: SensorReading) -> Twist:
        """The next twist of the script; zero after its end."""
        over = self._tick >= len(self._script)
        twist = Twist(0.0, 0.0) if over else self._script[self._tick]
        self._tick += 1
        self.state = StackState(
            reading.time,
            belief=self.state.belief,
            path=self.state.path,
            command=Command(reading.time, twist, "script", f"tick {self._tick}"),
            finished=over and self._stuck is None and not self._unsure,
            stuck=self._stuck if over else None,
            unsure=over and self._unsure,
        )
        return twist


class FakePilot:
    """Drives straight from goal to goal by dead reckoning from encoders and gyro.

    ``yaw_error`` [rad] is added to the starting yaw, so that it gets lost.
    """

    def __init__(self, robot: RobotModel | None = None, yaw_error: float = 0.0) -> None:
        self.robot = robot or RobotModel()
        self.yaw_error = yaw_error
        self.state = StackState(0.0)
        self._pose = Pose(0.0, 0.0, 0.0)
        self._goals: tuple[Waypoint, ...] = ()
        self._last: SensorReading | None = None

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Start at ``pose`` (None: the origin is assumed), with ``goals`` to visit in order."""
        pose = pose or Pose(0.0, 0.0, 0.0)
        self._pose = Pose(pose.x, pose.y, wrap_angle(pose.yaw + self.yaw_error))
        self._goals = tuple(goals)
        self._last = None
        self.state = StackState(0.0, path=self._goals)

    def step(self, reading: SensorReading) -> Twist:
        """Turn towards the goal, then drive straight."""
        self._reckon(reading)
        while self._goals and self._left(self._goals[0]) <= self._goals[0].tolerance:
            self._goals = self._goals[1:]
        twist = self._head_for(self._goals[0]) if self._goals else Twist(0.0, 0.0)
        self.state = StackState(
            reading.time,
            belief=Belief(reading.time, self._pose, np.zeros((3, 3))),
            path=self._goals,
            command=Command(reading.time, twist, "fake", "straight to the goal"),
            finished=not self._goals,
        )
        return twist

    def _left(self, goal: Waypoint) -> float:
        return math.hypot(goal.x - self._pose.x, goal.y - self._pose.y)

    def _head_for(self, goal: Waypoint) -> Twist:
        ahead, aside = self._pose.to_local(goal.x, goal.y)
        bearing = math.atan2(aside, ahead)
        w = max(-1.0, min(1.0, 2.0 * bearing))
        return Twist(0.3 if abs(bearing) < 0.5 else 0.0, w)

    def _reckon(self, reading: SensorReading) -> None:
        last, self._last = self._last, reading
        if last is None:
            return
        turn = 2.0 * math.pi / self.robot.ticks_per_turn
        left = (reading.encoders.left - last.encoders.left) * turn
        right = (reading.encoders.right - last.encoders.right) * turn
        way = 0.5 * self.robot.wheel_radius * (left + right)
        dyaw = reading.inertial.yaw_rate * (reading.time - last.time)
        middle = self._pose.yaw + 0.5 * dyaw
        self._pose = Pose(
            self._pose.x + way * math.cos(middle),
            self._pose.y + way * math.sin(middle),
            wrap_angle(self._pose.yaw + dyaw),
        )
