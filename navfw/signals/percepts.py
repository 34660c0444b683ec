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
    """A round piece of occupied floor: centre (x, y) [m] in ``odom`` and radius [m]."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class Conflicts(Frozen):
    """Closest approach to moving obstacles for every command; arrays (n_v, n_w).

    ``distance`` [m] is the distance at closest approach, rim to rim, within the horizon; negative
    for an overlap. ``time`` [s] is the time until closest approach, or until contact. ``approach``
    [m] is how much nearer the command brings the robot, within a moment, to a moving obstacle close
    by, if that stood still. ``nearest`` [m] is the present distance of the nearest one.
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
    """The camera sees next to nothing of it."""
    LITTLE = 1
    """The camera sees so little of it that only floor observed as floor counts as free."""
    ENOUGH = 2
    """The camera sees it, or there is no judgement yet."""

    @property
    def trouble(self) -> str:
        """Message to a person if the camera sees too little; empty for ``ENOUGH``."""
        if self is Sight.ENOUGH:
            return ""
        seen = self.name.lower()
        return f"{seen} is seen of the path ahead: too little texture above the noise"


@dataclass(frozen=True, slots=True)
class MovingObject(Frozen):
    """A detection of an object that moves by itself, at ``time`` [s].

    ``bearing`` [rad from ahead, left positive] and ``width`` [rad], half the angle that the object
    covers, are seen from the camera; ``distance`` [m] is that of the foot point on the floor. The
    velocity over the floor, along base_link's axes (ahead, left), is in information form:
    ``information`` (2, 2) [s^2/m^2] is the inverse covariance, singular if the velocity is not
    observable, ``evidence`` (2,) [s/m] its product with the velocity.
    """

    time: float
    bearing: float
    width: float
    distance: float
    information: Array
    evidence: Array

    def velocity(self, usual: float = 0.4) -> tuple[float, float]:
        """Estimate (ahead, left) [m/s] with a prior of mean 0, sigma ``usual`` [m/s] per axis."""
        prior = np.eye(2) / usual**2
        (xx, xy), (_, yy) = (self.information + prior).tolist()
        x, y = self.evidence.tolist()
        determinant = xx * yy - xy * xy
        return (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant


@dataclass(frozen=True, slots=True)
class Percept(Frozen):
    """OFFIS' interpretation of one flow field (paper sec 4 and 5).

    Metric part, arrays (rows, cols) on the flow's grid: ``nearness`` [1/m] with standard deviation
    ``sigma`` [1/m], ``confidence`` in [0, 1], ``height`` [m above floor] of the seen point and
    ``label`` (int8, values of ``Label``); ``points`` as in FlowField. Without translation no depth
    is observable (``sees_depth`` is false).

    Fuzzy part, degrees in [0, 1]: ``obstacles`` names per layer the region(s) of the nearest object
    with their distance term; ``quadrants`` holds for each of P1..P4 (counter-clockwise from the
    upper right) the degrees of near, middle and far; ``planes`` those to which P1-P2, P2-P3, P3-P4,
    P4-P1 show one plane; ``slopes`` the slope codes of the left and right plane; ``situations`` the
    degrees of the elementary situations of Table 1; ``floor_in_front`` that of free floor ahead;
    ``sentence`` the paper's report. ``explanation`` is plain data: the rules that fired.
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
        """Whether the nearness of any cell is known."""
        return bool(self.confidence.any())

    def explain(self) -> dict[str, Any]:
        """Return the sentence, and the inputs and fired rules of all inferences, as plain data."""
        return {"sentence": self.sentence, **self.explanation}


@dataclass(frozen=True, slots=True)
class Stixels(Frozen):
    """The nearest upright obstacle in each image column (stixel), at ``time`` [s].

    Arrays (n,), by column: ``slope`` [m/m] is how far the column's ray goes to the left per metre
    ahead, ``nearness`` [1/m] the inverse of the distance ahead of the camera, ``sigma`` [1/m] its
    standard deviation, ``confidence`` in [0, 1] is 0 where no obstacle is known.
    """

    time: float
    slope: Array
    nearness: Array
    sigma: Array
    confidence: Array

    def explain(self) -> list[dict[str, float]]:
        """Return the stixels of confidence above 0, in the order of the columns, as plain data."""
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
