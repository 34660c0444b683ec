"""Specification of a world: the data models of ``world.yaml``.

``navfw.sim.world_check`` checks names and geometry, ``navfw.sim.worldfile`` reads a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.landmark_appearance import ARUCO_IDS

__all__ = [
    "BoxSpec",
    "CylinderSpec",
    "DoorSpec",
    "DropSpec",
    "LandmarkPlateSpec",
    "LightSpec",
    "MoverSpec",
    "OpeningSpec",
    "RoomSpec",
    "TextureSpec",
    "WallSpec",
    "WorldSpec",
]


def _ascending(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] >= interval[1]:
        raise ValueError(f"must ascend: {interval[0]:g} is not below {interval[1]:g}")
    return interval


Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Point = tuple[Coordinate, Coordinate]
Interval = Annotated[tuple[Coordinate, Coordinate], AfterValidator(_ascending)]
Extent = Annotated[float, Field(ge=0.02, le=100.0)]
Name = Annotated[str, Field(min_length=1, max_length=60)]
Channel = Annotated[float, Field(ge=0.0, le=1.0)]


class TextureSpec(StrictModel):
    """A procedural texture: seeded smooth noise without detail finer than the camera resolves."""

    style: Annotated[
        Literal["plaster", "carpet", "wood", "stone", "panels"], Field(description="its pattern")
    ] = "plaster"
    seed: Annotated[int, Field(ge=0, description="seed of the pattern")] = 0
    contrast: Annotated[
        float, Field(ge=0.0, le=60.0, description="standard deviation [grey levels]")
    ] = 45.0
    brightness: Annotated[float, Field(ge=10.0, le=245.0, description="mean [grey levels]")] = 135.0
    colour: Annotated[
        tuple[Channel, Channel, Channel], Field(description="tint: red, green, blue in [0, 1]")
    ] = (1.0, 1.0, 1.0)
    finest: Annotated[
        float, Field(ge=0.005, le=0.5, description="size of the finest detail [m]")
    ] = 0.035


class RoomSpec(StrictModel):
    """An axis-parallel part of the floor with textures of its own; it adds no solid."""

    name: Name
    x: Annotated[Interval, Field(description="from, to [m]")]
    y: Annotated[Interval, Field(description="from, to [m]")]
    floor: Annotated[str | None, Field(description="texture")] = None
    walls: Annotated[str | None, Field(description="texture of the walls seen from inside")] = None
    ceiling: Annotated[str | None, Field(description="texture")] = None


class OpeningSpec(StrictModel):
    """A door gap in a wall."""

    name: Name
    at: Annotated[Point, Field(description="centre of the gap, on the wall's line [m]")]
    width: Annotated[float, Field(ge=0.1, le=50.0, description="[m]")]
    height: Annotated[float, Field(ge=0.1, le=20.0, description="under the lintel [m]")] = 2.05


class WallSpec(StrictModel):
    """A wall along a polyline (closed when the last point is the first), with openings."""

    name: Name
    points: Annotated[tuple[Point, ...], Field(min_length=2, description="the wall's line [m]")]
    thickness: Annotated[float, Field(ge=0.02, le=5.0, description="[m]")] = 0.1
    height: Annotated[float, Field(ge=0.05, le=20.0, description="[m]")] = 2.4
    texture: Annotated[str, Field(description="where no room says otherwise")] = "plaster"
    openings: tuple[OpeningSpec, ...] = ()


class DoorSpec(StrictModel):
    """A door leaf in an opening. Closed, it fills the gap; open, it has slid into the wall."""

    name: Name
    opening: Annotated[str, Field(description="name of the opening it belongs to")]
    state: Literal["open", "closed"] = "closed"
    texture: str = "wood"


class BoxSpec(StrictModel):
    """A box standing on the floor, or ``base`` above it."""

    name: Name
    at: Annotated[Point, Field(description="centre [m]")]
    size: Annotated[tuple[Extent, Extent, Extent], Field(description="x, y, z [m] before yaw")]
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="[rad]")] = 0.0
    base: Annotated[float, Field(ge=0.0, le=20.0, description="underside above the floor [m]")] = (
        0.0
    )
    texture: str = "wood"


class CylinderSpec(StrictModel):
    """An upright cylinder standing on the floor, or ``base`` above it."""

    name: Name
    at: Annotated[Point, Field(description="centre [m]")]
    radius: Annotated[float, Field(ge=0.01, le=50.0, description="[m]")]
    height: Annotated[float, Field(ge=0.02, le=20.0, description="[m]")] = 1.0
    base: Annotated[float, Field(ge=0.0, le=20.0, description="underside above the floor [m]")] = (
        0.0
    )
    texture: str = "stone"


class MoverSpec(StrictModel):
    """An upright cylinder that walks along a path, whatever is in its way (kinematic).

    One that ``yields`` stands still while the robot is near in front of it; the others walk on.
    """

    name: Name
    path: Annotated[
        tuple[Point, ...], Field(min_length=2, max_length=1000, description="corner points [m]")
    ]
    speed: Annotated[float, Field(gt=0.0, le=3.0, description="[m/s]")] = 0.4
    walk: Annotated[
        Literal["back-and-forth", "loop"],
        Field(description="at the path's end: turn round, or go straight on to the first point"),
    ] = "back-and-forth"
    yields: Annotated[bool, Field(description="whether it stops for a robot in front of it")] = True
    phase: Annotated[
        float, Field(ge=0.0, lt=1.0, description="where on its round it is at time 0")
    ] = 0.0
    radius: Annotated[float, Field(ge=0.02, le=5.0, description="[m]")] = 0.25
    height: Annotated[float, Field(ge=0.05, le=20.0, description="[m]")] = 1.7
    texture: str = "carpet"

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        closed = (*self.path, self.path[0])
        if any(a == b for a, b in pairwise(closed[: None if self.walk == "loop" else -1])):
            raise ValueError("two neighbouring points of path are in the same place")
        return self


class LandmarkPlateSpec(StrictModel):
    """A plate that a camera can recognise: flat, upright, in nobody's way.

    It hangs on a wall or box, with its centre on that one's face, unless it is ``free``. A map
    lists the same landmark with the same kind, id, place and size.
    """

    name: Name
    kind: Annotated[
        Literal["aruco", "poster"],
        Field(description="a marker of 4 x 4 modules on a white plate, or a picture"),
    ] = "aruco"
    id: Annotated[int, Field(ge=0, le=1_000_000, description="its own among those of its kind")]
    at: Annotated[Point, Field(description="centre [m]")]
    z: Annotated[float, Field(ge=0.0, le=20.0, description="centre above the floor [m]")] = 0.35
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="where it faces [rad]")]
    size: Annotated[
        float, Field(ge=0.05, le=3.0, description="side of the marker's black square [m]")
    ] = 0.25
    free: Annotated[bool, Field(description="whether it stands by itself")] = False

    @model_validator(mode="after")
    def _is_in_the_dictionary(self) -> Self:
        if self.kind == "aruco" and self.id >= ARUCO_IDS:
            raise ValueError(f"markers have ids 0 to {ARUCO_IDS - 1}, got {self.id}")
        return self


class DropSpec(StrictModel):
    """An axis-parallel hole in the floor: a pit, or with ``steps`` stairs down."""

    name: Name
    x: Annotated[Interval, Field(description="from, to [m]")]
    y: Annotated[Interval, Field(description="from, to [m]")]
    depth: Annotated[float, Field(ge=0.05, le=10.0, description="at its deepest [m]")] = 1.0
    steps: Annotated[
        int, Field(ge=0, le=60, description="treads, the last at the full depth; 0: a pit")
    ] = 0
    down: Annotated[
        Literal["east", "west", "north", "south"],
        Field(description="where its steps lead (east: along x, north: along y)"),
    ] = "east"
    texture: Annotated[str, Field(description="of what lies below")] = "stone"
    walls: Annotated[str, Field(description="texture of its sides and risers")] = "dark"


class LightSpec(StrictModel):
    """One directional light and an even one; their sum is about 1 for a well exposed image."""

    direction: Annotated[
        tuple[float, float, float], Field(description="where the light comes from")
    ] = (0.4, -0.55, 1.0)
    ambient: Annotated[float, Field(ge=0.0, le=2.0, description="share of the even light")] = 0.68
    diffuse: Annotated[float, Field(ge=0.0, le=2.0, description="share of the directed one")] = 0.35

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if not any(self.direction):
            raise ValueError("direction must not be [0, 0, 0]")
        return self


class WorldSpec(StrictModel):
    """A world: its bounds, floor, walls, doors and furniture, who walks there, and how it looks.

    Every wall, door, box, cylinder, mover, landmark and drop has a name of its own; contacts and
    falls are reported by it. Textures not listed under ``textures`` are the stock ones of
    ``navfw.sim.textures.STOCK``.
    """

    name: Name
    description: str = ""
    x: Annotated[Interval, Field(description="the floor from, to [m]")]
    y: Annotated[Interval, Field(description="the floor from, to [m]")]
    floor: Annotated[str, Field(description="texture")] = "carpet"
    ceiling: Annotated[str | None, Field(description="texture; none: open to the sky")] = None
    rooms: tuple[RoomSpec, ...] = ()
    walls: tuple[WallSpec, ...] = ()
    doors: tuple[DoorSpec, ...] = ()
    boxes: tuple[BoxSpec, ...] = ()
    cylinders: tuple[CylinderSpec, ...] = ()
    movers: Annotated[tuple[MoverSpec, ...], Field(description="who walks about")] = ()
    landmarks: Annotated[
        tuple[LandmarkPlateSpec, ...], Field(description="what a camera can recognise")
    ] = ()
    drops: Annotated[tuple[DropSpec, ...], Field(description="holes in the floor")] = ()
    textures: Mapping[str, TextureSpec] = Field(default_factory=dict)
    light: LightSpec = LightSpec()
    may_overlap: Annotated[
        bool, Field(description="whether solids may reach into each other (imported worlds do)")
    ] = False
