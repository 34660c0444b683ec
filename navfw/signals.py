"""What passes between the rooms: small frozen dataclasses, one per arrow of the data flow.

Conventions (all of navfw): SI units and radians. Frames after REP-103/105: ``map``, ``odom`` and
``base_link`` have x forward, y left, z up, yaw counter-clockwise; ``camera_optical`` has z
forward, x right, y down. Image points are in pixels relative to the principal point (x right,
y down). Arrays over the grid have shape (rows, cols) with row 0 at the top of the image and column
0 at its left. Nearness is 1/Z [1/m], Z the depth along the optical axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

__all__ = [
    "Array",
    "Belief",
    "CameraMotion",
    "Command",
    "Encoders",
    "Explain",
    "FlowField",
    "Frame",
    "FramePair",
    "Image",
    "Inertial",
    "Label",
    "Mask",
    "Odometry",
    "Outlook",
    "PassageQuery",
    "PassageState",
    "Percept",
    "Pose",
    "Proposal",
    "SensorReading",
    "Sighting",
    "Twist",
    "Waypoint",
    "position_sigma",
    "wrap_angle",
]

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]


def wrap_angle(angle: float) -> float:
    """The same angle [rad] in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def position_sigma(covariance: Array) -> float:
    """The largest standard deviation [m], in any direction, by the (3, 3) of (x, y, yaw)."""
    return math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))


@dataclass(frozen=True, slots=True)
class Pose:
    """A planar pose: x, y [m] and yaw [rad, counter-clockwise] in a named frame (REP-105)."""

    x: float
    y: float
    yaw: float

    def to_local(self, x: float, y: float) -> tuple[float, float]:
        """The point (x, y) of this pose's parent frame, seen from this pose (x ahead, y left)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = x - self.x, y - self.y
        return c * dx + s * dy, -s * dx + c * dy

    def to_parent(self, x: float, y: float) -> tuple[float, float]:
        """The point (x, y) seen from this pose, in this pose's parent frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + c * x - s * y, self.y + s * x + c * y

    def compose(self, other: Pose) -> Pose:
        """``other``, given relative to this pose, in this pose's parent frame."""
        x, y = self.to_parent(other.x, other.y)
        return Pose(x, y, wrap_angle(self.yaw + other.yaw))

    def relative(self, other: Pose) -> Pose:
        """``other``, given in this pose's parent frame, seen from this pose."""
        x, y = self.to_local(other.x, other.y)
        return Pose(x, y, wrap_angle(other.yaw - self.yaw))


@dataclass(frozen=True, slots=True)
class Twist:
    """A unicycle velocity: v = linear.x [m/s] forward, w = angular.z [rad/s] counter-clockwise."""

    v: float
    w: float


# --- what the sensors give ---------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Frame:
    """One camera image: ``image`` (height, width) uint8 luminance, taken at ``time`` [s]."""

    time: float
    image: Image


@dataclass(frozen=True, slots=True)
class Inertial:
    """Rate gyro: angular velocity [rad/s] about base_link x, y, z (roll, pitch, yaw rate)."""

    time: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class Encoders:
    """Wheel encoders: ticks counted since power-on, signed, forward positive."""

    time: float
    left: int
    right: int


@dataclass(frozen=True, slots=True)
class SensorReading:
    """All that the stack may see at one control tick; ``frame`` only when the camera delivered.

    ``landmark_frame`` is a larger image at a lower rate for landmark recognition, when configured.
    """

    time: float
    inertial: Inertial
    encoders: Encoders
    frame: Frame | None = None
    landmark_frame: Frame | None = None


# --- egomotion and flow ------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Odometry:
    """Dead reckoning from encoders and gyro: pose in ``odom``, measured twist.

    ``still`` is true while neither wheel has turned for a moment: then the gyro's bias is estimated
    (``yaw_bias`` [rad/s], already removed from the pose and twist). ``silent`` is true while the
    encoders do not answer what the wheels are told, so that the way driven is a guess.
    """

    time: float
    pose: Pose
    twist: Twist
    yaw_bias: float
    still: bool
    silent: bool = False


@dataclass(frozen=True, slots=True)
class CameraMotion:
    """How the camera moved from a past frame to the current one.

    ``rotation`` (3, 3) turns vectors given in the past camera's axes into the current camera's
    axes; ``translation`` (3,) [m] is the camera's displacement, current minus past position, in
    the CURRENT camera's axes. A static point obeys ``X_now = rotation @ X_past - translation``.
    ``yaw_sigma`` [rad] and ``translation_sigma`` [m] are one standard deviation.
    """

    rotation: Array
    translation: Array
    dt: float
    yaw_sigma: float = 0.0
    translation_sigma: float = 0.0

    @property
    def baseline(self) -> float:
        """Length of the translation [m]."""
        return float(np.linalg.norm(self.translation))


