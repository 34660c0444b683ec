"""Compiled loops of window registration: affine Lucas-Kanade, and a field's disagreements."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.algebra_kernels import dot, fma
from navfw.numerics.arrays import Array, Floats, Indices, Mask

#: Number of unknowns: displacement (x, y), then the change of each over half a window in x and y.
_UNKNOWNS = 6  # defined
#: Largest gain of the brightness between the frames, and its reciprocal the least; the offset is
#: free.
_GAIN = 2.0  # chosen
#: Least variance [grey^2] of a window's grey levels that counts, as equal images do not show it.
_MIN_CONTRAST = 16.0  # chosen


@numba.njit(cache=True, error_model="numpy")
def _factorize(matrix: Array, lower: Array) -> bool:
    """Cholesky factor, its diagonal inverted; False if ``matrix`` is not positive definite."""
    for i in range(_UNKNOWNS):
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
def _solve(lower: Array, right: Array, out: Array) -> None:
    """Solve (L L^T) out = right for L from ``_factorize``."""
    for i in range(_UNKNOWNS):
        total = right[i]
        for k in range(i):
            total -= lower[i, k] * out[k]
        out[i] = total * lower[i, i]
    for i in range(_UNKNOWNS - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, _UNKNOWNS):
            total -= lower[k, i] * out[k]
        out[i] = total * lower[i, i]


@numba.njit(cache=True)
def _axis(first: int, last: int, step: int, width: float) -> tuple[Indices, Floats, Floats]:
    """Sampled pixels of [first, last), their positions in [-1, 1] in the window, root weights."""
    count = (last - first + step - 1) // step
    begin = first + (last - first - 1 - (count - 1) * step) // 2
    pixels = np.empty(count, np.int64)
    place = np.empty(count, np.float32)
    root = np.empty(count, np.float32)
    centre, half = 0.5 * (first + last - 1), 0.5 * (last - first)
    for i in range(count):
        pixels[i] = begin + i * step
        place[i] = (pixels[i] - centre) / half
        root[i] = math.exp(-0.25 * (place[i] / width) ** 2)
    return pixels, place, root


@numba.njit(cache=True)
def _read(
    now: Floats,
    gradient_x: Floats,
    gradient_y: Floats,
    columns: tuple[Indices, Floats, Floats],
    lines: tuple[Indices, Floats, Floats],
    places: Floats,
    grey: Floats,
    steep: Floats,
) -> None:
    """Set what the samples of a window are, row by row.

    ``places`` (5, samples): column and row in the image, position x and y in the window, root of
    the weight; ``grey`` (samples,) and the first rows of ``steep``: grey value and gradient.
    """
    xs, place_x, root_x = columns
    ys, place_y, root_y = lines
    n = 0
    for j in range(ys.size):
        y, q, root = ys[j], place_y[j], root_y[j]
        for i in range(xs.size):
            x = xs[i]
            places[0, n], places[1, n], places[2, n], places[3, n] = x, y, place_x[i], q
            places[4, n] = root_x[i] * root
            grey[n], steep[0, n], steep[1, n] = now[y, x], gradient_x[y, x], gradient_y[y, x]
            n += 1


@numba.njit(cache=True, error_model="numpy")
def _weigh(places: Floats, grey: Floats, steep: Floats) -> tuple[float, float]:
    """Multiply ``grey`` less its mean, and gradients, by the root weight; fill in ``steep``.

    ``steep`` (_UNKNOWNS, samples) are the steepest descent images. A product of two such rows is
    weighted. Returns the sum of the weights and the mean grey value.
    """
    p, q, root = places[2], places[3], places[4]
    gx, gy = steep[0], steep[1]
    x_by_p, x_by_q, y_by_p, y_by_q = steep[2], steep[3], steep[4], steep[5]
    for i in range(grey.size):
        x_by_p[i] = root[i] * grey[i]
    weight = dot(root, root)
    mean = dot(root, x_by_p) / weight
    for i in range(grey.size):
        grey[i] = root[i] * (grey[i] - mean)
        gx[i] *= root[i]
        gy[i] *= root[i]
    for i in range(grey.size):
        x_by_p[i], x_by_q[i] = gx[i] * p[i], gx[i] * q[i]
        y_by_p[i], y_by_q[i] = gy[i] * p[i], gy[i] * q[i]
    return float(weight), float(mean)


@numba.njit(cache=True, error_model="numpy")
def _sample(
    past: Floats,
    places: Floats,
    grey: Floats,
    warp: Array,
    mean: float,
    limits: tuple[int, int, int, int],
    samples: Floats,
) -> int:
    """Sample ``past`` bilinearly at a window's positions warped by ``warp``.

    Sets ``samples`` (samples,), less ``mean`` and times the root of the weight; outside ``limits``
    (columns, rows) they are those of the window, so that they have no influence on the step.
    Returns how many these are.
    """
    left, right, top, bottom = limits
    low_x, low_y = np.float32(left), np.float32(top)
    high_x, high_y = np.float32(right - 1.001), np.float32(bottom - 1.001)
    shift_x, x_by_p, x_by_q = np.float32(-warp[0]), np.float32(-warp[2]), np.float32(-warp[3])
    shift_y, y_by_p, y_by_q = np.float32(-warp[1]), np.float32(-warp[4]), np.float32(-warp[5])
    middle, stride = np.float32(mean), past.shape[1]
    pixels, outside = past.ravel(), 0
    for i in range(samples.size):
        p, q = places[2, i], places[3, i]
        x = fma(x_by_q, q, fma(x_by_p, p, places[0, i] + shift_x))
        y = fma(y_by_q, q, fma(y_by_p, p, places[1, i] + shift_y))
        if low_x <= x <= high_x and low_y <= y <= high_y:
            column, line = np.int32(x), np.int32(y)
            fx, fy = x - np.float32(column), y - np.float32(line)
            at = np.uint64(line * stride + column)
            a, b = pixels[at], pixels[at + np.uint64(1)]
            c, d = pixels[at + np.uint64(stride)], pixels[at + np.uint64(stride + 1)]
            above, below = fma(fx, b - a, a), fma(fx, d - c, c)
            samples[i] = places[4, i] * (fma(fy, below - above, above) - middle)
        else:
            samples[i] = grey[i]
            outside += 1
    return outside


@numba.njit(cache=True)
def register(
    now: Floats,
    past: Floats,
    gradient_x: Floats,
    gradient_y: Floats,
    x_windows: Indices,
    y_windows: Indices,
    start: Array,
    active: Mask,
    limits: tuple[int, int, int, int],
    step: int,
    width: float,
    stiffness: float,
    iterations: int,
    tolerance: float,
    reach: float,
) -> tuple[Array, Array, Array, Array, Array, Array]:
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
    hessian = np.empty((_UNKNOWNS, _UNKNOWNS), np.float64)
    lower = np.zeros((_UNKNOWNS, _UNKNOWNS), np.float64)
    slope = np.empty(_UNKNOWNS, np.float64)
    fixed = np.empty(_UNKNOWNS, np.float64)
    moving = np.empty(_UNKNOWNS, np.float64)
    change = np.empty(_UNKNOWNS, np.float64)
    warp = np.empty(_UNKNOWNS, np.float64)
    columns = [_axis(x_windows[c, 0], x_windows[c, 1], step, width) for c in range(cols)]
    for r in range(rows):
        lines = _axis(y_windows[r, 0], y_windows[r, 1], step, width)
        for c in range(cols):
            if not active[r, c]:
                continue
            count = columns[c][0].size * lines[0].size
            places, steep = (
                np.empty((5, count), np.float32),
                np.empty((_UNKNOWNS, count), np.float32),
            )
            grey, samples = np.empty(count, np.float32), np.empty(count, np.float32)
            _read(now, gradient_x, gradient_y, columns[c], lines, places, grey, steep)
            weight, mean = _weigh(places, grey, steep)
            energy = float(dot(grey, grey))
            hold = stiffness * weight
            for k in range(_UNKNOWNS):
                slope[k], fixed[k] = dot(steep[k], places[4]), dot(steep[k], grey)
                for m in range(k + 1):
                    hessian[k, m] = dot(steep[k], steep[m]) - slope[k] * slope[m] / weight
                if k >= 2:
                    hessian[k, k] += hold
            if energy <= 0.0 or not _factorize(hessian, lower):
                continue
            warp[:] = 0.0
            warp[0], warp[1] = start[r, c, 0], start[r, c, 1]
            for iteration in range(iterations):
                outside = _sample(past, places, grey, warp, mean, limits, samples)
                total = float(dot(places[4], samples))
                both = float(dot(grey, samples))
                spread = max(float(dot(samples, samples)) - total * total / weight, 1e-6)
                score[r, c] = both / math.sqrt(spread * energy)
                share[r, c] = 1.0 - outside / count
                gain = min(max(both / spread, 1.0 / _GAIN), _GAIN)
                for k in range(_UNKNOWNS):
                    # the mean of the samples is free: offset of the brightness
                    product = dot(steep[k], samples) - total / weight * slope[k]
                    moving[k] = gain * product - fixed[k]
                    if k >= 2:
                        moving[k] -= hold * warp[k]
                _solve(lower, moving, change)
                for k in range(_UNKNOWNS):
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


@numba.njit(cache=True)
def find_mixtures(
    vectors: Array, gradients: Array, trusted: Mask, x_centres: Array, y_centres: Array
) -> Array:
    """Compute how far (rows, cols) [px] a window's affine motion disagrees with both neighbours.

    A window across a depth edge can fit both surfaces by a steep gradient of the flow that neither
    surface has. Within a surface both neighbours continue a window's motion; next to an edge the
    neighbour on the same side does. Only a mixed window disagrees with both neighbours. The result
    is therefore the smaller disagreement of the two neighbours, of rows or columns whichever is
    larger. For a neighbour that is missing or not ``trusted`` zero change of the flow is assumed.
    """
    rows, cols = trusted.shape
    worst = np.zeros((rows, cols), np.float64)
    for r in range(rows):
        for c in range(cols):
            for axis in range(2):
                least = np.inf
                for side in (-1, 1):
                    i, j = (r, c + side) if axis == 0 else (r + side, c)
                    exists = 0 <= i < rows and 0 <= j < cols
                    centres, own = (x_centres, c) if axis == 0 else (y_centres, r)
                    away = centres[own + side] - centres[own] if exists else centres[1] - centres[0]
                    off_x = gradients[r, c, axis] * away
                    off_y = gradients[r, c, 2 + axis] * away
                    if exists and trusted[i, j]:
                        off_x -= vectors[i, j, 0] - vectors[r, c, 0]
                        off_y -= vectors[i, j, 1] - vectors[r, c, 1]
                    least = min(least, math.sqrt(off_x * off_x + off_y * off_y))
                worst[r, c] = max(worst[r, c], least)
    return worst


@numba.njit(cache=True)
def find_bends(vectors: Array, trusted: Mask) -> Array:
    """Compute how far (rows, cols) [px] vectors (rows, cols, 2) are off their neighbours' middle.

    Three vectors of one surface along a row or column lie almost on a line, so the rest is mostly
    error. The smaller of both is returned: an edge in depth bends the field across it, but not
    along it; an error bends it both ways. 0 without two ``trusted`` neighbours in a line.
    """
    rows, cols = trusted.shape
    bend = np.zeros((rows, cols), np.float64)
    for r in range(rows):
        for c in range(cols):
            least_off = np.inf
            for down, right in ((0, 1), (1, 0)):
                i, j, k, m = r - down, c - right, r + down, c + right
                if i < 0 or j < 0 or k >= rows or m >= cols or not trusted[r, c]:
                    continue
                if trusted[i, j] and trusted[k, m]:
                    x = vectors[i, j, 0] - 2.0 * vectors[r, c, 0] + vectors[k, m, 0]
                    y = vectors[i, j, 1] - 2.0 * vectors[r, c, 1] + vectors[k, m, 1]
                    least_off = min(least_off, 0.5 * math.sqrt(x * x + y * y))
            bend[r, c] = least_off if least_off < np.inf else 0.0
    return bend


@numba.njit(cache=True, error_model="numpy")
def vector_sigma(
    vectors: Array,
    residual: Array,
    sensitivity: Array,
    score: Array,
    mixture: Array,
    trusted: Mask,
    shares: tuple[float, ...],
) -> Array:
    """Compute the sigma (rows, cols) [px] of registered vectors; infinite unless ``trusted``.

    ``residual`` [px] is ``Registration.sigma``; the other arrays are those of ``Registration``.
    ``shares``: factors of residual, bend, mixture and length; errors that a residual does not show,
    of rounding and interpolation [grey levels]; share of the mean over the cell and its neighbours
    in the logarithm, since few samples show a window's own errors; and the power of the variance of
    its grey levels over the usual one [grey^2], as steep edges are interpolated worse.
    """
    by_residual, by_bend, by_mixture, by_length, grey, around, power, usual = shares
    rows, cols = trusted.shape
    bend, own = find_bends(vectors, trusted), np.full((rows, cols), np.inf)
    for r in range(rows):
        for c in range(cols):
            if trusted[r, c]:
                x, y = vectors[r, c]
                variance = (by_residual * residual[r, c]) ** 2 + (grey * sensitivity[r, c]) ** 2
                variance += (by_bend * bend[r, c]) ** 2 + (by_mixture * mixture[r, c]) ** 2
                own[r, c] = 0.5 * math.log(variance + by_length**2 * (x * x + y * y))
    sigma = np.full((rows, cols), np.inf)
    for r in range(rows):
        for c in range(cols):
            if trusted[r, c]:
                total, count = 0.0, 0
                for i in range(max(r - 1, 0), min(r + 2, rows)):
                    for j in range(max(c - 1, 0), min(c + 2, cols)):
                        if trusted[i, j]:
                            total, count = total + own[i, j], count + 1
                contrast = (residual[r, c] / sensitivity[r, c]) ** 2
                contrast = max(contrast / max(1.0 - score[r, c] ** 2, 1e-6), _MIN_CONTRAST) / usual
                size = own[r, c] + around * (total / count - own[r, c])
                sigma[r, c] = math.exp(size + power * math.log(contrast))
    return sigma
