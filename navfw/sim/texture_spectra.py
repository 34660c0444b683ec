"""Size and resolution of textures, their low-pass filter, and periodic noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from navfw.numerics.functions import power
from navfw.signals import Array

TILE = 2.0
"""Period of a pattern: edge of the square that it covers [m]."""
RESOLUTION = 512
"""Texels along that edge: 4 mm each, half a pixel at 0.6 m with a focal length of 80 px."""


def frequencies(texels: tuple[int, ...], area: tuple[float, float]) -> tuple[Array, Array]:
    """Cycles per metre along rows and columns of the real Fourier transform of a texture.

    ``texels`` are its (rows, columns), ``area`` the height and width that it covers [m]. Shapes
    (rows, 1) and (1, columns // 2 + 1).
    """
    rows = np.fft.fftfreq(texels[0], d=area[0] / texels[0]).astype(np.float64)
    columns = np.fft.rfftfreq(texels[1], d=area[1] / texels[1]).astype(np.float64)
    return rows[:, None], columns[None, :]


def passed_share(frequency: Array, finest: float) -> Array:
    """Share of amplitudes that a texture keeps, by frequency [1/m]: none beyond the cutoff.

    The cutoff is half a cycle per ``finest`` [m]. A raised-cosine edge from 70 % to 100 % of it
    rings less than a sharp one.
    """
    cutoff = 0.5 / finest
    fall = np.clip((frequency / cutoff - 0.7) / 0.3, 0.0, 1.0)
    share: Array = 0.5 * (1.0 + np.cos(np.pi * fall))
    return share


def filtered(pattern: Array, amplitudes: Array) -> Array:
    """The periodic ``pattern`` with its real Fourier transform times ``amplitudes``."""
    result: Array = np.fft.irfft2(np.fft.rfft2(pattern) * amplitudes, s=pattern.shape)
    return result


def spectral_noise(
    rng: np.random.Generator, resolution: int, exponent: float, stretch: float = 1.0
) -> Array:
    """Gaussian noise of unit variance with amplitude ~ frequency**-exponent (1: pink noise).

    ``stretch`` > 1 elongates the grain along the texture's rows (vertical on walls).
    """
    white = rng.standard_normal((resolution, resolution))
    pattern = filtered(white, _noise_amplitudes(resolution, exponent, stretch))
    return pattern / float(pattern.std())


@lru_cache(maxsize=16)
def _noise_amplitudes(resolution: int, exponent: float, stretch: float) -> Array:
    """Amplitudes of ``spectral_noise`` in the real Fourier transform; none of the mean."""
    rows, columns = frequencies((resolution, resolution), (TILE, TILE))
    frequency = np.hypot(rows * np.sqrt(stretch), columns / np.sqrt(stretch))
    frequency[0, 0] = np.inf
    return power(frequency, -exponent)


@lru_cache(maxsize=16)
def passed_band(resolution: int, finest: float, coarsest: float) -> Array:
    """Share of amplitudes kept in a tile's real Fourier transform: a band-pass.

    Half wavelengths are at least ``finest`` [m], wavelengths at most ``coarsest`` [m].
    """
    frequency = np.hypot(*frequencies((resolution, resolution), (TILE, TILE)))
    band: Array = passed_share(frequency, finest) * (frequency >= 0.99 / coarsest)
    return band
