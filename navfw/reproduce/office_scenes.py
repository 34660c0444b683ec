"""The paper's three situations in an office (Table 3), built as small worlds.

The paper's images have 108 x 144 pixels (rows x columns) and 10 x 15 vectors, which do not divide
them; the grid here covers the central 100 x 135 pixels of such an image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim.worldspec import (
    BoxSpec,
    CylinderSpec,
    OpeningSpec,
    TextureSpec,
    WallSpec,
    WorldSpec,
)

IMAGE = (108, 144)
"""Rows and columns of the paper's images [px]."""
ROWS, COLS = 10, 15
"""Size of the flow grid."""
STEP = 0.06
"""Forward motion [m] of the camera between two images."""
SPEED = 0.3
"""Speed [m/s] of the camera."""

_TEXTURES = {
    # seen at a grazing angle, where a finer texture would alias in images this small
    "tiles": TextureSpec(style="stone", seed=34, finest=0.12, colour=(0.85, 0.87, 0.9)),
    "lining": TextureSpec(style="panels", seed=31, colour=(0.95, 0.9, 0.8)),
    "boards": TextureSpec(style="wood", seed=32, brightness=110.0, colour=(0.9, 0.7, 0.5)),
    "cover": TextureSpec(style="plaster", seed=33, brightness=90.0, colour=(0.55, 0.65, 0.9)),
}


@dataclass(frozen=True, slots=True)
class OfficeScene:
    """One of the situations: world, pose of the camera, and ``paper``, the sentence it reports."""

    number: int
    title: str
    world: WorldSpec
    pose: Pose
    paper: str


def hand_held() -> RobotModel:
    """The paper's hand-held camera: level, 0.55 m above the floor, 65 degrees wide.

    Height and width of view are assumed; the paper does not give them.
    """
    whole = 0.5 * IMAGE[1] / math.tan(0.5 * math.radians(65.0))
    width, height = 9 * COLS, 10 * ROWS
    camera = CameraModel(
        width=width,
        height=height,
        hfov=2.0 * math.atan(0.5 * width / whole),
        mount_height=0.55,
        mount_forward=0.0,
    )
    return RobotModel(camera=camera, height=0.6)


def _corridor(name: str, *things: BoxSpec | CylinderSpec, end: float = 9.0) -> WorldSpec:
    """A corridor 2.4 m wide along x that ends in a wall with a door."""
    ring = ((0.05, -1.25), (11.95, -1.25), (11.95, 1.25), (0.05, 1.25), (0.05, -1.25))
    door = OpeningSpec(name="door", at=(end, 0.0), width=0.9)
    return WorldSpec(
        name=name,
        x=(0, 12),
        y=(-1.3, 1.3),
        floor="tiles",
        ceiling="ceiling",
        walls=(
            WallSpec(name="walls", points=ring, texture="lining"),
            WallSpec(
                name="end", points=((end, -1.2), (end, 1.2)), openings=(door,), texture="boards"
            ),
        ),
        boxes=tuple(t for t in things if isinstance(t, BoxSpec)),
        cylinders=tuple(t for t in things if isinstance(t, CylinderSpec)),
        textures=_TEXTURES,
    )


def _chair(x: float, y: float) -> tuple[BoxSpec | CylinderSpec, ...]:
    """An office chair seen from behind: a seat on a column, and its low back."""
    return (
        CylinderSpec(name="leg", at=(x, y), radius=0.05, height=0.38, texture="cover"),
        BoxSpec(name="seat", at=(x, y), size=(0.42, 0.42, 0.08), base=0.38, texture="cover"),
    )


def _room_with_door() -> WorldSpec:
    """A room with a door in the wall ahead, between two hanging shelves."""
    ring = ((0.05, -1.95), (7.95, -1.95), (7.95, 1.95), (0.05, 1.95), (0.05, -1.95))
    door = OpeningSpec(name="door", at=(4.0, 0.0), width=0.9)
    return WorldSpec(
        name="room with a door",
        x=(0, 8),
        y=(-2, 2),
        floor="tiles",
        ceiling="ceiling",
        walls=(
            WallSpec(name="walls", points=ring, texture="lining"),
            WallSpec(
                name="end", points=((4.0, -1.9), (4.0, 1.9)), openings=(door,), texture="plaster"
            ),
        ),
        boxes=(
            BoxSpec(
                name="left shelf", at=(3.8, 0.95), size=(0.3, 0.7, 0.8), base=0.7, texture="boards"
            ),
            BoxSpec(
                name="right shelf",
                at=(3.8, -0.95),
                size=(0.3, 0.7, 0.8),
                base=0.7,
                texture="boards",
            ),
        ),
        textures=_TEXTURES,
    )


SCENES = (
    OfficeScene(
        1,
        "along a corridor to a door, no obstacle",
        _corridor(
            "corridor to a door",
            BoxSpec(
                name="hanging cupboard",
                at=(3.2, 0.9),
                size=(0.9, 0.6, 0.9),
                base=0.62,
                texture="boards",
            ),
        ),
        Pose(1.6, 0.0, 0.0),
        "Layer1: nearest object is on upper left in middle distance; Layer2: nearest object is on"
        " upper left in middle distance; Front is a door or corridor; Floor in front",
    ),
    OfficeScene(
        2,
        "along a corridor, a chair lower left",
        _corridor("corridor with a chair", *_chair(2.5, 0.35)),
        Pose(1.6, 0.0, 0.0),
        "Layer1: nearest object is on lower left in near distance; Layer2: nearest object is on"
        " lower left in near distance; Front is a door or corner; Floor in front",
    ),
    OfficeScene(
        3,
        "to a door, no obstacle",
        _room_with_door(),
        Pose(2.2, 0.0, 0.0),
        "Layer1: nearest object is on upper right and on upper left in middle distance; Layer2:"
        " nearest object is on upper right in middle distance and on upper left in middle"
        " distance; Front is a door",
    ),
)
"""The situations of Table 3, each with the sentence of the paper's OFFIS."""
