"""Surfaces of generated worlds: the textures of a palette, by role, and looks that replace them.

A look gives the same geometry other surfaces, by the role of each texture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, get_args

import numpy as np

from navfw.sim import worldspec
from navfw.sim.textures import STOCK
from navfw.sim.worldspec import Role

Interval = tuple[float, float]

_NOISE: Mapping[Role, tuple[tuple[worldspec.Style, ...], Interval]] = MappingProxyType(
    {
        "floor": (("carpet", "stone", "plaster", "wood"), (110.0, 150.0)),
        "wall": (("plaster", "panels", "stone", "carpet"), (120.0, 155.0)),
        "ceiling": (("plaster",), (160.0, 175.0)),
        "thing": (("wood", "stone", "panels", "plaster", "carpet"), (95.0, 150.0)),
        "person": (("carpet", "stone"), (95.0, 140.0)),
    }
)
"""Styles, and the interval of the mean luminance [grey levels], by role."""


class Palette:
    """The textures of one world by name, drawn at random."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self.textures: dict[str, worldspec.TextureSpec] = {}

    def draw(self, role: Role) -> str:
        """Add a random texture for a role; return its name."""
        rng = self._rng
        name = f"{role}-{sum(other.startswith(role) for other in self.textures) + 1}"
        styles, brightness = _NOISE[role]
        tint = rng.uniform(0.62, 1.0, 3)
        red, green, blue = np.round(tint / tint.max(), 2).tolist()
        self.textures[name] = worldspec.TextureSpec(
            style=styles[int(rng.integers(len(styles)))],
            seed=int(rng.integers(1_000_000)),
            contrast=round(float(rng.uniform(36.0, 48.0)), 1),
            brightness=round(float(rng.uniform(*brightness)), 1),
            colour=(red, green, blue),
            # coarser on floors, seen at a shallow angle, against aliasing
            finest=0.045 if role == "floor" else 0.035,
        )
        return name

    def draw_many(self, role: Role, count: int) -> tuple[str, ...]:
        """Add ``count`` random textures for a role; return their names."""
        return tuple(self.draw(role) for _ in range(count))

    def pick(self, names: Sequence[str]) -> str:
        """Return one of ``names`` at random."""
        return names[int(self._rng.integers(len(names)))]


def with_contrast(world: worldspec.WorldSpec, contrast: float) -> worldspec.WorldSpec:
    """Return ``world`` with ``contrast`` [grey levels] of all textures, stock textures included.

    Brightness and colour are kept, so that surfaces still differ from each other.
    """
    every = {**STOCK, **world.textures}
    changed = {n: spec.model_copy(update={"contrast": contrast}) for n, spec in every.items()}
    return world.model_copy(update={"textures": changed})


LOOKS: tuple[worldspec.Look, ...] = get_args(worldspec.Look)

Colour = tuple[float, float, float]

_STREAM = 0x100C
"""Spawn key of the random stream of looks; other uses of the seed have others."""
_TRIM = "trim"
"""Name of the texture of skirting boards and door frames."""


class _Surface(NamedTuple):
    """A pattern with intervals of contrast and mean luminance [grey levels], and its tint."""

    style: worldspec.Style
    contrast: Interval
    brightness: Interval
    colour: Colour


