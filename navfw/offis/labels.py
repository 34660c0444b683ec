"""What a grid cell shows, as far as its height above the floor tells (METHOD 2.8)."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Label"]


class Label(IntEnum):
    """The kind of thing seen in one grid cell; the values of ``Percept.label`` (int8)."""

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
