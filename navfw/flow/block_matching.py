"""The paper's flow processor: two-dimensional correlation of fixed windows (paper sec 3)."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import cv2
import numba
import numpy as np
from pydantic import Field

from navfw.flow.correlation_kernels import correlate, find_peaks
from navfw.flow.grid_flow import MatchedFlow, local_spread, match_sigma, ramp
from navfw.flow.registration import grid_windows, register_windows
from navfw.numerics import Image
from navfw.numerics.arrays import Array, Floats, Mask
from navfw.robot import RobotModel
from navfw.signals.immutability import read_only

TEXTURE_LOW = 2.0  # chosen
"""Grey deviation: no texture [grey levels]."""
TEXTURE_HIGH = 6.0  # chosen
"""Grey deviation: ample texture [grey levels]."""
PEAK_LOW = 0.7  # chosen
"""Peak correlation: no match."""
PEAK_HIGH = 0.9  # chosen
"""Peak correlation: certain match."""
REGISTERED_LOW = 0.85  # chosen
"""Registered correlation: no match."""
REGISTERED_HIGH = 0.97  # chosen
"""Registered correlation: certain match."""

#: Correlation of a peak: confidence rises from 0 at the first to 1 at the second value. Below the
#: first there is no registration: an affine motion can also be fitted to an accidental similarity.
_PEAK_CORRELATION = (0.4, 0.6)  # chosen
#: Share of a window's samples inside the past image: confidence rises from 0 to 1.
_SAMPLES_INSIDE = (0.6, 0.9)  # chosen
#: Distance [px] from the correlation peak to the registered position: confidence falls from 1 at
#: the first to 0 at the second value.
_REGISTRATION_SHIFT = (1.5, 3.0)  # chosen
#: Variance [px^2] of a registered vector, however well the window fits.
_REGISTRATION_FLOOR = 0.05**2  # chosen
#: Factors of the estimated sigma and of its square [1/px] in the error of a registered vector,
#: fitted to rendered frames. The square is there because the affine model holds the less, the worse
#: a window fits.
_REGISTRATION_SCALE, _REGISTRATION_EXCESS = 1.0, 3.4  # measured
#: Disagreement with both neighbours [px] (see ``find_mixtures``): confidence falls from 1 at the
#: first to 0 at the second value, where the window certainly spans two surfaces.
_MIXTURE = (0.5, 2.0)  # chosen
#: Share of the disagreement with both neighbours that counts as standard deviation.
_MIXTURE_SHARE = 0.4  # chosen
#: Ratio of mismatches at which a peak begins to be, and is, unique; the same at the edge of the
#: search range, where it is known on one side only.
_UNIQUE_INSIDE, _UNIQUE_AT_EDGE = (1.0, 1.5), (1.3, 2.2)  # chosen

_ramp: Any = numba.njit(cache=True, error_model="numpy")(ramp)


@numba.njit(cache=True, error_model="numpy")
def uniqueness(height: Array, second: Array, inner: Mask) -> Array:
    """Compute 1 for a unique peak, 0 if another displacement fits as well (METHOD 2.9).

    ``height`` (rows, cols) is the score of the peak, ``second`` the highest one elsewhere. Limits
    are stricter for a peak at the edge of the search range (not ``inner``).
    """
    unique = np.empty(height.shape)
    for r in range(height.shape[0]):
        for c in range(height.shape[1]):
            # ratio of the mismatches (1 - score) of the second highest score and of the peak
            contrast = (1.0 - second[r, c]) / max(1.0 - height[r, c], 1e-3)
            low, high = _UNIQUE_INSIDE if inner[r, c] else _UNIQUE_AT_EDGE
            unique[r, c] = _ramp(contrast, low, high)
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
) -> tuple[Array, Array]:
    """Compute confidence and sigma [px] of registered windows; all arrays are (rows, cols).

    ``score``, ``share`` and ``mixture`` are those of ``navfw.flow.registration.Registration``,
    ``noise`` [px] its sigma with the samples' common errors; ``shift`` (rows, cols, 2) [px] is the
    displacement from the correlation's peak of height ``peak`` and uniqueness ``unique``.
    """
    confidence, sigma = np.empty(score.shape), np.empty(score.shape)
    for r in range(score.shape[0]):
        for c in range(score.shape[1]):
            trust = _ramp(score[r, c], REGISTERED_LOW, REGISTERED_HIGH)
            trust *= _ramp(share[r, c], _SAMPLES_INSIDE[0], _SAMPLES_INSIDE[1])
            trust *= _ramp(peak[r, c], _PEAK_CORRELATION[0], _PEAK_CORRELATION[1]) * unique[r, c]
            x, y = shift[r, c]
            way = math.sqrt(x * x + y * y)
            trust *= 1.0 - _ramp(way, _REGISTRATION_SHIFT[0], _REGISTRATION_SHIFT[1])
            confidence[r, c] = trust * (1.0 - _ramp(mixture[r, c], _MIXTURE[0], _MIXTURE[1]))
            scaled = _REGISTRATION_SCALE * noise[r, c]
            excess = _REGISTRATION_EXCESS * (noise[r, c] * noise[r, c])
            mixed = _MIXTURE_SHARE * mixture[r, c]
            variance = scaled * scaled + _REGISTRATION_FLOOR
            sigma[r, c] = math.sqrt(variance + (excess * excess + mixed * mixed))
    return confidence, sigma


#: Correlation length of the errors of grey values [px]: nearer samples share their errors.
_CORRELATION_LENGTH = 3.0  # chosen
#: Share of the windows in the lower half of the image, mostly floor, with a deviation below
#: ``TEXTURE_HIGH`` above which both images are smoothed; usual frames have next to none.
_WEAK_SHARE = 0.4  # chosen
#: Standard deviation of the smoothing [px]: it leaves 0.28 of the noise, and most of the texture.
_SMOOTHING = 1.0  # chosen
#: Factor of ``TEXTURE_LOW`` and ``TEXTURE_HIGH`` in smoothed images: 0.28, and the rounding to
#: whole grey levels.
_SMOOTHED_TEXTURE = 0.5  # derived
#: For the quadratic peak alone: least standard deviation [px], factor of the estimated sigma, and
#: share of the flow's variation within a window that counts as standard deviation of its vector.
_PEAK_FLOOR, _PEAK_SCALE, _PEAK_SPREAD = 0.05, 2.0, 0.3  # chosen
#: Sampling interval of registration [px], and sigma of its weights [half windows].
_STRIDE, _WEIGHT_WIDTH = 3, 0.6  # chosen


class BlockMatching(MatchedFlow):
    """Normalised two-dimensional correlation block matching on a regular grid (paper sec 3).

    A window around each grid point of the current image is searched for in the past image by
    exhaustive zero-mean normalised cross-correlation, within ``search`` pixels of the position that
    the camera's known rotation predicts. The prediction warps the whole past image, so rotation
    does not distort the windows. The peak is refined to subpixel accuracy by affine registration of
    the window (``subpixel: affine``), which may end a little outside the search range, or only by a
    quadratic surface (``subpixel: peak``).

    If many windows on the floor have little texture, both images are smoothed before: noise
    decorrelates them, and lets a window follow a strong edge at its border that belongs to another
    surface.

    Windows at the border are clipped to the image less ``margin``. The field's ``points`` are the
    centres of the clipped windows: the grid points, except at the border, where they lie some
    pixels further inside.
    """

    name: ClassVar[str] = "block_matching"

    class Params(MatchedFlow.Params):
        """Grid, windows, search range, and refinement."""

        window: int = Field(24, ge=6, le=128, description="side of a window [px]")
        search: int = Field(
            8, ge=2, le=32, description="largest displacement searched per axis [px]"
        )
        margin: int = Field(
            2, ge=0, le=16, description="least distance of a window from the border [px]"
        )
        subpixel: Literal["affine", "peak"] = Field(
            "affine", description="refinement by affine registration or by the peak's quadratic"
        )

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p, camera = self.params, robot.camera
        self._x_windows = x = grid_windows(camera.width, p.cols, p.window, p.margin)
        self._y_windows = y = grid_windows(camera.height, p.rows, p.window, p.margin)
        centres = np.meshgrid(
            x.mean(axis=1) - 0.5 * camera.width,
            y.mean(axis=1) - 0.5 * camera.height,
        )
        self._points = read_only(np.stack(centres, axis=-1))
        self._pixels = np.outer(y[:, 1] - y[:, 0], x[:, 1] - x[:, 0]).astype(np.float64)

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        p = self.params
        # all read only: for arrays that are not, the kernels would be compiled once more
        now, past = read_only(np.ascontiguousarray(now)), read_only(np.ascontiguousarray(past))
        windows = (self._x_windows, self._y_windows)
        low, high = TEXTURE_LOW, TEXTURE_HIGH
        scores, deviation = correlate(now, past, *windows, p.search, visible)
        lower = deviation[len(deviation) // 2 :]
        if np.count_nonzero(lower < high) > _WEAK_SHARE * lower.size:
            now, past = _smoothed(now), _smoothed(past)
            low, high = _SMOOTHED_TEXTURE * low, _SMOOTHED_TEXTURE * high
            scores, deviation = correlate(now, past, *windows, p.search, visible)
        if p.subpixel == "affine":
            textured = deviation > low
            vectors, confidence, sigma = self._register(now, past, visible, scores, textured)
        else:
            vectors, confidence, sigma = self._peaks(scores)
        confidence *= ramp(deviation.astype(np.float64), low, high)
        return vectors, confidence, sigma

    def _register(
        self,
        now: Image,
        past: Image,
        visible: tuple[int, int, int, int],
        scores: Floats,
        textured: Mask,
    ) -> tuple[Array, Array, Array]:
        """Vectors, confidence and sigma by affine registration from the correlation's peaks."""
        _, start, height, second, _, inner = find_peaks(scores)
        registration = register_windows(
            now,
            past,
            self._x_windows,
            self._y_windows,
            start,
            (height > _PEAK_CORRELATION[0]) & textured,
            visible,
            _STRIDE,
            _WEIGHT_WIDTH,
        )
        confidence, sigma = judge_registration(
            registration.score,
            registration.share,
            registration.mixture,
            registration.sigma * np.sqrt(max(_CORRELATION_LENGTH / _STRIDE, 1.0)),
            registration.vectors - start,
            height,
            uniqueness(height, second, inner),
        )
        return registration.vectors, confidence, sigma

    def _peaks(self, scores: Floats) -> tuple[Array, Array, Array]:
        """Vectors, confidence and sigma by quadratic interpolation of the correlation peaks."""
        _, fine, height, second, curvature, inner = find_peaks(scores)
        confidence = np.where(inner & (curvature > 0.0), ramp(height, PEAK_LOW, PEAK_HIGH), 0.0)
        confidence *= uniqueness(height, second, inner)
        noise = _PEAK_SCALE * match_sigma(height, curvature, self._pixels)
        spread = _PEAK_SPREAD * local_spread(fine, confidence)
        return fine, confidence, np.sqrt(noise**2 + spread**2 + _PEAK_FLOOR**2)


def _smoothed(image: Image) -> Image:
    return read_only(np.asarray(cv2.GaussianBlur(image, (0, 0), _SMOOTHING)))
