"""Periodic patterns like photographs of materials: concrete, bricks, parquet, rugs, roughcast.

Their statistics are those of such photographs, not of noise: large smooth areas, edges at joints,
few dark spots. ``navfw.sim.textures`` filters and scales them like all others.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from navfw.signals import Array
from navfw.sim.texture_spectra import spectral_noise


def concrete(rng: np.random.Generator, resolution: int) -> Array:
    """Clouds, fine grain, and dark pores of 1 to 3 cm."""
    pattern = spectral_noise(rng, resolution, 1.4) + 0.35 * spectral_noise(rng, resolution, 0.3)
    return pattern - 2.5 * _spots(rng, resolution, 130, (0.003, 0.008))


def roughcast(rng: np.random.Generator, resolution: int) -> Array:
    """Even grain under large, faint clouds: trowelled plaster."""
    clouds, grain = spectral_noise(rng, resolution, 1.6), spectral_noise(rng, resolution, 0.4)
    return 0.6 * clouds + np.abs(grain)


def rug(rng: np.random.Generator, resolution: int) -> Array:
    """Loops of pile in rows, with flecks."""
    axis = np.arange(resolution) / resolution
    rows = np.sin(2.0 * np.pi * 24.0 * axis)[:, None]
    flecks = spectral_noise(rng, resolution, 0.5)
    return 0.5 * rows + flecks + np.maximum(flecks - 1.2, 0.0)


def brick(rng: np.random.Generator, resolution: int) -> Array:
    """A running bond of 8 x 16 bricks with bright joints; each brick has a brightness."""
    pattern = np.empty((resolution, resolution))
    joint = max(resolution // 90, 1)
    for course, (top, bottom) in enumerate(pairwise(_edges(resolution, 16))):
        cuts = _edges(resolution, 8)
        offset = (resolution // 16) * (course % 2)
        levels = 0.9 * rng.standard_normal(8)
        row = np.repeat(levels, np.diff(cuts))
        row[np.isin(np.arange(resolution), (cuts[:-1, None] + np.arange(joint)).ravel())] = 2.6
        pattern[top:bottom] = np.roll(row, offset)
        pattern[top : top + joint] = 2.6
    return pattern + 0.5 * spectral_noise(rng, resolution, 0.8)


def parquet(rng: np.random.Generator, resolution: int) -> Array:
    """Boards 12.5 cm wide of random length, with dark joints and grain along them."""
    pattern = np.empty((resolution, resolution))
    joint = max(resolution // 170, 1)
    for left, right in pairwise(_edges(resolution, 16)):
        column = np.empty(resolution)
        cuts = np.sort(rng.choice(np.arange(1, 12), 2, replace=False)) * resolution // 12
        levels = rng.standard_normal(3)
        column[:] = levels[np.searchsorted(cuts, np.arange(resolution), side="right") % 3]
        for cut in cuts:
            column[cut : cut + joint] = -2.5
        column = np.roll(column, int(rng.integers(resolution)))
        pattern[:, left:right] = column[:, None]
        pattern[:, left : left + joint] = -2.5
    grain = spectral_noise(rng, resolution, 0.9, stretch=12.0)
    return pattern + 0.7 * grain


def _edges(resolution: int, count: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Bounds of ``count`` equal parts of a row of texels."""
    return np.linspace(0, resolution, count + 1).astype(np.int64)


def _spots(
    rng: np.random.Generator, resolution: int, count: int, radii: tuple[float, float]
) -> Array:
    """1 inside ``count`` periodic round spots with radii from, to (shares of the tile), else 0."""
    axis = (np.arange(resolution) + 0.5) / resolution
    spots = np.zeros((resolution, resolution))
    for row, column, radius in zip(
        rng.random(count), rng.random(count), rng.uniform(*radii, count), strict=True
    ):
        down, across = (np.abs((axis - at + 0.5) % 1.0 - 0.5) for at in (row, column))
        near = np.ix_(down < radius, across < radius)
        spots[near] = np.maximum(spots[near], np.hypot(down[near[0]], across[near[1]]) < radius)
    return spots
