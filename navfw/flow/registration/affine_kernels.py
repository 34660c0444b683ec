"""Compiled inner loops of window registration: affine Lucas-Kanade, one window at a time."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["register"]

Ints = npt.NDArray[np.int64]
Doubles = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]
Real: TypeAlias = float | np.floating[Any]

#: Number of unknowns: displacement (x, y), then the change of each over half a window in x and y.
UNKNOWNS = 6
#: Largest gain of the brightness between the frames, and its reciprocal the least; the offset is
#: free.
GAIN = 2.0


@numba.njit(cache=True, error_model="numpy")
def _factorize(matrix: Doubles, lower: Doubles) -> bool:
    """Cholesky factor, its diagonal inverted; False if ``matrix`` is not positive definite."""
    for i in range(UNKNOWNS):
        for j in range(i):
            total = matrix[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = total * lower[j, j]
        total = matrix[i, i]
        for k in range(i):
            total -= lower[i, k] * lower[i, k]
        if total <= 1e-9:
            return False
        lower[i, i] = 1.0 / math.sqrt(total)
    return True


@numba.njit(cache=True)
def _solve(lower: Doubles, right: Doubles, out: Doubles) -> None:
    """Solve (L L^T) out = right for L from ``_factorize``."""
    for i in range(UNKNOWNS):
        total = right[i]
        for k in range(i):
            total -= lower[i, k] * out[k]
        out[i] = total * lower[i, i]
    for i in range(UNKNOWNS - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, UNKNOWNS):
            total -= lower[k, i] * out[k]
        out[i] = total * lower[i, i]


@numba.njit(cache=True)
def _axis(first: int, last: int, step: int, width: float) -> tuple[Ints, Floats, Floats]:
    """Sampled pixels of [first, last), their positions in [-1, 1] in the window, and weights."""
    count = (last - first + step - 1) // step
    begin = first + (last - first - 1 - (count - 1) * step) // 2
    pixels = np.empty(count, np.int64)
    place = np.empty(count, np.float32)
    weight = np.empty(count, np.float32)
    centre, half = 0.5 * (first + last - 1), 0.5 * (last - first)
    for i in range(count):
        pixels[i] = begin + i * step
        place[i] = (pixels[i] - centre) / half
        weight[i] = math.exp(-0.5 * (place[i] / width) ** 2)
    return pixels, place, weight


@numba.njit(cache=True)
def _template(
    now: Floats,
    gradient_x: Floats,
    gradient_y: Floats,
    xs: Ints,
    ys: Ints,
    place_x: Floats,
    place_y: Floats,
    weight_x: Floats,
    weight_y: Floats,
    hessian: Doubles,
    slope: Doubles,
    product: Doubles,
) -> tuple[float, float, float]:
    """Compute the quantities of a window that are constant over the iterations.

    Sets ``hessian`` (6, 6; lower triangle), the weighted products of the centred steepest descent
    images; ``slope`` (6,), their sums; ``product`` (6,), their products with the centred grey
    values. Returns the sum of the weights, the mean grey value and the weighted sum of squared
    deviations from it.
    """
    hessian[:] = 0.0
    slope[:] = 0.0
    product[:] = 0.0
    # relative to a grey value of the window: float32 squares would lose digits
    middle = now[ys[ys.size // 2], xs[xs.size // 2]]
    total, grey, energy = 0.0, 0.0, 0.0
    for j in range(ys.size):
        y = ys[j]
        zero = np.float32(0.0)
        sums_x, sums_y, places_x, places_y = zero, zero, zero, zero
        xx, xxp, xxpp, xy, xyp, xypp = zero, zero, zero, zero, zero, zero
        yy, yyp, yypp, tx, txp, ty, typ = zero, zero, zero, zero, zero, zero, zero
        weights, t_sum, tt = zero, zero, zero
        for i in range(xs.size):
            x, p, weight = xs[i], place_x[i], weight_x[i]
            t = now[y, x] - middle
            gx, gy = gradient_x[y, x], gradient_y[y, x]
            wx, wy, wt = weight * gx, weight * gy, weight * t
            weights += weight
            t_sum += wt
            tt += wt * t
            sums_x += wx
            sums_y += wy
            places_x += wx * p
            places_y += wy * p
            a, b, c = wx * gx, wx * gy, wy * gy
            xx += a
            xy += b
            yy += c
            a *= p
            b *= p
            c *= p
            xxp += a
            xyp += b
            yyp += c
            xxpp += a * p
            xypp += b * p
            yypp += c * p
            u, v = wx * t, wy * t
            tx += u
            ty += v
            txp += u * p
            typ += v * p
        w, q = float(weight_y[j]), float(place_y[j])
        total += float(w * weights)
        grey += float(w * t_sum)
        energy += float(w * tt)
        for k in range(2):
            g, gp, h, hp = (sums_x, places_x, tx, txp) if k == 0 else (sums_y, places_y, ty, typ)
            slope[k] += w * g
            slope[2 + 2 * k] += w * gp
            slope[3 + 2 * k] += w * g * q
            product[k] += w * h
            product[2 + 2 * k] += w * hp
            product[3 + 2 * k] += w * h * q
        _add_block(hessian, 0, 0, w, q, xx, xxp, xxpp)
        _add_block(hessian, 1, 0, w, q, xy, xyp, xypp)
        _add_block(hessian, 1, 1, w, q, yy, yyp, yypp)
    for k in range(UNKNOWNS):
        product[k] -= grey / total * slope[k]
        for m in range(k + 1):
            hessian[k, m] -= slope[k] * slope[m] / total
    return total, middle + grey / total, energy - grey * grey / total


@numba.njit(cache=True)
def _add_block(
    hessian: Doubles, u: int, v: int, w: float, q: float, g: Real, gp: Real, gpp: Real
) -> None:
    """Add a row's products of gradients u and v with 1, p and p^2 (lower triangle)."""
    a, b = 2 + 2 * u, 2 + 2 * v
    hessian[u, v] += w * g
    hessian[a, v] += w * gp
    hessian[a + 1, v] += w * g * q
    hessian[b, u] += w * gp * (u != v)
    hessian[b + 1, u] += w * g * q * (u != v)
    hessian[a, b] += w * gpp
    hessian[a + 1, b] += w * gp * q
    hessian[a, b + 1] += w * gp * q * (u != v)
    hessian[a + 1, b + 1] += w * g * q * q


