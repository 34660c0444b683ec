"""Compiled registration of the floor between two images: the robot's motion over it, in metres.

A point of the floor lies at a known place relative to the robot, since height and pitch of the
camera are known. The motion that brings the grey values of both images together is found by robust
least squares on the grey values themselves (Lucas and Kanade 1981; Baker and Matthews 2004).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.egomotion.epipolar_kernels import CAUCHY
from navfw.numerics.algebra_kernels import dot, solve_system
from navfw.numerics.arrays import Array, Floats

UNKNOWNS = 5  # defined
"""x, y [m], yaw [rad] of the robot in its past base_link; gain - 1 and offset [grey levels] of the
past image's brightness."""

SLANT = UNKNOWNS
"""Index of the slant of what is seen, which is tested and not fitted: with the slant s a pixel
shows something nearer than the floor by the factor (distance / nearest)^s, ``nearest`` being the
distance of the nearest floor in view. 0 is the floor, 1 a wall that stands there."""

_DEVIATION = 0.6745  # derived
"""Median absolute deviation of a normal distribution of standard deviation 1."""

_CONVERGED = 2e-5  # chosen
"""Step of the motion [m and rad] below which the fit has converged."""

_MIN_GREY = 0.7  # chosen
"""Least standard deviation of a residual [grey levels]: noise of both images after smoothing."""

_ITERATIONS = 10  # chosen
"""Largest number of Gauss-Newton steps."""

_WIDE = 3  # chosen
"""Number of steps with Cauchy weights, which reach far; the others have Welsch weights."""

_WELSCH = 2.985**2  # derived
"""Squared width of the Welsch weights [sigma^2]: 95 % efficient on normal errors."""


