"""Stops, slows down, limits: the last word on every twist, whatever plugins decided.

After Nav2's collision monitor: fusion, then smoothing, then safety. It stops on stale sources,
keeps the stopping distance within what is remembered to be free, and still lets the robot rotate,
and back along the way it has just come.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from navfw.robot import RobotModel
from navfw.safety.senses import Senses
from navfw.signals import Odometry, SensorReading, Twist

__all__ = ["SafetyMonitor", "SafetyParams", "SafetyVerdict"]

Seconds = Annotated[float, Field(gt=0.0, le=60.0)]

_PROBE_PERIOD, _PROBE_TIME = 3.0, 0.3
"""How often, and how long [s], the drive tries whether its encoders answer."""

Room = Callable[[Twist], tuple[float, float]]
"""How far [m] a twist leads until the body touches something remembered, and until the unseen."""


class SafetyParams(BaseModel):
    """When the monitor steps in."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    latency: Annotated[
        float, Field(ge=0.0, le=1.0, description="from here to the wheels' braking [s]")
    ] = 0.1
    gap: Annotated[
        float, Field(ge=0.0, le=0.3, description="rest left before a thing when stopped [m]")
    ] = 0.02
    slow: Annotated[
        float, Field(gt=0.0, le=1.0, description="speed while a source is ageing [m/s]")
    ] = 0.12
    creep: Annotated[
        float, Field(gt=0.0, le=0.5, description="speed into what has not been seen [m/s]")
    ] = 0.15
    camera_slow: Annotated[Seconds, Field(description="age of the last useful frame: slow [s]")] = (
        0.45
    )
    camera_stop: Annotated[Seconds, Field(description="age of it: stop driving forward [s]")] = 1.2
    blind_reverse: Annotated[
        float, Field(ge=0.0, le=2.0, description="way back without a useful frame, at most [m]")
    ] = 0.3
    gyro_slow: Annotated[Seconds, Field(description="age of the gyro's last word: slow [s]")] = 0.2
    encoder_stop: Annotated[Seconds, Field(description="age of the encoders' word: stop [s]")] = 0.5
    stall: Annotated[Seconds, Field(description="wheels not following for so long: stop [s]")] = 0.8
    stall_rest: Annotated[Seconds, Field(description="rest after a stall [s]")] = 1.0
    probe: Annotated[
        float, Field(gt=0.0, le=0.5, description="speed to try whether encoders answer again [m/s]")
    ] = 0.05
    give_up: Annotated[
        Seconds, Field(description="a sensor out for so long ends the mission [s]")
    ] = 20.0


@dataclass(frozen=True, slots=True)
class SafetyVerdict:
    """The twist that may be driven; ``reason`` says why it differs from the one asked, or is empty.

    ``stopped`` is true when driving forward was refused altogether.
    """

    twist: Twist
    reason: str = ""
    stopped: bool = False


