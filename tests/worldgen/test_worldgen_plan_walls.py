"""Walls of floor plans: few rectangles that cover what is not free, and nothing else."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_plans import PLANS, with_noise
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.numerics import Mask
from navfw.sim import Rectangle
from navfw.worldgen import PlanCleaning, cleaned, wall_rectangles

CELL = 0.05


def inside(walls: list[Rectangle], shape: tuple[int, ...], grow: float = 0.0) -> Mask:
    """The cells with their centre in a rectangle, or within ``grow`` cells of one."""
    i, j = np.indices(shape)
    centres = np.stack([(j + 0.5) * CELL, (i + 0.5) * CELL], axis=-1).reshape(-1, 2)
    distance = np.min([wall.distance(centres) for wall in walls], axis=0)
    found: Mask = (distance <= grow * CELL + 1e-9).reshape(shape)
    return found


def touching(free: Mask) -> Mask:
    """The cells that are not free and touch free ground."""
    grown = cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    touched: Mask = grown & ~free
    return touched


def check(free: Mask) -> int:
    """Check that walls are where the plan has them, within a cell; returns their number."""
    free = np.pad(free, 2)
    walls = wall_rectangles(free, CELL)
    away = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5)
    covered = inside(walls, free.shape)
    assert away[covered].max(initial=0.0) < 2.0, "a wall stands on free ground"
    assert not (touching(free) & ~inside(walls, free.shape, 1.5)).any(), "a wall is missing"
    return len(walls)


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("thick-walls", 16),
        ("long-corridors", 23),
        ("open-hall", 13),
        ("curved-walls", 60),
        ("clutter", 10),
    ],
)
def test_few_walls_are_where_the_plan_has_them(name: str, most: int) -> None:
    assert check(PLANS[name]().free) <= most


@pytest.mark.parametrize("name", ["thick-walls", "open-hall"])
def test_noise_does_not_become_a_wall_of_pixels(name: str) -> None:
    plan = PLANS[name]()
    noisy = cleaned(with_noise(plan, np.random.default_rng(3)), PlanCleaning())
    assert len(wall_rectangles(noisy.free, CELL)) <= 1.5 * len(wall_rectangles(plan.free, CELL))


@st.composite
def drawings(draw: st.DrawFn) -> Mask:
    """Free ground of some rectangles and slanted quadrangles, with solid ones in it."""
    free = np.zeros((70, 90), np.uint8)
    for value in (1, 1, 1, 0, 0):
        at = np.array([draw(st.integers(15, 75)), draw(st.integers(15, 55))])
        size = (draw(st.integers(8, 40)), draw(st.integers(8, 40)))
        box = cv2.boxPoints((at.tolist(), size, draw(st.sampled_from([0.0, 0.0, 17.0, 45.0]))))
        cv2.fillPoly(free, [np.round(box).astype(np.int32)], value)
    opened = cv2.morphologyEx(free, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0


@settings(max_examples=40, deadline=None)
@given(drawings())
def test_walls_cover_what_is_not_free_within_a_cell(free: Mask) -> None:
    if free.any():
        check(free)


def test_walls_of_one_pixel() -> None:
    free = np.ones((60, 80), np.bool_)
    free[:, 40] = False
    free[25:45, 40] = True
    free[[0, -1]] = free[:, [0, -1]] = False
    walls = wall_rectangles(free, CELL)
    assert len(walls) == 6
    thin = [wall for wall in walls if min(wall.half_x, wall.half_y) < CELL]
    assert [min(2 * wall.half_x, 2 * wall.half_y) for wall in thin] == pytest.approx([CELL] * 2)


def test_speckles_vanish_and_gaps_are_closed() -> None:
    plan = PLANS["open-hall"]()
    cells = plan.cells.copy()
    cells[40:42, 50] = 100  # two cells, in free ground
    cells[60:80, 60] = 100  # a thin wall stays
    spotted = type(plan)(cells, plan.resolution, plan.origin)
    free = cleaned(spotted, PlanCleaning()).free
    assert free[40:42, 50].all()
    assert not free[60:80, 60].any()
    assert not cleaned(spotted, PlanCleaning(speckle=0)).free[40:42, 50].any()
    wall = np.zeros((40, 60), np.int8)
    wall[:, 30:32] = 100
    wall[20:22, 30:32] = 0
    split = type(plan)(wall, 0.05, plan.origin)
    assert cleaned(split, PlanCleaning()).free.sum() == 40 * 30  # a side alone
    assert cleaned(split, PlanCleaning(gap=0)).free.sum() == 40 * 58 + 4
