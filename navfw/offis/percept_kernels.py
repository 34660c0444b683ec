"""Compiled per-cell loops of OFFIS, on flat float64 arrays over the cells of the grid."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics.arrays import Array, Indices, Mask

SIGMA_LIMIT = 20.0  # chosen
"""Sigma [1/m] of unknown cells, and upper limit of all others: no surface is nearer than 5 cm."""

_UNKNOWN, _FLOOR, _OBSTACLE, _DROP, _ABOVE = 0, 1, 2, 3, 4  # defined


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
    """Compute nearness, sigma and confidence (n,) of ``points`` (n, 2), as ``triangulate`` says."""
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
        # change of the vector by a yaw error of one sigma (METHOD 2.3)
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
    fall: Array,
    mount: float,
    limits: Array,
) -> tuple[Array, npt.NDArray[np.int8]]:
    """Compute height [m] above the floor and label of each cell; see ``FloorModel``.

    ``fall`` (n,) [m/m] is the descent of each ray per depth; ``mount`` [m] the height of the
    camera; ``limits`` are (minimum confidence, sigmas, drop sigmas, obstacle height, floor
    tolerance, floor resolution, drop depth, top).
    """
    n = nearness.shape[0]
    height = np.empty(n)
    label = np.zeros(n, np.int8)
    least, sigmas, drop_sigmas, rise, tolerance, resolution, depth, top = limits
    for i in range(n):
        q, s, g = nearness[i], sigma[i], fall[i]
        distance = 1.0 / max(q, 1e-3)
        height[i] = mount - g * distance
        if confidence[i] < least:
            continue
        # The tests compare nearness, whose errors are symmetric, not height, whose errors are not:
        # H > a for a ray that descends by g is equivalent to q > g / (mount - a).
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
def object_cells(
    nearness: Array,
    sigma: Array,
    confidence: Array,
    label: npt.NDArray[np.int8],
    upward: Mask,
    wall_top: Array,
    wall_share: Array,
    least: float,
) -> Array:
    """Compute object weight, wall weight and floor (1 or 0), (3, n), as in ``ObjectCells``."""
    n = nearness.shape[0]
    cells = np.zeros((3, n))
    for i in range(n):
        if label[i] == _FLOOR:
            cells[2, i] = 1.0
        shown = label[i] == _OBSTACLE or label[i] == _ABOVE
        if not shown and not (upward[i] and confidence[i] >= least):
            continue
        if nearness[i] + 2.0 * sigma[i] > wall_top[i]:
            cells[0, i] = confidence[i]
            cells[1, i] = confidence[i] * wall_share[i]
    return cells


_NEAR_SHARE = 0.125  # chosen
"""Share of a region's object cells in its nearest part."""

_MIN_NEAR_WEIGHT = 2.5  # chosen
"""Least weight of that part [cells of confidence 1]; missing weight counts as empty space."""


