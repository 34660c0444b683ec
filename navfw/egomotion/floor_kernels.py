"""Compiled registration of the floor between two images: the robot's motion over it, in metres.

A point of the floor lies at a known place relative to the robot, since height and pitch of the
camera are known. The motion that brings the grey values of both images together is found by robust
least squares on the grey values themselves (Lucas and Kanade 1981; Baker and Matthews 2004).
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.egomotion.epipolar_fit import CAUCHY

__all__ = ["SLANT", "UNKNOWNS", "register_floor"]

Doubles = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]

UNKNOWNS = 5
"""x, y [m], yaw [rad] of the robot in its past base_link; gain - 1 and offset [grey levels] of the
past image's brightness."""

SLANT = UNKNOWNS
"""Index of the slant of what is seen, which is tested and not fitted: with the slant s a pixel
shows something nearer than the floor by the factor (distance / nearest)^s, ``nearest`` being the
distance of the nearest floor in view. 0 is the floor, 1 a wall that stands there."""

DEVIATION = 0.6745
"""Median absolute deviation of a normal distribution of standard deviation 1."""

CONVERGED = 2e-5
"""Step of the motion [m and rad] below which the fit has converged."""

WIDE = 3
"""Number of steps with Cauchy weights, which reach far; the others have Welsch weights."""

WELSCH = 2.985**2
"""Squared width of the Welsch weights [sigma^2]: 95 % efficient on normal errors."""


