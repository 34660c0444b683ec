"""Compiled inner loops of block matching."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["correlate", "find_peaks"]

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]

#: Marks displacements whose window would leave the past image.
OUTSIDE = np.float32(-2.0)


@numba.njit(cache=True)
def _integrals(image: Bytes) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Integral images (height + 1, width + 1) of the grey values and of their squares."""
    h, w = image.shape
    total = np.zeros((h + 1, w + 1), np.int64)
    square = np.zeros((h + 1, w + 1), np.int64)
    for y in range(h):
        row = np.int64(0)
        row2 = np.int64(0)
        for x in range(w):
            value = np.int64(image[y, x])
            row += value
            row2 += value * value
            total[y + 1, x + 1] = total[y, x + 1] + row
            square[y + 1, x + 1] = square[y, x + 1] + row2
    return total, square


@numba.njit(cache=True)
def _box(integral: npt.NDArray[np.int64], x0: int, x1: int, y0: int, y1: int) -> int:
    """Sum over columns [x0, x1) and rows [y0, y1)."""
    return int(integral[y1, x1] - integral[y0, x1] - integral[y1, x0] + integral[y0, x0])


@numba.njit(cache=True)
def _products(
    now: Floats,
    past: Floats,
    dx: int,
    dy: int,
    x_edges: Ints,
    y_edges: Ints,
    out: npt.NDArray[np.float64],
) -> None:
    """Integral over the segments of now(x, y) * past(x - dx, y - dy).

    ``past`` is padded by the search on all sides, so that every index exists. The float32 sums of
    at most 257 products of two bytes stay below 2^24 and are exact.
    """
    pad = (past.shape[0] - now.shape[0]) // 2
    left, right = x_edges[0], x_edges[-1]
    column = np.empty(right - left, np.float32)
    for k in range(y_edges.size - 1):
        column[:] = np.float32(0.0)
        for y in range(y_edges[k], y_edges[k + 1]):
            a = now[y, left:right]
            b = past[y - dy + pad, left - dx + pad : right - dx + pad]
            for i in range(column.size):
                column[i] += a[i] * b[i]
        run = 0.0
        for j in range(x_edges.size - 1):
            for i in range(x_edges[j] - left, x_edges[j + 1] - left):
                run += column[i]
            out[k + 1, j + 1] = out[k, j + 1] + run


@numba.njit(cache=True)
def correlate(
    now: Bytes,
    past: Bytes,
    x_edges: Ints,
    y_edges: Ints,
    x_windows: Ints,
    y_windows: Ints,
    search: int,
    visible: tuple[int, int, int, int],
) -> tuple[Floats, Floats]:
    """Zero-mean normalised correlation of every window of ``now`` at every displacement.

    The windows overlap, so the products of the two images are formed once per displacement and
    summed over segments; every window is a run of whole segments. All sums are exact integers.

    Args:
        now: current image (height, width).
        past: past image (height, width), of which columns [visible[0], visible[1]) and rows
            [visible[2], visible[3]) are valid.
        x_edges: increasing borders of the column segments.
        y_edges: increasing borders of the row segments.
        x_windows: (cols, 2) first and last border (indices into ``x_edges``) of each window.
        y_windows: (rows, 2) the same for rows.
        search: largest displacement per axis [px].
        visible: see ``past``.

    Returns:
        scores (rows, cols, 2 search + 1, 2 search + 1) in [-1, 1] at displacement (dy, dx) =
        index - search, or OUTSIDE where the window would leave the visible past; and deviations
        (rows, cols) [grey] of the windows' grey values in ``now``.

    """
    h, w = now.shape
    rows, cols = y_windows.shape[0], x_windows.shape[0]
    span = 2 * search + 1
    scores = np.full((rows, cols, span, span), OUTSIDE, np.float32)
    deviations = np.zeros((rows, cols), np.float32)
    total, square = _integrals(past)
    now_total, now_square = _integrals(now)
    now32 = now.astype(np.float32)
    past32 = np.zeros((h + 2 * search, w + 2 * search), np.float32)
    past32[search : search + h, search : search + w] = past
    sums = np.zeros((y_edges.size, x_edges.size), np.float64)
    left, right, top, bottom = visible
    inverse = np.zeros((rows, cols), np.float64)
    mean_sum = np.zeros((rows, cols), np.float64)
    for r in range(rows):
        y0, y1 = y_edges[y_windows[r, 0]], y_edges[y_windows[r, 1]]
        for c in range(cols):
            x0, x1 = x_edges[x_windows[c, 0]], x_edges[x_windows[c, 1]]
            n = (x1 - x0) * (y1 - y0)
            s = _box(now_total, x0, x1, y0, y1)
            energy = n * _box(now_square, x0, x1, y0, y1) - s * s
            mean_sum[r, c] = s
            deviations[r, c] = math.sqrt(energy) / n
            if energy > 0:
                inverse[r, c] = 1.0 / math.sqrt(energy)
    for iy in range(span):
        dy = iy - search
        for ix in range(span):
            dx = ix - search
            _products(now32, past32, dx, dy, x_edges, y_edges, sums)
            for r in range(rows):
                ka, kb = y_windows[r, 0], y_windows[r, 1]
                y0, y1 = y_edges[ka] - dy, y_edges[kb] - dy
                if y0 < top or y1 > bottom:
                    continue
                for c in range(cols):
                    ja, jb = x_windows[c, 0], x_windows[c, 1]
                    x0, x1 = x_edges[ja] - dx, x_edges[jb] - dx
                    if x0 < left or x1 > right:
                        continue
                    n = (x1 - x0) * (y1 - y0)
                    s = _box(total, x0, x1, y0, y1)
                    energy = n * _box(square, x0, x1, y0, y1) - s * s
                    product = sums[kb, jb] - sums[ka, jb] - sums[kb, ja] + sums[ka, ja]
                    score = 0.0
                    if energy > 0:
                        covariance = n * product - mean_sum[r, c] * s
                        score = covariance * inverse[r, c] / math.sqrt(energy)
                    scores[r, c, iy, ix] = score
    return scores, deviations


