"""Walls show the heading: their direction is found, remembered, and corrects a drift."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapping_scenes import ROBOT, drifted, drive, poses_along

from navfw.mapping import GrowingMap
from navfw.mapping.wall_directions import WallDirections, wall_direction
from navfw.numerics import Array
from navfw.numerics.products import product

QUARTER = 0.5 * math.pi


def corridor(yaw: float, noise: float, seed: int, slant: float = 0.0) -> Array:
    """Points (n, 2) [m] of two walls and a door frame, as a robot that heads ``yaw`` sees them."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-3.0, 4.0, 300)
    walls = np.stack([along, np.where(rng.random(300) < 0.5, -0.9, 1.1)], axis=1)
    across = np.stack([np.full(40, 1.5), rng.uniform(0.8, 1.6, 40)], axis=1)
    points = np.concatenate([walls, across]) + rng.normal(0.0, noise, (340, 2))
    c, s = math.cos(slant - yaw), math.sin(slant - yaw)
    seen: Array = product(points, np.array([[c, s], [-s, c]]))
    return seen


def arc(radius: float, seed: int) -> Array:
    """Points (n, 2) [m] of the walls of a corridor that turns with ``radius`` [m]."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-3.0, 4.0, 300) / radius
    at = radius + np.where(rng.random(300) < 0.5, -0.9, 1.1)
    points = np.stack([at * np.sin(angle), radius - at * np.cos(angle)], axis=1)
    return points + rng.normal(0.0, 0.03, (300, 2))


def off(a: float, b: float) -> float:
    """Difference of two directions of walls [rad]."""
    return abs((a - b + 0.5 * QUARTER) % QUARTER - 0.5 * QUARTER)


@settings(max_examples=20)
@given(st.floats(-3.2, 3.2), st.floats(0.0, 0.06), st.integers(0, 99))
def test_the_direction_of_walls_is_found(yaw: float, noise: float, seed: int) -> None:
    found = wall_direction(corridor(yaw, noise, seed))
    assert found is not None
    assert off(found, -yaw) < 0.012


@pytest.mark.parametrize("radius", [3.0, 5.0, 8.0, 12.0])
def test_curved_walls_and_clutter_have_no_direction(radius: float) -> None:
    assert wall_direction(arc(radius, 1)) is None
    scattered = np.random.default_rng(2).uniform(-3.0, 3.0, (400, 2))
    assert wall_direction(scattered) is None
    assert wall_direction(scattered[:10]) is None


def test_a_heading_that_drifts_is_held_by_the_walls() -> None:
    walls, corrected, plain = WallDirections(), 0.0, 0.0
    for step in range(60):
        drift = 0.004
        corrected, plain = corrected + drift, plain + drift
        turn = 0.3 * math.sin(0.4 * step)  # the true heading; the robot looks about
        seen = corridor(turn, 0.03, step)
        yaw = walls.heading(seen, turn + corrected, 0.01)
        corrected = corrected if yaw is None else yaw - turn
    assert plain == pytest.approx(0.24)
    assert abs(corrected) < 0.03


def test_a_slanted_wing_is_learned_beside_the_first_direction() -> None:
    walls = WallDirections()
    headings = [walls.heading(corridor(0.0, 0.03, k), 0.0, 0.01) for k in range(6)]
    assert headings[0] is None
    assert headings[-1] == pytest.approx(0.0, abs=0.01)
    slanted = [walls.heading(corridor(0.0, 0.03, k, slant=0.5), 0.0, 0.01) for k in range(6)]
    assert slanted[0] is None
    assert slanted[-1] == pytest.approx(0.0, abs=0.015)


def test_a_long_corridor_becomes_straight_without_any_loop() -> None:
    boxes = ((-2.0, 26.0, -1.0, -1.0), (-2.0, 26.0, 1.2, 1.2), (9.0, 9.0, 0.7, 1.2))
    truth = list(poses_along(((0.0, 0.0), (25.0, 0.0)), 0.1))
    ends = {}
    for corrects in (True, False):
        growing = GrowingMap(ROBOT, close_loops=corrects)
        drive(growing, boxes, truth, drifted(truth, 0.004))
        assert growing.loops.closed == 0
        ends[corrects] = growing.pose
    assert ends[False].yaw > 0.08
    assert abs(ends[True].yaw) < 0.03
    assert abs(ends[True].y) < 0.4 * abs(ends[False].y)