@numba.njit(cache=True, error_model="numpy")
def _residuals(
    past: Floats,
    values: Array,
    ground: Array,
    farness: Array,
    camera: Array,
    base_from_camera: Array,
    at: Array,
    offsets: Array,
    slopes: Array,
) -> None:
    """Residuals (n,) [grey levels] at the parameters ``at``, and their slopes (UNKNOWNS + 1, n).

    The last slope is that of the slant, about 0.

    NaN where the past image does not show the point. Arguments as in ``register_floor``.
    """
    # locals, which no store into an array can change: the compiler keeps them in registers
    focal, ahead, height, cx, cy = camera[0], camera[1], camera[2], camera[3], camera[4]
    b = base_from_camera
    xx, xy, xz = b[0, 0], b[0, 1], b[0, 2]
    yx, yy, yz = b[1, 0], b[1, 1], b[1, 2]
    low_x, low_y, low_z = b[2, 0] * height, b[2, 1] * height, b[2, 2] * height
    tx, ty, gain, offset = at[0], at[1], 1.0 + at[3], at[4]
    c, s = math.cos(at[2]), math.sin(at[2])
    rows, columns = past.shape
    pixels, one, row = past.ravel(), np.uint64(1), np.uint64(columns)
    for i in range(values.size):
        px, py, value = ground[i, 0], ground[i, 1], values[i]
        qx, qy = c * px - s * py, s * px + c * py
        dx, dy = qx + tx - ahead, qy + ty
        depth = xz * dx + yz * dy - low_z
        offsets[i] = math.nan
        if depth <= 0.0:
            continue
        scale = 1.0 / depth
        x = focal * (xx * dx + yx * dy - low_x) * scale
        y = focal * (xy * dx + yy * dy - low_y) * scale
        u, v = cx + x, cy + y
        if not (1.0 <= u < columns - 2 and 1.0 <= v < rows - 2):
            continue
        k, j = int(u), int(v)
        u, v = u - k, v - j
        # grey values by row and column: the four around the point, and the eight beside these
        n = np.uint64(j * columns + k)
        g11, g12, g21, g22 = pixels[n], pixels[n + one], pixels[n + row], pixels[n + row + one]
        g01, g02 = pixels[n - row], pixels[n - row + one]
        g31, g32 = pixels[n + row + row], pixels[n + row + row + one]
        g10, g13 = pixels[n - one], pixels[n + one + one]
        g20, g23 = pixels[n + row - one], pixels[n + row + one + one]
        w11, w12, w21, w22 = (1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u
        grey = w11 * g11 + w12 * g12 + (w21 * g21 + w22 * g22)
        # gradients [grey levels/px] by central differences
        gu = w11 * (g12 - g10) + w12 * (g13 - g11) + (w21 * (g22 - g20) + w22 * (g23 - g21))
        gv = w11 * (g21 - g01) + w12 * (g22 - g02) + (w21 * (g31 - g11) + w22 * (g32 - g12))
        gu, gv = 0.5 * scale * gu, 0.5 * scale * gv
        offsets[i] = grey - gain * value - offset
        # motion [px/m] of the image point as the ground point moves along the past base's axes
        fx = gu * (focal * xx - x * xz) + gv * (focal * xy - y * xz)
        fy = gu * (focal * yx - x * yz) + gv * (focal * yy - y * yz)
        slopes[0, i], slopes[1, i] = fx, fy
        slopes[2, i] = fy * qx - fx * qy
        slopes[3, i], slopes[4, i] = -value, -1.0
        slopes[SLANT, i] = (fx * tx + fy * ty) * farness[i]


@numba.njit(cache=True, error_model="numpy")
def _weighted_sums(
    weights: Array,
    offsets: Array,
    slopes: Array,
    scaled: Array,
    matrix: Array,
    right: Array,
) -> None:
    """Set ``matrix`` (m, m), the weighted products of ``slopes`` (m, n), and ``right`` (m,).

    ``right`` are the negative ones with ``offsets`` (n,); ``scaled`` (n,) is workspace.
    """
    for a in range(right.size):
        for i in range(scaled.size):
            scaled[i] = weights[i] * slopes[a, i]
        right[a] = -dot(scaled, offsets)
        for e in range(a, right.size):
            matrix[a, e] = matrix[e, a] = dot(scaled, slopes[e])


@numba.njit(cache=True, error_model="numpy")
def register_floor(
    past: Floats,
    values: Array,
    ground: Array,
    farness: Array,
    camera: Array,
    base_from_camera: Array,
    start: Array,
    prior: Array,
) -> tuple[Array, Array, float, float, float]:
    """Fit the motion over the floor that explains the present image by the past one.

    Args:
        past: (rows, columns) the part of the past image that may show floor [grey levels],
            smoothed.
        values: (n,) grey levels of the present image, smoothed, at n of its pixels.
        ground: (n, 2) x, y [m, base_link] of the floor that these pixels show.
        farness: (n,) logarithm of the floor's distance from the camera over the least distance.
        camera: focal length [px], position ahead of base_link and height above the floor [m],
            principal point in ``past`` (column, row).
        base_from_camera: (3, 3) rotation of the camera's axes into base_link's.
        start: (UNKNOWNS,) parameters to start from; also the mean of the prior.
        prior: (UNKNOWNS, UNKNOWNS) information of the prior.

    Returns:
        parameters (UNKNOWNS,); the images' information on them and on the slant, (UNKNOWNS + 1,
        UNKNOWNS + 1), and pull on the slant; the share of the visible pixels that agree; the share
        of the variance of their grey levels that the motion explains. The last three are 0 if the
        past image shows less than a quarter of the pixels.

    """
    n = values.size
    texture = np.median(np.abs(values - np.median(values))) / _DEVIATION
    size = UNKNOWNS + 1
    at, offsets, slopes = start.copy(), np.empty(n), np.zeros((size, n))
    weights, scaled = np.empty(n), np.empty(n)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    sigma, agree = _MIN_GREY, 0
    for iteration in range(_ITERATIONS):
        _residuals(past, values, ground, farness, camera, base_from_camera, at, offsets, slopes)
        seen = np.abs(offsets[~np.isnan(offsets)])
        if seen.size < n // 4:
            return at, matrix, 0.0, 0.0, 0.0
        sigma = max(np.median(seen) / _DEVIATION, _MIN_GREY)
        agree = 0
        for i in range(n):
            weights[i] = 0.0
            if math.isnan(offsets[i]):
                offsets[i] = 0.0
                continue
            off = offsets[i] / sigma
            agree += abs(off) < 3.0
            if iteration < _WIDE:
                weights[i] = 1.0 / (sigma * sigma * (1.0 + off * off / CAUCHY))
            else:
                weights[i] = math.exp(-off * off / _WELSCH) / (sigma * sigma)
        _weighted_sums(weights, offsets, slopes, scaled, matrix, right)
        away = start - at
        for a in range(UNKNOWNS):
            right[a] += dot(prior[a], away)
        step = solve_system(matrix[:UNKNOWNS, :UNKNOWNS] + prior, right[:UNKNOWNS])
        at += step
        if iteration >= _WIDE and max(abs(step[0]), abs(step[1]), abs(step[2])) < _CONVERGED:
            break
    explained = 1.0 - (sigma / max(texture, _MIN_GREY)) ** 2
    return at, matrix, right[SLANT], agree / seen.size, explained
