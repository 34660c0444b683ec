"""Injected faults of sensors and drive, applied to readings and wheel speeds."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import TypeVar

import cv2
import numpy as np

from navfw.numerics import Image
from navfw.signals import Encoders, Frame, Inertial
from navfw.sim.event_actions import (
    CameraFault,
    EncoderFault,
    EventAction,
    GyroFault,
    LightChange,
    Slippery,
    WeakWheel,
)

_OVER_EXPOSURE = 6.0
"""Gain of an over-exposed image: it saturates every texture."""

ActionT = TypeVar("ActionT")


class InjectedFaults:
    """The active faults in the order in which they began; without any, nothing is changed.

    Only faults draw from ``rng``: the noise of a run without faults does not depend on them.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._active: list[EventAction] = []
        self._delivered: Image | None = None
        self._waiting: deque[Frame] = deque()
        self._inertial: Inertial | None = None
        self._counted: Encoders | None = None
        self._missed = [0, 0]

    def begin(self, fault: EventAction) -> None:
        """Activate a fault."""
        self._active.append(fault)

    def end(self, fault: EventAction) -> None:
        """Deactivate a fault; of two equal ones, one stays active."""
        self._active.remove(fault)

    def _of(self, kind: type[ActionT]) -> list[ActionT]:
        active = self._active
        return [fault for fault in active if isinstance(fault, kind)] if active else []

    # --- the camera ---------------------------------------------------------------------------

    @property
    def light(self) -> float:
        """Remaining share of the light."""
        return math.prod(fault.share for fault in self._of(LightChange))

    @property
    def hfov_error(self) -> float:
        """Relative error of the field of view: the true one is wider by this share."""
        return sum(fault.hfov_error or 0.0 for fault in self._of(CameraFault))

    def apply_optics(self, clean: Image, scale: float = 1.0) -> Image:
        """Apply blur, over-exposure and darkness to an image (height, width).

        ``scale`` is its resolution relative to that of the robot's camera.
        """
        image = clean
        for fault in self._of(CameraFault):
            if fault.blurred is not None:
                blurred = cv2.GaussianBlur(image, (0, 0), fault.blurred * scale)
                image = blurred.astype(np.uint8, copy=False)
            if fault.over_exposed:
                bright = cv2.convertScaleAbs(image, alpha=_OVER_EXPOSURE)
                image = bright.astype(np.uint8, copy=False)
            if fault.black:
                image = np.zeros_like(image)
        return image

    def apply_readout(self, image: Image) -> Image:
        """Apply additional noise and frozen frames to an exposed image (height, width)."""
        faults = self._of(CameraFault)
        for fault in faults:
            if fault.noisy is not None:
                noise = fault.noisy * self._rng.standard_normal(image.shape)
                image = np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)
        if self._delivered is None or not any(fault.frozen for fault in faults):
            self._delivered = image
        return self._delivered

    def transport(self, time: float, frame: Frame | None) -> Frame | None:
        """Apply lost frames and latency: the frame delivered at ``time`` [s], if any.

        ``frame`` is the one captured at that time, if any. A delayed frame keeps its time of
        capture. Frames are delivered in order.
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

    def apply_gyro(self, inertial: Inertial) -> Inertial:
        """Apply bias steps and dropouts to a gyro reading."""
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

    def apply_encoders(self, encoders: Encoders) -> Encoders:
        """Apply dropouts to encoder counts; ticks during a dropout are lost for good.

        >>> faults = InjectedFaults(np.random.default_rng(0))
        >>> dead = EncoderFault(dropout="left")
        >>> counts = [faults.apply_encoders(Encoders(0.0, 0, 0))]
        >>> faults.begin(dead)
        >>> counts.append(faults.apply_encoders(Encoders(0.1, 50, 50)))
        >>> faults.end(dead)
        >>> counts.append(faults.apply_encoders(Encoders(0.2, 60, 60)))
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
        """Slip in addition to that of the sensor model, as a share of the distance."""
        return sum(fault.slip for fault in self._of(Slippery))

    def apply_wheels(self, left: float, right: float) -> tuple[float, float]:
        """The wheel speeds [rad/s] reached for the commanded ``left`` and ``right``."""
        for fault in self._of(WeakWheel):
            left *= fault.share if fault.side == "left" else 1.0
            right *= fault.share if fault.side == "right" else 1.0
        return left, right
