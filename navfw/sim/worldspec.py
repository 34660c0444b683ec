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

    style: Annotated[
        Style,
        Field(description="pattern: shaped noise; from concrete on like photographs of a material"),
    ] = "plaster"
    seed: Annotated[int, Field(ge=0, lt=2**32, description="seed of the pattern")] = 0
    contrast: Annotated[
        float,
        Field(
            ge=0.0, le=MAX_CONTRAST, description="standard deviation of the luminance [grey levels]"
        ),
    ] = 45.0
    brightness: Annotated[
        float, Field(ge=10.0, le=245.0, description="mean luminance [grey levels]")
    ] = 135.0
    colour: Annotated[
        tuple[Channel, Channel, Channel], Field(description="tint: red, green, blue in [0, 1]")
    ] = (1.0, 1.0, 1.0)
    finest: Annotated[
        float,
        Field(
            ge=0.005,
            le=0.5,
            description="size of the finest detail [m]: half its shortest wavelength",
        ),
    ] = 0.035
    picture: Annotated[
        str | None,
        Field(
            min_length=1,
            max_length=400,
            description="PNG or JPEG file, relative to the world file, instead of a pattern",
        ),
    ] = None
    size: Annotated[
        float | None,
        Field(
            ge=0.1,
            le=20.0,
            description="width that the picture covers before it repeats [m]; none: 2 m",
        ),
    ] = None

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

    height: Annotated[float, Field(ge=0.02, le=1.0, description="[m]")] = 0.1
    texture: str = "wood"


class DoorFrameSpec(StrictModel):
    """Door frames: a strip beside and above all openings, and the wall's ends inside them."""

    width: Annotated[float, Field(ge=0.02, le=0.5, description="[m]")] = 0.07
    texture: str = "wood"


class RoomSpec(StrictModel):
    """An axis-aligned rectangle of the floor with its own textures; it adds no solid."""

    name: Name
    x: Annotated[Interval, Field(description="from, to [m]")]
    y: Annotated[Interval, Field(description="from, to [m]")]
    floor: Annotated[str | None, Field(description="texture; none: the world's")] = None
    walls: Annotated[
        str | None, Field(description="texture of the wall faces towards the room")
    ] = None
    ceiling: Annotated[str | None, Field(description="texture; none: the world's")] = None


class OpeningSpec(StrictModel):
    """A door gap in a wall."""

    name: Name
    at: Annotated[Point, Field(description="centre of the gap, on the wall's centre line [m]")]
    width: Annotated[float, Field(ge=0.1, le=50.0, description="[m]")]
    height: Annotated[
        float, Field(ge=0.1, le=20.0, description="from the floor to the lintel [m]")
    ] = 2.05


class WallSpec(StrictModel):
    """A wall along a polyline (closed when the last point equals the first), with openings."""

    name: Name
    points: Annotated[tuple[Point, ...], Field(min_length=2, description="centre line [m]")]
    thickness: Annotated[float, Field(ge=0.02, le=5.0, description="[m]")] = 0.1
    height: Annotated[float, Field(ge=0.05, le=20.0, description="[m]")] = 2.4
    texture: Annotated[str, Field(description="texture of faces without a room's")] = "plaster"
    openings: tuple[OpeningSpec, ...] = ()


class DoorSpec(StrictModel):
    """A sliding door in an opening. Closed, it fills the gap; open, it is inside the wall."""

    name: Name
    opening: Annotated[str, Field(description="name of its opening")]
    state: Literal["open", "closed"] = "closed"
    texture: str = "wood"
    front: Annotated[str | None, Field(description="texture stretched over its faces")] = None


class BoxSpec(StrictModel):
    """A box, turned about the vertical axis; its underside is ``base`` above the floor."""

    name: Name
    at: Annotated[Point, Field(description="centre [m]")]
    size: Annotated[
        tuple[Extent, Extent, Extent], Field(description="edges along x, y, z at yaw 0 [m]")
    ]
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="[rad]")] = 0.0
    base: Annotated[float, Field(ge=0.0, le=20.0, description="height of the underside [m]")] = 0.0
    texture: str = "wood"
    front: Annotated[
        str | None, Field(description="texture stretched over its two longer sides")
    ] = None


class CylinderSpec(StrictModel):
    """An upright cylinder; its underside is ``base`` above the floor."""

    name: Name
    at: Annotated[Point, Field(description="centre [m]")]
    radius: Annotated[float, Field(ge=0.01, le=50.0, description="[m]")]
    height: Annotated[float, Field(ge=0.02, le=20.0, description="[m]")] = 1.0
    base: Annotated[float, Field(ge=0.0, le=20.0, description="height of the underside [m]")] = 0.0
    texture: str = "stone"


class MeshSpec(StrictModel):
    """Furniture from a file: a closed mesh (OBJ, STL), or the collision shapes of a URDF.

    The mesh's origin is ``base`` above the floor at ``at``.
    """

    name: Name
    file: Annotated[
        str,
        Field(
            min_length=1,
            max_length=400,
            description="OBJ, STL or URDF file, relative to the world file",
        ),
    ]
    at: Annotated[Point, Field(description="place of its origin [m]")]
    base: Annotated[float, Field(ge=-20.0, le=20.0, description="height of its origin [m]")] = 0.0
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="[rad]")] = 0.0
    scale: Annotated[
        float, Field(ge=1e-4, le=1000.0, description="metres per unit of the file")
    ] = 1.0
    up: Annotated[Literal["z", "y"], Field(description="axis of the file that points up")] = "z"
    texture: str = "wood"


