"""Arcs and ranges against slow references that step through the grid in plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.ray_kernels import Ground, Start, cast_ranges, follow_arc
from navfw.numerics import Array

CELL = 0.05
SIZE = 61
ORIGIN = (-1.3, 0.4)
"""Odom position [m] of cell [0, 0]: the axes differ, so that they cannot be mistaken."""
CENTRE = (ORIGIN[0] + CELL * (SIZE // 2), ORIGIN[1] + CELL * (SIZE // 2))
RADIUS, REACH, HORIZON = 0.18, 1.0, 0.4


def cell_of(x: float, y: float) -> tuple[int, int] | None:
    """(row, column) of an odom point; None outside the grid."""
    row = math.floor((y - ORIGIN[1]) / CELL + 0.5)
    column = math.floor((x - ORIGIN[0]) / CELL + 0.5)
    return (row, column) if 0 <= row < SIZE and 0 <= column < SIZE else None


def ground_of(clearance: Array, observed: Array) -> Ground:
    return (clearance, observed.astype(np.uint8), *ORIGIN, CELL)


def reference_arc(
    clearance: Array, observed: Array, start: Start, v: float, w: float
) -> tuple[float, float, float]:
    """Free length, observed length and clearance of one command, step by step along its circle."""
    x, y, yaw = start
    at = cell_of(x, y)
    assert at is not None
    here = least = float(clearance[at])
    if v == 0.0:
        return REACH, REACH, here - RADIUS
    step, forward = 0.5 * CELL, math.copysign(1.0, v)
    longest = min(REACH, math.pi * abs(v / w)) if w else REACH
    # an arc that starts in contact is free as long as no cell is nearer by more than 2 cm
    nearest_allowed = min(RADIUS, here - 0.02)
    length, contact, unobserved = 0.0, False, math.inf
    while length < longest:
        heading = yaw + forward * (length + 0.5 * step) * w / v
        x += forward * step * math.cos(heading)
        y += forward * step * math.sin(heading)
        at = cell_of(x, y)
        if at is None:
            break
        contact = clearance[at] < nearest_allowed
        if contact:
            break
        if clearance[at] > nearest_allowed:
            nearest_allowed = min(RADIUS, max(nearest_allowed, clearance[at] - 0.02))
        if length < HORIZON:
            least = min(least, clearance[at])
        if not observed[at]:
            unobserved = min(unobserved, length)
        length += step
    if not contact and length >= longest - step:
        length = REACH
    return length, min(length, unobserved), least - RADIUS


def random_ground(rng: np.random.Generator, tight: bool) -> tuple[Array, Array]:
    """A random clearance and random observed cells; ``tight``: the start is in contact."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    clearance = np.full((SIZE, SIZE), 2.0)
    for _ in range(rng.integers(1, 6)):
        r, c = rng.integers(0, SIZE, 2)
        clearance = np.minimum(clearance, CELL * np.hypot(rows - r, columns - c))
    if tight:
        near = SIZE // 2 + rng.integers(-3, 4, 2)
        clearance = np.minimum(clearance, CELL * np.hypot(rows - near[0], columns - near[1]))
    observed = rng.random((SIZE, SIZE)) < rng.choice([0.5, 0.97, 1.0])
    return clearance, observed


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    tight=st.booleans(),
    v=st.sampled_from([-0.15, -0.05, 0.0, 0.05, 0.2, 0.5]),
    w=st.sampled_from([-1.2, -0.4, 0.0, 0.3, 1.2]),
)
def test_arcs_are_those_of_the_reference(seed: int, tight: bool, v: float, w: float) -> None:
    rng = np.random.default_rng(seed)
    clearance, observed = random_ground(rng, tight)
    # off the centre, so that arcs leave the grid at times
    x, y = (c + rng.uniform(-0.9, 0.9) for c in CENTRE) if not tight else CENTRE
    start = (x + 1e-4, y + 1e-4, rng.uniform(-3.1, 3.1))
    expected = reference_arc(clearance, observed, start, v, w)
    found = follow_arc(ground_of(clearance, observed), start, v, w, RADIUS, REACH, HORIZON)
    assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi])
