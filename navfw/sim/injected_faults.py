"""What is wrong with sensors and drive just now: it stands between what is and what is read."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import TypeVar

import cv2
import numpy as np

from navfw.signals import Encoders, Frame, Image, Inertial
from navfw.sim.event_actions import (
    CameraFault,
    EncoderFault,
    EventAction,
    GyroFault,
    LightChange,
    Slippery,
    WeakWheel,
)

__all__ = ["InjectedFaults"]

_OVER_EXPOSURE = 6.0
"""How many times too much light saturates every texture."""

ActionT = TypeVar("ActionT")


class InjectedFaults:
    """The faults in force, in the order in which they came; without any, all passes unchanged.

    ``rng`` is drawn from by faults alone: a run without them has the noise it always had.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._active: list[EventAction] = []
        self._picture: Image | None = None
        self._waiting: deque[Frame] = deque()
        self._inertial: Inertial | None = None
        self._counted: Encoders | None = None
        self._missed = [0, 0]

    def begin(self, fault: EventAction) -> None:
        """From now on."""
        self._active.append(fault)

    def end(self, fault: EventAction) -> None:
        """No longer; of two equal ones, one stays."""
        self._active.remove(fault)

    def _of(self, kind: type[ActionT]) -> list[ActionT]:
        active = self._active
        return [fault for fault in active if isinstance(fault, kind)] if active else []

    # --- the camera ---------------------------------------------------------------------------

    @property
    def light(self) -> float:
        """Share of the light that is left."""
        return math.prod(fault.share for fault in self._of(LightChange))

    @property
    def hfov_error(self) -> float:
        """By which share the true field of view is wider than the robot believes."""
        return sum(fault.hfov_error or 0.0 for fault in self._of(CameraFault))

    def through_lens(self, clean: Image, finer: float = 1.0) -> Image:
        """What falls on the sensor, of what there is to see (height, width).

        ``finer`` tells how many pixels stand where the robot's camera usually has one.
        """
        image = clean
        for fault in self._of(CameraFault):
            if fault.blurred is not None:
                blurred = cv2.GaussianBlur(image, (0, 0), fault.blurred * finer)
                image = blurred.astype(np.uint8, copy=False)
            if fault.over_exposed:
                bright = cv2.convertScaleAbs(image, alpha=_OVER_EXPOSURE)
                image = bright.astype(np.uint8, copy=False)
            if fault.black:
                image = np.zeros_like(image)
        return image

    def from_sensor(self, image: Image) -> Image:
        """The picture as the camera's electronics give it on."""
        faults = self._of(CameraFault)
        for fault in faults:
            if fault.noisy is not None:
                noise = fault.noisy * self._rng.standard_normal(image.shape)
                image = np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)
        if self._picture is None or not any(fault.frozen for fault in faults):
            self._picture = image
        return self._picture

    def transport(self, time: float, frame: Frame | None) -> Frame | None:
        """The frame that arrives at ``time`` [s], when ``frame`` (if any) has been taken then.

        A late frame keeps the time at which it was taken. Frames never overtake each other.
        """
        faults = self._of(CameraFault)
        if not (faults or self._waiting):
            return frame
        for fault in faults:
            if fault.dropped is not None and frame is not None:
                frame = None if self._rng.random() < fault.dropped else frame
        latency = sum(fault.latency or 0.0 for fault in faults)
        if frame is not None and latency == 0.0:
            self._waiting.clear()
            return frame
        if frame is not None:
            self._waiting.append(frame)
        due = self._waiting and self._waiting[0].time + latency <= time + 1e-9
        return self._waiting.popleft() if due else None

    # --- gyro, encoders, drive ----------------------------------------------------------------

    def gyro(self, inertial: Inertial) -> Inertial:
        """What arrives of a gyro's reading."""
        faults = self._of(GyroFault)
        if not faults:
            self._inertial = inertial
            return inertial
        step = math.radians(sum(fault.bias_step or 0.0 for fault in faults))
        if step:
            inertial = dataclasses.replace(inertial, yaw_rate=inertial.yaw_rate + step)
        if self._inertial is None or not any(fault.dropout for fault in faults):
            self._inertial = inertial
        return self._inertial

    def encoders(self, encoders: Encoders) -> Encoders:
        """What is counted of the wheels' marks; those that pass a dead encoder are lost for good.

        >>> faults = InjectedFaults(np.random.default_rng(0))
        >>> dead = EncoderFault(dropout="left")
        >>> counts = [faults.encoders(Encoders(0.0, 0, 0))]
        >>> faults.begin(dead)
        >>> counts.append(faults.encoders(Encoders(0.1, 50, 50)))
        >>> faults.end(dead)
        >>> counts.append(faults.encoders(Encoders(0.2, 60, 60)))
        >>> [(count.left, count.right) for count in counts]
        [(0, 0), (0, 50), (10, 60)]
        """
        dead = {fault.dropout for fault in self._of(EncoderFault)}
        if not (dead or any(self._missed)):
            self._counted = encoders
            return encoders
        now = [encoders.left, encoders.right]
        for index, side in enumerate(("left", "right")):
            if self._counted is not None and dead & {side, "both"}:
                before = (self._counted.left, self._counted.right)[index]
                self._missed[index] = now[index] - before
        self._counted = Encoders(encoders.time, now[0] - self._missed[0], now[1] - self._missed[1])
        return self._counted

    @property
    def slip(self) -> float:
        """Share that the wheels turn further than the robot goes, beside the usual slip."""
        return sum(fault.slip for fault in self._of(Slippery))

    def wheels(self, left: float, right: float) -> tuple[float, float]:
        """The speeds [rad/s] that the wheels reach when ``left`` and ``right`` are asked."""
        for fault in self._of(WeakWheel):
            left *= fault.share if fault.side == "left" else 1.0
            right *= fault.share if fault.side == "right" else 1.0
        return left, right
