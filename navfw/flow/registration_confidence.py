"""Confidence and standard deviation of windows registered from the peaks of their correlation."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from navfw.flow.confidence import ramp
from navfw.numerics.arrays import Array, Mask

#: Correlation of a peak: confidence rises from 0 at the first to 1 at the second value. Below the
#: first there is no registration: an affine motion can also be fitted to an accidental similarity.
PEAK_CORRELATION = (0.4, 0.6)
#: Share of a window's samples inside the past image: confidence rises from 0 to 1.
SAMPLES_INSIDE = (0.6, 0.9)
#: Distance [px] from the correlation peak to the registered position: confidence falls from 1 at
#: the first to 0 at the second value.
REGISTRATION_SHIFT = (1.5, 3.0)
#: Variance [px^2] of a registered vector, however well the window fits.
REGISTRATION_FLOOR = 0.05**2
#: Factors of the estimated sigma and of its square [1/px] in the error of a registered vector,
#: fitted to rendered frames. The square is there because the affine model holds the less, the worse
#: a window fits.
REGISTRATION_SCALE, REGISTRATION_EXCESS = 1.0, 3.4
#: Disagreement with both neighbours [px] (see ``find_mixtures``): confidence falls from 1 at the
#: first to 0 at the second value, where the window certainly spans two surfaces.
MIXTURE = (0.5, 2.0)
#: Share of the disagreement with both neighbours that counts as standard deviation.
MIXTURE_SHARE = 0.4
#: Ratio of mismatches at which a peak begins to be, and is, unique; the same at the edge of the
#: search range, where it is known on one side only.
_UNIQUE_INSIDE, _UNIQUE_AT_EDGE = (1.0, 1.5), (1.3, 2.2)

_ramp: Any = numba.njit(cache=True, error_model="numpy")(ramp)


@numba.njit(cache=True, error_model="numpy")
def _uniqueness(height: float, second: float, inner: bool) -> float:
    # ratio of the mismatches (1 - score) of the second highest score and of the peak
    contrast = (1.0 - second) / max(1.0 - height, 1e-3)
    low, high = _UNIQUE_INSIDE if inner else _UNIQUE_AT_EDGE
    return float(_ramp(contrast, low, high))


@numba.njit(cache=True)
def uniqueness(height: Array, second: Array, inner: Mask) -> Array:
    """1 for a unique peak, 0 if another displacement fits as well (METHOD 2.9); (rows, cols).

    ``height`` is the score of the peak, ``second`` the highest one elsewhere. Limits are stricter
    for a peak at the edge of the search range (not ``inner``).
    """
    unique = np.empty(height.shape)
    for r in range(height.shape[0]):
        for c in range(height.shape[1]):
            unique[r, c] = _uniqueness(height[r, c], second[r, c], inner[r, c])
    return unique


@numba.njit(cache=True, error_model="numpy")
def judge_registration(
    score: Array,
    share: Array,
    mixture: Array,
    noise: Array,
    shift: Array,
    peak: Array,
    unique: Array,
    limits: tuple[float, float],
) -> tuple[Array, Array]:
    """Confidence and sigma [px] of registered windows; all arrays are (rows, cols).

    ``score``, ``share`` and ``mixture`` are those of ``navfw.flow.registration.Registration``,
    ``noise`` [px] its sigma with the samples' common errors; ``shift`` (rows, cols, 2) [px] is the
    way from the correlation's peak of height ``peak`` and uniqueness ``unique``. ``limits`` are the
    scores of no match and of a certain one.
    """
    confidence, sigma = np.empty(score.shape), np.empty(score.shape)
    for r in range(score.shape[0]):
        for c in range(score.shape[1]):
            trust = _ramp(score[r, c], limits[0], limits[1])
            trust *= _ramp(share[r, c], SAMPLES_INSIDE[0], SAMPLES_INSIDE[1])
            trust *= _ramp(peak[r, c], PEAK_CORRELATION[0], PEAK_CORRELATION[1]) * unique[r, c]
            x, y = shift[r, c]
            way = math.sqrt(x * x + y * y)
            trust *= 1.0 - _ramp(way, REGISTRATION_SHIFT[0], REGISTRATION_SHIFT[1])
            confidence[r, c] = trust * (1.0 - _ramp(mixture[r, c], MIXTURE[0], MIXTURE[1]))
            scaled = REGISTRATION_SCALE * noise[r, c]
            excess = REGISTRATION_EXCESS * (noise[r, c] * noise[r, c])
            mixed = MIXTURE_SHARE * mixture[r, c]
            variance = scaled * scaled + REGISTRATION_FLOOR
            sigma[r, c] = math.sqrt(variance + (excess * excess + mixed * mixed))
    return confidence, sigma