@numba.njit(cache=True, error_model="numpy")
def _residuals(
    past: Floats,
    across: Floats,
    down: Floats,
    values: Doubles,
    ground: Doubles,
    farness: Doubles,
    camera: Doubles,
    base_from_camera: Doubles,
    at: Doubles,
    offsets: Doubles,
    slopes: Doubles,
) -> None:
    """Residuals (n,) [grey levels] at the parameters ``at``, and their slopes (n, UNKNOWNS + 1).

    The last slope is that of the slant, about 0.

    NaN where the past image does not show the point. Arguments as in ``register_floor``.
    """
    focal, ahead, height = camera[0], camera[1], camera[2]
    rows, columns = past.shape
    cx, cy = 0.5 * (columns - 1), 0.5 * (rows - 1)
    c, s = math.cos(at[2]), math.sin(at[2])
    b = base_from_camera
    for i in range(values.size):
        px, py = ground[i, 0], ground[i, 1]
        qx, qy = c * px - s * py, s * px + c * py
        dx, dy = qx + at[0] - ahead, qy + at[1]
        depth = b[0, 2] * dx + b[1, 2] * dy - b[2, 2] * height
        offsets[i] = math.nan
        if depth <= 0.0:
            continue
        x = focal * (b[0, 0] * dx + b[1, 0] * dy - b[2, 0] * height) / depth
        y = focal * (b[0, 1] * dx + b[1, 1] * dy - b[2, 1] * height) / depth
        column, row = cx + x, cy + y
        j, k = int(math.floor(row)), int(math.floor(column))
        if j < 1 or k < 1 or j + 2 >= rows or k + 2 >= columns:
            continue
        v, u = row - j, column - k
        w00, w01, w10, w11 = (1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u
        grey = w00 * past[j, k] + w01 * past[j, k + 1]
        grey += w10 * past[j + 1, k] + w11 * past[j + 1, k + 1]
        gu = w00 * across[j, k] + w01 * across[j, k + 1]
        gu += w10 * across[j + 1, k] + w11 * across[j + 1, k + 1]
        gv = w00 * down[j, k] + w01 * down[j, k + 1]
        gv += w10 * down[j + 1, k] + w11 * down[j + 1, k + 1]
        offsets[i] = grey - (1.0 + at[3]) * values[i] - at[4]
        # motion [px/m] of the image point as the ground point moves along the past base's axes
        fx = gu * (focal * b[0, 0] - x * b[0, 2]) + gv * (focal * b[0, 1] - y * b[0, 2])
        fy = gu * (focal * b[1, 0] - x * b[1, 2]) + gv * (focal * b[1, 1] - y * b[1, 2])
        slopes[i, 0], slopes[i, 1] = fx / depth, fy / depth
        slopes[i, 2] = (-fx * qy + fy * qx) / depth
        slopes[i, 3], slopes[i, 4] = -values[i], -1.0
        slopes[i, SLANT] = (slopes[i, 0] * at[0] + slopes[i, 1] * at[1]) * farness[i]


@numba.njit(cache=True, error_model="numpy")
def register_floor(
    past: Floats,
    across: Floats,
    down: Floats,
    values: Doubles,
    ground: Doubles,
    farness: Doubles,
    camera: Doubles,
    base_from_camera: Doubles,
    start: Doubles,
    prior: Doubles,
    least: float,
    iterations: int,
) -> tuple[Doubles, Doubles, float, float, float]:
    """The motion over the floor that explains the present image by the past one.

    Args:
        past: (height, width) past image [grey levels], smoothed.
        across: (height, width) its derivative along columns [grey levels/px].
        down: (height, width) its derivative along rows [grey levels/px].
        values: (n,) grey levels of the present image, smoothed, at n of its pixels.
        ground: (n, 2) x, y [m, base_link] of the floor that these pixels show.
        farness: (n,) logarithm of its distance from the camera over that of the nearest of it.
        camera: focal length [px], position ahead of base_link and height above the floor [m].
        base_from_camera: (3, 3) rotation of the camera's axes into base_link's.
        start: (UNKNOWNS,) parameters to start from; also the mean of the prior.
        prior: (UNKNOWNS, UNKNOWNS) information of the prior.
        least: least standard deviation of a residual [grey levels].
        iterations: largest number of Gauss-Newton steps.

    Returns:
        parameters (UNKNOWNS,), the information (UNKNOWNS + 1, UNKNOWNS + 1) of the images alone on
        them and on the slant, the images' pull on the slant, the share of the visible pixels that
        agree, and the share of the variance of their grey levels that the motion explains.

    """
    n = values.size
    texture = np.median(np.abs(values - np.median(values))) / DEVIATION
    size = UNKNOWNS + 1
    at, offsets, slopes = start.copy(), np.empty(n), np.zeros((n, size))
    matrix, right = np.zeros((size, size)), np.zeros(size)
    sigma, agree = least, 0
    for iteration in range(iterations):
        _residuals(
            past,
            across,
            down,
            values,
            ground,
            farness,
            camera,
            base_from_camera,
            at,
            offsets,
            slopes,
        )
        seen = np.abs(offsets[~np.isnan(offsets)])
        if seen.size < n // 4:
            return at, matrix, 0.0, 0.0, 0.0
        sigma = max(np.median(seen) / DEVIATION, least)
        matrix[:] = 0.0
        right[:UNKNOWNS] = prior @ (start - at)
        right[SLANT] = 0.0
        agree = 0
        for i in range(n):
            if math.isnan(offsets[i]):
                continue
            off = offsets[i] / sigma
            agree += abs(off) < 3.0
            if iteration < WIDE:
                weight = 1.0 / (sigma * sigma * (1.0 + off * off / CAUCHY))
            else:
                weight = math.exp(-off * off / WELSCH) / (sigma * sigma)
            for a in range(size):
                scaled = weight * slopes[i, a]
                right[a] -= scaled * offsets[i]
                for e in range(a, size):
                    matrix[a, e] += scaled * slopes[i, e]
        for a in range(size):
            for e in range(a):
                matrix[a, e] = matrix[e, a]
        step = np.linalg.solve(matrix[:UNKNOWNS, :UNKNOWNS] + prior, right[:UNKNOWNS])
        at += step
        if iteration >= WIDE and max(abs(step[0]), abs(step[1]), abs(step[2])) < CONVERGED:
            break
    explained = 1.0 - (sigma / max(texture, least)) ** 2
    return at, matrix, right[SLANT], agree / seen.size, explained