@numba.njit(cache=True)
def find_peaks(
    scores: Floats,
) -> tuple[
    npt.NDArray[np.int64],
    npt.NDArray[np.float64],
    npt.NDArray[np.float64],
    npt.NDArray[np.float64],
    npt.NDArray[np.float64],
    npt.NDArray[np.bool_],
]:
    """Highest score of every window, refined below a pixel by a quadratic surface.

    Returns, per (row, col): ``peak`` (2,) whole-pixel displacement (dx, dy); ``fine`` (2,) the
    refined one; ``height`` of the peak; ``second``, the highest score outside the peak's 3 x 3
    neighbourhood; ``curvature`` [1/px^2], how steeply the score falls off in its flattest
    direction; ``inner``, whether all eight neighbours of the peak exist.
    """
    rows, cols, span, _ = scores.shape
    search = (span - 1) // 2
    peak = np.zeros((rows, cols, 2), np.int64)
    fine = np.zeros((rows, cols, 2), np.float64)
    height = np.full((rows, cols), -2.0, np.float64)
    second = np.full((rows, cols), -2.0, np.float64)
    curvature = np.zeros((rows, cols), np.float64)
    inner = np.zeros((rows, cols), np.bool_)
    for r in range(rows):
        for c in range(cols):
            s = scores[r, c]
            py, px, best = 0, 0, np.float32(-2.0)
            for iy in range(span):
                for ix in range(span):
                    if s[iy, ix] > best:
                        py, px, best = iy, ix, s[iy, ix]
            if best <= OUTSIDE:
                continue
            rival = np.float32(-2.0)
            for iy in range(span):
                for ix in range(span):
                    if (abs(iy - py) > 1 or abs(ix - px) > 1) and s[iy, ix] > rival:
                        rival = s[iy, ix]
            height[r, c] = best
            second[r, c] = rival
            peak[r, c, 0], peak[r, c, 1] = px - search, py - search
            fine[r, c, 0], fine[r, c, 1] = px - search, py - search
            if not (0 < py < span - 1 and 0 < px < span - 1):
                continue
            complete = True
            for iy in range(py - 1, py + 2):
                for ix in range(px - 1, px + 2):
                    if s[iy, ix] <= OUTSIDE:
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
def _quadratic_peak(s: Floats) -> tuple[float, float, float]:
    """Offset (x, y) of the top of the least-squares quadratic through 3 x 3 scores, and curvature.

    The offset stays within the pixel. The curvature is the smaller eigenvalue of the negated
    Hessian; not positive when the scores form no top.
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
