"""Textures: procedural, seeded and periodic, or of pictures; all of them band-limited.

The rasteriser, like TinyRenderer, samples textures by nearest neighbour without mipmaps: detail
finer than about two pixels at the working distance aliases and disturbs the flow (METHOD sec 0).
Every pattern is therefore low-pass filtered with a cutoff of half a cycle per ``finest`` metres,
and so is a picture, which repeats beyond its size, like tiles. Patterns have contrast for the
optical flow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from itertools import pairwise
from types import MappingProxyType

import cv2
import numpy as np

from navfw.config.image_file import read_image
from navfw.config.input_file import cached_by_files
from navfw.errors import ConfigError
from navfw.numerics import Array, Image
from navfw.numerics.functions import power
from navfw.numerics.products import product
from navfw.sim.worldspec import TextureSpec

TILE = 2.0
"""Period of a pattern: edge of the square that it covers [m]."""
RESOLUTION = 512
"""Texels along a tile's edge: 4 mm each, half a pixel at 0.6 m with a focal length of 80 px."""
_MAX_WAVELENGTH = 1.0
"""Longest wavelength [m]: longer ones do not help the correlation of a 24 px window."""


def _frequencies(texels: tuple[int, ...], area: tuple[float, float]) -> tuple[Array, Array]:
    """Cycles per metre along rows and columns of the real Fourier transform of a texture.

    ``texels`` are its (rows, columns), ``area`` the height and width that it covers [m]. Shapes
    (rows, 1) and (1, columns // 2 + 1).
    """
    rows = np.fft.fftfreq(texels[0], d=area[0] / texels[0]).astype(np.float64)
    columns = np.fft.rfftfreq(texels[1], d=area[1] / texels[1]).astype(np.float64)
    return rows[:, None], columns[None, :]


def _passed_share(frequency: Array, finest: float) -> Array:
    """Share of amplitudes that a texture keeps, by frequency [1/m]: none beyond the cutoff.

    The cutoff is half a cycle per ``finest`` [m]. A raised-cosine edge from 70 % to 100 % of it
    rings less than a sharp one.
    """
    cutoff = 0.5 / finest
    fall = np.clip((frequency / cutoff - 0.7) / 0.3, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(np.pi * fall))


def _filtered(pattern: Array, amplitudes: Array) -> Array:
    """Return the periodic ``pattern`` with its real Fourier transform times ``amplitudes``."""
    return np.fft.irfft2(np.fft.rfft2(pattern) * amplitudes, s=pattern.shape)


def _spectral_noise(rng: np.random.Generator, exponent: float, stretch: float = 1.0) -> Array:
    """Gaussian noise of unit variance with amplitude ~ frequency**-exponent (1: pink noise).

    ``stretch`` > 1 elongates the grain along the texture's rows (vertical on walls).
    """
    white = rng.standard_normal((RESOLUTION, RESOLUTION))
    pattern = _filtered(white, _noise_amplitudes(exponent, stretch))
    return pattern / float(pattern.std())


@lru_cache(maxsize=16)
def _noise_amplitudes(exponent: float, stretch: float) -> Array:
    """Amplitudes of ``_spectral_noise`` in the real Fourier transform; none of the mean."""
    rows, columns = _frequencies((RESOLUTION, RESOLUTION), (TILE, TILE))
    frequency = np.hypot(rows * np.sqrt(stretch), columns / np.sqrt(stretch))
    frequency[0, 0] = np.inf
    return power(frequency, -exponent)


@lru_cache(maxsize=16)
def _passed_band(finest: float) -> Array:
    """Share of amplitudes kept in a tile's real Fourier transform: a band-pass.

    Half wavelengths are at least ``finest`` [m], wavelengths at most ``_MAX_WAVELENGTH``.
    """
    frequency = np.hypot(*_frequencies((RESOLUTION, RESOLUTION), (TILE, TILE)))
    return _passed_share(frequency, finest) * (frequency >= 0.99 / _MAX_WAVELENGTH)


def _concrete(rng: np.random.Generator) -> Array:
    """Clouds, fine grain, and dark pores of 1 to 3 cm."""
    pattern = _spectral_noise(rng, 1.4) + 0.35 * _spectral_noise(rng, 0.3)
    return pattern - 2.5 * _spots(rng, 130, (0.003, 0.008))


def _roughcast(rng: np.random.Generator) -> Array:
    """Even grain under large, faint clouds: trowelled plaster."""
    clouds, grain = _spectral_noise(rng, 1.6), _spectral_noise(rng, 0.4)
    return 0.6 * clouds + np.abs(grain)


def _rug(rng: np.random.Generator) -> Array:
    """Loops of pile in rows, with flecks."""
    axis = np.arange(RESOLUTION) / RESOLUTION
    rows = np.sin(2.0 * np.pi * 24.0 * axis)[:, None]
    flecks = _spectral_noise(rng, 0.5)
    return 0.5 * rows + flecks + np.maximum(flecks - 1.2, 0.0)


