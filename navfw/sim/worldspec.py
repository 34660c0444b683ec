"""The specification of a world: the data models of ``world.yaml``.

``navfw.sim.world_check`` checks names and geometry, ``navfw.sim.worldfile`` reads a file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.config.yaml_text import KeyPath
from navfw.features.landmark_appearance import check_landmark_kind, landmark_kind


def _ascending(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] >= interval[1]:
        raise ValueError(f"must ascend: {interval[0]:g} is not below {interval[1]:g}")
    return interval


Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Point = tuple[Coordinate, Coordinate]
Interval = Annotated[tuple[Coordinate, Coordinate], AfterValidator(_ascending)]
Extent = Annotated[float, Field(ge=0.02, le=100.0)]
Name = Annotated[str, Field(min_length=1, max_length=60)]
Slope = Annotated[float, Field(ge=-1000.0, le=1000.0)]
"""A component of a vector of which only the direction counts."""
Channel = Annotated[float, Field(ge=0.0, le=1.0)]


MAX_CONTRAST = 60.0
"""Largest contrast of a texture [grey levels]: more would be clipped at black and white."""

Style = Literal[
    "plaster",
    "carpet",
    "wood",
    "stone",
    "panels",
    "concrete",
    "brick",
    "parquet",
    "rug",
    "roughcast",
]
"""Names of the patterns of textures."""

Look = Literal["plain", "photo"]
"""Names of the looks of generated worlds (see ``navfw.worldgen.looks``)."""

Role = Literal["floor", "wall", "ceiling", "thing", "person"]
"""The kind of surface that a texture is used for."""


class TextureSpec(StrictModel):
    """A texture without detail finer than the camera resolves: a seeded pattern, or a picture."""

    style: Style = Field(
        "plaster",
        description="pattern: shaped noise; from concrete on like photographs of a material",
    )
    seed: int = Field(0, ge=0, lt=2**32, description="seed of the pattern")
    contrast: float = Field(
        45.0,
        ge=0.0,
        le=MAX_CONTRAST,
        description="standard deviation of the luminance [grey levels]",
    )
    brightness: float = Field(135.0, ge=10.0, le=245.0, description="mean luminance [grey levels]")
    colour: tuple[Channel, Channel, Channel] = Field(
        (1.0, 1.0, 1.0), description="tint: red, green, blue in [0, 1]"
    )
    finest: float = Field(
        0.035,
        ge=0.005,
        le=0.5,
        description="size of the finest detail [m]: half its shortest wavelength",
    )
    picture: str | None = Field(
        None,
        min_length=1,
        max_length=400,
        description="PNG or JPEG file, relative to the world file, instead of a pattern",
    )
    size: float | None = Field(
        None,
        ge=0.1,
        le=20.0,
        description="width that the picture covers before it repeats [m]; none: 2 m",
    )

    @model_validator(mode="after")
    def _pattern_or_picture(self) -> Self:
        of_patterns = {"style", "seed", "contrast", "brightness", "colour"} & self.model_fields_set
        if self.picture is not None and of_patterns:
            raise ValueError(f"a picture has its own pattern: leave out {sorted(of_patterns)[0]}")
        if self.picture is None and self.size is not None:
            raise ValueError("size is for a picture: name one, or leave out size")
        return self


class SkirtingSpec(StrictModel):
    """Skirting boards: a strip along the foot of all walls, drawn on their faces."""

    height: float = Field(0.1, ge=0.02, le=1.0, description="[m]")
    texture: str = "wood"


class DoorFrameSpec(StrictModel):
    """Door frames: a strip beside and above all openings, and the wall's ends inside them."""

    width: float = Field(0.07, ge=0.02, le=0.5, description="[m]")
    texture: str = "wood"


class RoomSpec(StrictModel):
    """An axis-aligned rectangle of the floor with its own textures; it adds no solid."""

    name: Name
    x: Interval = Field(description="from, to [m]")
    y: Interval = Field(description="from, to [m]")
    floor: str | None = Field(None, description="texture; none: the world's")
    walls: str | None = Field(None, description="texture of the wall faces towards the room")
    ceiling: str | None = Field(None, description="texture; none: the world's")


class OpeningSpec(StrictModel):
    """A door gap in a wall."""

    name: Name
    at: Point = Field(description="centre of the gap, on the wall's centre line [m]")
    width: float = Field(ge=0.1, le=50.0, description="[m]")
    height: float = Field(2.05, ge=0.1, le=20.0, description="from the floor to the lintel [m]")


