"""What OFFIS says of the world: nearness, labels, situations, and who moves by itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.signals.geometry import Array

__all__ = ["Label", "MovingObject", "Percept", "Stixels"]


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
class MovingObject:
    """Something that moves by itself, seen at ``time`` [s]: its flow contradicts a world at rest.

    ``bearing`` (from ahead) and half its angular ``width`` [rad, left positive], as the camera sees
    it;
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


@dataclass(frozen=True, slots=True)
class Stixels:
    """What stands upright on the floor, seen at ``time`` [s] in columns of small cells.

    Arrays (n,), by column: ``slope`` [m/m] is how far left its ray leads per metre ahead,
    ``nearness`` [1/m] the inverse of the distance ahead of the camera, ``sigma`` [1/m] one standard
    deviation, ``confidence`` in [0, 1] is 0 where nothing is known to stand.
    """

    time: float
    slope: Array
    nearness: Array
    sigma: Array
    confidence: Array

    def explain(self) -> list[dict[str, float]]:
        """The columns that say anything, from left to right, as plain data."""
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
