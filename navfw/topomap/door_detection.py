"""Doors on the lines of a skeleton: short narrow gaps between wider ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array
from navfw.topomap.clearance_grid import ClearanceGrid

DOOR_WIDTH = 1.5
"""Largest width of a door [m]."""

BEFORE_DOOR = 0.8
"""Distance [m] from a door to the places before and behind it."""

_DOOR_DEPTH = 1.7
"""Largest distance [m] between the points before and behind a door where it has become wider: a
door of 1.5 m in a wall of 1 m. A gap that is longer is a corridor."""

_WIDER = 0.06
"""Clearance [m] gained in front of a door: it opens into wider ground."""

_JAMB_REACH = 0.15
"""Jambs lie at most this much [m] farther than the nearest obstacle on both sides of a door."""

_SQUARE = math.radians(8.0)
"""A door whose direction is within this angle [rad] of an axis is taken to be along the axis."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Door:
    """A door on a line: the index of its point on it, its middle [m], and the unit direction."""

    index: int
    at: Point
    through: Point


def doors_on(grid: ClearanceGrid, line: Array) -> list[Door]:
    """The doors on ``line`` (N, 2) [m], in its order.

    A door is the narrowest part of a gap between jambs on both sides that widens within
    ``_DOOR_DEPTH``; it lies in the middle of the wall.
    """
    clearance = np.array([grid.at(*point) for point in line])
    found: list[Door] = []
    for index in range(1, len(line) - 1):
        here = clearance[index]
        around = slice(max(index - 10, 0), index + 11)
        if here > 0.5 * DOOR_WIDTH or here > clearance[around].min() + 1e-9:
            continue
        jambs = _jambs(grid, line, index, here + _JAMB_REACH)
        if jambs is None:
            continue
        point, through = _across(*jambs)
        gap = [_until_wider(grid, point, through, sign, here) for sign in (-1, 1)]
        if sum(gap) > _DOOR_DEPTH:
            continue
        shift = 0.5 * (gap[1] - gap[0])
        middle = point[0] + shift * through[0], point[1] + shift * through[1]
        if grid.at(*middle) < here - 1.5 * grid.cell:
            continue  # no straight gap: its middle is narrower than its narrowest point
        if found and math.dist(found[-1].at, middle) < BEFORE_DOOR:
            continue
        nearest = int(np.argmin(np.linalg.norm(line - middle, axis=1)))
        found.append(Door(nearest, middle, through))
    return found


def _until_wider(
    grid: ClearanceGrid, at: Point, through: Point, sign: int, clearance: float
) -> float:
    """Distance [m] from a point to where the gap is wider; infinite beyond ``_DOOR_DEPTH``."""
    for step in np.arange(grid.cell, _DOOR_DEPTH, grid.cell):
        x, y = at[0] + sign * step * through[0], at[1] + sign * step * through[1]
        if grid.at(x, y) >= clearance + _WIDER:
            return float(step)
    return math.inf


def _jambs(
    grid: ClearanceGrid, line: Array, index: int, reach: float
) -> tuple[Array, Array] | None:
    """The nearest solid points [m] right and left of ``line`` at one of its points, within reach.

    None where there is nothing solid on one of the sides.
    """
    at = line[index]
    ahead = line[min(index + 6, len(line) - 1)] - line[max(index - 6, 0)]
    steps = np.arange(-reach, reach + grid.cell, 0.5 * grid.cell)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(offsets, axis=1)
    solid = (grid.at_points(at + offsets) < 0.5 * grid.cell) & (away <= reach)
    left = ahead[0] * offsets[:, 1] - ahead[1] * offsets[:, 0]
    found = []
    for side in (left < 0.0, left > 0.0):
        here = np.flatnonzero(solid & side)
        if here.size == 0:
            return None
        found.append(at + offsets[here[np.argmin(away[here])]])
    return found[0], found[1]


def _across(right: Array, left: Array) -> tuple[Point, Point]:
    """The middle [m] between two jambs, and the unit direction through them.

    The direction is along an axis if it nearly is (``_SQUARE``).
    """
    middle, across = 0.5 * (right + left), left - right
    angle = math.atan2(-across[0], across[1])
    square = 0.5 * math.pi * round(angle / (0.5 * math.pi))
    if abs(angle - square) < _SQUARE:
        angle = square
    return (float(middle[0]), float(middle[1])), (math.cos(angle), math.sin(angle))
