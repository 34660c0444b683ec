"""Compiled kernels of the local planner: prices of cells, cost-to-go, and descent along it.

All work on grids indexed [row, column] = [y, x] in their frame's directions; distances along a path
are in cells.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array

NARROW_PRICE = 4.0  # chosen
"""Extra price of a cell that just fits."""


@numba.njit(cache=True)
def price_cells(
    clearance: Array,
    observed: npt.NDArray[np.uint8],
    radius: float,
    clear: float,
    margin: float,
    unobserved_price: float,
) -> Array:
    """Compute the prices (m, l) of crossing every second cell of a grid (n, k); inf where barred.

    A cell costs 1. It is barred if nearer to an obstacle than ``radius`` plus ``margin`` [m]. From
    there to a rim clearance of ``clear`` [m] the extra price falls quadratically from NARROW_PRICE
    to 0. A cell that is not ``observed`` is passable, but costs ``unobserved_price`` more.
    """
    rows, columns = (clearance.shape[0] + 1) // 2, (clearance.shape[1] + 1) // 2
    cost = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            row, column = 2 * i, 2 * j
            rim = clearance[row, column] - radius
            if rim < margin:
                cost[i, j] = np.inf
                continue
            cost[i, j] = 1.0
            if rim < clear:
                tight = min((clear - rim) / max(clear - margin, 1e-6), 1.0)
                cost[i, j] += NARROW_PRICE * (tight * tight)
            if not observed[row, column]:
                cost[i, j] += unobserved_price
    return cost


@numba.njit(cache=True)
def cost_to_go(cost: Array, value: Array, sweeps: int) -> int:
    """Solve the eikonal equation |grad value| = cost by fast sweeping, in place.

    ``cost`` (n, k) is the price of a cell's width, infinite where impassable; ``value`` (n, k)
    holds the boundary values at the sources and infinity elsewhere. Returns the sweeps used
    (Zhao 2005). A cell is updated again only after the value of a neighbour has fallen (locking;
    Bak, McLaughlin and Renzi 2010), which changes no result.
    """
    n, k = value.shape
    # padded with infinity, so that every cell has four neighbours
    padded = np.full((n + 2, k + 2), np.inf)
    padded[1:-1, 1:-1] = value
    stale = np.zeros((n + 2, k + 2), np.bool_)
    for i in range(1, n + 1):
        for j in range(1, k + 1):
            if padded[i, j] < np.inf:
                _unlock(stale, i, j)
    used = 0
    for sweep in range(sweeps):
        used += 1
        change = 0.0
        down, right = sweep & 1, (sweep >> 1) & 1
        for a in range(1, n + 1):
            i = n + 1 - a if down else a
            for b in range(1, k + 1):
                j = k + 1 - b if right else b
                if not stale[i, j]:
                    continue
                stale[i, j] = False
                f = cost[i - 1, j - 1]
                if f == np.inf:
                    continue
                vertical = min(padded[i - 1, j], padded[i + 1, j])
                horizontal = min(padded[i, j - 1], padded[i, j + 1])
                difference = abs(vertical - horizontal)
                if difference >= f:
                    candidate = min(vertical, horizontal) + f
                else:
                    candidate = 0.5 * (
                        vertical + horizontal + math.sqrt(2.0 * f * f - difference * difference)
                    )
                if candidate < padded[i, j] - 1e-9:
                    change = max(change, min(padded[i, j], 1e6) - candidate)
                    padded[i, j] = candidate
                    _unlock(stale, i, j)
        if change < 1e-3 and sweep >= 3:
            break
    value[:] = padded[1:-1, 1:-1]
    return used


@numba.njit(cache=True)
def _unlock(stale: npt.NDArray[np.bool_], row: int, column: int) -> None:
    """Mark the four neighbours of a cell for another update."""
    stale[row - 1, column] = stale[row + 1, column] = True
    stale[row, column - 1] = stale[row, column + 1] = True


@numba.njit(cache=True)
def _downhill(value: Array, row: float, column: float) -> tuple[float, float]:
    """Return the unit direction (row, column) of steepest descent at a point between cells.

    It follows the bilinear surface through the four cells around; (0, 0) where one of them is
    outside or barred.
    """
    n = value.shape[0]
    r0, c0 = int(math.floor(row)), int(math.floor(column))
    if r0 < 0 or c0 < 0 or r0 >= n - 1 or c0 >= n - 1:
        return 0.0, 0.0
    a, b = value[r0, c0], value[r0, c0 + 1]
    c, d = value[r0 + 1, c0], value[r0 + 1, c0 + 1]
    if max(a, b, c, d) == np.inf:
        return 0.0, 0.0
    fr, fc = row - r0, column - c0
    down = (1.0 - fc) * (c - a) + fc * (d - b)
    right = (1.0 - fr) * (b - a) + fr * (d - c)
    length = math.hypot(down, right)
    if length < 1e-9:
        return 0.0, 0.0
    return -down / length, -right / length


@numba.njit(cache=True)
def _lowest_around(value: Array, row: float, column: float) -> tuple[float, float]:
    """Return the unit direction to the lowest cell up to two away; (0, 0) if none is lower.

    Used beside barred cells, where there is no gradient. From within a barred cell it points to
    the nearest passable cell.
    """
    n = value.shape[0]
    r0, c0 = int(round(row)), int(round(column))
    if r0 < 0 or c0 < 0 or r0 >= n or c0 >= n:
        return 0.0, 0.0
    centre = value[r0, c0]
    best = np.inf if centre == np.inf else 0.0
    best_r, best_c = row, column
    for dr in range(-2, 3):
        for dc in range(-2, 3):
            r, c = r0 + dr, c0 + dc
            if r < 0 or c < 0 or r >= n or c >= n or (dr == 0 and dc == 0):
                continue
            if value[r, c] == np.inf:
                continue
            distance = math.hypot(dr, dc)
            slope = (value[r, c] - centre) / distance
            if centre == np.inf:
                slope = value[r, c] * 1e-3 + distance
            if slope < best:
                best = slope
                best_r, best_c = float(r), float(c)
    distance = math.hypot(best_r - row, best_c - column)
    if distance < 1e-9:
        return 0.0, 0.0
    return (best_r - row) / distance, (best_c - column) / distance


@numba.njit(cache=True)
def first_leg(
    value: Array,
    cost: Array,
    row: float,
    column: float,
    yaw: float,
    bearings: Array,
    length: float,
    turn_price: float,
) -> tuple[float, float, float]:
    """Find the cheapest straight leg of ``length`` [cells] from (row, column).

    It has of all ``bearings`` [rad, from ``yaw``] the least sum of the prices on the leg,
    the cost-to-go at its end and ``turn_price`` [cells/rad] for the turn to it. Returns its end
    (row, column) and its bearing; a row of -1 where every leg is barred.
    """
    n = value.shape[0]
    steps = int(2.0 * length)
    best, best_r, best_c, best_bearing = np.inf, -1.0, -1.0, 0.0
    for k in range(bearings.size):
        dr, dc = 0.5 * math.sin(yaw + bearings[k]), 0.5 * math.cos(yaw + bearings[k])
        r, c = row, column
        total = turn_price * abs(bearings[k])
        for i in range(steps):
            r += dr
            c += dc
            cell_r, cell_c = int(round(r)), int(round(c))
            if cell_r < 0 or cell_c < 0 or cell_r >= n or cell_c >= n:
                total = np.inf
                break
            price = cost[cell_r, cell_c]
            if price == np.inf and i < 3:
                price = 5.0  # a robot that stands too close may drive off
            total += 0.5 * price
            if total >= best:
                break
        if total < best:
            total += value[int(round(r)), int(round(c))]
            if total < best:
                best, best_r, best_c, best_bearing = total, r, c, bearings[k]
    return best_r, best_c, best_bearing


@numba.njit(cache=True)
def descend(value: Array, row: float, column: float, steps: int, path: Array) -> int:
    """Descend ``value`` from (row, column) in half-cell steps; write them to ``path`` (steps, 2).

    Returns the number of points written: fewer than ``steps`` at a minimum.
    """
    count = 0
    before_r, before_c = 0.0, 0.0
    for _ in range(steps):
        step_r, step_c = _downhill(value, row, column)
        if step_r == 0.0 and step_c == 0.0:
            step_r, step_c = _lowest_around(value, row, column)
        if step_r == 0.0 and step_c == 0.0:
            break
        if step_r * before_r + step_c * before_c < -0.5:
            break  # turned back: this was the minimum
        before_r, before_c = step_r, step_c
        row += 0.5 * step_r
        column += 0.5 * step_c
        path[count, 0] = row
        path[count, 1] = column
        count += 1
    return count