@dataclass(frozen=True, slots=True)
class FramePair:
    """Two frames over a useful baseline, with the camera's motion between them."""

    past: Frame
    now: Frame
    motion: CameraMotion


@dataclass(frozen=True, slots=True)
class FlowField:
    """Optical flow on a regular sparse grid over the CURRENT image (paper sec 3).

    ``points`` (rows, cols, 2) [px, relative to the principal point] are the grid points in the
    current image; ``vectors`` (rows, cols, 2) [px] say how far each imaged point came since the
    past frame (``now - past``: forward motion makes vectors point away from the focus of
    expansion). ``confidence`` (rows, cols) in [0, 1]; 0 means the vector says nothing. ``sigma``
    (rows, cols) [px] is one standard deviation of a vector's components. ``derotated`` tells
    whether the part due to camera rotation has been removed. ``contradiction`` (rows, cols) in
    [0, 1], if known: how confidently a vector was found that nothing at rest can have.
    """

    time: float
    points: Array
    vectors: Array
    confidence: Array
    sigma: Array
    motion: CameraMotion
    derotated: bool = False
    contradiction: Array | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of the grid."""
        return self.confidence.shape[0], self.confidence.shape[1]


# --- OFFIS -------------------------------------------------------------------------------------


class Label(IntEnum):
    """What a grid cell shows, as far as its height above the floor tells (METHOD 2.8)."""

    UNKNOWN = 0
    """Too uncertain to say: never to be taken for free space."""
    FLOOR = 1
    """The floor the robot drives on."""
    OBSTACLE = 2
    """Stands higher than the floor and lower than the robot's top."""
    DROP = 3
    """Clearly below the floor: stairs down, a pit."""
    ABOVE = 4
    """Passes over the robot: ceiling, lintel, upper wall."""


@dataclass(frozen=True, slots=True)
class Mover:
    """Something that moves by itself, seen at ``time`` [s]: its flow contradicts a world at rest.

    ``bearing`` and half its angular ``width`` [rad, left positive] seen from the camera;
    ``distance`` [m] along the floor to where it stands, by its lowest seen part. What its vectors
    say of its velocity over the floor, along base_link's axes (ahead, left), is in information
    form: ``information`` (2, 2) [s^2/m^2] is the inverse of a covariance, singular where they say
    nothing, ``evidence`` (2,) [s/m] its product with the velocity.
    """

    time: float
    bearing: float
    width: float
    distance: float
    information: Array
    evidence: Array

    def velocity(self, usual: float = 0.4) -> tuple[float, float]:
        """(ahead, left) [m/s], given that things move as fast as ``usual`` [m/s, one sigma]."""
        prior = np.eye(2) / usual**2
        ahead, left = np.linalg.solve(self.information + prior, self.evidence).tolist()
        return ahead, left


@dataclass(frozen=True, slots=True)
class Percept:
    """What OFFIS makes of one flow field (paper sec 4 and 5).

    Metric part, arrays (rows, cols) on the flow's grid: ``nearness`` [1/m], ``sigma`` [1/m],
    ``confidence`` in [0, 1] and ``height`` [m above floor] of the seen point; ``points`` as in
    FlowField. ``label`` (rows, cols) int8: the values of ``Label``. A robot that does not translate
    sees nothing (``sees_depth`` is false).

    Fuzzy part: ``obstacles`` names per layer the region(s) of the nearest object with their
    distance term; ``quadrants`` holds for each of P1..P4 the degrees of near / middle / far;
    ``slopes`` the slope code of the left and right plane; ``situations`` the degree of each
    elementary situation of Table 1; ``sentence`` the paper's report. ``explanation`` is plain data:
    which rules fired, how strongly, on which numbers.
    """

    time: float
    points: Array
    nearness: Array
    sigma: Array
    confidence: Array
    height: Array
    label: npt.NDArray[np.int8]
    obstacles: Mapping[str, Mapping[str, str]]
    quadrants: Mapping[str, Mapping[str, float]]
    planes: Mapping[str, float]
    slopes: Mapping[str, str]
    situations: Mapping[str, float]
    floor_in_front: float
    sentence: str
    explanation: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sees_depth(self) -> bool:
        """Whether any cell knows its nearness."""
        return bool(self.confidence.any())

    def explain(self) -> dict[str, Any]:
        """Why it says so, as plain data: rules that fired, how strongly, from which numbers.

        Made on request: a percept that nobody asks costs nothing.
        """
        return {"sentence": self.sentence, **self.explanation}


