"""What may happen to the robot and its world during a mission, as an event of its file says it.

Each model is one kind of happening and belongs to one key of an event: ``camera: {noisy: 12}``.
``navfw.sim.injected_faults`` and ``navfw.sim.world_changes`` make them happen.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.errors import did_you_mean
from navfw.sim.shapes import Circle, Rectangle, Shape

__all__ = [
    "CameraFault",
    "DoorChange",
    "EncoderFault",
    "EventAction",
    "GyroFault",
    "LightChange",
    "Obstacle",
    "Slippery",
    "Textureless",
    "WeakWheel",
]


def _ascending(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] >= interval[1]:
        raise ValueError(f"must ascend: {interval[0]:g} is not below {interval[1]:g}")
    return interval


Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Interval = Annotated[tuple[Coordinate, Coordinate], AfterValidator(_ascending)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Length = Annotated[float, Field(ge=0.02, le=20.0)]
Side = Literal["left", "right"]


class _OneOf(StrictModel):
    """Exactly one of its keys; a key that is only true or false may stand alone: ``black``."""

    alone: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, data: Any) -> Any:
        if not isinstance(data, str):
            return data
        if data in cls.alone:
            return {data: True}
        if data in cls.model_fields:
            raise ValueError(f"{data} needs a value: {{{data}: ...}}")
        raise ValueError(f"unknown fault {data!r}: {did_you_mean(data, cls.model_fields)}")

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        given = [key for key in type(self).model_fields if getattr(self, key) not in (None, False)]
        if len(given) != 1:
            known = ", ".join(type(self).model_fields)
            got = " and ".join(given) or "none of them"
            raise ValueError(f"expected exactly one of {known}; got {got}")
        return self


class CameraFault(_OneOf):
    """One thing wrong with the camera's pictures."""

    alone: ClassVar[tuple[str, ...]] = ("frozen", "black", "over_exposed")

    dropped: Annotated[Share | None, Field(description="share of the frames that get lost")] = None
    frozen: Annotated[bool, Field(description="the last picture comes again and again")] = False
    black: Annotated[bool, Field(description="nothing but the sensor's noise")] = False
    over_exposed: Annotated[bool, Field(description="six times too bright")] = False
    noisy: Annotated[
        Annotated[float, Field(gt=0.0, le=100.0)] | None,
        Field(description="more noise, standard deviation [grey levels]"),
    ] = None
    blurred: Annotated[
        Annotated[float, Field(gt=0.0, le=20.0)] | None,
        Field(description="out of focus, sigma [px]"),
    ] = None
    latency: Annotated[
        Annotated[float, Field(gt=0.0, le=10.0)] | None,
        Field(description="frames come so much later [s]"),
    ] = None
    hfov_error: Annotated[
        Annotated[float, Field(ge=-0.5, le=0.5)] | None,
        Field(description="the true field of view is wider by this share"),
    ] = None


class GyroFault(_OneOf):
    """One thing wrong with the gyro."""

    alone: ClassVar[tuple[str, ...]] = ("dropout",)

    dropout: Annotated[bool, Field(description="no new readings: time and values stay")] = False
    bias_step: Annotated[
        Annotated[float, Field(ge=-90.0, le=90.0)] | None,
        Field(description="added to the yaw rate [deg/s]"),
    ] = None


class EncoderFault(StrictModel):
    """Encoders that do not count."""

    dropout: Annotated[
        Literal["left", "right", "both"], Field(description="whose count stands still")
    ]


class WeakWheel(StrictModel):
    """A wheel that does not reach the speed asked of it."""

    side: Side
    share: Annotated[Share, Field(description="of the speed asked that it reaches")]


class Slippery(StrictModel):
    """Floor on which the wheels turn further than the robot goes."""

    slip: Annotated[
        float, Field(gt=0.0, le=0.9, description="share that the wheels turn further than it goes")
    ]


class LightChange(StrictModel):
    """Lamps that go dim, or out."""

    share: Annotated[Share, Field(description="of the light that is left; 0: dark")]


class Textureless(StrictModel):
    """Walls or things that lose their texture: a stretch of wall within an area, or by name."""

    name: Annotated[str | None, Field(description="of a wall, box or cylinder")] = None
    x: Annotated[Interval | None, Field(description="what stands between these x [m]")] = None
    y: Annotated[Interval | None, Field(description="what stands between these y [m]")] = None
    brightness: Annotated[
        float, Field(ge=10.0, le=245.0, description="what it looks like [grey levels]")
    ] = 150.0

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if self.name is None and self.x is None and self.y is None:
            raise ValueError("expected a name, or x or y of an area, or both")
        return self


class DoorChange(StrictModel):
    """A door of the world that opens or closes; it waits until the robot is out of its way."""

    name: Annotated[str, Field(description="of a door of the world")]
    state: Literal["open", "closed"]


class Obstacle(StrictModel):
    """A box or a cylinder that stands there all at once; it waits until its place is free.

    Nothing stands over a hole in the floor: what is to appear ``ahead`` of the robot waits until it
    has floor in front of it.
    """

    name: Annotated[str, Field(min_length=1, max_length=60, description="contacts report it")] = (
        "obstacle"
    )
    at: Annotated[
        tuple[Coordinate, Coordinate] | None, Field(description="centre [m], in the map frame")
    ] = None
    ahead: Annotated[Length | None, Field(description="or so far in front of the robot [m]")] = None
    size: Annotated[
        tuple[Length, Length] | None, Field(description="a box: x, y [m] before yaw")
    ] = None
    radius: Annotated[Length | None, Field(description="a cylinder [m]")] = None
    height: Annotated[Length, Field(description="[m]")] = 1.0
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="of a box [rad]")] = 0.0
    texture: Annotated[str, Field(description="of the world's textures, or a stock one")] = "stone"

    @model_validator(mode="after")
    def _one_place_one_shape(self) -> Self:
        for keys in (("at", "ahead"), ("size", "radius")):
            if sum(getattr(self, key) is not None for key in keys) != 1:
                raise ValueError(f"expected exactly one of {' and '.join(keys)}")
        return self

    def footprint(self, x: float, y: float) -> Shape:
        """Its outline in the plan with its centre at (x, y) [m]."""
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
"""All that a simulation can make happen."""
