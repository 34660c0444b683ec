"""Actions of mission events: faults of sensors and drive, changes of the world.

Each model is the value of one key of an event in a mission file, as in ``camera: {noisy: 12}``.
``navfw.sim.injected_faults`` and ``navfw.sim.world_changes`` apply them.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.errors import did_you_mean
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.worldspec import Coordinate, Interval

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Length = Annotated[float, Field(ge=0.02, le=20.0)]
Side = Literal["left", "right"]


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

    dropped: Annotated[Share | None, Field(description="share of the frames that are lost")] = None
    frozen: Annotated[bool, Field(description="every frame repeats the last image")] = False
    black: Annotated[bool, Field(description="the image holds sensor noise only")] = False
    over_exposed: Annotated[bool, Field(description="exposure six times too high")] = False
    noisy: Annotated[
        Annotated[float, Field(gt=0.0, le=100.0)] | None,
        Field(description="standard deviation of additional noise [grey levels]"),
    ] = None
    blurred: Annotated[
        Annotated[float, Field(gt=0.0, le=20.0)] | None,
        Field(description="Gaussian blur, sigma [px]"),
    ] = None
    latency: Annotated[
        Annotated[float, Field(gt=0.0, le=10.0)] | None,
        Field(description="delay of the frames [s]"),
    ] = None
    hfov_error: Annotated[
        Annotated[float, Field(ge=-0.5, le=0.5)] | None,
        Field(description="relative error: the true field of view is wider by this share"),
    ] = None


class GyroFault(_OneOf):
    """One fault of the gyro."""

    flags: ClassVar[tuple[str, ...]] = ("dropout",)

    dropout: Annotated[
        bool, Field(description="no new readings: the last one repeats, with its time")
    ] = False
    bias_step: Annotated[
        Annotated[float, Field(ge=-90.0, le=90.0)] | None,
        Field(description="bias added to the yaw rate [deg/s]"),
    ] = None


class EncoderFault(StrictModel):
    """A wheel encoder that stops counting."""

    dropout: Annotated[Literal["left", "right", "both"], Field(description="side of the encoder")]


class WeakWheel(StrictModel):
    """A wheel that does not reach its commanded speed."""

    side: Side
    share: Annotated[Share, Field(description="reached share of the commanded speed")]


class Slippery(StrictModel):
    """Floor on which the wheels slip."""

    slip: Annotated[
        float, Field(gt=0.0, le=0.9, description="share by which the wheels turn too far")
    ]


class LightChange(StrictModel):
    """Light that is dimmed or switched off."""

    share: Annotated[Share, Field(description="remaining share of the light; 0: dark")]


class Textureless(StrictModel):
    """Solids without texture: selected by name, or the parts of walls within an area."""

    name: Annotated[str | None, Field(description="name of a wall, box or cylinder")] = None
    x: Annotated[Interval | None, Field(description="area: x from, to [m]")] = None
    y: Annotated[Interval | None, Field(description="area: y from, to [m]")] = None
    brightness: Annotated[
        float,
        Field(ge=10.0, le=245.0, description="luminance instead of the texture [grey levels]"),
    ] = 150.0

    @model_validator(mode="after")
    def _has_selection(self) -> Self:
        if self.name is None and self.x is None and self.y is None:
            raise ValueError("expected a name, or x or y of an area, or both")
        return self


class DoorChange(StrictModel):
    """A door of the world that opens or closes, as soon as the robot is clear of it."""

    name: Annotated[str, Field(description="name of a door of the world")]
    state: Literal["open", "closed"]


class Obstacle(StrictModel):
    """A box or a cylinder that appears, as soon as the robot is clear of its place.

    It needs floor under it: an obstacle ``ahead`` of the robot does not appear above a drop.
    """

    name: Annotated[
        str, Field(min_length=1, max_length=60, description="name reported by contacts")
    ] = "obstacle"
    at: Annotated[
        tuple[Coordinate, Coordinate] | None, Field(description="centre in the map frame [m]")
    ] = None
    ahead: Annotated[Length | None, Field(description="or distance in front of the robot [m]")] = (
        None
    )
    size: Annotated[
        tuple[Length, Length] | None, Field(description="box: edges along x, y at yaw 0 [m]")
    ] = None
    radius: Annotated[Length | None, Field(description="cylinder: radius [m]")] = None
    height: Annotated[Length, Field(description="[m]")] = 1.0
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="yaw of a box [rad]")] = 0.0
    texture: Annotated[str, Field(description="a texture of the world, or a stock texture")] = (
        "stone"
    )

    @model_validator(mode="after")
    def _one_position_one_shape(self) -> Self:
        for keys in (("at", "ahead"), ("size", "radius")):
            if sum(getattr(self, key) is not None for key in keys) != 1:
                raise ValueError(f"expected exactly one of {' and '.join(keys)}")
        return self

    def footprint(self, x: float, y: float) -> Shape:
        """Its outline in the plane with its centre at (x, y) [m]."""
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
