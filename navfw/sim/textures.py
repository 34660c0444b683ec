"""Procedural textures: seeded, periodic, band-limited, with contrast for the optical flow.

The rasteriser, like TinyRenderer, samples textures by nearest neighbour without mipmaps: detail
finer than about two pixels at the working distance aliases and disturbs the flow (METHOD sec 0).
Every pattern is therefore low-pass filtered with a cutoff of half a cycle per ``finest`` metres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from navfw.numerics.products import product
from navfw.signals import Array, Image
from navfw.sim.material_patterns import (
    brick,
    concrete,
    parquet,
    roughcast,
    rug,
)
from navfw.sim.texture_spectra import (
    RESOLUTION,
    filtered,
    passed_band,
    spectral_noise,
)

if TYPE_CHECKING:
    from navfw.sim.worldspec import TextureSpec

_MAX_WAVELENGTH = 1.0
"""Longest wavelength [m]: longer ones do not help the correlation of a 24 px window."""
_LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in the luminance (Rec. 601)."""

MAX_KEPT = 32
"""Number of textures that are kept: those of a world, for the next run in it, at 0.8 MB each."""

STOCK: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        "plaster": {"style": "plaster", "seed": 1, "colour": (1.0, 0.96, 0.88)},
        "carpet": {"style": "carpet", "seed": 2, "colour": (0.75, 0.8, 0.9), "finest": 0.045},
        "wood": {"style": "wood", "seed": 3, "colour": (1.0, 0.78, 0.52)},
        "stone": {"style": "stone", "seed": 4, "colour": (0.85, 0.88, 0.92)},
        "panels": {"style": "panels", "seed": 5, "colour": (0.95, 0.85, 0.75)},
        "dark": {"style": "plaster", "seed": 7, "brightness": 55.0, "contrast": 22.0},
        "ceiling": {"style": "plaster", "seed": 6, "brightness": 170.0, "contrast": 35.0},
    }
)
"""The textures that every world may use without listing them: arguments of TextureSpec."""


def stock_texture(name: str) -> TextureSpec:
    """The stock texture of that name; KeyError when there is none."""
    from navfw.sim.worldspec import TextureSpec

    return TextureSpec.model_validate(dict(STOCK[name]))


@lru_cache(maxsize=MAX_KEPT)
def synthesize(spec: TextureSpec, resolution: int = RESOLUTION) -> Image:
    """The texture as a read-only, periodic image (resolution, resolution, 3) uint8, RGB.

    Its luminance has about the specified mean and standard deviation. The tails are compressed, not
    clipped: hard edges would add detail beyond the cutoff.
    """
    grey = luminance_pattern(spec, resolution)
    tint = np.asarray(spec.colour) / max(float(product(_LUMA, spec.colour)), 1e-3)
    channels = np.clip(np.rint(tint[:, None, None] * grey), 0, 255).astype(np.uint8)
    image: Image = np.ascontiguousarray(np.moveaxis(channels, 0, -1))
    image.setflags(write=False)
    return image


def luminance_pattern(spec: TextureSpec, resolution: int = RESOLUTION) -> Array:
    """The texture's luminance (resolution, resolution) [grey levels] before rounding and tint."""
    rng = np.random.default_rng([spec.seed, sum(map(ord, spec.style))])
    raw = _STYLES[spec.style](rng, resolution)
    smooth = _band_limit(raw, spec.finest)
    smooth -= smooth.mean()
    smooth /= max(float(smooth.std()), 1e-12)
    # compress the tails into the range of a byte; a smooth curve hardly widens the spectrum
    bent = np.tanh(0.6 * smooth)
    bent -= bent.mean()
    pattern: Array = spec.brightness + spec.contrast * bent / max(float(bent.std()), 1e-12)
    return pattern


def _band_limit(pattern: Array, finest: float) -> Array:
    """Band-pass: half wavelengths of at least ``finest`` [m], wavelengths of at most 1 m."""
    return filtered(pattern, passed_band(len(pattern), finest, _MAX_WAVELENGTH))


def _plaster(rng: np.random.Generator, resolution: int) -> Array:
    return spectral_noise(rng, resolution, 0.8)


def _carpet(rng: np.random.Generator, resolution: int) -> Array:
    return spectral_noise(rng, resolution, 0.6)


def _wood(rng: np.random.Generator, resolution: int) -> Array:
    return spectral_noise(rng, resolution, 0.7, stretch=2.0)


def _stone(rng: np.random.Generator, resolution: int) -> Array:
    """Slabs of different brightness (a periodic Voronoi pattern), and grain."""
    seeds, levels = rng.random((70, 2)), rng.standard_normal(70)
    # half the resolution suffices: the result is low-pass filtered
    axis = (np.arange(resolution // 2) + 0.5) / (resolution // 2)
    nearest = np.full((axis.size, axis.size), np.inf)
    slabs = np.zeros_like(nearest)
    for (row, column), level in zip(seeds, levels, strict=True):
        down, across = (np.abs((axis - at + 0.5) % 1.0 - 0.5) for at in (row, column))
        away = down[:, None] ** 2 + across[None, :] ** 2
        slabs[away < nearest] = level
        np.minimum(nearest, away, out=nearest)
    return slabs.repeat(2, axis=0).repeat(2, axis=1) + 0.8 * spectral_noise(rng, resolution, 0.7)


def _panels(rng: np.random.Generator, resolution: int) -> Array:
    """Courses of bricks of random length and brightness, and grain."""
    pattern = np.empty((resolution, resolution))
    courses = 8
    edges = np.linspace(0, resolution, courses + 1).astype(int)
    for top, bottom in pairwise(edges):
        cuts = np.cumsum(rng.uniform(0.12, 0.3, size=12))
        cuts = np.r_[0.0, cuts[cuts < 0.92]]
        levels = rng.standard_normal(cuts.size)
        column = (np.arange(resolution) / resolution + rng.random()) % 1.0
        pattern[top:bottom] = levels[np.searchsorted(cuts, column, side="right") - 1]
    return pattern + 0.8 * spectral_noise(rng, resolution, 0.7)


_STYLES: Mapping[str, Callable[[np.random.Generator, int], Array]] = MappingProxyType(
    {
        "plaster": _plaster,
        "carpet": _carpet,
        "wood": _wood,
        "stone": _stone,
        "panels": _panels,
        "concrete": concrete,
        "brick": brick,
        "parquet": parquet,
        "rug": rug,
        "roughcast": roughcast,
    }
)