class WallSpec(StrictModel):
    """A wall along a polyline (closed when the last point equals the first), with openings."""

    name: Name
    points: tuple[Point, ...] = Field(min_length=2, description="centre line [m]")
    thickness: float = Field(0.1, ge=0.02, le=5.0, description="[m]")
    height: float = Field(2.4, ge=0.05, le=20.0, description="[m]")
    texture: str = Field("plaster", description="texture of faces without a room's")
    openings: tuple[OpeningSpec, ...] = ()


class DoorSpec(StrictModel):
    """A sliding door in an opening. Closed, it fills the gap; open, it is inside the wall."""

    name: Name
    opening: str = Field(description="name of its opening")
    state: Literal["open", "closed"] = "closed"
    texture: str = "wood"
    front: str | None = Field(None, description="texture stretched over its faces")


class BoxSpec(StrictModel):
    """A box, turned about the vertical axis; its underside is ``base`` above the floor."""

    name: Name
    at: Point = Field(description="centre [m]")
    size: tuple[Extent, Extent, Extent] = Field(description="edges along x, y, z at yaw 0 [m]")
    yaw: float = Field(0.0, ge=-6.3, le=6.3, description="[rad]")
    base: float = Field(0.0, ge=0.0, le=20.0, description="height of the underside [m]")
    texture: str = "wood"
    front: str | None = Field(None, description="texture stretched over its two longer sides")


class CylinderSpec(StrictModel):
    """An upright cylinder; its underside is ``base`` above the floor."""

    name: Name
    at: Point = Field(description="centre [m]")
    radius: float = Field(ge=0.01, le=50.0, description="[m]")
    height: float = Field(1.0, ge=0.02, le=20.0, description="[m]")
    base: float = Field(0.0, ge=0.0, le=20.0, description="height of the underside [m]")
    texture: str = "stone"


class MeshSpec(StrictModel):
    """Furniture from a file: a closed mesh (OBJ, STL), or the collision shapes of a URDF.

    The mesh's origin is ``base`` above the floor at ``at``.
    """

    name: Name
    file: str = Field(
        min_length=1,
        max_length=400,
        description="OBJ, STL or URDF file, relative to the world file",
    )
    at: Point = Field(description="place of its origin [m]")
    base: float = Field(0.0, ge=-20.0, le=20.0, description="height of its origin [m]")
    yaw: float = Field(0.0, ge=-6.3, le=6.3, description="[rad]")
    scale: float = Field(1.0, ge=1e-4, le=1000.0, description="metres per unit of the file")
    up: Literal["z", "y"] = Field("z", description="axis of the file that points up")
    texture: str = "wood"


class WalkerSpec(StrictModel):
    """A moving obstacle: an upright cylinder that follows a path (kinematic, nothing stops it).

    If it ``yields``, it waits while the robot is close in front of it.
    """

    name: Name
    path: tuple[Point, ...] = Field(
        min_length=2, max_length=1000, description="way points of a polyline [m]"
    )
    speed: float = Field(0.4, gt=0.0, le=3.0, description="[m/s]")
    walk: Literal["back-and-forth", "loop"] = Field(
        "back-and-forth", description="at the path's end: reverse, or go on to the first point"
    )
    yields: bool = Field(True, description="whether it waits for a robot in front of it")
    phase: float = Field(
        0.0, ge=0.0, lt=1.0, description="position at time 0, as a share of one round"
    )
    radius: float = Field(0.25, ge=0.02, le=5.0, description="[m]")
    height: float = Field(1.7, ge=0.05, le=20.0, description="[m]")
    texture: str = "carpet"

    @model_validator(mode="after")
    def _path_has_length(self) -> Self:
        closed = (*self.path, self.path[0])
        if any(a == b for a, b in pairwise(closed[: None if self.walk == "loop" else -1])):
            raise ValueError("two consecutive points of path are equal")
        return self


class LandmarkPlateSpec(StrictModel):
    """A visual landmark: a flat upright plate without collision shape.

    It is mounted on a wall or box, with its centre on the face, unless it is ``free``. A map lists
    the same landmark with the same kind, id, position and size.
    """

    name: Name
    kind: Annotated[
        str,
        AfterValidator(check_landmark_kind),
        Field(description="aruco: a marker on a white plate; or a plugin's"),
    ] = "aruco"
    id: int = Field(ge=0, le=1_000_000, description="unique within its kind")
    at: Point = Field(description="centre [m]")
    z: float = Field(0.35, ge=0.0, le=20.0, description="height of the centre [m]")
    yaw: float = Field(ge=-6.3, le=6.3, description="direction of its normal [rad]")
    size: float = Field(
        0.25,
        ge=0.05,
        le=3.0,
        description="side of the marker's black square, or of the picture [m]",
    )
    free: bool = Field(False, description="whether it stands without a wall or box behind it")

    @model_validator(mode="after")
    def _id_in_range(self) -> Self:
        ids = landmark_kind(self.kind).ids
        if self.id >= ids:
            raise ValueError(
                f"landmarks of kind {self.kind} have ids 0 to {ids - 1}, got {self.id}"
            )
        return self


