"""The per-cell loops of OFFIS, compiled. Flat arrays over the cells of the grid; float64."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.signals import Array

__all__ = [
    "SIGMA_LIMIT",
    "fit_upright_plane",
    "fit_upright_planes",
    "label_cells",
    "region_moments",
    "triangulate_cells",
]

SIGMA_LIMIT = 20.0
"""Sigma [1/m] at which a cell says nothing at all: nothing is nearer than a few centimetres."""

_UNKNOWN, _FLOOR, _OBSTACLE, _DROP, _ABOVE = 0, 1, 2, 3, 4


@numba.njit(cache=True)
def triangulate_cells(
    points: Array,
    vectors: Array,
    confidence: Array,
    sigma: Array,
    focal: float,
    translation: Array,
    yaw_sigma: float,
    relative_sigma: float,
    rejection: float,
) -> tuple[Array, Array, Array]:
    """Nearness, its sigma and its confidence for each of (n, 2) points; see ``nearness``."""
    n = points.shape[0]
    nearness = np.zeros(n)
    spread = np.full(n, SIGMA_LIMIT)
    trust = np.zeros(n)
    sx, sy, sz = translation[0], translation[1], translation[2]
    for i in range(n):
        x, y = points[i, 0], points[i, 1]
        u, v = vectors[i, 0], vectors[i, 1]
        if not (confidence[i] > 0.0 and math.isfinite(u) and math.isfinite(v)):
            continue
        ex, ey = x * sz - focal * sx, y * sz - focal * sy
        length = math.hypot(ex, ey)
        if length < 1e-9:
            continue
        ex, ey = ex / length, ey / length
        along = u * ex + v * ey
        across = v * ex - u * ey
        # what a yaw error of one sigma adds to the vector (METHOD 2.3), on both directions
        rx = yaw_sigma * (focal + x * x / focal)
        ry = yaw_sigma * x * y / focal
        sigma_along = math.hypot(sigma[i], rx * ex + ry * ey)
        sigma_across = math.hypot(sigma[i], ry * ex - rx * ey)

        k = along / length
        sigma_k = math.hypot(sigma_along / length, relative_sigma * k)
        # q = k / (1 - sz k); the denominator is Z / (Z + sz), so it must stay positive
        shrink = 1.0 - sz * k
        if shrink < 0.05:
            continue
        q = k / shrink
        sigma_q = sigma_k / (shrink * shrink)
        residual = abs(across)
        if q < -rejection * sigma_q - 1e-9 or residual > rejection * sigma_across + 1e-9:
            continue
        nearness[i] = max(q, 0.0)
        spread[i] = min(sigma_q, SIGMA_LIMIT)
        informative = sigma_q / (0.2 + 0.3 * nearness[i])
        ratio = residual / (2.0 * sigma_across + 1e-9)
        trust[i] = confidence[i] * math.exp(-ratio * ratio) / (1.0 + informative * informative)
    return nearness, spread, trust


@numba.njit(cache=True)
def label_cells(
    nearness: Array,
    sigma: Array,
    confidence: Array,
    drop_slope: Array,
    mount: float,
    limits: Array,
) -> tuple[Array, npt.NDArray[np.int8]]:
    """Height [m] above the floor and label of each cell; see ``floor``.

    ``drop_slope`` (n,) is how far [m] the ray falls per metre of depth; ``limits`` are
    (minimum confidence, sigmas, drop sigmas, obstacle height, floor tolerance, floor resolution,
    drop depth, top).
    """
    n = nearness.shape[0]
    height = np.empty(n)
    label = np.zeros(n, np.int8)
    least, sigmas, drop_sigmas, rise, tolerance, resolution, depth, top = limits
    for i in range(n):
        q, s, g = nearness[i], sigma[i], drop_slope[i]
        distance = 1.0 / max(q, 1e-3)
        height[i] = mount - g * distance
        if confidence[i] < least:
            continue
        # Tested in nearness, where errors are symmetric, not in height, where they are not:
        # H > a for a ray that falls by g means q > g / (mount - a).
        if g <= 0.0:
            overhead = -g / (top - mount) if top > mount else math.inf
            if q + sigmas * s < overhead:
                label[i] = _ABOVE
            elif q >= overhead and q > sigmas * s:
                label[i] = _OBSTACLE
        else:
            floor = g / mount
            sigma_height = g * s * distance * distance
            if height[i] > rise and q - floor > sigmas * s:
                if height[i] < top:
                    label[i] = _OBSTACLE
            elif height[i] < -depth and floor - q > drop_sigmas * s:
                label[i] = _DROP
            elif sigma_height < resolution and abs(height[i]) < max(
                tolerance, sigmas * sigma_height
            ):
                label[i] = _FLOOR
    return height, label


@numba.njit(cache=True)
def region_moments(
    regions: npt.NDArray[np.int64],
    values: Array,
    weights: Array,
    known: Array,
    nearest_share: float,
    nearest_least: float,
) -> Array:
    """Statistics (n_regions, 9) over rectangles of the grid; see ``pyramid.RegionStatistics``.

    ``regions`` (n_regions, 4) are (row, end row, column, end column); ``values`` and ``weights``
    (3, rows, cols) hold nearness, muU's and muV's quantity; ``known`` (rows, cols) is 1 or 0.
    """
    result = np.zeros((regions.shape[0], 9))
    for r in range(regions.shape[0]):
        row, end_row, col, end_col = regions[r]
        cells = (end_row - row) * (end_col - col)
        near = np.empty(cells)
        share = np.empty(cells)
        filled = 0
        count = 0.0
        for i in range(row, end_row):
            for j in range(col, end_col):
                count += known[i, j]
                if weights[0, i, j] > 0.0:
                    near[filled] = -values[0, i, j]
                    share[filled] = weights[0, i, j]
                    filled += 1
        result[r, 0] = count / cells
        result[r, 1] = filled / cells
        for channel in range(3):
            total, mean = 0.0, 0.0
            for i in range(row, end_row):
                for j in range(col, end_col):
                    total += weights[channel, i, j]
                    mean += weights[channel, i, j] * values[channel, i, j]
            if total <= 0.0:
                continue
            mean /= total
            variance = 0.0
            for i in range(row, end_row):
                for j in range(col, end_col):
                    off = values[channel, i, j] - mean
                    variance += weights[channel, i, j] * off * off
            result[r, 2 + 2 * channel] = mean
            result[r, 3 + 2 * channel] = variance / total
        if filled > 0:
            order = np.argsort(near[:filled])
            wanted = max(nearest_share * share[:filled].sum(), nearest_least)
            total, mean = 0.0, 0.0
            for n in range(filled):
                weight = min(share[order[n]], wanted - total)
                total += weight
                mean -= weight * near[order[n]]
                if total >= wanted:
                    break
            # a few lone cells weigh less than a patch of them: the rest counts as empty space
            result[r, 8] = mean / wanted
    return result


@numba.njit(cache=True)
def fit_upright_plane(
    across: Array,
    ahead: Array,
    nearness: Array,
    weight: Array,
    sigma: Array,
    rounds: int,
) -> tuple[float, float, float]:
    """Robust fit of ``nearness = a * across + b * ahead``: (a, b, sum of the weights).

    Iteratively reweighted least squares after Huber, with a generous threshold: it takes the edge
    off gross outliers and still lets a door in a wall pull the plane (see ``slopes``).
    """
    n = nearness.shape[0]
    a, b = 0.0, 0.0
    total, mean = 0.0, 0.0
    for i in range(n):
        total += weight[i]
        mean += weight[i] * nearness[i]
    if total <= 0.0:
        return 0.0, 0.0, 0.0
    mean /= total
    for step in range(rounds):
        xx, xy, yy, xq, yq = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            w = weight[i]
            if w <= 0.0:
                continue
            if step > 0:
                residual = abs(nearness[i] - a * across[i] - b * ahead[i])
                threshold = 2.5 * sigma[i] + 0.5 * mean
                if residual > threshold:
                    w *= threshold / residual
            xx += w * across[i] * across[i]
            xy += w * across[i] * ahead[i]
            yy += w * ahead[i] * ahead[i]
            xq += w * across[i] * nearness[i]
            yq += w * ahead[i] * nearness[i]
        determinant = xx * yy - xy * xy
        if determinant <= 1e-9 * xx * yy + 1e-12:
            return 0.0, 0.0, 0.0
        a = (xq * yy - yq * xy) / determinant
        b = (yq * xx - xq * xy) / determinant
    return a, b, total


@numba.njit(cache=True)
def fit_upright_planes(
    masks: Array, across: Array, ahead: Array, nearness: Array, weight: Array, sigma: Array
) -> Array:
    """``fit_upright_plane`` for several (n_planes, n) masks: (n_planes, 3)."""
    result = np.zeros((masks.shape[0], 3))
    for p in range(masks.shape[0]):
        a, b, total = fit_upright_plane(across, ahead, nearness, masks[p] * weight, sigma, 3)
        result[p, 0], result[p, 1], result[p, 2] = a, b, total
    return result
