"""Results of vision: percepts of OFFIS, moving objects with their conflicts, stixels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.numerics.arrays import Array
from navfw.signals.immutability import Frozen


@dataclass(frozen=True, slots=True)
class OccupiedDisc:
    """A round piece of floor that is occupied: centre (x, y) in odom and radius [m]."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class Conflicts(Frozen):
    """Closest approach to moving obstacles for every command; arrays (n_v, n_w).

    ``distance`` [m] is the distance at closest approach, rim to rim, within the horizon; negative
    for an overlap. ``time`` [s] is the time until closest approach, or until contact. ``approach``
    [m] is by how much the command brings the robot nearer to a moving obstacle close by within a
    moment, if that obstacle stood. ``nearest`` [m] is the present distance of the nearest one.
    """

    distance: Array
    time: Array
    approach: Array
    nearest: float


class Label(IntEnum):
    """What a flow cell shows, by its height above the floor (METHOD 2.8)."""

    UNKNOWN = 0
    """Too uncertain; never to be taken for free space."""
    FLOOR = 1
    """The floor the robot drives on."""
    OBSTACLE = 2
    """Stands higher than the floor and lower than the robot's top."""
    DROP = 3
    """Clearly below the floor: stairs down, a pit."""
    ABOVE = 4
    """Passes over the robot: ceiling, lintel, upper wall."""


class Sight(IntEnum):
    """How well the camera shows the floor of the path ahead."""

    NOTHING = 0
    """Next to nothing of it is seen."""
    LITTLE = 1
    """So little is seen that only floor observed as such is free."""
    ENOUGH = 2
    """It is seen, or there is no judgement yet."""

    @property
    def trouble(self) -> str:
        """What a person should know about it; empty where it is good."""
        if self is Sight.ENOUGH:
            return ""
        seen = self.name.lower()
        return f"{seen} is seen of the path ahead: too little texture above the noise"


@dataclass(frozen=True, slots=True)
class MovingObject(Frozen):
    """A detection of an object that moves by itself, at ``time`` [s].

    ``bearing`` [rad from ahead, left positive] and half the angular ``width`` [rad] are seen from
    the camera; ``distance`` [m] is that of the foot point on the floor. The velocity over the
    floor, along base_link's axes (ahead, left), is in information form: ``information`` (2, 2)
    [s^2/m^2] is the inverse covariance, singular where it is not observable, ``evidence`` (2,)
    [s/m] its product with the velocity.
    """

    time: float
    bearing: float
    width: float
    distance: float
    information: Array
    evidence: Array

    def velocity(self, usual: float = 0.4) -> tuple[float, float]:
        """(ahead, left) [m/s] under a prior of zero mean and sigma ``usual`` [m/s] per axis."""
        prior = np.eye(2) / usual**2
        (xx, xy), (_, yy) = (self.information + prior).tolist()
        x, y = self.evidence.tolist()
        determinant = xx * yy - xy * xy
        return (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant


@dataclass(frozen=True, slots=True)
class Percept(Frozen):
    """OFFIS' interpretation of one flow field (paper sec 4 and 5).

    Metric part, arrays (rows, cols) on the flow's grid: ``nearness`` [1/m], ``sigma`` [1/m],
    ``confidence`` in [0, 1] and ``height`` [m above floor] of the seen point; ``points`` as in
    FlowField. ``label`` (rows, cols) int8: the values of ``Label``. Without
    translation no depth is observable (``sees_depth`` is false).

    Fuzzy part: ``obstacles`` names per layer the region(s) of the nearest object with their
    distance term; ``quadrants`` holds for each of P1..P4 (counter-clockwise from the upper right)
    the degrees of near / middle / far; ``planes`` those of P1-P2, P2-P3, P3-P4, P4-P1 being one;
    ``slopes`` the slope code of the left and right plane; ``situations`` the degree of each
    elementary situation of Table 1, among them door, corridor, corner, wall, left wall, right wall,
    unknown; ``sentence`` the paper's report. ``explanation`` is plain data: which rules fired.
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
        """The explanation as plain data, made on request: rules that fired, strengths, inputs."""
        return {"sentence": self.sentence, **self.explanation}


@dataclass(frozen=True, slots=True)
class Stixels(Frozen):
    """The nearest upright obstacle in each image column (stixel), at ``time`` [s].

    Arrays (n,), by column: ``slope`` [m/m] is the advance of the ray to the left per metre ahead,
    ``nearness`` [1/m] the inverse of the distance ahead of the camera, ``sigma`` [1/m] one standard
    deviation, ``confidence`` in [0, 1] is 0 where no obstacle is known.
    """

    time: float
    slope: Array
    nearness: Array
    sigma: Array
    confidence: Array

    def explain(self) -> list[dict[str, float]]:
        """The stixels with any confidence, from left to right, as plain data."""
        return [
            {
                "bearing_deg": math.degrees(math.atan(slope)),
                "ahead_m": 1.0 / nearness,
                "confidence": confidence,
            }
            for slope, nearness, confidence in zip(
                self.slope.tolist(), self.nearness.tolist(), self.confidence.tolist(), strict=True
            )
            if confidence > 0.0
        ]
