"""Compiled matching of seen points to a floor plan: one pose refined, or many poses rated.

The plan is a signed distance field: distance [m] of each cell's centre from the nearest wall's
surface, negative inside walls. A seen point of a wall has the distance 0; one of furniture or of a
wall that is not there has any, so points count by their probability of belonging to the plan.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.numerics.algebra_kernels import dot, solve_system
from navfw.numerics.arrays import Floats

PLAN_SIGMA = 0.04  # chosen
"""Standard deviation [m] of the walls in a plan: its cells, skirting, doors left ajar."""

_OTHER = 0.1  # chosen
"""Density of points of furniture, the same at all distances, relative to the peak of those of
walls."""

SHORT = 0.25  # chosen
"""Part of a ray next to its point [m] in which no wall counts as blocking it."""

NEAR = 0.1  # chosen
"""Distance [m] up to which a point belongs to a wall; rays and points count so far around."""

_ITERATIONS = 8  # chosen
"""Number of Gauss-Newton steps."""


@numba.njit(cache=True, error_model="numpy")
def _at(field: Floats, x: float, y: float) -> tuple[float, float, float]:
    """Interpolate distance and slopes along x and y, in cells, at column ``x``, row ``y`` [cells].

    Bilinear between the centres of the cells; NaN outside.
    """
    rows, columns = field.shape
    j, i = int(math.floor(x)), int(math.floor(y))
    if j < 0 or i < 0 or j + 1 >= columns or i + 1 >= rows:
        return math.nan, 0.0, 0.0
    u, v = x - j, y - i
    a, b, c, d = field[i, j], field[i, j + 1], field[i + 1, j], field[i + 1, j + 1]
    value = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d)
    return value, (1 - v) * (b - a) + v * (d - c), (1 - u) * (c - a) + u * (d - b)


@numba.njit(cache=True, error_model="numpy")
def match_points(
    points: Array,
    sigma: Array,
    origins: Array,
    field: Floats,
    cell: float,
    start: Array,
    prior: Array,
) -> tuple[Array, Array, float]:
    """Fit the pose, and a scale of the points' distances, to the walls of the plan.

    Gauss-Newton on the distances from the walls. Each point counts by the probability that it
    belongs to the plan: the density of its distance against a constant one of all else.

    Args:
        points: (n, 2) seen points [m] in base_link.
        sigma: (n,) standard deviations [m] along the rays from the camera to the points.
        origins: (n, 2) where the camera was when it saw each point [m], in base_link.
        field: (rows, columns) signed distances [cells].
        cell: side of a cell [m].
        start: (4,) x, y [m] and yaw [rad] of the robot along the grid's axes, and the logarithm of
            the scale.
        prior: (4, 4) information of ``start``.

    Returns:
        the state (4,), the information (4, 4) of the points only, as if they were independent, and
        the mean probability of belonging to the plan.

    """
    state, information, right = start.copy(), np.zeros((4, 4)), np.zeros(4)
    slope = np.zeros(4)
    belonging = 0.0
    for _ in range(_ITERATIONS):
        information[:] = 0.0
        away = start - state
        for a in range(4):
            right[a] = dot(prior[a], away)
        belonging = 0.0
        c, s, scale = math.cos(state[2]), math.sin(state[2]), math.exp(state[3])
        for i in range(points.shape[0]):
            rx, ry = points[i, 0] - origins[i, 0], points[i, 1] - origins[i, 1]
            px, py = origins[i, 0] + scale * rx, origins[i, 1] + scale * ry
            dx, dy = c * px - s * py, s * px + c * py
            x, y = (state[0] + dx) / cell - 0.5, (state[1] + dy) / cell - 0.5
            distance, gx, gy = _at(field, x, y)
            if math.isnan(distance):
                continue
            steep = math.hypot(gx, gy)
            if steep < 0.1:
                continue
            # by how much the distance grows where the point is farther, in parts of its range
            deeper = scale * (gx * (c * rx - s * ry) + gy * (s * rx + c * ry))
            across = deeper / max(steep * math.hypot(rx, ry), 1e-9) * sigma[i]
            variance = PLAN_SIGMA * PLAN_SIGMA + across * across
            off = distance * cell
            density = math.exp(-0.5 * off * off / variance)
            # a wider density has a lower peak
            weight = density / (density + _OTHER * math.sqrt(variance) / PLAN_SIGMA)
            belonging += weight
            slope[0], slope[1], slope[2], slope[3] = gx, gy, -gx * dy + gy * dx, deeper
            for a in range(4):
                right[a] -= weight * slope[a] * off / variance
                for b in range(4):
                    information[a, b] += weight * slope[a] * slope[b] / variance
        state += solve_system(information + prior, right)
    return state, information, belonging / max(points.shape[0], 1)


@numba.njit(cache=True, error_model="numpy")
def rate_poses(
    points: Array, sigma: Array, field: Floats, cell: float, poses: Array, plan_sigma: float
) -> Array:
    """Rate each of ``poses`` (m, 3) by the points' mean log likelihood; see ``match_points``."""
    rating = np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        total = 0.0
        for i in range(points.shape[0]):
            x = (poses[k, 0] + c * points[i, 0] - s * points[i, 1]) / cell - 0.5
            y = (poses[k, 1] + s * points[i, 0] + c * points[i, 1]) / cell - 0.5
            j, r = int(x + 0.5), int(y + 0.5)
            density = 0.0
            if 0 <= r < field.shape[0] and 0 <= j < field.shape[1] and x >= 0.0 and y >= 0.0:
                off = field[r, j] * cell
                density = math.exp(-0.5 * off * off / (plan_sigma**2 + sigma[i] ** 2))
            total += math.log(density + _OTHER)
        rating[k] = total / max(points.shape[0], 1)
    return rating