class DropSpec(StrictModel):
    """An axis-aligned hole in the floor: a pit, or with ``steps`` a flight of stairs down."""

    name: Name
    x: Interval = Field(description="from, to [m]")
    y: Interval = Field(description="from, to [m]")
    depth: float = Field(1.0, ge=0.05, le=10.0, description="depth of its lowest tread [m]")
    steps: int = Field(
        0, ge=0, le=60, description="number of treads, the last at full depth; 0: a pit"
    )
    down: Literal["east", "west", "north", "south"] = Field(
        "east", description="direction of descent (east: along x, north: along y)"
    )
    texture: str = Field("stone", description="texture of the treads")
    walls: str = Field("dark", description="texture of the sides and risers")


class LightSpec(StrictModel):
    """A directional and an ambient light; their sum is about 1 for a well exposed image.

    With ``soft``, light comes from straight above, whatever the direction; surfaces are darker
    where walls, furniture and floor meet.
    """

    soft: bool = Field(False, description="whether light from above has soft shadows")
    direction: tuple[Slope, Slope, Slope] = Field(
        (0.4, -0.55, 1.0), description="vector towards the directional light"
    )
    ambient: float = Field(0.68, ge=0.0, le=2.0, description="ambient intensity")
    diffuse: float = Field(0.35, ge=0.0, le=2.0, description="directional intensity")

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if not any(self.direction):
            raise ValueError("direction must not be [0, 0, 0]")
        return self


class WorldSpec(StrictModel):
    """A world: bounds, floor, walls, doors, furniture, moving obstacles, landmarks, appearance.

    Every wall, door, box, cylinder, mesh, mover, landmark and drop has a unique name, by which
    contacts and falls are reported. A texture is one of ``textures`` or of
    ``navfw.sim.textures.STOCK``.
    """

    name: Name
    description: str = ""
    x: Interval = Field(description="extent of the floor: from, to [m]")
    y: Interval = Field(description="extent of the floor: from, to [m]")
    floor: str = Field("carpet", description="texture")
    ceiling: str | None = Field(None, description="texture; none: no ceiling")
    rooms: tuple[RoomSpec, ...] = ()
    walls: tuple[WallSpec, ...] = ()
    doors: tuple[DoorSpec, ...] = ()
    boxes: tuple[BoxSpec, ...] = ()
    cylinders: tuple[CylinderSpec, ...] = ()
    meshes: tuple[MeshSpec, ...] = Field((), max_length=1000, description="furniture from files")
    movers: tuple[WalkerSpec, ...] = Field((), description="moving obstacles")
    landmarks: tuple[LandmarkPlateSpec, ...] = Field((), description="visual landmarks")
    drops: tuple[DropSpec, ...] = Field((), description="holes in the floor")
    textures: Mapping[str, TextureSpec] = Field(default_factory=dict)
    skirting: SkirtingSpec | None = Field(None, description="skirting boards of all walls")
    door_frames: DoorFrameSpec | None = Field(None, description="frames of all openings")
    light: LightSpec = LightSpec()
    hazards: tuple[Name, ...] = Field(
        (), description="what makes it hard; failures are counted by them"
    )
    may_overlap: bool = Field(
        False, description="whether solids may overlap (in imported worlds they do)"
    )

    def texture_uses(self) -> Iterator[tuple[KeyPath, str, Role]]:
        """Yield the textures of all surfaces: the key that names each, its name and role."""
        yield ("floor",), self.floor, "floor"
        if self.ceiling is not None:
            yield ("ceiling",), self.ceiling, "ceiling"
        thing: Mapping[str, Role] = {"texture": "thing"}
        sections: Mapping[str, Mapping[str, Role]] = {
            "rooms": {"floor": "floor", "walls": "wall", "ceiling": "ceiling"},
            "walls": {"texture": "wall"},
            "movers": {"texture": "person"},
            "doors": {"texture": "thing", "front": "thing"},
            "boxes": {"texture": "thing", "front": "thing"},
            **dict.fromkeys(("cylinders", "meshes"), thing),
            "drops": {"texture": "thing", "walls": "thing"},
        }
        for section, roles in sections.items():
            for i, item in enumerate(getattr(self, section)):
                for key, role in roles.items():
                    if (name := getattr(item, key)) is not None:
                        yield (section, i, key), name, role
        for trim in ("skirting", "door_frames"):
            if (strip := getattr(self, trim)) is not None:
                yield (trim, "texture"), strip.texture, "thing"
