"""Random textures of generated worlds by role, all with contrast for the optical flow."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import numpy as np

from navfw.sim.textures import STOCK, stock_texture
from navfw.sim.worldspec import TextureSpec

Role = Literal["floor", "wall", "ceiling", "thing", "person"]
Style = Literal["plaster", "carpet", "wood", "stone", "panels"]

_STYLES: Mapping[Role, tuple[Style, ...]] = MappingProxyType(
    {
        "floor": ("carpet", "stone", "plaster", "wood"),
        "wall": ("plaster", "panels", "stone", "carpet"),
        "ceiling": ("plaster",),
        "thing": ("wood", "stone", "panels", "plaster", "carpet"),
        "person": ("carpet", "stone"),
    }
)
"""Styles by role."""
_BRIGHTNESS: Mapping[Role, tuple[float, float]] = MappingProxyType(
    {
        "floor": (110.0, 150.0),
        "wall": (120.0, 155.0),
        "ceiling": (160.0, 175.0),
        "thing": (95.0, 150.0),
        "person": (95.0, 140.0),
    }
)
"""Interval of the mean luminance [grey levels] by role."""
_MIN_DETAIL: Mapping[Role, float] = MappingProxyType({"floor": 0.045})
"""Finest detail [m] by role: coarser on floors, seen at a shallow angle, against aliasing."""


class Palette:
    """The textures of one world by name; ``draw`` adds one."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self.textures: dict[str, TextureSpec] = {}

    def draw(self, role: Role) -> str:
        """Add a random texture for a role; returns its name."""
        rng = self._rng
        name = f"{role}-{sum(known.startswith(role) for known in self.textures) + 1}"
        styles = _STYLES[role]
        tint = rng.uniform(0.62, 1.0, 3)
        red, green, blue = np.round(tint / tint.max(), 2).tolist()
        self.textures[name] = TextureSpec(
            style=styles[int(rng.integers(len(styles)))],
            seed=int(rng.integers(1_000_000)),
            contrast=round(float(rng.uniform(36.0, 48.0)), 1),
            brightness=round(float(rng.uniform(*_BRIGHTNESS[role])), 1),
            colour=(red, green, blue),
            finest=_MIN_DETAIL.get(role, 0.035),
        )
        return name

    def draw_many(self, role: Role, count: int) -> tuple[str, ...]:
        """Add ``count`` random textures for a role; returns their names."""
        return tuple(self.draw(role) for _ in range(count))

    def pick(self, names: tuple[str, ...]) -> str:
        """One of ``names`` at random."""
        return names[int(self._rng.integers(len(names)))]


def with_contrast(textures: Mapping[str, TextureSpec], contrast: float) -> dict[str, TextureSpec]:
    """``textures`` and the stock textures, all with ``contrast`` [grey levels].

    Brightness and colour stay, so that surfaces still differ from each other.
    """
    every = {name: stock_texture(name) for name in STOCK} | dict(textures)
    return {name: spec.model_copy(update={"contrast": contrast}) for name, spec in every.items()}