@numba.njit(cache=True)
def region_moments(regions: Indices, values: Array, weights: Array, known: Array) -> Array:
    """Compute statistics (n_regions, 9) of rectangles of the grid, as in ``RegionStatistics``.

    ``regions`` (n_regions, 4) are (row, end row, column, end column); ``values`` and ``weights``
    (3, rows, cols) are those of nearness and of the quantities averaged to muU and muV; ``known``
    (rows, cols) is 1 or 0.
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
            wanted = max(_NEAR_SHARE * share[:filled].sum(), _MIN_NEAR_WEIGHT)
            total, mean = 0.0, 0.0
            for n in range(filled):
                weight = min(share[order[n]], wanted - total)
                total += weight
                mean -= weight * near[order[n]]
                if total >= wanted:
                    break
            # missing weight counts as empty space: a few single cells weigh less than a patch
            result[r, 8] = mean / wanted
    return result


@numba.njit(cache=True)
def blind_border(
    points: Array,
    fall: Array,
    column: Indices,
    vectors: Array,
    confidence: Array,
    rotation: Array,
    focal: float,
    limit: float,
    shift: float,
    longest: float,
) -> Array:
    """Find blind columns at the image's borders: no vector was matched near the horizon. (2, 4).

    Per side (left, right): number of blind columns; mean length [px] of the vectors in the first
    column inside them (-1 if unknown); least nearness [1/m] of a point that moves more than
    ``longest`` [px] in the innermost blind column; index of that column. ``shift`` [m] is the
    distance driven ahead. Outermost columns that were not within ``limit`` [px] of the middle of
    the past image, after ``rotation``, are skipped.
    """
    columns = column.max() + 1
    seen, cells, inside = np.zeros(columns), np.zeros(columns), np.zeros(columns)
    length, lateral = np.zeros(columns), np.zeros(columns)
    for i in range(points.shape[0]):
        if abs(fall[i]) > 0.2:
            continue
        c = column[i]
        x, y = points[i, 0], points[i, 1]
        depth = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * focal
        past = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * focal
        cells[c] += 1.0
        lateral[c] = abs(x)
        if depth > 0.0 and abs(past / depth * focal) <= limit:
            inside[c] += 1.0
        if confidence[i] > 0.0:
            seen[c] += 1.0
            length[c] += math.hypot(vectors[i, 0], vectors[i, 1])
    result = np.zeros((2, 4))
    for side in range(2):
        result[side, 1] = -1.0
        for step in range(columns // 2):
            c = step if side == 0 else columns - 1 - step
            if inside[c] < cells[c] and result[side, 0] == 0.0:
                continue
            if seen[c] > 0.0:
                result[side, 1] = length[c] / seen[c]
                break
            result[side, 0] += 1.0
            result[side, 2] = longest / max(lateral[c] * abs(shift), 1e-6)
            result[side, 3] = c
    return result


@numba.njit(cache=True)
def object_nearness(
    lateral_edge: Array,
    lateral: Array,
    ahead: Array,
    fall: Array,
    halves: Mask,
    off_axis: Array,
    slant: Array,
    front: Array,
    support: Array,
    nearness: Array,
    sigma: Array,
    confidence: Array,
    weight: Array,
    floor_seen: Array,
    column: Indices,
    nearer: Array,
    border: Array,
    mount: float,
    wall_height: float,
    least: float,
) -> tuple[Array, Array, Array]:
    """Compute nearness and weights (3, n) and known (n,) of objects, given walls and blind borders.

    ``slant``, ``front`` and ``support`` (2,) are the planes of the walls and the trust in them,
    ``nearer`` (columns,) as in ``walls.Walls``; ``border`` (2, columns) is nearness and degree of
    obstacles too near to be matched. A cell in a plane takes the plane's nearness at the cell's
    outer edge, in proportion to the support; an unknown cell where the wall must be takes it too.
    The three channels are those of ``pyramid.Channels``: equal values, with weights times 1 and
    times ``off_axis`` (2, n).
    """
    n = nearness.shape[0]
    values, weights, known = np.empty((3, n)), np.empty((3, n)), np.zeros(n)
    for i in range(n):
        value, share = nearness[i], weight[i]
        wall, edge, trust = 0.0, 0.0, 0.0
        for half in range(2):
            if halves[half, i] and support[half] > 0.0:
                in_plane = slant[half] * lateral[i] + front[half] * ahead[i]
                if in_plane > wall:
                    wall, trust = in_plane, support[half]
                    edge = max(slant[half] * lateral_edge[i] + front[half] * ahead[i], wall)
        floor = max(fall[i], 0.0) / mount
        if weight[i] > 0.0:
            width = 2.5 * sigma[i] + 0.08 * wall + 0.02
            if wall > 0.0 and abs(nearness[i] - wall) < width and wall > floor:
                value += trust * (edge * nearer[column[i]] - nearness[i])
            elif floor > 0.0:
                # an obstacle may be badly measured floor: it must differ clearly from the floor
                spread = math.sqrt(sigma[i] * sigma[i] + 0.0025 * floor * floor)
                clear = (nearness[i] - floor) / spread
                share *= min(max(0.5 * (clear - 2.0), 0.0), 1.0)
        elif floor_seen[i] == 0.0:
            if wall > max(floor, 0.05) and mount - fall[i] / wall < wall_height:
                value, share = edge * nearer[column[i]], 0.5 * trust
            hidden, degree = border[0, column[i]], border[1, column[i]]
            if degree > 0.0 and hidden > floor and mount - fall[i] / hidden < wall_height:
                value, share = max(hidden, value), max(degree, share)
        if share > 0.0 or confidence[i] >= least:
            known[i] = 1.0
        values[:, i] = value
        weights[0, i] = share
        weights[1, i] = share * off_axis[0, i]
        weights[2, i] = share * off_axis[1, i]
    return values, weights, known


@numba.njit(cache=True)
def compare_pairs(
    pairs: Indices, mu_u: Array, mu_v: Array, size: Array, objects: Array
) -> tuple[Array, Array]:
    """Compute inputs (3, n_pairs) of the plane inference, and whether both show an object (1, 0).

    The inputs are the relative differences |a - b| / (a + b) of muU and of muV, and the ratio of
    the sizes.
    """
    rows, present = np.empty((3, pairs.shape[0])), np.zeros(pairs.shape[0])
    for k in range(pairs.shape[0]):
        i, j = pairs[k]
        rows[0, k] = abs(mu_u[i] - mu_u[j]) / max(mu_u[i] + mu_u[j], 1e-12)
        rows[1, k] = abs(mu_v[i] - mu_v[j]) / max(mu_v[i] + mu_v[j], 1e-12)
        rows[2, k] = min(size[i], size[j]) / max(size[i], size[j], 1e-12)
        # a region without an object has no plane in common with another
        if objects[i] > 0.0 and objects[j] > 0.0:
            present[k] = 1.0
    return rows, present
