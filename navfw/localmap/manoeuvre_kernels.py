"""Compiled search of a state lattice: poses of a long body, joined by short arcs of either gear.

Lattices of motion primitives after Pivtoraiko, Knepper and Kelly (2009); poses are kept continuous
within their cell of the lattice (hybrid A*, Dolgov et al. 2010).
"""

from __future__ import annotations

import heapq
import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.localmap.ray_kernels import SLACK, Ground, body_room
from navfw.numerics import Array

STEP = 0.1  # chosen
"""Length [m] of a primitive: it leaves its cell of the lattice in any direction."""
_CELL = 0.05  # chosen
"""Side [m] of a cell of the lattice."""
HEADINGS = 32  # chosen
"""Headings of the lattice; a primitive turns by one of them, or by none."""
_TURN = 2.0 * math.pi / HEADINGS  # derived
PRIMITIVES = (  # defined
    (1.0, -_TURN), (1.0, 0.0), (1.0, _TURN),
    (-1.0, -_TURN), (-1.0, 0.0), (-1.0, _TURN),
    (0.0, -_TURN), (0.0, _TURN),
)  # fmt: skip
"""Gear (1 ahead, -1 back, 0 on the spot) and turn [rad] of each primitive."""
_SIDE = 100  # chosen
"""Cells along each side of the lattice, the robot in the middle."""
_MAX_EXPANDED = 12000  # chosen
"""States expanded at most: a search without a result ends."""
_COMFORT = 0.25  # chosen
"""Clearance [m] of the body from which a state costs no more."""
_NARROW, _BACKWARD, _SPOT, _SWITCH = 6.0, 3.0, 0.15, 0.2  # chosen
"""Extra price of a state that just fits; factor on a path backward; prices [m] of one
heading's turn on the spot, and of a change of gear."""
_AT = 0.08  # chosen
"""Cost-to-go [m] at which a state is at the waypoint."""
_GREED = 1.3  # chosen
"""Weight of the cost-to-go: a path may cost more than the cheapest by this factor."""


@numba.njit(cache=True)
def _to_go(value: Array, ground: Ground, x: float, y: float) -> float:
    """Return the cost-to-go [m] at odom (x, y); ``value`` [cells] has cells of twice the grid's."""
    size = 2.0 * ground[4]
    row, column = int(round((y - ground[3]) / size)), int(round((x - ground[2]) / size))
    if row < 0 or column < 0 or row >= value.shape[0] or column >= value.shape[1]:
        return np.inf
    return float(value[row, column] * size)