@numba.njit(cache=True)
def _compare(
    now: Floats,
    past: Floats,
    gradient_x: Floats,
    gradient_y: Floats,
    xs: Ints,
    ys: Ints,
    place_x: Floats,
    place_y: Floats,
    weight_x: Floats,
    weight_y: Floats,
    warp: Doubles,
    mean: float,
    limits: tuple[int, int, int, int],
    product: Doubles,
) -> tuple[float, float, float, int]:
    """Sample the past image at the window's positions warped by ``warp``, and compare.

    Sets ``product`` (6,), the products of the samples with the steepest descent images. Returns the
    weighted sums of the samples (less ``mean``), of their squares and of their products with the
    window, and the number of samples outside ``limits`` (columns, rows), which are left out.
    """
    left, right, top, bottom = limits
    high_x, high_y = np.float32(right - 1.001), np.float32(bottom - 1.001)
    low_x, low_y = np.float32(left), np.float32(top)
    reach_x, reach_y = abs(warp[2]) + abs(warp[3]), abs(warp[4]) + abs(warp[5])
    safe = (
        xs[0] - warp[0] - reach_x >= left
        and xs[-1] - warp[0] + reach_x <= high_x
        and ys[0] - warp[1] - reach_y >= top
        and ys[-1] - warp[1] + reach_y <= high_y
    )
    stride = past.shape[1]
    pixels = past.ravel()
    slope_x, slope_y = np.float32(warp[2]), np.float32(warp[4])
    middle = np.float32(mean)
    product[:] = 0.0
    total, squares, both, outside = 0.0, 0.0, 0.0, 0
    for j in range(ys.size):
        y, q = ys[j], place_y[j]
        from_x = np.float32(-warp[0] - warp[3] * q)
        from_y = np.float32(y - warp[1] - warp[5] * q)
        row, row_squares, row_both = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        vx, vxp = np.float32(0.0), np.float32(0.0)
        vy, vyp = np.float32(0.0), np.float32(0.0)
        for i in range(xs.size):
            x, p = xs[i], place_x[i]
            px = np.float32(x) + from_x - slope_x * p
            py = from_y - slope_y * p
            template = now[y, x] - middle
            if safe or (low_x <= px <= high_x and low_y <= py <= high_y):
                column, line = np.int32(px), np.int32(py)
                fx, fy = px - np.float32(column), py - np.float32(line)
                at = np.uint64(line * stride + column)
                a, b = pixels[at], pixels[at + np.uint64(1)]
                c, d = pixels[at + np.uint64(stride)], pixels[at + np.uint64(stride + 1)]
                above, below = a + fx * (b - a), c + fx * (d - c)
                v = above + fy * (below - above) - middle
            else:
                # equal to the window, so that it has no influence on the step
                outside += 1
                v = template
            wv = weight_x[i] * v
            row += wv
            row_squares += wv * v
            row_both += wv * template
            gx, gy = wv * gradient_x[y, x], wv * gradient_y[y, x]
            vx += gx
            vy += gy
            vxp += gx * p
            vyp += gy * p
        w = float(weight_y[j])
        total += float(w * row)
        squares += float(w * row_squares)
        both += float(w * row_both)
        product[0] += w * vx
        product[1] += w * vy
        product[2] += w * vxp
        product[3] += w * vx * q
        product[4] += w * vyp
        product[5] += w * vy * q
    return total, squares, both, outside


