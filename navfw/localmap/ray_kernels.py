"""Compiled inner loops over the ego map: arcs and rays through it.

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
    "follow_arc",
    "least_within",
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