class SafetyMonitor:
    """Watches readings and commands at the control rate; has no opinion on where to go."""

    def __init__(self, robot: RobotModel, params: SafetyParams | None = None) -> None:
        self.robot = robot
        self.params = params or SafetyParams()
        self.senses = Senses()
        self.reset()

    def reset(self) -> None:
        """A new run: nothing heard, nothing held."""
        self.senses.reset()
        self._asked = Twist(0.0, 0.0)
        self._stalled_since: float | None = None
        self._rest_until = -math.inf
        self._heard: float | None = None
        self._backed = 0.0

    def hear(self, reading: SensorReading, odometry: Odometry) -> None:
        """Take note of the newest reading."""
        self.senses.hear(reading, odometry)
        self._watch_wheels(odometry)
        self._watch_way_back(odometry)

    def limit(self, twist: Twist, time: float, room: Room) -> SafetyVerdict:
        """``twist`` as far as it is safe; ``room`` tells how far a twist leads in the free."""
        verdict = self._limited(twist, time, room)
        self._asked = verdict.twist
        return verdict

    def _limited(self, twist: Twist, time: float, room: Room) -> SafetyVerdict:
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            return SafetyVerdict(Twist(0.0, 0.0), "the command is not a number", stopped=True)
        robot = self.robot
        silent = self._silence_cap()
        v = min(max(twist.v, -min(robot.max_reverse, silent)), robot.max_v)
        w = min(max(twist.w, -robot.max_w), robot.max_w)
        reason = "" if (v, w) == (twist.v, twist.w) else "the command exceeds the drive's limits"
        answer = (silent, "the wheel encoders do not answer")
        for cap, why in (answer, self._source_cap(), self._stall_cap(time)):
            if v > cap:
                v, reason = cap, why
        if v > 0.0:
            free, known = room(Twist(v, w))
            for allowed, why in (
                (self._braking_speed(free), "no room to stop in"),
                (max(self._braking_speed(known), self.params.creep), "it has not been seen"),
            ):
                if allowed < v:
                    v, reason = allowed, why
        elif v < 0.0:
            free, known = room(Twist(v, w))
            # the robot's own place is known: its rim must stay out of the unseen
            if min(free, known - robot.radius) <= self.params.gap:
                v, reason = 0.0, "no known way back"
            # what was seen is forgotten, walls too: a blind robot's map is no better than its age
            if self._backed >= self.params.blind_reverse:
                v, reason = 0.0, "it has backed far enough without seeing"
        stopped = twist.v > 0.0 and v <= 0.0
        return SafetyVerdict(Twist(v, w), reason, stopped)

    @property
    def failure(self) -> str | None:
        """Why the robot cannot go on: a sensor that has said nothing of use for too long."""
        senses, patience = self.senses, self.params.give_up
        if senses.camera_age > patience:
            trouble = senses.trouble or "the camera is silent"
            return f"{trouble}, for {senses.camera_age:.0f} s"
        if max(senses.silence, senses.encoder_age) > patience:
            return f"the wheel encoders do not answer, for {patience:.0f} s"
        return None

    def _silence_cap(self) -> float:
        """Top speed either way [m/s] while encoders do not answer: nearly always none.

        Only a wheel that is told to turn can show that it is counted again: now and then one goes
        a few millimetres, and no farther.
        """
        silence = self.senses.silence
        if silence <= 0.0:
            return math.inf
        return self.params.probe if silence % _PROBE_PERIOD > _PROBE_PERIOD - _PROBE_TIME else 0.0

    def _source_cap(self) -> tuple[float, str]:
        """Top forward speed [m/s] that the state of the sensors allows, and why."""
        p, senses = self.params, self.senses
        if senses.encoder_age > p.encoder_stop:
            return 0.0, "the wheel encoders are silent"
        if senses.camera_age > p.camera_stop:
            return 0.0, senses.trouble or "the camera is silent"
        if senses.camera_age > p.camera_slow:
            return p.slow, senses.trouble or "the camera is late"
        if senses.gyro_age > p.gyro_slow:
            return p.slow, "the gyro is silent"
        return math.inf, ""

    def _stall_cap(self, time: float) -> tuple[float, str]:
        """Stand still for a moment after the wheels did not follow."""
        if self._stalled_since is not None and time - self._stalled_since > self.params.stall:
            self._rest_until = time + self.params.stall_rest
            self._stalled_since = None
        return (0.0, "the wheels do not follow") if time < self._rest_until else (math.inf, "")

    def _watch_wheels(self, odometry: Odometry) -> None:
        asked, got = self._asked.v, odometry.twist.v
        if asked > 0.08 and got < 0.2 * asked:
            if self._stalled_since is None:
                self._stalled_since = odometry.time
        else:
            self._stalled_since = None

    def _watch_way_back(self, odometry: Odometry) -> None:
        """How far it has backed since the camera was last of use."""
        since = 0.0 if self._heard is None else odometry.time - self._heard
        self._heard = odometry.time
        blind = self.senses.camera_age > self.params.camera_stop
        self._backed = self._backed + max(-odometry.twist.v, 0.0) * since if blind else 0.0

    def _braking_speed(self, room: float) -> float:
        """Top speed [m/s] from which braking at the hardest ends within ``room`` [m] (METHOD 2.13).

        Solves ``v latency + v^2 / (2 brake) = room - gap``.
        """
        left = room - self.params.gap
        if left <= 0.0:
            return 0.0
        brake, latency = self.robot.max_brake, self.params.latency
        lag = brake * latency
        return math.sqrt(lag * lag + 2.0 * brake * left) - lag
