"""Compiled inner loops over the ego map: arcs and rays through it, cost to go.

All work on square grids indexed [row, column] = [y, x] in the odom frame's directions; ``origin``
is the odom coordinate [m] of the centre of cell [0, 0], ``cell`` the cell size [m].
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.signals import Array

__all__ = [
    "are_degrees",
    "cast_ranges",
    "cost_to_go",
    "descend",
    "first_leg",
    "follow_arc",
    "least_within",
    "price_cells",
    "sweep_arcs",
]


@numba.njit(cache=True)
def sweep_arcs(
    clearance: Array,
    known: npt.NDArray[np.uint8],
    origin_x: float,
    origin_y: float,
    cell: float,
    x: float,
    y: float,
    yaw: float,
    speeds: Array,
    turns: Array,
    radius: float,
    reach: float,
    horizon: float,
    free_length: Array,
    known_length: Array,
    arc_clearance: Array,
) -> None:
    """Drive a disc of ``radius`` along every command's arc through the map.

    ``clearance`` [m] is the distance of each cell to the nearest occupied one, ``known`` > 0 where
    the cell has been seen free. Out come, for each (speed, turn): the length [m] up to ``reach``
    until the disc would touch (``free_length``), until its centre would enter the unknown
    (``known_length``), and the least clearance [m] from the disc's rim met within ``horizon`` [m]
    (``arc_clearance``). An arc that starts too close is free as long as it leads away. For a
    standing robot the lengths are ``reach``.
    """
    for i in range(speeds.shape[0]):
        for j in range(turns.shape[0]):
            free_length[i, j], known_length[i, j], arc_clearance[i, j] = follow_arc(
                *(clearance, known, origin_x, origin_y, cell, x, y, yaw),
                *(speeds[i], turns[j], radius, reach, horizon),
            )


@numba.njit(cache=True)
def follow_arc(
    clearance: Array,
    known: npt.NDArray[np.uint8],
    origin_x: float,
    origin_y: float,
    cell: float,
    x: float,
    y: float,
    yaw: float,
    v: float,
    w: float,
    radius: float,
    reach: float,
    horizon: float,
) -> tuple[float, float, float]:
    """Free length, known length and clearance [m] of one command; see ``sweep_arcs``."""
    size = clearance.shape[0]
    column = int(math.floor((x - origin_x) / cell + 0.5))
    row = int(math.floor((y - origin_y) / cell + 0.5))
    here = clearance[row, column]
    if v == 0.0:
        return reach, reach, here - radius
    step = 0.5 * cell
    curvature = w / v
    sign = 1.0 if v > 0.0 else -1.0
    px, py = x, y
    # the heading in the middle of each step, as a unit vector that is turned by the step
    turn = sign * step * curvature
    c_turn, s_turn = math.cos(turn), math.sin(turn)
    c_mid, s_mid = math.cos(yaw + 0.5 * turn), math.sin(yaw + 0.5 * turn)
    length = 0.0
    least = here
    floor = min(radius, here - 0.02)
    blocked = False
    known_until = -1.0
    # an arc that closes half a turn is as good as its first half
    longest = min(reach, math.pi / max(abs(curvature), 1e-6))
    while length < longest:
        px += sign * step * c_mid
        py += sign * step * s_mid
        c_mid, s_mid = c_mid * c_turn - s_mid * s_turn, s_mid * c_turn + c_mid * s_turn
        column = int(math.floor((px - origin_x) / cell + 0.5))
        row = int(math.floor((py - origin_y) / cell + 0.5))
        if row < 0 or column < 0 or row >= size or column >= size:
            break
        c = clearance[row, column]
        if c < floor:
            blocked = True
            break
        if c > floor and floor < radius:
            floor = min(radius, c - 0.02)  # moving away: from now on no nearer than this
        if length < horizon and c < least:
            least = c
        if known_until < 0.0 and known[row, column] == 0:
            known_until = length
        length += step
    if not blocked and length >= longest - step:
        length = reach
    return length, length if known_until < 0.0 else known_until, least - radius


@numba.njit(cache=True)
def cast_ranges(
    clearance: Array,
    known: npt.NDArray[np.uint8],
    origin_x: float,
    origin_y: float,
    cell: float,
    x: float,
    y: float,
    angles: Array,
    limit: float,
    free: Array,
    seen: Array,
) -> None:
    """March from (x, y) along each of ``angles`` (n,) [rad, odom] up to ``limit`` [m].

    ``free`` (n,) [m] is the distance to the first occupied cell, ``seen`` (n,) [m] that to the
    first cell never seen free. Steps as long as the clearance allows.
    """
    size = clearance.shape[0]
    for i in range(angles.shape[0]):
        c, s = math.cos(angles[i]), math.sin(angles[i])
        free[i] = limit
        seen[i] = limit
        distance = 0.0
        while distance < limit:
            column = int(math.floor((x + distance * c - origin_x) / cell + 0.5))
            row = int(math.floor((y + distance * s - origin_y) / cell + 0.5))
            if row < 0 or column < 0 or row >= size or column >= size:
                break
            if known[row, column] == 0 and seen[i] == limit:
                seen[i] = distance
            if clearance[row, column] < cell:
                free[i] = distance
                break
            # unknown cells do not show in the clearance, so do not leap over them
            distance += (
                0.7 * cell
                if seen[i] == limit
                else max(0.7 * cell, 0.9 * (clearance[row, column] - cell))
            )
        seen[i] = min(seen[i], free[i])


@numba.njit(cache=True)
def price_cells(
    clearance: Array,
    seen: npt.NDArray[np.uint8],
    radius: float,
    clear: float,
    margin: float,
    squeeze: float,
    unknown: float,
) -> Array:
    """Price (m, m) of crossing each second cell of the map (n, n); infinite where barred.

    Barred is what lies nearer to something than a disc of ``radius`` and its ``margin`` [m]. From
    there to a rim's clearance of ``clear`` [m] the extra price falls from ``squeeze`` to nothing
    with the square; a cell that is not ``seen`` costs ``unknown`` more.
    """
    n = clearance.shape[0]
    m = (n + 1) // 2
    cost = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            row, column = 2 * i, 2 * j
            rim = clearance[row, column] - radius
            if rim < margin:
                cost[i, j] = np.inf
                continue
            cost[i, j] = 1.0
            if rim < clear:
                tight = min((clear - rim) / max(clear - margin, 1e-6), 1.0)
                cost[i, j] += squeeze * (tight * tight)
            if not seen[row, column]:
                cost[i, j] += unknown
    return cost


@numba.njit(cache=True)
def cost_to_go(cost: Array, value: Array, sweeps: int) -> int:
    """Solve the eikonal equation |grad value| = cost by fast sweeping, in place.

    ``cost`` (n, n) is the price of a cell's width, infinite where impassable; ``value`` (n, n)
    holds the boundary values at the sources and infinity elsewhere. Returns the sweeps used
    (Zhao 2005). A cell is looked at again only after one of its neighbours has fallen (locking;
    Bak, McLaughlin and Renzi 2010), which changes no result.
    """
    n = value.shape[0]
    # a frame of infinity all around, so that no cell lacks a neighbour
    known = np.full((n + 2, n + 2), np.inf)
    known[1:-1, 1:-1] = value
    stale = np.zeros((n + 2, n + 2), np.bool_)
    for i in range(1, n + 1):
        for j in range(1, n + 1):
            if known[i, j] < np.inf:
                _unlock(stale, i, j)
    used = 0
    for sweep in range(sweeps):
        used += 1
        change = 0.0
        down, right = sweep & 1, (sweep >> 1) & 1
        for a in range(1, n + 1):
            i = n + 1 - a if down else a
            for b in range(1, n + 1):
                j = n + 1 - b if right else b
                if not stale[i, j]:
                    continue
                stale[i, j] = False
                f = cost[i - 1, j - 1]
                if f == np.inf:
                    continue
                vertical = min(known[i - 1, j], known[i + 1, j])
                horizontal = min(known[i, j - 1], known[i, j + 1])
                difference = abs(vertical - horizontal)
                if difference >= f:
                    candidate = min(vertical, horizontal) + f
                else:
                    candidate = 0.5 * (
                        vertical + horizontal + math.sqrt(2.0 * f * f - difference * difference)
                    )
                if candidate < known[i, j] - 1e-9:
                    change = max(change, min(known[i, j], 1e6) - candidate)
                    known[i, j] = candidate
                    _unlock(stale, i, j)
        if change < 1e-3 and sweep >= 3:
            break
    value[:] = known[1:-1, 1:-1]
    return used


@numba.njit(cache=True)
def _unlock(stale: npt.NDArray[np.bool_], row: int, column: int) -> None:
    """The four neighbours of a cell have to be looked at again."""
    stale[row - 1, column] = stale[row + 1, column] = True
    stale[row, column - 1] = stale[row, column + 1] = True


@numba.njit(cache=True)
def _downhill(value: Array, row: float, column: float) -> tuple[float, float]:
    """Unit direction (row, column) of steepest descent at a point between cells.

    The gradient of the bilinear surface through the four cells around; (0, 0) where one of them is
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
    """Unit direction (row, column) to the best of the cells up to two away; (0, 0) if none is.

    For places beside barred cells, where there is no gradient. From within a barred cell it leads
    out by the nearest exit.
    """
    n = value.shape[0]
    r0, c0 = int(round(row)), int(round(column))
    if r0 < 0 or c0 < 0 or r0 >= n or c0 >= n:
        return 0.0, 0.0
    here = value[r0, c0]
    best = np.inf if here == np.inf else 0.0
    best_r, best_c = row, column
    for dr in range(-2, 3):
        for dc in range(-2, 3):
            r, c = r0 + dr, c0 + dc
            if r < 0 or c < 0 or r >= n or c >= n or (dr == 0 and dc == 0):
                continue
            if value[r, c] == np.inf:
                continue
            distance = math.hypot(dr, dc)
            slope = (value[r, c] - here) / distance
            if here == np.inf:
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
    turning: float,
) -> tuple[float, float, float]:
    """The best straight leg of ``length`` [cells] from (row, column), turning counted.

    Of all ``bearings`` [rad, from ``yaw``], the one with the least sum of the prices on the leg,
    the value at its end and ``turning`` [cells/rad] for the turn to it. Returns its end (row,
    column) and its bearing; a row of -1 where every leg is barred.
    """
    n = value.shape[0]
    steps = int(2.0 * length)
    best, best_r, best_c, best_bearing = np.inf, -1.0, -1.0, 0.0
    for k in range(bearings.size):
        dr, dc = 0.5 * math.sin(yaw + bearings[k]), 0.5 * math.cos(yaw + bearings[k])
        r, c = row, column
        total = turning * abs(bearings[k])
        for i in range(steps):
            r += dr
            c += dc
            cell_r, cell_c = int(round(r)), int(round(c))
            if cell_r < 0 or cell_c < 0 or cell_r >= n or cell_c >= n:
                total = np.inf
                break
            price = cost[cell_r, cell_c]
            if price == np.inf and i < 3:
                price = 5.0  # a robot that stands too near to something may leave
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
    """Walk down ``value`` from (row, column) in half-cell steps; fills ``path`` (steps, 2).

    Returns the number of points written: fewer than ``steps`` where it comes to the bottom.
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
            break  # turned back: this was the bottom
        before_r, before_c = step_r, step_c
        row += 0.5 * step_r
        column += 0.5 * step_c
        path[count, 0] = row
        path[count, 1] = column
        count += 1
    return count


@numba.njit(cache=True)
def least_within(bearings: Array, ranges: Array, low: float, high: float, default: float) -> float:
    """The least of ``ranges`` (n,) whose bearing (n,) is in [low, high]; ``default`` if none is."""
    least = np.inf
    for i in range(bearings.shape[0]):
        if low <= bearings[i] <= high:
            least = min(least, ranges[i])
    return default if least == np.inf else least


@numba.njit(cache=True)
def are_degrees(layer: Array) -> bool:
    """Whether all of ``layer`` (n_v, n_w) is in [0, 1], but for rounding; what is NaN is not."""
    sound = True
    for value in layer.flat:
        sound = sound and bool(0.0 <= value <= 1.0 + 1e-9)
    return sound
