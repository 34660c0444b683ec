"""The evidence of single rays against the sensor model, written out in plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.sensor_kernels import cast_evidence
from navfw.numerics import Array

CELL, SIZE = 0.05, 81
ORIGIN = (-2.0, 1.0)
CAMERA = (ORIGIN[0] + 2.0013, ORIGIN[1] + 1.9017)
"""Place of the camera [m], off the cells' borders, so that rounding decides nothing."""
HEIGHT = 0.35
RANGE, WIDTH, NOTHING, EVERYTHING, LOW, OVER = LIMITS = (1.5, 0.7, 0.08, 0.3, 0.15, 0.2)


def evidence(
    direction: Array, nearness: float, sigma: float, hit_weight: float, free_weight: float
) -> tuple[Array, Array]:
    """The layers (hit, free) of one ray."""
    hit, free = np.zeros((2, SIZE, SIZE))
    one = np.ones(1)
    cast_evidence(
        hit, free, *ORIGIN, CELL, *CAMERA, HEIGHT, direction[None, :], nearness * one,
        sigma * one, hit_weight * one, free_weight * one, np.array(LIMITS),
    )  # fmt: skip
    return hit, free


def cell_at(direction: Array, depth: float) -> tuple[int, int] | None:
    """The cell (row, column) of the ray at ``depth`` [m]; None outside the grid."""
    column = math.floor((CAMERA[0] + depth * direction[0] - ORIGIN[0]) / CELL + 0.5)
    row = math.floor((CAMERA[1] + depth * direction[1] - ORIGIN[1]) / CELL + 0.5)
    return (row, column) if 0 <= row < SIZE and 0 <= column < SIZE else None


def reference_free(direction: Array, nearness: float, sigma: float, weight: float) -> Array:
    """Free evidence up to one sigma before the reading, less above low obstacles."""
    free = np.zeros((SIZE, SIZE))
    step = 0.7 * CELL / math.hypot(direction[0], direction[1])
    depth = step
    while depth < min(1.0 / (nearness + sigma), RANGE):
        at = cell_at(direction, depth)
        if at is None:
            break
        height = HEIGHT + depth * direction[2]
        share = np.interp(height, (LOW, HEIGHT), (1.0, OVER))
        free[at] = max(free[at], weight * share)
        depth += step
    return free


def reference_hit(direction: Array, nearness: float, sigma: float, weight: float) -> Array:
    """Hit evidence by the probability that the reading is within the cell."""
    hit = np.zeros((SIZE, SIZE))
    slant = math.hypot(direction[0], direction[1])
    half = 0.5 * CELL / slant
    near = min(1.0 / (nearness + WIDTH * sigma), 1.0 / nearness - half)
    far = max(1.0 / max(nearness - WIDTH * sigma, 0.4 * nearness), 1.0 / nearness + half)
    depth = near
    while near <= RANGE and depth <= far:
        at = cell_at(direction, depth)
        if at is None:
            break
        density = math.exp(-0.5 * ((1.0 / depth - nearness) / sigma) ** 2) / math.sqrt(2 * math.pi)
        # the sigma of the depth on the floor is that of nearness times depth squared
        probability = density * CELL / max(sigma * depth * depth * slant, 0.5 * CELL)
        share = np.interp(probability, (NOTHING, EVERYTHING), (0.0, 1.0))
        hit[at] = max(hit[at], weight * share)
        depth += 0.7 * CELL / slant
    return hit


@settings(max_examples=150)
@given(
    heading=st.floats(-3.1, 3.1),
    slant=st.floats(0.8, 1.3),
    rise=st.floats(-0.7, 0.4),
    depth=st.floats(0.3, 3.0),
    sigma=st.floats(0.02, 0.5),
    weights=st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 1.0)),
)
def test_the_evidence_of_a_ray_is_that_of_the_sensor_model(
    heading: float,
    slant: float,
    rise: float,
    depth: float,
    sigma: float,
    weights: tuple[float, float],
) -> None:
    direction = np.array([slant * math.cos(heading), slant * math.sin(heading), rise])
    hit, free = evidence(direction, 1.0 / depth, sigma, *weights)
    expected = reference_hit(direction, 1.0 / depth, sigma, weights[0])
    np.testing.assert_allclose(hit, expected, atol=1e-9)
    expected = reference_free(direction, 1.0 / depth, sigma, weights[1])
    np.testing.assert_allclose(free, expected, atol=1e-9)


AHEAD = np.array([1.0, 0.0, 0.0])


def test_rays_without_weight_leave_no_evidence() -> None:
    hit, free = evidence(AHEAD, 1.0, 0.02, 0.0, 0.0)
    assert not hit.any()
    assert not free.any()


def test_rays_of_one_point_share_its_reading() -> None:
    hit, free = np.zeros((2, SIZE, SIZE))
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.2, 0.0], [0.2, 1.0, 0.0]])
    readings = np.array([[1.0, 0.05, 1.0, 0.9], [2.0, 0.1, 0.5, 0.7]])
    cast_evidence(
        hit,
        free,
        *ORIGIN,
        CELL,
        *CAMERA,
        HEIGHT,
        directions,
        readings[:, 0].copy(),
        readings[:, 1].copy(),
        readings[:, 2].copy(),
        readings[:, 3].copy(),
        np.array(LIMITS),
    )
    # the third ray belongs to the first point, the fourth to the second
    single = [
        evidence(direction, *reading)
        for direction, reading in zip(directions, [*readings, *readings], strict=True)
    ]
    np.testing.assert_array_equal(hit, np.max([one for one, _ in single], axis=0))
    np.testing.assert_array_equal(free, np.max([one for _, one in single], axis=0))


def test_the_larger_evidence_of_two_rays_counts() -> None:
    once, _ = evidence(AHEAD, 1.0, 0.02, 0.8, 0.0)
    hit, free = np.zeros((2, SIZE, SIZE))
    cast_evidence(
        hit, free, *ORIGIN, CELL, *CAMERA, HEIGHT, np.array([AHEAD, AHEAD]), np.ones(2),
        np.full(2, 0.02), np.array([0.8, 0.3]), np.array([0.3, 0.9]), np.array(LIMITS),
    )  # fmt: skip
    np.testing.assert_array_equal(hit, once)
    # a level ray passes at camera height
    assert free.max() == pytest.approx(0.9 * OVER)
