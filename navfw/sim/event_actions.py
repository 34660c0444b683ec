"""Actions of mission events: faults of sensors and drive, changes of the world.

Each model is the value of one key of an event in a mission file, as in ``camera: {noisy: 12}``.
``InjectedFaults`` applies faults to readings and wheel speeds, ``navfw.sim.world_changes`` changes
the world.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import cv2
import numpy as np
from pydantic import Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.errors import did_you_mean
from navfw.numerics import Image
from navfw.signals import Encoders, Frame, Inertial
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.worldspec import Coordinate, Interval

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Length = Annotated[float, Field(ge=0.02, le=20.0)]


class _OneOf(StrictModel):
    """Exactly one of its keys is given; a flag may be given as a plain word: ``black``."""

    flags: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, data: Any) -> Any:
        if not isinstance(data, str):
            return data
        if data in cls.flags:
            return {data: True}
        if data in cls.model_fields:
            raise ValueError(f"{data} needs a value: {{{data}: ...}}")
        raise ValueError(f"unknown fault {data!r}: {did_you_mean(data, cls.model_fields)}")

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        keys = [key for key in type(self).model_fields if getattr(self, key) not in (None, False)]
        if len(keys) != 1:
            names = ", ".join(type(self).model_fields)
            got = " and ".join(keys) or "none of them"
            raise ValueError(f"expected exactly one of {names}; got {got}")
        return self


class CameraFault(_OneOf):
    """One fault of the camera."""

    flags: ClassVar[tuple[str, ...]] = ("frozen", "black", "over_exposed")

    dropped: Share | None = Field(None, description="share of the frames that are lost")
    frozen: bool = Field(False, description="every frame repeats the last image")
    black: bool = Field(False, description="the image holds sensor noise only")
    over_exposed: bool = Field(False, description="exposure six times too high")
    noisy: Annotated[float, Field(gt=0.0, le=100.0)] | None = Field(
        None, description="standard deviation of additional noise [grey levels]"
    )
    blurred: Annotated[float, Field(gt=0.0, le=20.0)] | None = Field(
        None, description="Gaussian blur, sigma [px]"
    )
    latency: Annotated[float, Field(gt=0.0, le=10.0)] | None = Field(
        None, description="delay of the frames [s]"
    )
    hfov_error: Annotated[float, Field(ge=-0.5, le=0.5)] | None = Field(
        None, description="relative error: the true field of view is wider by this share"
    )


class GyroFault(_OneOf):
    """One fault of the gyro."""

    flags: ClassVar[tuple[str, ...]] = ("dropout",)

    dropout: bool = Field(False, description="no new readings: the last one repeats, with its time")
    bias_step: Annotated[float, Field(ge=-90.0, le=90.0)] | None = Field(
        None, description="bias added to the yaw rate [deg/s]"
    )


class EncoderFault(StrictModel):
    """A wheel encoder that stops counting."""

    dropout: Literal["left", "right", "both"] = Field(description="side of the encoder")


class WeakWheel(StrictModel):
    """A wheel that does not reach its commanded speed."""

    side: Literal["left", "right"]
    share: Share = Field(description="reached share of the commanded speed")


class Slippery(StrictModel):
    """Floor on which the wheels slip."""

    slip: float = Field(gt=0.0, le=0.9, description="share by which the wheels turn too far")


class LightChange(StrictModel):
    """Light that is dimmed or switched off."""

    share: Share = Field(description="remaining share of the light; 0: dark")


class Textureless(StrictModel):
    """Makes solids plain: those with a name, or the parts of walls within an area."""

    name: str | None = Field(None, description="name of a wall, box or cylinder")
    x: Interval | None = Field(None, description="area: x from, to [m]")
    y: Interval | None = Field(None, description="area: y from, to [m]")
    brightness: float = Field(
        150.0, ge=10.0, le=245.0, description="luminance instead of the texture [grey levels]"
    )

    @model_validator(mode="after")
    def _has_selection(self) -> Self:
        if self.name is None and self.x is None and self.y is None:
            raise ValueError("expected a name, or x or y of an area, or both")
        return self


class DoorChange(StrictModel):
    """Opens or closes a door of the world, as soon as the robot is clear of it."""

    name: str = Field(description="name of a door of the world")
    state: Literal["open", "closed"]


class Obstacle(StrictModel):
    """Adds a box or a cylinder, as soon as the robot is clear of its place.

    It needs floor under it: an obstacle ``ahead`` of the robot does not appear above a drop.
    """

    name: str = Field(
        "obstacle", min_length=1, max_length=60, description="name reported by contacts"
    )
    at: tuple[Coordinate, Coordinate] | None = Field(
        None, description="centre in the map frame [m]"
    )
    ahead: Length | None = Field(None, description="or distance in front of the robot [m]")
    size: tuple[Length, Length] | None = Field(
        None, description="box: edges along x, y at yaw 0 [m]"
    )
    radius: Length | None = Field(None, description="cylinder: radius [m]")
    height: Length = Field(1.0, description="[m]")
    yaw: float = Field(0.0, ge=-6.3, le=6.3, description="yaw of a box [rad]")
    texture: str = Field("stone", description="a texture of the world, or a stock texture")

    @model_validator(mode="after")
    def _one_position_one_shape(self) -> Self:
        for keys in (("at", "ahead"), ("size", "radius")):
            if sum(getattr(self, key) is not None for key in keys) != 1:
                raise ValueError(f"expected exactly one of {' and '.join(keys)}")
        return self

    def footprint(self, x: float, y: float) -> Shape:
        """Return the obstacle's outline in the plane with its centre at (x, y) [m]."""
        if self.size is None:
            return Circle(x, y, self.radius or 0.0)
        return Rectangle(x, y, 0.5 * self.size[0], 0.5 * self.size[1], self.yaw)


EventAction = (
    CameraFault
    | GyroFault
    | EncoderFault
    | WeakWheel
    | Slippery
    | LightChange
    | Textureless
    | DoorChange
    | Obstacle
)
"""An action of an event that the simulation carries out."""


_OVER_EXPOSURE = 6.0
"""Gain of an over-exposed image: it saturates every texture."""

ActionT = TypeVar("ActionT")


class InjectedFaults:
    """Applies the active faults, in the order in which they began.

    It draws from ``rng`` only for faults, so that the noise of a run without faults does not
    change.
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
        """Deactivate a fault; if two are equal, one stays active."""
        self._active.remove(fault)

    def _of(self, kind: type[ActionT]) -> list[ActionT]:
        active = self._active
        return [fault for fault in active if isinstance(fault, kind)] if active else []

    # --- the camera ---------------------------------------------------------------------------

    @property
    def light(self) -> float:
        """Remaining share of the light, 0 to 1."""
        return math.prod(fault.share for fault in self._of(LightChange))

    @property
    def hfov_error(self) -> float:
        """Relative error of the field of view: the true one is wider by this share."""
        return sum(fault.hfov_error or 0.0 for fault in self._of(CameraFault))

    def apply_optics(self, clean: Image, scale: float = 1.0) -> Image:
        """Apply blur, over-exposure and darkness to an image (height, width).

        ``scale`` is its focal length relative to that of the robot's camera.
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
        """Apply lost frames and latency: return the frame delivered at ``time`` [s], or None.

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
        """Apply dropouts to encoder counts; ticks during a dropout are lost permanently.

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
        """Return the reached wheel speeds [rad/s] for the commanded ``left`` and ``right``."""
        for fault in self._of(WeakWheel):
            left *= fault.share if fault.side == "left" else 1.0
            right *= fault.share if fault.side == "right" else 1.0
        return left, right
