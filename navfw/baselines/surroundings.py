"""What truly stands around the robot: for behaviours that are marked ``oracle``, and no others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from navfw.signals import Array

__all__ = ["Surroundings", "SurroundingsSource"]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """All that stands at the robot's height, in base_link.

    ``edges`` (n, 2, 2) [m] are both ends of the sides of walls and boxes, ``discs`` (m, 3) x, y and
    radius [m] of what is round, ``walkers`` (k, 5) x, y, radius [m] and velocity [m/s] of those who
    walk.
    """

    edges: Array
    discs: Array
    walkers: Array


class SurroundingsSource(Protocol):
    """Who knows what no robot knows: the simulator, on behalf of a mission."""

    def surroundings(self, reach: float) -> Surroundings:
        """What stands within ``reach`` [m] of the robot just now."""
        ...
