"""True obstacles around the robot: for behaviours that are marked ``oracle``, and no others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from navfw.signals import Array


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Obstacles at the robot's height, in base_link.

    ``edges`` (n, 2, 2) [m] are both ends of the sides of walls and boxes, ``discs`` (m, 3) x, y and
    radius [m] of cylinders, ``walkers`` (k, 5) x, y, radius [m] and velocity [m/s] of movers.
    """

    edges: Array
    discs: Array
    walkers: Array


class SurroundingsSource(Protocol):
    """A source of the true obstacles: the simulator, set by a mission."""

    def surroundings(self, reach: float) -> Surroundings:
        """The obstacles within ``reach`` [m] of the robot now."""
        ...