@numba.njit(cache=True)
def search_lattice(
    ground: Ground,
    blind: Ground,
    discs: Array,
    margin: float,
    value: Array,
    start: tuple[float, float, float],
    progress: float,
) -> Array:
    """Search a path from ``start`` that comes ``progress`` [m] nearer by the cost-to-go ``value``.

    Returns poses (k, 4): x, y [m], yaw [rad] in odom and the gear that leads there: 1 ahead, -1
    back, 0 a turn on the spot; the first row is ``start``. Each keeps ``margin`` [m] from occupied
    cells, or what ``start`` has where that is less; unless straight ahead, by the ``blind``
    ground. The last is at the waypoint, or heads down ``value``. No rows: no path was found.
    """
    cells = _SIDE * _SIDE * HEADINGS
    price = np.full(cells, np.inf)
    parent = np.full(cells, -1, np.int32)
    done = np.zeros(cells, np.bool_)
    state = np.empty((cells, 4))
    left, bottom = start[0] - 0.5 * _CELL * _SIDE, start[1] - 0.5 * _CELL * _SIDE
    x, y, yaw = start
    need = min(0.0, body_room(blind, x, y, yaw, discs, margin) - SLACK)
    need_ahead = min(0.0, body_room(ground, x, y, yaw, discs, margin) - SLACK)
    first_key = _key(start[0] - left, start[1] - bottom, start[2])
    first = _to_go(value, ground, start[0], start[1])
    target = max(_AT, first - progress) if first < np.inf else _AT
    price[first_key] = 0.0
    _enter(state, first_key, start[0], start[1], start[2], 1.0)
    queue = [(0.0, first_key)]
    expanded = 0
    while len(queue) > 0 and expanded < _MAX_EXPANDED:
        _, node = heapq.heappop(queue)
        if done[node]:
            continue
        done[node] = True
        expanded += 1
        x, y, yaw, gear = state[node]
        to_go = _to_go(value, ground, x, y)
        ahead = _to_go(value, ground, x + 0.4 * math.cos(yaw), y + 0.4 * math.sin(yaw))
        if to_go <= _AT or (to_go <= target and ahead < to_go - 0.25):
            return _way_to(node, parent, state)
        for new_gear, bend in PRIMITIVES:
            middle = yaw + 0.5 * bend
            new_x = x + new_gear * STEP * math.cos(middle)
            new_y = y + new_gear * STEP * math.sin(middle)
            new_yaw = yaw + bend
            key = _key(new_x - left, new_y - bottom, new_yaw)
            if key < 0 or done[key]:
                continue
            straight = new_gear == 1.0 and bend == 0.0
            around, least = (ground, need_ahead) if straight else (blind, need)
            room = body_room(around, new_x, new_y, new_yaw, discs, margin)
            if new_gear == 0.0:
                room = min(room, body_room(around, x, y, middle, discs, margin))
            if room < least:
                continue
            if new_gear < 1.0 and not _seen(ground, discs, new_x, new_y, new_yaw):
                continue
            tight = max(0.0, 1.0 - max(room, 0.0) / _COMFORT)
            way = _SPOT if new_gear == 0.0 else STEP * (_BACKWARD if new_gear < 0.0 else 1.0)
            new_price = price[node] + way * (1.0 + _NARROW * tight * tight)
            new_price += _SWITCH * (new_gear != gear)
            rest = _to_go(value, ground, new_x, new_y)
            if new_price >= price[key] or rest == np.inf:
                continue
            price[key] = new_price
            parent[key] = node
            _enter(state, key, new_x, new_y, new_yaw, new_gear)
            heapq.heappush(queue, (new_price + _GREED * rest, key))
    return np.empty((0, 4))


@numba.njit(cache=True)
def _enter(state: Array, key: int, x: float, y: float, yaw: float, gear: float) -> None:
    """Write one state into its row."""
    state[key, 0], state[key, 1], state[key, 2], state[key, 3] = x, y, yaw, gear


@numba.njit(cache=True)
def _key(x: float, y: float, yaw: float) -> int:
    """Return the index of the lattice's cell with a pose; -1 outside."""
    column, row = int(math.floor(x / _CELL)), int(math.floor(y / _CELL))
    if row < 0 or column < 0 or row >= _SIDE or column >= _SIDE:
        return -1
    heading = int(round(yaw * HEADINGS / (2.0 * math.pi))) % HEADINGS
    return (row * _SIDE + column) * HEADINGS + heading


@numba.njit(cache=True)
def _seen(ground: Ground, discs: Array, x: float, y: float, yaw: float) -> bool:
    """Return whether the floor under the body was observed: no camera looks back or aside."""
    _, observed, left, bottom, cell = ground
    n = observed.shape[0]
    c, s = math.cos(yaw), math.sin(yaw)
    for k in range(discs.shape[0]):
        column = int(round((x + c * discs[k, 0] - s * discs[k, 1] - left) / cell))
        row = int(round((y + s * discs[k, 0] + c * discs[k, 1] - bottom) / cell))
        inside = 0 <= row < n and 0 <= column < n
        if not inside or observed[row, column] == 0:
            return False
    return True


@numba.njit(cache=True)
def _way_to(last: int, parent: npt.NDArray[np.int32], state: Array) -> Array:
    """Return the states (k, 4) from the start to ``last``."""
    count, node = 0, last
    while node >= 0:
        count += 1
        node = parent[node]
    way = np.empty((count, 4))
    node = last
    for k in range(count - 1, -1, -1):
        way[k] = state[node]
        node = parent[node]
    return way