@numba.njit(cache=True)
def register(
    now: Floats,
    past: Floats,
    gradient_x: Floats,
    gradient_y: Floats,
    x_windows: Ints,
    y_windows: Ints,
    start: Doubles,
    active: Flags,
    limits: tuple[int, int, int, int],
    step: int,
    width: float,
    stiffness: float,
    iterations: int,
    tolerance: float,
    reach: float,
) -> tuple[Doubles, Doubles, Doubles, Doubles, Doubles, Doubles]:
    """Register each active window of ``now`` with ``past`` by an affine motion (Gauss-Newton).

    Args:
        now: current image (height, width), smoothed.
        past: past image (height, width), smoothed; valid within ``limits``.
        gradient_x: horizontal gradient of ``now`` [grey/px].
        gradient_y: vertical gradient of ``now`` [grey/px].
        x_windows: (cols, 2) first and end (exclusive) column of each window.
        y_windows: (rows, 2) first and end (exclusive) row of each window.
        start: (rows, cols, 2) initial displacement [px], now - past.
        active: (rows, cols) windows to register.
        limits: columns [limits[0], limits[1]) and rows [limits[2], limits[3]) of ``past``.
        step: sampling interval [px].
        width: standard deviation of the Gaussian weights [half windows].
        stiffness: regularisation of the affine part, as a mean squared gradient [grey^2/px^2].
        iterations: largest number of iterations.
        tolerance: step of the displacement [px] below which the iteration ends.
        reach: largest distance from ``start`` [px]; a window that moves further is lost.

    Returns:
        vectors (rows, cols, 2) of the windows' centres [px]; their gradients (rows, cols, 4)
        [px/px]: change of x along x and along y, of y along x and along y; score (rows, cols),
        the normalised correlation after registration, 0 for inactive or lost windows; variance
        (rows, cols) [px^2] of the vectors' worse component for independent errors of the samples,
        as large as what the registration leaves over; the same (rows, cols) [px^2/grey^2] for
        errors of one grey level; and the share (rows, cols) of the samples inside the limits.

    """
    rows, cols = y_windows.shape[0], x_windows.shape[0]
    vectors = start.copy()
    gradients = np.zeros((rows, cols, 4), np.float64)
    score = np.zeros((rows, cols), np.float64)
    variance = np.full((rows, cols), np.inf)
    by_grey = np.full((rows, cols), np.inf)
    share = np.zeros((rows, cols), np.float64)
    hessian = np.empty((UNKNOWNS, UNKNOWNS), np.float64)
    lower = np.zeros((UNKNOWNS, UNKNOWNS), np.float64)
    slope = np.empty(UNKNOWNS, np.float64)
    fixed = np.empty(UNKNOWNS, np.float64)
    moving = np.empty(UNKNOWNS, np.float64)
    change = np.empty(UNKNOWNS, np.float64)
    warp = np.empty(UNKNOWNS, np.float64)
    columns = [_axis(x_windows[c, 0], x_windows[c, 1], step, width) for c in range(cols)]
    for r in range(rows):
        ys, place_y, weight_y = _axis(y_windows[r, 0], y_windows[r, 1], step, width)
        for c in range(cols):
            if not active[r, c]:
                continue
            xs, place_x, weight_x = columns[c]
            weight, mean, energy = _template(
                *(now, gradient_x, gradient_y, xs, ys, place_x, place_y, weight_x, weight_y),
                *(hessian, slope, fixed),
            )
            hold = stiffness * weight
            for k in range(2, UNKNOWNS):
                hessian[k, k] += hold
            if energy <= 0.0 or not _factorize(hessian, lower):
                continue
            warp[:] = 0.0
            warp[0], warp[1] = start[r, c, 0], start[r, c, 1]
            for iteration in range(iterations):
                total, squares, both, outside = _compare(
                    *(now, past, gradient_x, gradient_y, xs, ys, place_x, place_y),
                    *(weight_x, weight_y, warp, mean, limits, moving),
                )
                spread = max(squares - total * total / weight, 1e-6)
                score[r, c] = both / math.sqrt(spread * energy)
                share[r, c] = 1.0 - outside / (xs.size * ys.size)
                gain = min(max(both / spread, 1.0 / GAIN), GAIN)
                for k in range(UNKNOWNS):
                    # the mean of the samples is free: offset of the brightness
                    moving[k] = gain * (moving[k] - total / weight * slope[k]) - fixed[k]
                    if k >= 2:
                        moving[k] -= hold * warp[k]
                _solve(lower, moving, change)
                for k in range(UNKNOWNS):
                    warp[k] += change[k]
                off_x, off_y = warp[0] - start[r, c, 0], warp[1] - start[r, c, 1]
                if off_x * off_x + off_y * off_y > reach * reach:
                    score[r, c] = 0.0
                    break
                if iteration > 0 and max(abs(change[0]), abs(change[1])) < tolerance:
                    break
            if score[r, c] <= 0.0:
                continue
            vectors[r, c, 0], vectors[r, c, 1] = warp[0], warp[1]
            half_x = 0.5 * (x_windows[c, 1] - x_windows[c, 0])
            half_y = 0.5 * (y_windows[r, 1] - y_windows[r, 0])
            gradients[r, c, 0], gradients[r, c, 1] = warp[2] / half_x, warp[3] / half_y
            gradients[r, c, 2], gradients[r, c, 3] = warp[4] / half_x, warp[5] / half_y
            left_over = max(1.0 - score[r, c] ** 2, 0.0) * energy / weight
            worst = 0.0
            for k in range(2):
                moving[:] = 0.0
                moving[k] = 1.0
                _solve(lower, moving, change)
                worst = max(worst, change[k])
            variance[r, c] = left_over * worst
            by_grey[r, c] = worst
    return vectors, gradients, score, variance, by_grey, share
