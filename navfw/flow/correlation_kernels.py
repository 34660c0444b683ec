"""Compiled inner loops of block matching."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array, Bytes, Floats, Indices, Int32s, Mask

#: Score of displacements whose window would leave the visible part of the past image.
_OUTSIDE = np.float32(-2.0)  # defined

_LOW = np.int64((1 << 32) - 1)  # defined


@numba.njit(cache=True)
def _integrals(image: Bytes) -> tuple[Int32s, Int32s]:
    """Integral images of the grey values and of their squares, (height + 1, width + 1).

    The sums may wrap around in int32. Sums over windows, which are their differences, stay below
    2^31 and are exact.
    """
    h, w = image.shape
    total = np.zeros((h + 1, w + 1), np.int32)
    square = np.zeros((h + 1, w + 1), np.int32)
    for y in range(h):
        row, row2 = np.int32(0), np.int32(0)
        for x in range(w):
            value = np.int32(image[y, x])
            row = np.int32(row + value)
            row2 = np.int32(row2 + np.int32(value * value))
            total[y + 1, x + 1] = np.int32(total[y, x + 1] + row)
            square[y + 1, x + 1] = np.int32(square[y, x + 1] + row2)
    return total, square


@numba.njit(cache=True)
def _between_rows(integral: Int32s, y0: int, y1: int, line: Int32s) -> None:
    """Sums over rows [y0, y1) and the columns before each, from an integral image."""
    above, below = integral[y0], integral[y1]
    for x in range(line.size):
        line[x] = np.int32(below[x] - above[x])


@numba.njit(cache=True, error_model="numpy")
def _describe_windows(
    line: Int32s, line2: Int32s, width: int, height: int, greys: Array, scales: Array
) -> None:
    """Set sum(g) and 1 / sqrt(n sum(g^2) - sum(g)^2) of the windows at each column of a band.

    ``line`` and ``line2`` are the cumulative sums of the band's grey values and their squares up to
    each column.
    """
    pixels = float(width * height)
    places = line.size - width
    left, right, left2, right2 = line[:places], line[width:], line2[:places], line2[width:]
    for x in range(places):
        greys[x] = np.int32(right[x] - left[x])
    for x in range(places):
        # an exact integer: zero if and only if the window has one grey value
        energy = pixels * np.int32(right2[x] - left2[x]) - greys[x] * greys[x]
        scales[x] = 1.0 / math.sqrt(max(energy, 1.0))


@numba.njit(cache=True)
def _column_sums(
    now: Bytes, past: Bytes, right: int, down: int, y_edges: Indices, sums: Int32s
) -> None:
    """Set ``sums``: products of ``now`` and ``past`` summed over the rows up to each edge.

    ``past`` is read at an offset of ``right`` columns and ``down`` rows. The loop takes two rows at
    a time, since processors multiply and add pairs of small integers in one instruction.
    """
    width = now.shape[1]
    for k in range(y_edges.size - 1):
        above, column = sums[k], sums[k + 1]
        for i in range(width):
            column[i] = above[i]
        y, last = y_edges[k], y_edges[k + 1]
        while y + 2 <= last:
            a, c = now[y], now[y + 1]
            b, d = past[y + down, right : right + width], past[y + down + 1, right : right + width]
            for i in range(width):
                # explicit int32: numba's products would be int64
                upper = np.int32(np.int32(a[i]) * np.int32(b[i]))
                lower = np.int32(np.int32(c[i]) * np.int32(d[i]))
                column[i] = np.int32(column[i] + upper + lower)
            y += 2
        if y < last:
            a, b = now[y], past[y + down, right : right + width]
            for i in range(width):
                column[i] = np.int32(column[i] + np.int32(np.int32(a[i]) * np.int32(b[i])))


@numba.njit(cache=True)
def _window_sums(
    sums: Int32s, x_windows: Indices, y_windows: Indices, run: Indices, out: Array, index: int
) -> None:
    """Sum the column sums (2, ...) of two displacements over each window: out[row, col, index ...].

    A running sum cannot be vectorised, so both displacements share one int64, the second above bit
    32. The sums may wrap around; those of windows, which are differences, stay below 2^31.
    """
    for r in range(y_windows.shape[0]):
        above, below = sums[0, y_windows[r, 0]], sums[0, y_windows[r, 1]]
        above_two, below_two = sums[1, y_windows[r, 0]], sums[1, y_windows[r, 1]]
        for i in range(above.size):
            one, two = np.int32(below[i] - above[i]), np.int32(below_two[i] - above_two[i])
            run[i + 1] = (np.int64(two) << 32) + np.int64(one)
        total = np.int64(0)
        for i in range(above.size):
            total += run[i + 1]
            run[i + 1] = total
        for c in range(x_windows.shape[0]):
            both = run[x_windows[c, 1]] - run[x_windows[c, 0]]
            out[r, c, index] = both & _LOW
            out[r, c, index + 1] = both >> 32


@numba.njit(cache=True, error_model="numpy")
def correlate(
    now: Bytes,
    past: Bytes,
    x_windows: Indices,
    y_windows: Indices,
    search: int,
    visible: tuple[int, int, int, int],
) -> tuple[Floats, Floats]:
    """Correlate each window of ``now`` with ``past`` at each displacement (zero-mean, normalised).

    The windows overlap. The products of the two images are therefore computed once per displacement
    and summed along the columns between the windows' borders; the sum over a window is a difference
    of such sums. All sums are exact integers.

    Args:
        now: current image (height, width).
        past: past image (height, width), of which columns [visible[0], visible[1]) and rows
            [visible[2], visible[3]) are valid.
        x_windows: (cols, 2) first and end (exclusive) column of each window.
        y_windows: (rows, 2) first and end (exclusive) row of each window.
        search: largest displacement per axis [px].
        visible: see ``past``.

    Returns:
        scores (rows, cols, 2 search + 1, 2 search + 1) in [-1, 1] at displacement (dy, dx) =
        index - search, or -2 where the window would leave the visible past; and deviations
        (rows, cols) [grey] of the windows' grey values in ``now``.

    """
    h, w = now.shape
    rows, cols = y_windows.shape[0], x_windows.shape[0]
    span = 2 * search + 1
    scores = np.full((rows, cols, span, span), _OUTSIDE, np.float32)
    left, right, top, bottom = visible
    totals, inverses, deviations = _templates(now, x_windows, y_windows)

    y_edges = np.unique(y_windows)
    y_runs = np.searchsorted(y_edges, y_windows.ravel()).reshape(rows, 2)
    padded = np.zeros((h + 2 * search, w + 2 * search), np.uint8)
    padded[search : search + h, search : search + w] = past
    sums = np.zeros((2, y_edges.size, w), np.int32)
    run = np.zeros(w + 1, np.int64)
    products = np.empty((rows, cols, span + 1), np.float64)
    # mirrored, since a larger displacement starts further left in the past image
    total, square = _integrals(past[:, ::-1])
    line, line2 = np.empty(w + 1, np.int32), np.empty(w + 1, np.int32)
    widths = np.unique(x_windows[:, 1] - x_windows[:, 0])
    kinds = np.searchsorted(widths, x_windows[:, 1] - x_windows[:, 0])
    greys, scales = np.empty((widths.size, w)), np.empty((widths.size, w))

    for iy in range(span):
        for ix in range(span):
            # a point now at p was at p - d, which is p - d + search in the padded image
            right_by, down_by = 2 * search - ix, 2 * search - iy
            _column_sums(now, padded, right_by, down_by, y_edges, sums[ix % 2])
            if ix % 2 or ix == span - 1:
                _window_sums(sums, x_windows, y_runs, run, products, ix - ix % 2)
        for r in range(rows):
            y0, y1 = y_windows[r, 0] + search - iy, y_windows[r, 1] + search - iy
            if y0 < top or y1 > bottom:
                continue
            _between_rows(total, y0, y1, line)
            _between_rows(square, y0, y1, line2)
            for k in range(widths.size):
                _describe_windows(line, line2, widths[k], y1 - y0, greys[k], scales[k])
            for c in range(cols):
                x0, x1 = x_windows[c, 0], x_windows[c, 1]
                # the window lies in the visible columns if x0 - dx >= left and x1 - dx <= right
                first = min(max(0, x1 - right + search), span)
                last = max(min(span, x0 - left + search + 1), first)
                row, product = scores[r, c, iy, first:last], products[r, c, first:last]
                place = w - x1 - search + first
                grey, scale = greys[kinds[c], place:], scales[kinds[c], place:]
                pixels, window, inverse = float((x1 - x0) * (y1 - y0)), totals[r, c], inverses[r, c]
                for i in range(row.size):
                    covariance = pixels * product[i] - window * grey[i]
                    row[i] = covariance * inverse * scale[i]
    return scores, deviations


@numba.njit(cache=True)
def _templates(now: Bytes, x_windows: Indices, y_windows: Indices) -> tuple[Array, Array, Floats]:
    """Grey sum, 1 / sqrt(n sum(g^2) - sum(g)^2) (0 if untextured) and deviation of each window."""
    rows, cols = y_windows.shape[0], x_windows.shape[0]
    totals = np.zeros((rows, cols), np.float64)
    inverses = np.zeros((rows, cols), np.float64)
    deviations = np.zeros((rows, cols), np.float32)
    total, square = _integrals(now)
    line, line2 = np.empty(now.shape[1] + 1, np.int32), np.empty(now.shape[1] + 1, np.int32)
    for r in range(rows):
        y0, y1 = y_windows[r, 0], y_windows[r, 1]
        _between_rows(total, y0, y1, line)
        _between_rows(square, y0, y1, line2)
        for c in range(cols):
            x0, x1 = x_windows[c, 0], x_windows[c, 1]
            n = (x1 - x0) * (y1 - y0)
            s = np.int32(line[x1] - line[x0])
            energy = n * np.int32(line2[x1] - line2[x0]) - np.int64(s) * s
            totals[r, c] = s
            deviations[r, c] = math.sqrt(energy) / n
            if energy > 0:
                inverses[r, c] = 1.0 / math.sqrt(energy)
    return totals, inverses, deviations


@numba.njit(cache=True)
def find_peaks(scores: Floats) -> tuple[Indices, Array, Array, Array, Array, Mask]:
    """Find the highest score of each window and refine it to subpixels by a quadratic surface.

    Returns, per (row, col): ``peak`` (2,) whole-pixel displacement (dx, dy); ``fine`` (2,) the
    refined displacement; ``height`` of the peak; ``second``, the highest score outside the peak's
    3 x 3 neighbourhood; ``curvature`` [1/px^2], the negative second derivative of the score in its
    flattest direction; ``inner``, whether all eight neighbours of the peak exist.
    """
    rows, cols, span, _ = scores.shape
    search = (span - 1) // 2
    peak = np.zeros((rows, cols, 2), np.int64)
    fine = np.zeros((rows, cols, 2), np.float64)
    height = np.full((rows, cols), -2.0, np.float64)
    second = np.full((rows, cols), -2.0, np.float64)
    curvature = np.zeros((rows, cols), np.float64)
    inner = np.zeros((rows, cols), np.bool_)
    tops = np.empty(span, np.float32)
    for r in range(rows):
        for c in range(cols):
            s = scores[r, c]
            py, px, best, rival = _highest(s, tops)
            if best <= _OUTSIDE:
                continue
            height[r, c] = best
            second[r, c] = rival
            peak[r, c, 0], peak[r, c, 1] = px - search, py - search
            fine[r, c, 0], fine[r, c, 1] = px - search, py - search
            if not (0 < py < span - 1 and 0 < px < span - 1):
                continue
            complete = True
            for iy in range(py - 1, py + 2):
                for ix in range(px - 1, px + 2):
                    if s[iy, ix] <= _OUTSIDE:
                        complete = False
            if not complete:
                continue
            inner[r, c] = True
            ox, oy, flattest = _quadratic_peak(s[py - 1 : py + 2, px - 1 : px + 2])
            fine[r, c, 0] += ox
            fine[r, c, 1] += oy
            curvature[r, c] = flattest
    return peak, fine, height, second, curvature, inner


@numba.njit(cache=True)
def _highest(s: Floats, tops: Floats) -> tuple[int, int, np.float32, np.float32]:
    """Row and column of the highest score, the score, and the highest outside its neighbourhood.

    The first of equal scores counts. ``tops`` (span,) is workspace for the maxima of the rows.
    """
    span = tops.size
    py = 0
    for iy in range(span):
        tops[iy] = _maximum(s[iy])
        if tops[iy] > tops[py]:
            py = iy
    best = tops[py]
    px = 0
    while s[py, px] < best:
        px += 1
    rival = _OUTSIDE
    for iy in range(span):
        if abs(iy - py) > 1:
            rival = max(rival, tops[iy])
        else:
            rival = max(rival, _maximum(s[iy, : max(px - 1, 0)]), _maximum(s[iy, px + 2 :]))
    return py, px, best, rival


@numba.njit(cache=True, fastmath={"nnan", "nsz"})
def _maximum(values: Floats) -> np.float32:
    """Return the largest of ``values``, at least _OUTSIDE; a loop that the compiler vectorises."""
    top = _OUTSIDE
    for value in values:
        top = value if value > top else top
    return top


@numba.njit(cache=True)
def _quadratic_peak(s: Floats) -> tuple[float, float, float]:
    """Offset (x, y) of the maximum of the least-squares quadratic of 3 x 3 scores, and curvature.

    The offset is limited to half a pixel. The curvature is the smaller eigenvalue of the negated
    Hessian; all three are 0 if the quadratic has no maximum.
    """
    gx = (s[0, 2] + s[1, 2] + s[2, 2] - s[0, 0] - s[1, 0] - s[2, 0]) / 6.0
    gy = (s[2, 0] + s[2, 1] + s[2, 2] - s[0, 0] - s[0, 1] - s[0, 2]) / 6.0
    columns = s[0, 0] + s[1, 0] + s[2, 0] + s[0, 2] + s[1, 2] + s[2, 2]
    hxx = (columns - 2.0 * (s[0, 1] + s[1, 1] + s[2, 1])) / 3.0
    lines = s[0, 0] + s[0, 1] + s[0, 2] + s[2, 0] + s[2, 1] + s[2, 2]
    hyy = (lines - 2.0 * (s[1, 0] + s[1, 1] + s[1, 2])) / 3.0
    hxy = (s[0, 0] + s[2, 2] - s[0, 2] - s[2, 0]) / 4.0
    half = 0.5 * (hxx - hyy)
    flattest = -(0.5 * (hxx + hyy) + math.sqrt(half * half + hxy * hxy))
    det = hxx * hyy - hxy * hxy
    if flattest <= 0.0 or det <= 0.0:
        return 0.0, 0.0, 0.0
    ox = (hxy * gy - hyy * gx) / det
    oy = (hxy * gx - hxx * gy) / det
    return min(max(ox, -0.5), 0.5), min(max(oy, -0.5), 0.5), flattest