def test_arcs_end_where_they_leave_the_grid(yaw: float) -> None:
    clearance, observed = np.full((SIZE, SIZE), 2.0), np.ones((SIZE, SIZE))
    ground = ground_of(clearance, observed)
    # 0.5 m from the border ahead, which is half a cell beyond the last cell's centre
    off = 0.5 * (SIZE - 1) * CELL + 0.5 * CELL - 0.5
    start = (CENTRE[0] + off * math.cos(yaw), CENTRE[1] + off * math.sin(yaw), yaw)
    free, seen, clear = follow_arc(ground, start, 0.3, 0.0, RADIUS, REACH, HORIZON)
    assert free == pytest.approx(0.5, abs=0.5 * CELL)
    assert seen == free
    assert clear == 2.0 - RADIUS
    back, _, _ = follow_arc(ground, start, -0.3, 0.0, RADIUS, REACH, HORIZON)
    assert back == REACH


def test_an_arc_of_half_a_turn_is_as_good_as_an_endless_one() -> None:
    clearance, observed = np.full((SIZE, SIZE), 2.0), np.ones((SIZE, SIZE))
    row, column = SIZE // 2, SIZE // 2
    radius = 0.2
    # occupied beside the start, where the second half of the circle would lead
    clearance[row - 2 : row + 3, column - 9 : column - 3] = 0.0
    start = (*CENTRE, 0.5 * math.pi)
    for w in (0.3 / radius, -0.3 / radius):
        free, _, _ = follow_arc(ground_of(clearance, observed), start, 0.3, w, RADIUS, REACH, 0.0)
        assert (free == REACH) == (w < 0.0), "to the left it would close on the obstacle"


BEARINGS = np.linspace(-math.pi, math.pi, 25)[1:]


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), limit=st.sampled_from([0.7, 3.0]))
def test_ranges_are_the_first_occupied_and_the_first_unobserved_cell(
    seed: int, limit: float
) -> None:
    rng = np.random.default_rng(seed)
    occupied = rng.random((SIZE, SIZE)) < rng.choice([0.0, 0.01])
    occupied |= np.roll(occupied, 1, 0) | np.roll(occupied, 1, 1)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    spots = np.argwhere(occupied)
    clearance = np.full((SIZE, SIZE), 8.0)
    for r, c in spots:
        clearance = np.minimum(clearance, CELL * np.hypot(rows - r, columns - c))
    observed = rng.random((SIZE, SIZE)) < rng.choice([0.9, 1.0])
    observed &= np.roll(observed, 1, 0) & np.roll(observed, 1, 1)
    start = (CENTRE[0] + 1e-4, CENTRE[1] + 1e-4, rng.uniform(-3.1, 3.1))
    free, seen = np.empty((2, BEARINGS.size))
    cast_ranges(ground_of(clearance, observed), start, BEARINGS, limit, free, seen)
    for bearing, range_, first in zip(BEARINGS, free, seen, strict=True):
        c, s = math.cos(bearing + start[2]), math.sin(bearing + start[2])

        def at(distance: float, c: float = c, s: float = s) -> tuple[int, int] | None:
            return cell_of(start[0] + distance * c, start[1] + distance * s)

        hit, gap = at(range_), at(first)
        assert range_ == limit or (hit is not None and clearance[hit] < CELL)
        assert first in (limit, range_) or (gap is not None and not observed[gap])
        # what is at least two cells deep along the ray is not missed
        cells = [at(distance) for distance in np.arange(0.0, limit, 0.2 * CELL)]
        inside = cells[: cells.index(None)] if None in cells else cells
        steps = range(len(inside) - 9)
        deep = [k for k in steps if all(occupied[j] for j in inside[k : k + 10])]
        assert range_ <= min(deep, default=math.inf) * 0.2 * CELL + CELL
        wide = [k for k in steps if not any(observed[j] for j in inside[k : k + 10])]
        assert first <= min(wide, default=math.inf) * 0.2 * CELL + CELL
        assert first <= range_ <= limit


def test_ranges_in_an_empty_grid_are_the_limit() -> None:
    ground = ground_of(np.full((SIZE, SIZE), 8.0), np.ones((SIZE, SIZE)))
    free, seen = np.zeros((2, BEARINGS.size))
    cast_ranges(ground, (*CENTRE, 0.3), BEARINGS, 1.1, free, seen)
    assert (free == 1.1).all()
    assert (seen == 1.1).all()
    # beyond the grid's border nothing is known to be occupied, nor is anything unobserved
    cast_ranges(ground, (*CENTRE, 0.3), BEARINGS, 9.0, free, seen)
    assert (free == 9.0).all()
    assert (seen == 9.0).all()
