"""The compiled kernels of the local map against their formulas, written out in numpy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from navfw.localmap.cost_kernels import cost_to_go
from navfw.localmap.ray_kernels import body_room
from navfw.localmap.sensor_kernels import cast_evidence, decay_view
from navfw.numerics import Array

SEEDS = st.integers(0, 2**32 - 1)


def swept(cost: Array, value: Array, sweeps: int) -> tuple[Array, int]:
    """Fast sweeping that updates every cell in every sweep; also the number of sweeps."""
    n = len(value)
    value = np.pad(value, 1, constant_values=np.inf)
    for sweep in range(sweeps):
        change = 0.0
        for i in range(n, 0, -1) if sweep & 1 else range(1, n + 1):
            for j in range(n, 0, -1) if sweep & 2 else range(1, n + 1):
                f, old = cost[i - 1, j - 1], value[i, j]
                a, b = sorted(
                    (
                        min(value[i - 1, j], value[i + 1, j]),
                        min(value[i, j - 1], value[i, j + 1]),
                    )
                )
                if math.isinf(f) or math.isinf(a):
                    continue
                new = a + f if b - a >= f else 0.5 * (a + b + math.sqrt(2 * f * f - (b - a) ** 2))
                if new < old - 1e-9:
                    change = max(change, min(old, 1e6) - new)
                    value[i, j] = new
        if change < 1e-3 and sweep >= 3:
            break
    return value[1:-1, 1:-1], sweep + 1


@settings(max_examples=25)
@given(SEEDS, st.floats(0.0, 0.4), st.integers(1, 24))
def test_locked_sweeps_find_what_full_sweeps_find(seed: int, barred: float, sweeps: int) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.uniform(1.0, 5.0, (13, 13))
    cost[rng.random(cost.shape) < barred] = np.inf
    value = np.full(cost.shape, np.inf)
    for _ in range(rng.integers(1, 4)):
        value[tuple(rng.integers(0, 13, 2))] = rng.uniform(0.0, 9.0)
    expected, used = swept(cost, value, sweeps)
    assert cost_to_go(cost, value, sweeps) == used
    np.testing.assert_allclose(value, expected, rtol=0.0, atol=1e-9)


@given(SEEDS, st.floats(0.0, 8.99), st.floats(0.0, 8.99))
def test_room_between_cells_is_bilinear(seed: int, row: float, column: float) -> None:
    clearance = np.random.default_rng(seed).uniform(0.0, 1.0, (10, 10))
    (expected,) = map_coordinates(clearance, [[row], [column]], order=1) - 0.2
    ground = (clearance, np.ones((10, 10), np.uint8), 0.0, 0.0, 1.0)
    room = body_room(ground, column, row, 0.0, np.array([[0.0, 0.0, 0.15]]), 0.05)
    assert room == pytest.approx(expected)


@settings(max_examples=30)
@given(SEEDS, st.floats(-3.2, 3.2), st.floats(-10, 40), st.floats(-10, 40))
def test_only_free_cells_in_view_decay(seed: int, yaw: float, row: float, column: float) -> None:
    rng = np.random.default_rng(seed)
    log_odds = rng.uniform(-1.5, 3.0, (31, 31))
    slope, near, reach = rng.uniform(0.2, 2.0), rng.uniform(0.0, 3.0), rng.uniform(2.0, 30.0)
    i, j = np.mgrid[:31, :31]
    ahead = (j - column) * math.cos(yaw) + (i - row) * math.sin(yaw)
    aside = (i - row) * math.cos(yaw) - (j - column) * math.sin(yaw)
    inside = (ahead > near) & (ahead < reach) & (np.abs(aside) <= slope * ahead)
    expected = np.where(inside & (log_odds < 0.0), 0.5 * log_odds, log_odds)
    decay_view(log_odds, row, column, yaw, slope, near, reach, 0.5)
    np.testing.assert_array_equal(log_odds, expected)


# --- the evidence of single rays -----------------------------------------------------------------

CELL, SIZE = 0.05, 81
ORIGIN = (-2.0, 1.0)
CAMERA_AT = (ORIGIN[0] + 2.0013, ORIGIN[1] + 1.9017)
"""Place of the camera [m], off the cells' borders, so that rounding decides nothing."""
HEIGHT = 0.35
LIMITS = (1.5, 0.7, 0.08, 0.3, 0.15, 0.2, 0.5)


def evidence(
    directions: Array, *readings: tuple[float, float, float, float], known: float = 0.0
) -> list[Array]:
    """The layers (hit, free) of rays, by nearness, sigma and weights of both for each point.

    All cells have the log-odds ``known``.
    """
    hit, free = np.zeros((2, SIZE, SIZE))
    nearness, sigma, hits, frees = np.ascontiguousarray(np.transpose(readings))
    directions, limits = np.atleast_2d(directions), np.array(LIMITS)
    cast_evidence(
        hit, free, np.full_like(hit, known), *ORIGIN, CELL, *CAMERA_AT, HEIGHT, directions,
        nearness, sigma, hits, frees, limits,
    )  # fmt: skip
    return [hit, free]


def cell_at(direction: Array, depth: float) -> tuple[int, int] | None:
    """The cell (row, column) of the ray at ``depth`` [m]; None outside the grid."""
    column = math.floor((CAMERA_AT[0] + depth * direction[0] - ORIGIN[0]) / CELL + 0.5)
    row = math.floor((CAMERA_AT[1] + depth * direction[1] - ORIGIN[1]) / CELL + 0.5)
    return (row, column) if 0 <= row < SIZE and 0 <= column < SIZE else None


def test_where_the_floor_is_not_in_view_nothing_known_is_cleared() -> None:
    ahead, reading = np.array([1.0, 0.0, -0.25]), (0.8, 0.1, 0.0, 1.0)
    unknown, occupied = (evidence(ahead, reading, known=known)[1] for known in (0.0, 1.0))
    row, blind = cell_at(ahead, 0.0)[0], cell_at(ahead, LIMITS[-1])[1]  # type: ignore[index]
    assert unknown[row, blind - 5 : blind + 5].all()
    assert not occupied[row, :blind].any()
    assert (occupied[row, blind + 1 :] == unknown[row, blind + 1 :]).all()


AHEAD = np.array([1.0, 0.0, 0.0])


def test_rays_without_weight_leave_no_evidence() -> None:
    assert not np.any(evidence(AHEAD, (1.0, 0.02, 0.0, 0.0)))


def test_rays_of_one_point_share_its_reading() -> None:
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.2, 0.0], [0.2, 1.0, 0.0]])
    readings = [(1.0, 0.05, 1.0, 0.9), (2.0, 0.1, 0.5, 0.7)]
    # the third ray belongs to the first point, the fourth to the second
    single = [evidence(ray, readings[k % 2]) for k, ray in enumerate(directions)]
    np.testing.assert_array_equal(evidence(directions, *readings), np.max(single, axis=0))


def test_the_larger_evidence_of_two_rays_counts() -> None:
    once, _ = evidence(AHEAD, (1.0, 0.02, 0.8, 0.0))
    hit, free = evidence(np.stack([AHEAD, AHEAD]), (1.0, 0.02, 0.8, 0.3), (1.0, 0.02, 0.3, 0.9))
    np.testing.assert_array_equal(hit, once)
    # a level ray passes at camera height
    assert free.max() == pytest.approx(0.9 * LIMITS[5])
