"""Obstacles of known place: occupied discs of floor, and conflicts with moving obstacles."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.numerics.arrays import Array
from navfw.signals.immutable import freeze


@dataclass(frozen=True, slots=True)
class OccupiedDisc:
    """A round piece of floor that is occupied: centre (x, y) in odom and radius [m]."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class Conflicts:
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

    def __post_init__(self) -> None:
        freeze(self, "distance", "time", "approach")
