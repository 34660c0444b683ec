"""Compiled ray casting through the occupancy grid: arcs of commands, and ranges all around.

All work on square grids indexed [row, column] = [y, x] in the odom frame's directions.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array

Ground = tuple[Array, npt.NDArray[np.uint8], float, float, float]
"""What rays are cast through: ``clearance`` (n, n) [m], the distance of each cell to the nearest
occupied one; ``observed`` (n, n), > 0 where a cell has been observed free; origin x and y [m, odom]
of the centre of cell [0, 0]; cell size [m]. A plain tuple: numba dispatches named ones slowly."""

Start = tuple[float, float, float]
"""Where rays and arcs begin: x, y [m] and yaw [rad] in odom."""


@numba.njit(cache=True)
def sweep_arcs(
    ground: Ground,
    start: Start,
    speeds: Array,
    turns: Array,
    radius: float,
    reach: float,
    horizon: float,
    free_length: Array,
    observed_length: Array,
    arc_clearance: Array,
) -> None:
    """Sweep a disc of ``radius`` [m] along the arc of every command (speed, turn).

    Fills (n_v, n_w) arrays: ``free_length`` [m], up to ``reach``, until the disc would touch
    something; ``observed_length`` [m] until its centre would enter a cell not observed free;
    ``arc_clearance`` [m], the least clearance of the disc's rim within ``horizon`` [m]. An arc that
    starts too close is free as long as it leads away. At speed 0 the lengths are ``reach``.
    """
    for i in range(speeds.shape[0]):
        for j in range(turns.shape[0]):
            free_length[i, j], observed_length[i, j], arc_clearance[i, j] = follow_arc(
                ground, start, speeds[i], turns[j], radius, reach, horizon
            )


@numba.njit(cache=True)
def follow_arc(
    ground: Ground, start: Start, v: float, w: float, radius: float, reach: float, horizon: float
) -> tuple[float, float, float]:
    """Return free length, observed length and clearance [m] of one command; see ``sweep_arcs``."""
    clearance, observed, origin_x, origin_y, cell = ground
    px, py, yaw = start
    size = clearance.shape[0]
    column = int(math.floor((px - origin_x) / cell + 0.5))
    row = int(math.floor((py - origin_y) / cell + 0.5))
    least = clearance[row, column]
    if v == 0.0:
        return reach, reach, least - radius
    step = 0.5 * cell
    curvature = w / v
    sign = 1.0 if v > 0.0 else -1.0
    # the heading in the middle of each step, as a unit vector that is turned by the step
    turn = sign * step * curvature
    c_turn, s_turn = math.cos(turn), math.sin(turn)
    c_mid, s_mid = math.cos(yaw + 0.5 * turn), math.sin(yaw + 0.5 * turn)
    length = 0.0
    floor = min(radius, least - 0.02)
    blocked = False
    observed_until = -1.0
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
        if observed_until < 0.0 and observed[row, column] == 0:
            observed_until = length
        length += step
    if not blocked and length >= longest - step:
        length = reach
    return length, length if observed_until < 0.0 else observed_until, least - radius


SLACK = 0.005  # chosen
"""Length [m] by which a body may be nearer than it was, or than its rim: interpolation errs."""

TURN = 0.5  # chosen
"""Angle [rad] of a turn on the spot by which the room to turn is judged."""


@numba.njit(cache=True)
def sweep_body(
    ground: Ground,
    start: Start,
    speeds: Array,
    turns: Array,
    discs: Array,
    margin: float,
    reach: float,
    horizon: float,
    free_length: Array,
    observed_length: Array,
    arc_clearance: Array,
) -> None:
    """Sweep a body covered by ``discs``, like ``sweep_arcs``; see ``follow_body``."""
    for i in range(speeds.shape[0]):
        for j in range(turns.shape[0]):
            free_length[i, j], observed_length[i, j], arc_clearance[i, j] = follow_body(
                ground, start, speeds[i], turns[j], discs, margin, reach, horizon
            )


@numba.njit(cache=True)
def follow_body(
    ground: Ground,
    start: Start,
    v: float,
    w: float,
    discs: Array,
    margin: float,
    reach: float,
    horizon: float,
) -> tuple[float, float, float]:
    """Follow one command with a body of ``discs`` (n, 3), like ``follow_arc``.

    Rows are the centre in base_link and the radius [m], widened by ``margin`` [m]. The observed
    length is that of the middle of the front, backward of the rear. The free length of a turn on
    the spot is ``reach``, or less in proportion to the share of ``TURN`` for which there is room.
    """
    _, observed, origin_x, origin_y, cell = ground
    size = observed.shape[0]
    px, py, yaw = start
    least = widest = body_room(ground, px, py, yaw, discs, margin)
    if v == 0.0 and w == 0.0:
        return reach, reach, least
    front, rear = discs[:, 0].max(), discs[:, 0].min()
    lever = max(front, -rear, discs[:, 1].max())
    length, step, longest = 0.0, 0.5 * cell, reach
    turn = math.copysign(step / lever, w)  # the step of a turn on the spot
    if v == 0.0:
        step = reach * abs(turn) / TURN
    else:
        turn = step * w / abs(v)
        longest = min(reach, math.pi * step / max(abs(turn), 1e-9))
    sign = 0.0 if v == 0.0 else math.copysign(1.0, v)
    end = front if v >= 0.0 else rear
    observed_until = -1.0
    blocked = False
    while length < longest:
        px += sign * step * math.cos(yaw + 0.5 * turn)
        py += sign * step * math.sin(yaw + 0.5 * turn)
        yaw += turn
        room = body_room(ground, px, py, yaw, discs, margin)
        if room < min(0.0, widest) - SLACK:
            blocked = True
            break
        widest = max(widest, room)  # moving away: from now on no nearer than this
        if length < horizon and room < least:
            least = room
        row = int(math.floor((py + end * math.sin(yaw) - origin_y) / cell + 0.5))
        column = int(math.floor((px + end * math.cos(yaw) - origin_x) / cell + 0.5))
        if row < 0 or column < 0 or row >= size or column >= size:
            blocked = True
            break
        if sign != 0.0 and observed_until < 0.0 and observed[row, column] == 0:
            observed_until = length
        length += step
    if not blocked and length >= longest - step:
        length = reach
    return length, length if observed_until < 0.0 else observed_until, least


@numba.njit(cache=True)
def body_room(ground: Ground, x: float, y: float, yaw: float, discs: Array, margin: float) -> float:
    """Return the least distance [m] from the rim of widened ``discs`` to an occupied cell."""
    clearance, _, origin_x, origin_y, cell = ground
    size = clearance.shape[0]
    c, s = math.cos(yaw), math.sin(yaw)
    room = np.inf
    for k in range(discs.shape[0]):
        ahead, left = discs[k, 0], discs[k, 1]
        column = (x + ahead * c - left * s - origin_x) / cell
        row = (y + ahead * s + left * c - origin_y) / cell
        if row < 0.0 or column < 0.0 or row >= size - 1 or column >= size - 1:
            continue
        room = min(room, _interpolated(clearance, row, column) - discs[k, 2] - margin)
    return room


@numba.njit(cache=True)
def _interpolated(field: Array, row: float, column: float) -> float:
    """Interpolate ``field`` (n, n) bilinearly at (row, column) [cells] inside of it.

    Taken from the nearest cell only, the room beside a moving body would jump by half a cell.
    """
    i, j = int(row), int(column)
    down, right = row - i, column - j
    above = field[i, j] * (1.0 - right) + field[i, j + 1] * right
    below = field[i + 1, j] * (1.0 - right) + field[i + 1, j + 1] * right
    return float(above * (1.0 - down) + below * down)


@numba.njit(cache=True)
def cast_ranges(
    ground: Ground, start: Start, bearings: Array, limit: float, free: Array, seen: Array
) -> None:
    """Cast a ray along each of ``bearings`` (n,) [rad, from ``start.yaw``] up to ``limit`` [m].

    Fills ``free`` (n,) [m], the distance from ``start`` to the first occupied cell, and ``seen``
    (n,) [m], that to the first cell not observed free; ``limit`` if the ray meets none.
    """
    clearance, observed, origin_x, origin_y, cell = ground
    x, y, yaw = start
    size = clearance.shape[0]
    for i in range(bearings.shape[0]):
        c, s = math.cos(bearings[i] + yaw), math.sin(bearings[i] + yaw)
        free[i] = limit
        seen[i] = limit
        distance = 0.0
        while distance < limit:
            column = int(math.floor((x + distance * c - origin_x) / cell + 0.5))
            row = int(math.floor((y + distance * s - origin_y) / cell + 0.5))
            if row < 0 or column < 0 or row >= size or column >= size:
                break
            if observed[row, column] == 0 and seen[i] == limit:
                seen[i] = distance
            if clearance[row, column] < cell:
                free[i] = distance
                break
            # unobserved cells do not show in the clearance: no long steps before the first of them
            distance += (
                0.7 * cell
                if seen[i] == limit
                else max(0.7 * cell, 0.9 * (clearance[row, column] - cell))
            )
        seen[i] = min(seen[i], free[i])


@numba.njit(cache=True)
def least_within(bearings: Array, ranges: Array, low: float, high: float, default: float) -> float:
    """Return the least of ``ranges`` (n,) at bearings in [low, high]; ``default`` if none is."""
    least = np.inf
    for i in range(bearings.shape[0]):
        if low <= bearings[i] <= high:
            least = min(least, ranges[i])
    return default if least == np.inf else least