_WHITE: Colour = (1.0, 0.98, 0.94)
_PAINTS: tuple[Colour, ...] = (_WHITE, (1.0, 0.95, 0.82), (0.88, 0.96, 1.0), (0.9, 1.0, 0.9))
_OAK: Colour = (1.0, 0.8, 0.55)
_PLAIN: Mapping[Role, tuple[_Surface, ...]] = MappingProxyType(
    {
        # vinyl, felt and laminate have grain; paint has next to none
        "floor": (
            _Surface("carpet", (14.0, 20.0), (95.0, 130.0), (0.85, 0.9, 1.0)),
            _Surface("plaster", (14.0, 20.0), (100.0, 135.0), (1.0, 0.97, 0.9)),
            _Surface("wood", (14.0, 20.0), (105.0, 140.0), _OAK),
        ),
        "wall": tuple(_Surface("plaster", (2.0, 4.0), (165.0, 195.0), p) for p in _PAINTS),
        "ceiling": (_Surface("plaster", (2.0, 4.0), (200.0, 215.0), _WHITE),),
        "thing": (
            _Surface("wood", (8.0, 14.0), (85.0, 150.0), _OAK),
            _Surface("wood", (8.0, 14.0), (60.0, 90.0), (0.9, 0.65, 0.45)),
            _Surface("carpet", (8.0, 14.0), (70.0, 120.0), (0.7, 0.8, 1.0)),
        ),
        "person": (_Surface("carpet", (14.0, 24.0), (60.0, 120.0), (0.7, 0.75, 1.0)),),
    }
)
_PHOTO: Mapping[Role, tuple[_Surface, ...]] = MappingProxyType(
    {
        "floor": (
            _Surface("parquet", (16.0, 24.0), (110.0, 145.0), _OAK),
            _Surface("concrete", (11.0, 16.0), (120.0, 155.0), (0.96, 0.97, 1.0)),
            _Surface("rug", (14.0, 20.0), (85.0, 125.0), (0.8, 0.85, 1.0)),
        ),
        "wall": (
            _Surface("roughcast", (9.0, 13.0), (150.0, 185.0), _WHITE),
            _Surface("concrete", (11.0, 16.0), (130.0, 165.0), (0.96, 0.97, 1.0)),
            _Surface("brick", (20.0, 28.0), (100.0, 130.0), (1.0, 0.7, 0.56)),
        ),
        "ceiling": (_Surface("roughcast", (6.0, 9.0), (190.0, 205.0), _WHITE),),
        "thing": (
            _Surface("parquet", (14.0, 22.0), (85.0, 140.0), _OAK),
            _Surface("rug", (14.0, 20.0), (80.0, 120.0), (1.0, 0.75, 0.7)),
            _Surface("concrete", (11.0, 16.0), (110.0, 150.0), (0.96, 0.97, 1.0)),
        ),
        "person": (_Surface("rug", (16.0, 24.0), (70.0, 120.0), (0.7, 0.75, 1.0)),),
    }
)
_SURFACES: Mapping[worldspec.Look, Mapping[Role, tuple[_Surface, ...]]] = MappingProxyType(
    {"plain": _PLAIN, "photo": _PHOTO}
)


def with_look(world: worldspec.WorldSpec, look: worldspec.Look, seed: int) -> worldspec.WorldSpec:
    """Return ``world`` with surfaces of that look, drawn by ``seed``; its solids are the same.

    ``plain``: walls painted in one colour, with skirting boards and door frames. ``photo``:
    patterns like photographs of materials (``navfw.sim.textures``).
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_STREAM,)))
    roles: dict[str, Role] = {}
    for _, name, role in world.texture_uses():
        roles.setdefault(name, role)
    # textures that nothing uses yet may be those of obstacles that appear
    for name in (*world.textures, *STOCK):
        roles.setdefault(name, "thing")
    textures = {name: _drawn(rng, look, role) for name, role in roles.items()}
    changes: dict[str, object] = {"textures": textures}
    if look == "plain":
        bright = float(rng.integers(2)) * 170.0 + 50.0
        trim = worldspec.TextureSpec(contrast=2.0, brightness=bright, colour=_WHITE)
        changes["textures"] = {**textures, _TRIM: trim}
        height = round(float(rng.uniform(0.08, 0.12)), 3)
        changes["skirting"] = worldspec.SkirtingSpec(height=height, texture=_TRIM)
        changes["door_frames"] = worldspec.DoorFrameSpec(texture=_TRIM)
    return world.model_copy(update=changes)


def _drawn(rng: np.random.Generator, look: worldspec.Look, role: Role) -> worldspec.TextureSpec:
    """Return a random texture of a look for a role."""
    surfaces = _SURFACES[look][role]
    surface = surfaces[int(rng.integers(len(surfaces)))]
    return worldspec.TextureSpec(
        style=surface.style,
        seed=int(rng.integers(1_000_000)),
        contrast=round(float(rng.uniform(*surface.contrast)), 1),
        brightness=round(float(rng.uniform(*surface.brightness)), 1),
        colour=surface.colour,
        finest=0.035 if role == "floor" else 0.025,
    )
