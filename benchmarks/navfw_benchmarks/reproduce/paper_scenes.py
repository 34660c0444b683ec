"""The paper's three situations in an office (Table 3), built as small worlds.

The paper's images have 108 x 144 pixels (rows x columns) and 10 x 15 vectors, which do not divide
them; the grid here covers the central 100 x 135 pixels of such an image.

The paper's simulated trajectory (Fig. 16): go-to-XY through a room, with marked waypoints.

The figure's coordinates are not in the text, so the path is navfw's own: from a corner of the room
between its round and square objects to the door and through it. At waypoint 3 the next goal is far
to the left, and the robot turns at its highest rate, as in the paper. The other waypoints are where
it goes straight: one on each stretch before the turn, two or three on each after it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose, Twist
from navfw.sim.worldspec import BoxSpec, CylinderSpec, OpeningSpec, TextureSpec, WallSpec, WorldSpec
from navfw_benchmarks.bench.true_pairs import MovingPose

START = Pose(0.9, 2.3, 0.0)
"""Start pose of the robot in the map of ``paper-room``."""

PLACES = ((3.2, 2.3), (4.6, 1.4), (5.2, 3.0), (7.4, 3.2), (8.1, 2.2))
"""Goals (x, y) [m] of go-to-XY, in order."""

FAST_TURN = 0.9
"""Highest turning rate [rad/s], reached at waypoint 3."""

_SPEED, _REACHED, _GAIN, _TICK = 0.4, 0.12, 4.0, 1.0 / 60.0
_MAX_TIME = 60.0


WAYPOINTS = (
    (3.0, "goes on between the box and the column"),
    (8.0, "heads for the corner"),
    (11.3, "turns left, fast"),
    (13.2, "goes on along the partition"),
    (14.5, "comes up to the door, which is on its right"),
    (17.4, "goes through the door"),
    (18.7, "leaves the door behind"),
    (20.0, "goes to the wall of the next room"),
    (23.0, "goes to its corner"),
    (23.8, "arrives"),
)
"""The marked points, from number 1 on: time [s] at which the robot passes, and its action."""


def drive() -> list[MovingPose]:
    """The trajectory from ``START`` over all of ``PLACES``, in steps of 1/60 s."""
    pose, time = START, 0.0
    path: list[MovingPose] = []
    places = list(PLACES)
    while places and time < _MAX_TIME:
        x, y = pose.to_local(*places[0])
        if math.hypot(x, y) < _REACHED:
            places.pop(0)
            continue
        bearing = math.atan2(y, x)
        turn = min(max(_GAIN * bearing, -FAST_TURN), FAST_TURN)
        twist = Twist(_SPEED * max(math.cos(bearing), 0.45), turn)
        path.append(MovingPose(pose, twist))
        pose = path[-1].before(-_TICK)
        time += _TICK
    return path


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


def _room(
    name: str, length: float, half: float, end: tuple[float, str], *things: BoxSpec | CylinderSpec
) -> WorldSpec:
    """A room along x, ``length`` by twice ``half`` [m], across it a wall with a door.

    ``end`` is where that wall stands, x [m], and its texture.
    """
    at, texture = end
    x, y, y_end = length - 0.05, half - 0.05, half - 0.1
    ring = ((0.05, -y), (x, -y), (x, y), (0.05, y), (0.05, -y))
    door = OpeningSpec(name="door", at=(at, 0.0), width=0.9)
    return WorldSpec(
        name=name,
        x=(0, length),
        y=(-half, half),
        floor="tiles",
        ceiling="ceiling",
        walls=(
            WallSpec(name="walls", points=ring, texture="lining"),
            WallSpec(
                name="end", points=((at, -y_end), (at, y_end)), openings=(door,), texture=texture
            ),
        ),
        boxes=tuple(thing for thing in things if isinstance(thing, BoxSpec)),
        cylinders=tuple(thing for thing in things if isinstance(thing, CylinderSpec)),
        textures=_TEXTURES,
    )


def _chair(x: float, y: float) -> tuple[BoxSpec | CylinderSpec, ...]:
    """An office chair seen from behind: a seat on a column, and its low back."""
    return (
        CylinderSpec(name="leg", at=(x, y), radius=0.05, height=0.38, texture="cover"),
        BoxSpec(name="seat", at=(x, y), size=(0.42, 0.42, 0.08), base=0.38, texture="cover"),
    )


def _hanging(
    name: str, at: tuple[float, float], size: tuple[float, float, float], base: float
) -> BoxSpec:
    return BoxSpec(name=name, at=at, size=size, base=base, texture="boards")


_CORRIDOR = 12.0, 1.3, (9.0, "boards")
_OFFICE = 8.0, 2.0, (4.0, "plaster")
_SHELF = 0.3, 0.7, 0.8

SCENES = (
    OfficeScene(
        1,
        "along a corridor to a door, no obstacle",
        _room(
            "corridor to a door",
            *_CORRIDOR,
            _hanging("hanging cupboard", (3.2, 0.9), (0.9, 0.6, 0.9), 0.62),
        ),
        Pose(1.6, 0.0, 0.0),
        "Layer1: nearest object is on upper left in middle distance; Layer2: nearest object is on"
        " upper left in middle distance; Front is a door or corridor; Floor in front",
    ),
    OfficeScene(
        2,
        "along a corridor, a chair lower left",
        _room("corridor with a chair", *_CORRIDOR, *_chair(2.5, 0.35)),
        Pose(1.6, 0.0, 0.0),
        "Layer1: nearest object is on lower left in near distance; Layer2: nearest object is on"
        " lower left in near distance; Front is a door or corner; Floor in front",
    ),
    OfficeScene(
        3,
        "to a door, no obstacle",
        _room(
            "room with a door",
            *_OFFICE,
            _hanging("left shelf", (3.8, 0.95), _SHELF, 0.7),
            _hanging("right shelf", (3.8, -0.95), _SHELF, 0.7),
        ),
        Pose(2.2, 0.0, 0.0),
        "Layer1: nearest object is on upper right and on upper left in middle distance; Layer2:"
        " nearest object is on upper right in middle distance and on upper left in middle"
        " distance; Front is a door",
    ),
)
"""The situations of Table 3, each with the sentence of the paper's OFFIS."""
