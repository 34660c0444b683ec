"""A kinematic simulator, and a pilot that drives a script: exact, and quick."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

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
)
from navfw.stack import StackState

_STILL = Twist(0.0, 0.0)


Posts = Mapping[str, tuple[float, float]]
"""Round obstacles by name, of radius 0.1 m; they give a contact, but do not stop the robot."""


class FakeSimulator:
    """A robot with ideal wheels and sensors among ``posts``; its images are noise."""

    def __init__(
        self, start: Pose, robot: RobotModel | None = None, posts: Posts | None = None
    ) -> None:
        self.robot = robot or RobotModel()
        self.posts = posts or {}
        self.time = 0.0
        self.contacts: tuple[str, ...] = ()
        self._random = np.random.default_rng(0)
        self._pose = start
        self._turned = np.zeros(2)
        self._wheels = (0.0, 0.0)
        self._next_frame = 0.0

    def read(self) -> SensorReading:
        """Exact gyro and encoders; a frame whenever the camera is due."""
        frame = None
        if self.time >= self._next_frame - 1e-9:
            self._next_frame += 1.0 / self.robot.camera.rate
            size = (self.robot.camera.height, self.robot.camera.width)
            frame = Frame(self.time, self._random.integers(0, 256, size, dtype=np.uint8))
        ticks = (self._turned / (2.0 * math.pi) * self.robot.ticks_per_turn).round()
        inertial = Inertial(self.time, 0.0, 0.0, self.robot.twist(*self._wheels).w)
        return SensorReading(self.time, inertial, Encoders(self.time, *map(int, ticks)), frame)

    def drive(self, left: float, right: float) -> None:
        """Set the wheel speeds [rad/s]; they apply immediately."""
        self._wheels = (left, right)

    def advance(self, dt: float) -> None:
        """Move along the arc of the wheel speeds for ``dt`` [s]."""
        twist = self.robot.twist(*self._wheels)
        half = 0.5 * twist.w * dt
        chord = twist.v * dt * (math.sin(half) / half if half else 1.0)
        moved = Pose(chord * math.cos(half), chord * math.sin(half), 2.0 * half)
        self._pose = self._pose.compose(moved)
        self._turned += np.array(self._wheels) * dt
        self.time += dt
        away = {name: math.hypot(*self._pose.to_local(*at)) for name, at in self.posts.items()}
        self.contacts = tuple(name for name in away if away[name] <= 0.1 + self.robot.radius)

    def true_pose(self) -> Pose:
        """The robot's pose."""
        return self._pose


class ScriptedPilot:
    """Drives a twist per tick, then is finished, ``stuck`` for a reason, or ``unsure``."""

    def __init__(
        self, twists: Iterable[Twist], stuck: str | None = None, *, unsure: bool = False
    ) -> None:
        self.state = StackState(0.0)
        self._script = list(twists)
        self._end: dict[str, Any] = {
            "finished": stuck is None and not unsure,
            "stuck": stuck,
            "unsure": unsure,
        }

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """The goals become the path and have no other effect."""
        belief = Belief(0.0, pose or Pose(0.0, 0.0, 0.0), np.zeros((3, 3)))
        self.state = StackState(0.0, path=tuple(goals), belief=belief)

    def step(self, reading: SensorReading) -> Twist:
        """The next twist of the script; zero after its end."""
        twist = self._script.pop(0) if self._script else None
        end = {} if twist else self._end
        command = Command(reading.time, twist or _STILL, "script", "the next twist")
        self.state = replace(self.state, time=reading.time, command=command, **end)
        return twist or _STILL