# --- map, localiser, planner -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Sighting:
    """A landmark recognised in one image: bearing [rad, left positive] and range [m] in base_link.

    ``covariance`` (2, 2) is of (bearing, range); ``identity`` is the landmark's id in the map file.
    """

    time: float
    identity: str
    bearing: float
    range: float
    covariance: Array


@dataclass(frozen=True, slots=True)
class Belief:
    """Where the robot thinks it is: ``pose`` in ``map`` with ``covariance`` (3, 3) of (x, y, yaw).

    ``places`` gives the probability of each place of the topological map (may be empty).
    ``confidence`` in [0, 1] is the probability that the robot truly is within a metre of ``pose``.
    Where it is ``lost``, the localiser itself does not trust ``pose``: nothing should be planned
    from it. ``updates`` counts the landmark sightings that have gone into it so far.
    """

    time: float
    pose: Pose
    covariance: Array
    places: Mapping[str, float] = field(default_factory=dict)
    confidence: float = 1.0
    lost: bool = False
    updates: int = 0

    @property
    def sigma(self) -> float:
        """The largest standard deviation [m] of the position, in any direction."""
        return position_sigma(self.covariance)


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where to go next: x, y [m] in ``map``; passed when nearer than ``tolerance`` [m].

    ``place`` is the place's name, ``kind`` its kind in the map ("goal" for a mission goal);
    ``final`` marks the last waypoint of the present goal. ``width`` [m] is that of the passage
    that leads there, ``passage`` the names of the two places that it joins, as in the map.
    """

    x: float
    y: float
    tolerance: float
    place: str
    kind: str
    final: bool
    width: float = math.inf
    passage: tuple[str, str] | None = None

    @property
    def label(self) -> str:
        """What messages call it: the place's name, or the coordinates."""
        return self.place or f"({self.x:g}, {self.y:g})"


@dataclass(frozen=True, slots=True)
class PassageQuery:
    """A leg of the way ahead of which the planner wants to know whether it is open.

    ``passage`` are the names of the two places that it joins; the leg goes straight from ``start``
    to ``end`` (x, y) [m] in ``map`` through a passage ``width`` [m] wide.
    """

    passage: tuple[str, str]
    start: tuple[float, float]
    end: tuple[float, float]
    width: float = math.inf


PassageState = Literal["open", "closed", "unknown"]


@dataclass(frozen=True, slots=True)
class Outlook:
    """What the short-term memory says of the way ahead, up to a few metres (METHOD 4.3).

    ``passages`` are the queries that could be judged, in their order: "open" when a free way
    through the leg has been seen, "closed" when what has been seen leaves none, "unknown"
    otherwise. ``drops`` are points (x, y) [m] in ``map`` where the floor is missing.
    """

    time: float
    passages: tuple[tuple[PassageQuery, PassageState], ...] = ()
    drops: tuple[tuple[float, float], ...] = ()


# --- MOFIS and LOCOM ---------------------------------------------------------------------------


Explain = Callable[[int, int], Sequence[Mapping[str, Any]]]
"""Gives the rules that fired for the command at (row, column) of the grid, strongest first."""


def _no_rules(row: int, column: int) -> Sequence[Mapping[str, Any]]:
    return ()


@dataclass(frozen=True, slots=True)
class Proposal:
    """What one behaviour asks for, over the command grid (METHOD 3.6).

    ``applicability`` in [0, 1]; ``desirability`` and ``prohibition`` are (n_v, n_w) in [0, 1];
    ``reason`` is one line for a person. ``explain`` tells, when somebody asks, which rules fired.
    """

    applicability: float
    desirability: Array
    prohibition: Array
    reason: str
    explain: Explain = _no_rules


@dataclass(frozen=True, slots=True)
class Command:
    """The fused command: ``twist``, the behaviour that led it, and why.

    ``emergency`` asks LOCOM to brake as hard as it can. ``weights`` gives each behaviour's share.
    """

    time: float
    twist: Twist
    leader: str
    reason: str
    emergency: bool = False
    weights: Mapping[str, float] = field(default_factory=dict)
    explanation: Mapping[str, Any] = field(default_factory=dict)
