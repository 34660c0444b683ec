"""The shipped families of generated worlds, as plugins."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from navfw.interfaces import WorldFamily
from navfw.worldgen import clutter, corridors, maze, moving, poles, rooms
from navfw.worldgen.world_draft import WorldDraft


class Clutter(WorldFamily):
    """A walled area with boxes and cylinders, gaps from 1.2 down to 0.75 m."""

    name: ClassVar[str] = "clutter"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """One area; see ``navfw.worldgen.clutter``."""
        return clutter.build(rng, difficulty)


class Corridors(WorldFamily):
    """Bent and branching corridors 1.0 to 2.0 m wide with side doors and obstacles."""

    name: ClassVar[str] = "corridors"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """One network of corridors; see ``navfw.worldgen.corridors``."""
        return corridors.build(rng, difficulty)


class Maze(WorldFamily):
    """A grid maze with cells of 1.6 down to 1.1 m."""

    name: ClassVar[str] = "maze"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """One maze; see ``navfw.worldgen.maze``."""
        return maze.build(rng, difficulty)


class Moving(WorldFamily):
    """A hall with walking people, some of whom yield to the robot."""

    name: ClassVar[str] = "moving"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """One hall; see ``navfw.worldgen.moving``."""
        return moving.build(rng, difficulty)


class Poles(WorldFamily):
    """A field of thin poles between walls, as dense as BARN worlds."""

    name: ClassVar[str] = "poles"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """One field; see ``navfw.worldgen.poles``."""
        return poles.build(rng, difficulty)


class Rooms(WorldFamily):
    """Two to six furnished rooms, joined by doors 0.8 to 1.0 m wide."""

    name: ClassVar[str] = "rooms"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """One set of rooms; see ``navfw.worldgen.rooms``."""
        return rooms.build(rng, difficulty)
