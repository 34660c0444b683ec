"""Compiled fits of walls: reweighted least squares over cells, and deviations from the planes."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array, Indices, Mask


@numba.njit(cache=True)
def find_wall_planes(
    lateral: Array,
    ahead: Array,
    fall: Array,
    halves: Mask,
    column: Indices,
    nearness: Array,
    sigma: Array,
    confidence: Array,
    weight: Array,
    mount: float,
) -> tuple[Array, Array]:
    """Fit the planes of both halves and compute the deviations from them; see ``walls``.

    Returns (3, 4): two rows (slant, front, explained weight, weight) of the left and the right
    half, then (shared, opening, left step, right step); and (columns,): the factor by which the
    contents of each column are significantly nearer than the planes, otherwise 1.
    """
    planes = _fit_planes(lateral, ahead, halves, nearness, weight, sigma)
    apart = planes[0, 2] + planes[1, 2]
    # share that one plane explains of what two planes do: one wall for certain from 93 % on
    shared = 0.0
    if apart > 0.0:
        shared = min(max((planes[2, 2] / apart - 0.88) / 0.05, 0.0), 1.0)
        # unless the two planes form a well-fitting corner
        worse = min(planes[0, 2] / max(planes[0, 3], 1e-9), planes[1, 2] / max(planes[1, 3], 1e-9))
        bend = math.atan2(-planes[0, 0], planes[0, 1]) + math.atan2(planes[1, 0], planes[1, 1])
        corner = min(max((bend - 0.6) / 0.3, 0.0), 1.0) * min(max((worse - 0.84) / 0.06, 0.0), 1.0)
        shared *= 1.0 - corner
    for half in range(2):
        for k in range(2):
            planes[half, k] += shared * (planes[2, k] - planes[half, k])
    deficit = _off_planes(
        planes, lateral, ahead, fall, halves, column, nearness, sigma, confidence, mount
    )
    columns = deficit.shape[1]
    middle = columns // 2
    opening = -1.0
    for c in range(middle - 3, middle + 2):
        opening = max(opening, _surely(deficit, c, c + 2, 1.0))
    planes[2, 0], planes[2, 1] = shared, opening
    edge = max(columns // 5, 1)
    planes[2, 2] = _surely(deficit, 0, edge, -1.0)
    planes[2, 3] = _surely(deficit, columns - edge, columns, -1.0)
    nearer = np.ones(columns)
    for c in range(columns):
        if _surely(deficit, c, c + 1, -1.0) > 0.0:
            nearer[c] = 1.0 / (1.0 + deficit[1, c] / deficit[0, c])
    return planes, nearer


@numba.njit(cache=True)
def _off_planes(
    planes: Array,
    lateral: Array,
    ahead: Array,
    fall: Array,
    halves: Mask,
    column: Indices,
    nearness: Array,
    sigma: Array,
    confidence: Array,
    mount: float,
) -> Array:
    """Sums (2, columns) of weights and of weighted relative deficits of nearness to the planes.

    The sums include the cells whose rays meet the plane at the heights of an open door.
    """
    sums = np.zeros((2, column.max() + 1))
    # far along a corridor an open door changes nearness little: the scale is at least a share of
    # the greatest nearness in the planes
    near = 0.0
    for i in range(nearness.shape[0]):
        near = max(near, _nearer_plane(planes, lateral, ahead, halves, i))
    for i in range(nearness.shape[0]):
        if confidence[i] < 0.1:
            continue
        predicted = _nearer_plane(planes, lateral, ahead, halves, i)
        if predicted < 0.05:
            continue
        height = mount - fall[i] / predicted
        if height < 0.1 or height > 1.9:
            continue
        scale = max(predicted, nearness[i], 0.4 * near)
        s = sigma[i] / scale
        w = confidence[i] / (s * s + 0.0025)
        sums[0, column[i]] += w
        sums[1, column[i]] += w * (predicted - nearness[i]) / scale
    return sums


@numba.njit(cache=True)
def _nearer_plane(planes: Array, lateral: Array, ahead: Array, halves: Mask, i: int) -> float:
    """Nearness [1/m] of the planes in whose half cell ``i`` lies, the larger one; at least 0."""
    nearness = 0.0
    for half in range(2):
        if halves[half, i]:
            nearness = max(nearness, planes[half, 0] * lateral[i] + planes[half, 1] * ahead[i])
    return nearness


@numba.njit(cache=True)
def _surely(sums: Array, begin: int, end: int, sign: float) -> float:
    """Return mean over columns times ``sign``, less its standard error, at least -1; -1 if unknown.

    The standard error is that of correlated neighbours: twice that of independent cells.
    """
    total = sums[0, begin:end].sum()
    if total <= 0.0:
        return -1.0
    return max(float(sign * sums[1, begin:end].sum() / total - math.sqrt(4.0 / total)), -1.0)


@numba.njit(cache=True)
def _fit_planes(
    lateral: Array,
    ahead: Array,
    halves: Mask,
    nearness: Array,
    weight: Array,
    sigma: Array,
) -> Array:
    """Planes of the left half, the right half and the whole image: (3, 4).

    Each row is (slant, front, explained weight, weight) of ``slant * lateral + front * ahead``.
    """
    n = nearness.shape[0]
    cells = np.empty((3, 5, n))
    counts = np.zeros(3, np.int64)
    for i in range(n):
        if weight[i] <= 0.0:
            continue
        for fit in range(3):
            if fit == 2 or halves[fit, i]:
                k = counts[fit]
                cells[fit, 0, k], cells[fit, 1, k] = lateral[i], ahead[i]
                cells[fit, 2, k], cells[fit, 3, k] = nearness[i], weight[i]
                cells[fit, 4, k] = sigma[i]
                counts[fit] += 1
    result = np.zeros((3, 4))
    for fit in range(3):
        members = cells[fit, :, : counts[fit]]
        result[fit, 3] = members[3].sum()
        if counts[fit] < 3:
            continue
        middle = 0.5 * np.abs(members[0]).max()
        for start in range(3):
            # starts: fits to all cells, to the outer and to the inner ones; for the whole image, to
            # all cells and the planes of the halves
            if fit == 2 and start > 0:
                slant, front = result[start - 1, 0], result[start - 1, 1]
            else:
                slant, front = _start(members, start, middle)
            slant, front, explained = _settle(members, slant, front)
            if explained > result[fit, 2]:
                result[fit, 0], result[fit, 1], result[fit, 2] = slant, front, explained
    return result


@numba.njit(cache=True)
def _start(cells: Array, start: int, middle: float) -> tuple[float, float]:
    """Weighted fit to all cells (``start`` 0), those beyond ``middle`` (1) or within it (2)."""
    weights = np.zeros(cells.shape[1])
    for i in range(weights.size):
        x, q, s = cells[0, i], cells[2, i], cells[4, i]
        if (start == 1 and abs(x) < middle) or (start == 2 and abs(x) > middle):
            continue
        weights[i] = cells[3, i] / (s * s + 0.01 * q * q + 0.001)
    slant, front, _ = _least_squares(cells, weights)
    return slant, front


@numba.njit(cache=True)
def _settle(cells: Array, slant: float, front: float) -> tuple[float, float, float]:
    """Reweighted fit (Tukey's biweight of decreasing width): (slant, front, explained weight).

    The explained weight is the sum over the cells of weight times 1 - (residual / width)^2.
    """
    weights = np.empty(cells.shape[1])
    for step in range(7):
        widen = max(4.0 - 0.75 * step, 1.0)
        explained = 0.0
        for i in range(weights.size):
            q, s = cells[2, i], cells[4, i]
            predicted = slant * cells[0, i] + front * cells[1, i]
            # two sigmas plus the unevenness of walls
            width = widen * (2.0 * s + 0.08 * abs(predicted) + 0.02)
            ratio = (q - predicted) / width
            share = max(1.0 - ratio * ratio, 0.0)
            weights[i] = cells[3, i] * share
            explained += weights[i]
            weights[i] *= share / (s * s + 0.0025 * q * q + 0.0004)
        if step == 6:
            break
        fitted_slant, fitted_front, unique = _least_squares(cells, weights)
        if not unique:
            break
        slant, front = fitted_slant, fitted_front
    return slant, front, explained


@numba.njit(cache=True)
def _least_squares(cells: Array, weights: Array) -> tuple[float, float, bool]:
    """Slant and front of the plane that fits ``cells``, and whether it is the only one; else 0."""
    xx, xy, yy, xq, yq = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(weights.size):
        x, y, q, w = cells[0, i], cells[1, i], cells[2, i], weights[i]
        xx += w * x * x
        xy += w * x * y
        yy += w * y * y
        xq += w * x * q
        yq += w * y * q
    determinant = xx * yy - xy * xy
    if determinant <= 1e-9 * xx * yy + 1e-12:
        return 0.0, 0.0, False
    return (xq * yy - yq * xy) / determinant, (yq * xx - xq * xy) / determinant, True