class WalkerSpec(StrictModel):
    """A moving obstacle: an upright cylinder that follows a path (kinematic, nothing stops it).

    If it ``yields``, it waits while the robot is close in front of it.
    """

    name: Name
    path: Annotated[
        tuple[Point, ...],
        Field(min_length=2, max_length=1000, description="way points of a polyline [m]"),
    ]
    speed: Annotated[float, Field(gt=0.0, le=3.0, description="[m/s]")] = 0.4
    walk: Annotated[
        Literal["back-and-forth", "loop"],
        Field(description="at the path's end: reverse, or go on to the first point"),
    ] = "back-and-forth"
    yields: Annotated[bool, Field(description="whether it waits for a robot in front of it")] = True
    phase: Annotated[
        float, Field(ge=0.0, lt=1.0, description="position at time 0, as a share of one round")
    ] = 0.0
    radius: Annotated[float, Field(ge=0.02, le=5.0, description="[m]")] = 0.25
    height: Annotated[float, Field(ge=0.05, le=20.0, description="[m]")] = 1.7
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
    id: Annotated[int, Field(ge=0, le=1_000_000, description="unique within its kind")]
    at: Annotated[Point, Field(description="centre [m]")]
    z: Annotated[float, Field(ge=0.0, le=20.0, description="height of the centre [m]")] = 0.35
    yaw: Annotated[float, Field(ge=-6.3, le=6.3, description="direction of its normal [rad]")]
    size: Annotated[
        float,
        Field(
            ge=0.05, le=3.0, description="side of the marker's black square, or of the picture [m]"
        ),
    ] = 0.25
    free: Annotated[
        bool, Field(description="whether it stands without a wall or box behind it")
    ] = False

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
    x: Annotated[Interval, Field(description="from, to [m]")]
    y: Annotated[Interval, Field(description="from, to [m]")]
    depth: Annotated[
        float, Field(ge=0.05, le=10.0, description="depth of its lowest tread [m]")
    ] = 1.0
    steps: Annotated[
        int, Field(ge=0, le=60, description="number of treads, the last at full depth; 0: a pit")
    ] = 0
    down: Annotated[
        Literal["east", "west", "north", "south"],
        Field(description="direction of descent (east: along x, north: along y)"),
    ] = "east"
    texture: Annotated[str, Field(description="texture of the treads")] = "stone"
    walls: Annotated[str, Field(description="texture of the sides and risers")] = "dark"


class LightSpec(StrictModel):
    """A directional and an ambient light; their sum is about 1 for a well exposed image.

    With ``soft``, light comes from straight above, whatever the direction; surfaces are darker
    where walls, furniture and floor meet.
    """

    soft: Annotated[bool, Field(description="whether light from above has soft shadows")] = False
    direction: Annotated[
        tuple[Slope, Slope, Slope], Field(description="vector towards the directional light")
    ] = (0.4, -0.55, 1.0)
    ambient: Annotated[float, Field(ge=0.0, le=2.0, description="ambient intensity")] = 0.68
    diffuse: Annotated[float, Field(ge=0.0, le=2.0, description="directional intensity")] = 0.35

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
    x: Annotated[Interval, Field(description="extent of the floor: from, to [m]")]
    y: Annotated[Interval, Field(description="extent of the floor: from, to [m]")]
    floor: Annotated[str, Field(description="texture")] = "carpet"
    ceiling: Annotated[str | None, Field(description="texture; none: no ceiling")] = None
    rooms: tuple[RoomSpec, ...] = ()
    walls: tuple[WallSpec, ...] = ()
    doors: tuple[DoorSpec, ...] = ()
    boxes: tuple[BoxSpec, ...] = ()
    cylinders: tuple[CylinderSpec, ...] = ()
    meshes: Annotated[
        tuple[MeshSpec, ...], Field(max_length=1000, description="furniture from files")
    ] = ()
    movers: Annotated[tuple[WalkerSpec, ...], Field(description="moving obstacles")] = ()
    landmarks: Annotated[tuple[LandmarkPlateSpec, ...], Field(description="visual landmarks")] = ()
    drops: Annotated[tuple[DropSpec, ...], Field(description="holes in the floor")] = ()
    textures: Mapping[str, TextureSpec] = Field(default_factory=dict)
    skirting: Annotated[SkirtingSpec | None, Field(description="skirting boards of all walls")] = (
        None
    )
    door_frames: Annotated[DoorFrameSpec | None, Field(description="frames of all openings")] = None
    light: LightSpec = LightSpec()
    hazards: Annotated[
        tuple[Name, ...], Field(description="what makes it hard; failures are counted by them")
    ] = ()
    may_overlap: Annotated[
        bool, Field(description="whether solids may overlap (in imported worlds they do)")
    ] = False

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