@numba.njit(cache=True, error_model="numpy")
def _count_around(
    counts: npt.NDArray[np.int64], field: Floats, x: int, y: int, reach: int, amount: np.int64
) -> None:
    """Add to the counts of the walls' cells at most ``reach`` [cells] from a cell, down to 0."""
    for row in range(max(y - reach, 0), min(y + reach + 1, field.shape[0])):
        for column in range(max(x - reach, 0), min(x + reach + 1, field.shape[1])):
            if field[row, column] < 0.0:
                counts[row, column] = min(max(counts[row, column] + amount, 0), 1000)


@numba.njit(cache=True, error_model="numpy")
def count_rays_through_walls(
    points: Array,
    origins: Array,
    field: Floats,
    cell: float,
    pose: Array,
    counts: npt.NDArray[np.int64],
) -> None:
    """Count in ``counts`` (rows, columns) the rays through each wall, less the points on it.

    A ray counts only if its point belongs to a wall, at most ``NEAR`` off: the pose then
    explains the point, so the walls before it are in doubt. Rays and points count for the cells
    around, too. For the other arguments see ``share_of_blocked_rays``; ``pose`` is (3,).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    near = NEAR / cell
    reach, through, seen = int(near) + 1, np.int64(1), np.int64(-1)
    for i in range(points.shape[0]):
        ex = int((pose[0] + c * points[i, 0] - s * points[i, 1]) / cell)
        ey = int((pose[1] + s * points[i, 0] + c * points[i, 1]) / cell)
        if not (0 <= ex < field.shape[1] and 0 <= ey < field.shape[0]):
            continue
        if abs(field[ey, ex]) > near:
            continue
        _count_around(counts, field, ex, ey, reach, seen)
        dx, dy = points[i, 0] - origins[i, 0], points[i, 1] - origins[i, 1]
        length = math.hypot(dx, dy)
        inside = False
        for step in range(int((length - SHORT) / cell)):
            share = step * cell / length
            px, py = origins[i, 0] + share * dx, origins[i, 1] + share * dy
            x, y = int((pose[0] + c * px - s * py) / cell), int((pose[1] + s * px + c * py) / cell)
            if not (0 <= x < field.shape[1] and 0 <= y < field.shape[0]):
                break
            if field[y, x] < 0.0 and not inside:
                _count_around(counts, field, x, y, reach, through)
            inside = field[y, x] < 0.0


@numba.njit(cache=True, error_model="numpy")
def share_of_blocked_rays(
    points: Array, origins: Array, field: Floats, cell: float, poses: Array
) -> Array:
    """Compute the share (m,) of the rays to seen points that a wall of the plan would block.

    Args:
        points: (n, 2) seen points [m] in base_link.
        origins: (n, 2) where the camera was when it saw them [m], in base_link.
        field: (rows, columns) signed distances [cells].
        cell: side of a cell [m].
        poses: (m, 3) x, y [m] and yaw [rad] of base_link along the grid's axes.

    """
    share = np.zeros(poses.shape[0])
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - origins[i, 0], points[i, 1] - origins[i, 1]
            length = math.hypot(dx, dy)
            steps = int((length - SHORT) / cell)
            for step in range(steps):
                along = step * cell / length
                px, py = origins[i, 0] + along * dx, origins[i, 1] + along * dy
                x = (poses[k, 0] + c * px - s * py) / cell
                y = (poses[k, 1] + s * px + c * py) / cell
                if not (0.0 <= x < field.shape[1] and 0.0 <= y < field.shape[0]):
                    break
                if field[int(y), int(x)] < 0.0:
                    share[k] += 1.0
                    break
        share[k] /= max(points.shape[0], 1)
    return share
