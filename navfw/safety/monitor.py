"""The safety monitor: limits every twist that the plugins decide on.

Like Nav2's collision monitor it comes last, after fusion and control. It stops on stale sensors,
keeps the stopping distance within the free distance of the local map, and still lets the robot
rotate, and reverse over floor that was observed free. A sensor is stale by the age of its last
valid reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.guard import FailingStage
from navfw.localmap import LocalMap
from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.signals import Frame, Odometry, Pose, SensorReading, Twist, wrap_angle

BLIND_ADVANCE = 0.3  # chosen
"""Longest advance with nothing of the path seen [m]."""
WEAK_SIGHT = 0.25  # chosen
"""Speed while little is seen of the path [m/s]."""
STALL, STALL_REST = 0.8, 1.0  # chosen
"""Time of wheels not following: stop [s]; standstill after a stall [s]."""

_DARK, BRIGHT = 8.0, 247.0  # chosen
"""Mean grey levels below and above which an image is invalid."""
_FLAT = 2.5  # chosen
"""Standard deviation [grey levels] below which an image has no contrast (noise has some)."""
MOVED = (0.02, 0.035)  # chosen
"""Displacement [m] and turn [rad] after which an unchanged image is frozen."""
MOVED_SLIGHTLY = 0.002  # chosen
"""Displacement [m] or turn [rad] after which an unchanged image is not used for flow."""


class Senses:
    """Follows the age [s] of each sensor's last valid reading, counted from its time stamp.

    A frame is invalid if it is dark, over-exposed, without contrast, or equal to the one before
    although the robot has moved; ``trouble`` says why the newest is, and is empty if it is valid.
    ``silence`` [s] is how long the encoders have not counted although commanded to move.

    ``seeing`` says whether the newest frame may be used for flow: not if it is unchanged after the
    slightest motion, although only a clear one counts as ``trouble``.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first reading."""
        self.camera_age = 0.0
        self.gyro_age = 0.0
        self.encoder_age = 0.0
        self.silence = 0.0
        self._last_count = 0.0
        self.trouble = ""
        self.seeing = True
        self._last_useful: float | None = None
        self._image: Image | None = None
        self._displacement = 0.0
        self._turn = 0.0
        self._pose: Odometry | None = None

    def update(self, reading: SensorReading, odometry: Odometry) -> None:
        """Update all ages by one reading and the ``odometry`` computed from it."""
        time = reading.time
        if self._last_useful is None:
            self._last_useful = self._last_count = time
        self.gyro_age = time - reading.inertial.time
        self.encoder_age = time - reading.encoders.time
        if not odometry.silent:
            self._last_count = time
        self.silence = time - self._last_count
        self._move(odometry)
        if reading.frame is not None:
            self.trouble = self._fault_of(reading.frame)
            self.seeing = (
                not self.trouble
                and self._displacement <= MOVED_SLIGHTLY
                and self._turn <= MOVED_SLIGHTLY
            )
            if not self.trouble:
                self._last_useful = reading.frame.time
        self.camera_age = time - self._last_useful

    def _move(self, odometry: Odometry) -> None:
        if self._pose is not None:
            before, now = self._pose.pose, odometry.pose
            ahead, aside = before.to_local(now.x, now.y)
            self._displacement += abs(ahead) + abs(aside)
            self._turn += abs(wrap_angle(now.yaw - before.yaw))
        self._pose = odometry

    def _fault_of(self, frame: Frame) -> str:
        """Return why ``frame`` is invalid; an empty text if it is valid."""
        image = frame.image
        # every fourth pixel is enough for mean and spread
        mean, spread = (value.item() for value in cv2.meanStdDev(image[::4, ::4]))
        if mean < _DARK:
            return "the camera image is dark"
        if mean > BRIGHT:
            return "the camera is over-exposed"
        if spread < _FLAT:
            return "the camera image has no contrast"
        moved = self._displacement > MOVED[0] or self._turn > MOVED[1]
        frozen = self._image is not None and np.array_equal(image, self._image)
        if frozen and moved:
            return "the camera image is frozen"
        if not frozen:
            self._image, self._displacement, self._turn = image, 0.0, 0.0
        return ""


Seconds = Annotated[float, Field(gt=0.0, le=60.0)]

_PROBE_PERIOD, _PROBE_TIME = 3.0, 0.3  # chosen
"""Period and duration [s] of the probes whether silent encoders count again."""


class SafetyParams(StrictModel):
    """Thresholds of the safety monitor."""

    latency: float = Field(0.1, ge=0.0, le=1.0, description="delay until the wheels brake [s]")
    gap: float = Field(
        0.02, ge=0.0, le=0.3, description="distance kept from an obstacle at standstill [m]"
    )
    slow: float = Field(
        0.12,
        gt=0.0,
        le=1.0,
        description="speed while a sensor is late, or the path has just changed [m/s]",
    )
    creep: float = Field(
        0.15, gt=0.0, le=0.5, description="speed into unobserved space; 0 with weak sight [m/s]"
    )
    start_creep: float = Field(
        0.3, ge=0.0, le=1.0, description="distance from the start over which it creeps [m]"
    )
    camera_slow: Seconds = Field(
        0.45, description="age of the last valid frame, or time that a stage fails: slow [s]"
    )
    camera_stop: Seconds = Field(
        1.2, description="age of the last valid frame, or time that a stage fails: stop [s]"
    )
    blind_reverse: float = Field(
        0.3, ge=0.0, le=2.0, description="longest reverse without a valid frame [m]"
    )
    gyro_slow: Seconds = Field(0.2, description="age of the last gyro reading: slow [s]")
    encoder_stop: Seconds = Field(0.5, description="age of the last encoder reading: stop [s]")
    probe: float = Field(
        0.05, gt=0.0, le=0.5, description="speed of a probe of silent encoders [m/s]"
    )
    give_up: float = Field(
        20.0, ge=1.0, le=60.0, description="failure time of a sensor or stage that ends the run [s]"
    )


@dataclass(frozen=True, slots=True)
class SafetyVerdict:
    """The twist that may be driven; ``reason`` says why it differs from the one given, or is empty.

    ``stopped`` is true if a forward speed was reduced to zero, or the command was not finite.
    """

    twist: Twist
    reason: str = ""
    stopped: bool = False


@dataclass(frozen=True, slots=True)
class PersistentFailure:
    """A failure that has lasted too long for the run to go on: of what, and why in words."""

    part: Literal["sensor", "sight", "stage"]
    reason: str


class SafetyMonitor:
    """Checks readings and limits twists at the control rate; it may only reduce speeds.

    Free distances come from ``local_map``. Before its first update nothing is known to be free, and
    the monitor allows no translation.
    """

    def __init__(
        self, robot: RobotModel, local_map: LocalMap, params: SafetyParams | None = None
    ) -> None:
        self.robot = robot
        self.local_map = local_map
        self.params = params or SafetyParams()
        self.senses = Senses()
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first reading of a run."""
        self.senses.reset()
        self._last_twist = Twist(0.0, 0.0)
        self._stalled_since: float | None = None
        self._rest_until = -math.inf
        self._last_time: float | None = None
        self._driven = 0.0
        self._blind_reverse = 0.0
        self._blind_advance = 0.0
        self._sightless_since: float | None = None
        self._failing: FailingStage | None = None

    def update(
        self,
        reading: SensorReading,
        odometry: Odometry,
        failing: tuple[FailingStage, ...] = (),
    ) -> None:
        """Check the newest reading with its odometry, and the stages that fail at present."""
        self.senses.update(reading, odometry)
        self._watch_sight(odometry)
        self._failing = min(failing, key=lambda stage: stage.since, default=None)
        self._watch_wheels(odometry)
        self._watch_way(odometry)

    def limit(self, twist: Twist, time: float, pose: Pose) -> SafetyVerdict:
        """Reduce ``twist`` to what is safe at ``time`` [s] from odom ``pose``."""
        verdict = self._limited(twist, time, pose)
        self._last_twist = verdict.twist
        return verdict

    def follow(self, twist: Twist) -> None:
        """Assume that the robot was given ``twist``, instead of the twist allowed last."""
        self._last_twist = twist

    def _limited(self, twist: Twist, time: float, pose: Pose) -> SafetyVerdict:
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            return SafetyVerdict(Twist(0.0, 0.0), "the command is not finite", stopped=True)
        robot = self.robot
        silent = self._silence_cap()
        v = min(max(twist.v, -min(robot.max_reverse, silent)), robot.max_v)
        w = min(max(twist.w, -robot.max_w), robot.max_w)
        reason = "" if (v, w) == (twist.v, twist.w) else "the command exceeds the drive's limits"
        encoders = (silent, "the wheel encoders do not count")
        caps = (encoders, self._source_cap(), self._stall_cap(time), self._sight_cap())
        for cap, why in caps:
            if v > cap:
                v, reason = cap, why
        if v > 0.0:
            free, observed = self.local_map.free_distance(pose, Twist(v, w))
            # a camera that has not moved yet sees nothing: it must move to see
            starting = self._driven < self.params.start_creep
            creep = self.params.creep if starting or not self.local_map.sight.weak else 0.0
            for allowed, why in (
                (self._braking_speed(free), "no room to stop"),
                (max(self._braking_speed(observed), creep), "unobserved space ahead"),
            ):
                if allowed < v:
                    v, reason = allowed, why
        elif v < 0.0:
            free, observed = self.local_map.free_distance(pose, Twist(v, w))
            # the footprint itself is observed: the rim must stay out of the unobserved
            allowed = self._braking_speed(min(free, observed - robot.disc_radius))
            if allowed < -v:
                v, reason = 0.0 - allowed, "no observed free space behind"
            # evidence decays, walls too: without frames the map gets worse with time
            if self._blind_reverse > self.params.blind_reverse:
                v, reason = 0.0, "longest reverse without a valid frame"
        if v == 0.0:
            room = self.local_map.free_turn(pose, w) - self.params.gap / robot.reach
            fastest = self._stopping_speed(room, robot.max_turn_accel)
            if abs(w) > fastest:
                w, reason = math.copysign(fastest, w), "no room to turn"
        return SafetyVerdict(Twist(v, w), reason, stopped=twist.v > 0.0 and v <= 0.0)

    @property
    def failure(self) -> PersistentFailure | None:
        """The failure that has lasted too long for the run to go on; None if there is none."""
        senses, patience = self.senses, self.params.give_up
        if senses.camera_age > patience:
            trouble = senses.trouble or "the camera is silent"
            return PersistentFailure("sensor", f"{trouble}, for {senses.camera_age:.0f} s")
        if max(senses.silence, senses.encoder_age) > patience:
            reason = f"the wheel encoders do not count, for {patience:.0f} s"
            return PersistentFailure("sensor", reason)
        sightless, failing = self._elapsed(self._sightless_since), self._failing
        if sightless > patience:
            reason = f"{self.local_map.sight.judgement.trouble}, for {sightless:.0f} s"
            return PersistentFailure("sight", reason)
        if failing is not None and self._elapsed(failing.since) > patience:
            what = f"{failing.plugin}: {failing.error}"
            return PersistentFailure("stage", f"{what}, for {self._elapsed(failing.since):.0f} s")
        return None

    def _elapsed(self, since: float | None) -> float:
        """Return the time [s] from ``since`` to the last reading; 0 without either."""
        return 0.0 if since is None or self._last_time is None else self._last_time - since

    def _silence_cap(self) -> float:
        """Return the top speed [m/s], forward or back, with silent encoders: 0 but for probes.

        Only a turning wheel can show that its encoder counts again, so the robot moves by a few
        millimetres now and then.
        """
        silence = self.senses.silence
        if silence <= 0.0:
            return math.inf
        return self.params.probe if silence % _PROBE_PERIOD > _PROBE_PERIOD - _PROBE_TIME else 0.0

    def _source_cap(self) -> tuple[float, str]:
        """Return the top forward speed [m/s] that sensors and stages allow, and why."""
        p, senses = self.params, self.senses
        if senses.encoder_age > p.encoder_stop:
            return 0.0, "the wheel encoders are silent"
        blind, trouble = senses.camera_age, senses.trouble
        if self._failing is not None and self._elapsed(self._failing.since) > blind:
            blind, trouble = self._elapsed(self._failing.since), f"{self._failing.plugin} fails"
        if blind > p.camera_stop:
            return 0.0, trouble or "the camera is silent"
        if blind > p.camera_slow:
            return p.slow, trouble or "the camera is late"
        if senses.gyro_age > p.gyro_slow:
            return p.slow, "the gyro is silent"
        return math.inf, ""

    def _sight_cap(self) -> tuple[float, str]:
        """Return the top forward speed [m/s] that the sight of the path allows, and why."""
        sight = self.local_map.sight
        trouble = sight.judgement.trouble
        if self._sightless_since is not None:
            return 0.0, trouble
        if sight.changed:
            return self.params.slow, "something has changed on the path"
        return (WEAK_SIGHT if sight.weak else math.inf), trouble

    def _stall_cap(self, time: float) -> tuple[float, str]:
        """Return 0 [m/s] for a moment after the wheels did not follow, else inf, and why."""
        if self._stalled_since is not None and time - self._stalled_since > STALL:
            self._rest_until = time + STALL_REST
            self._stalled_since = None
        return (0.0, "the wheels do not follow") if time < self._rest_until else (math.inf, "")

    def _watch_wheels(self, odometry: Odometry) -> None:
        commanded, measured = self._last_twist.v, odometry.twist.v
        if commanded > 0.08 and measured < 0.2 * commanded:
            if self._stalled_since is None:
                self._stalled_since = odometry.time
        else:
            self._stalled_since = None

    def _watch_way(self, odometry: Odometry) -> None:
        """Add up the distance driven, and the reverse since the last valid frame."""
        since = 0.0 if self._last_time is None else odometry.time - self._last_time
        self._last_time = odometry.time
        self._driven += abs(odometry.twist.v) * since
        blind = self.senses.camera_age > self.params.camera_stop
        reverse = max(-odometry.twist.v, 0.0) * since
        self._blind_reverse = self._blind_reverse + reverse if blind else 0.0

    def _watch_sight(self, odometry: Odometry) -> None:
        """Add up the advance without sight of the path, and note since when it is too long."""
        if not self.local_map.sight.none:
            self._blind_advance, self._sightless_since = 0.0, None
            return
        if self._last_time is not None:
            self._blind_advance += max(odometry.twist.v, 0.0) * (odometry.time - self._last_time)
        too_far = self._blind_advance >= BLIND_ADVANCE
        if too_far and self._sightless_since is None:
            self._sightless_since = odometry.time

    def _braking_speed(self, room: float) -> float:
        """Return the top speed [m/s] from which full braking ends ``gap`` before ``room`` [m]."""
        return self._stopping_speed(room - self.params.gap, self.robot.max_brake)

    def _stopping_speed(self, room: float, brake: float) -> float:
        """Return the top speed from which deceleration ``brake`` ends in ``room`` (METHOD 2.13).

        Solves ``v latency + v^2 / (2 brake) = room``, in metres or in radians.
        """
        lag = brake * self.params.latency
        return max(math.sqrt(lag * lag + 2.0 * brake * max(room, 0.0)) - lag, 0.0)