def _brick(rng: np.random.Generator) -> Array:
    """Return a running bond of 8 x 16 bricks with bright joints; each brick has a brightness."""
    pattern = np.empty((RESOLUTION, RESOLUTION))
    joint = max(RESOLUTION // 90, 1)
    for course, (top, bottom) in enumerate(pairwise(_edges(16))):
        cuts = _edges(8)
        offset = (RESOLUTION // 16) * (course % 2)
        levels = 0.9 * rng.standard_normal(8)
        row = np.repeat(levels, np.diff(cuts))
        row[np.isin(np.arange(RESOLUTION), (cuts[:-1, None] + np.arange(joint)).ravel())] = 2.6
        pattern[top:bottom] = np.roll(row, offset)
        pattern[top : top + joint] = 2.6
    return pattern + 0.5 * _spectral_noise(rng, 0.8)


def _parquet(rng: np.random.Generator) -> Array:
    """Boards 12.5 cm wide of random length, with dark joints and grain along them."""
    pattern = np.empty((RESOLUTION, RESOLUTION))
    joint = max(RESOLUTION // 170, 1)
    for left, right in pairwise(_edges(16)):
        column = np.empty(RESOLUTION)
        cuts = np.sort(rng.choice(np.arange(1, 12), 2, replace=False)) * RESOLUTION // 12
        levels = rng.standard_normal(3)
        column[:] = levels[np.searchsorted(cuts, np.arange(RESOLUTION), side="right") % 3]
        for cut in cuts:
            column[cut : cut + joint] = -2.5
        column = np.roll(column, int(rng.integers(RESOLUTION)))
        pattern[:, left:right] = column[:, None]
        pattern[:, left : left + joint] = -2.5
    grain = _spectral_noise(rng, 0.9, stretch=12.0)
    return pattern + 0.7 * grain


def _edges(count: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Bounds of ``count`` equal parts of a row of texels."""
    return np.linspace(0, RESOLUTION, count + 1).astype(np.int64)


def _spots(rng: np.random.Generator, count: int, radii: tuple[float, float]) -> Array:
    """1 inside ``count`` periodic round spots with radii from, to (shares of the tile), else 0."""
    axis = (np.arange(RESOLUTION) + 0.5) / RESOLUTION
    spots = np.zeros((RESOLUTION, RESOLUTION))
    for row, column, radius in zip(
        rng.random(count), rng.random(count), rng.uniform(*radii, count), strict=True
    ):
        down, across = (np.abs((axis - at + 0.5) % 1.0 - 0.5) for at in (row, column))
        near = np.ix_(down < radius, across < radius)
        spots[near] = np.maximum(spots[near], np.hypot(down[near[0]], across[near[1]]) < radius)
    return spots


_LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in the luminance (Rec. 601)."""

_MAX_KEPT = 32
"""Number of textures kept in memory for the next run, 0.8 MB each."""

STOCK: Mapping[str, TextureSpec] = MappingProxyType(
    {
        "plaster": TextureSpec(style="plaster", seed=1, colour=(1.0, 0.96, 0.88)),
        "carpet": TextureSpec(style="carpet", seed=2, colour=(0.75, 0.8, 0.9), finest=0.045),
        "wood": TextureSpec(style="wood", seed=3, colour=(1.0, 0.78, 0.52)),
        "stone": TextureSpec(style="stone", seed=4, colour=(0.85, 0.88, 0.92)),
        "panels": TextureSpec(style="panels", seed=5, colour=(0.95, 0.85, 0.75)),
        "dark": TextureSpec(style="plaster", seed=7, brightness=55.0, contrast=22.0),
        "ceiling": TextureSpec(style="plaster", seed=6, brightness=170.0, contrast=35.0),
    }
)
"""The textures that every world may use without listing them."""


@lru_cache(maxsize=_MAX_KEPT)
def synthesize(spec: TextureSpec) -> Image:
    """Make the texture as a read-only, periodic image (RESOLUTION, RESOLUTION, 3) uint8, RGB.

    Its luminance has about the specified mean and standard deviation. The tails are compressed, not
    clipped: hard edges would add detail beyond the cutoff.
    """
    grey = luminance_pattern(spec)
    tint = np.asarray(spec.colour) / max(float(product(_LUMA, spec.colour)), 1e-3)
    channels = np.clip(np.rint(tint[:, None, None] * grey), 0, 255).astype(np.uint8)
    image: Image = np.ascontiguousarray(np.moveaxis(channels, 0, -1))
    image.setflags(write=False)
    return image


def luminance_pattern(spec: TextureSpec) -> Array:
    """Return a texture's luminance (RESOLUTION, RESOLUTION) [grey levels], unrounded, untinted."""
    rng = np.random.default_rng([spec.seed, sum(map(ord, spec.style))])
    raw = _STYLES[spec.style](rng)
    smooth = _filtered(raw, _passed_band(spec.finest))
    smooth -= smooth.mean()
    smooth /= max(float(smooth.std()), 1e-12)
    # compress the tails into the range of a byte; a smooth curve hardly widens the spectrum
    bent = np.tanh(0.6 * smooth)
    bent -= bent.mean()
    return spec.brightness + spec.contrast * bent / max(float(bent.std()), 1e-12)


def _stone(rng: np.random.Generator) -> Array:
    """Slabs of different brightness (a periodic Voronoi pattern), and grain."""
    seeds, levels = rng.random((70, 2)), rng.standard_normal(70)
    # half the resolution suffices: the result is low-pass filtered
    axis = (np.arange(RESOLUTION // 2) + 0.5) / (RESOLUTION // 2)
    nearest = np.full((axis.size, axis.size), np.inf)
    slabs = np.zeros_like(nearest)
    for (row, column), level in zip(seeds, levels, strict=True):
        down, across = (np.abs((axis - at + 0.5) % 1.0 - 0.5) for at in (row, column))
        away = down[:, None] ** 2 + across[None, :] ** 2
        slabs[away < nearest] = level
        np.minimum(nearest, away, out=nearest)
    return slabs.repeat(2, axis=0).repeat(2, axis=1) + 0.8 * _spectral_noise(rng, 0.7)


def _panels(rng: np.random.Generator) -> Array:
    """Courses of bricks of random length and brightness, and grain."""
    pattern = np.empty((RESOLUTION, RESOLUTION))
    for top, bottom in pairwise(_edges(8)):
        cuts = np.cumsum(rng.uniform(0.12, 0.3, size=12))
        cuts = np.r_[0.0, cuts[cuts < 0.92]]
        levels = rng.standard_normal(cuts.size)
        column = (np.arange(RESOLUTION) / RESOLUTION + rng.random()) % 1.0
        pattern[top:bottom] = levels[np.searchsorted(cuts, column, side="right") - 1]
    return pattern + 0.8 * _spectral_noise(rng, 0.7)


_STYLES: Mapping[str, Callable[[np.random.Generator], Array]] = MappingProxyType(
    {
        "plaster": partial(_spectral_noise, exponent=0.8),
        "carpet": partial(_spectral_noise, exponent=0.6),
        "wood": partial(_spectral_noise, exponent=0.7, stretch=2.0),
        "stone": _stone,
        "panels": _panels,
        "concrete": _concrete,
        "brick": _brick,
        "parquet": _parquet,
        "rug": _rug,
        "roughcast": _roughcast,
    }
)


_MAX_PIXELS = 4_000_000
"""Largest number of pixels of a picture: 4 mm over 8 x 8 m."""
_MAX_ASPECT = 20.0
"""Largest ratio of a picture's sides."""
_MAX_TEXELS = 2048
"""Largest number of texels along an edge; a wider picture has texels larger than 4 mm."""


@cached_by_files(16)
def read_picture(path: str) -> Image:
    """Read the picture in a file: read-only (height, width, 3) uint8, RGB.

    Raises:
        ConfigError: the file cannot be read, is no PNG or JPEG image, is damaged, has more than
            4,000,000 pixels, or is a narrow strip.

    """
    image = read_image(path, max_pixels=_MAX_PIXELS)
    height, width = image.shape[:2]
    if max(height, width) > _MAX_ASPECT * min(height, width):
        what = f"the picture is {width} x {height} pixels; its sides may differ by a factor of"
        raise ConfigError(f"{what} {_MAX_ASPECT:g} at most: cut it", file=path)
    picture: Image = np.ascontiguousarray(image[:, :, ::-1]).astype(np.uint8)
    picture.setflags(write=False)
    return picture


def covered_area(picture: Image, size: float | None) -> tuple[float, float]:
    """Width and height [m] that a picture covers; ``size`` [m] is the width (None: a tile's)."""
    width = TILE if size is None else size
    return width, width * picture.shape[0] / picture.shape[1]


@cached_by_files(_MAX_KEPT)
def picture_texture(spec: TextureSpec) -> Image:
    """Return the texels (height, width, 3), RGB, of a texture with a picture, antialiased."""
    assert spec.picture is not None  # noqa: S101 - the caller has tested it
    picture = read_picture(spec.picture)
    area = covered_area(picture, spec.size)
    columns, rows = (
        min(max(math.ceil(edge * RESOLUTION / TILE), 16), _MAX_TEXELS) for edge in area
    )
    shrinks = columns < picture.shape[1]
    how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    scaled = cv2.resize(picture, (columns, rows), interpolation=how).astype(np.float64)
    keep = _passed_share(np.hypot(*_frequencies(scaled.shape[:2], area[::-1])), spec.finest)
    smooth = np.stack([_filtered(scaled[..., c], keep) for c in range(3)], axis=2)
    return np.clip(np.rint(smooth), 0, 255).astype(np.uint8)
