"""Families of one open area: ``clutter``, ``poles`` as in BARN, and ``moving`` with people.

BARN (Perille et al. 2020) fills 30 x 30 cells of 0.15 m at random, smooths them by a cellular
automaton, and puts a pole in every filled cell, between two rows of poles. In ``poles``, walls
replace these rows, and radii vary.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from navfw.interfaces import WorldFamily
from navfw.robot import SideViews
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.worldspec import WalkerSpec
from navfw.worldgen.world_draft import (
    FAST_ROBOT,
    POLES_STACK,
    ROBOT,
    WALL,
    Point,
    Unsuitable,
    WorldDraft,
    blend,
)

Interval = tuple[float, float]


class Clutter(WorldFamily):
    """A walled area with boxes and cylinders, with gaps of 1.2 m when easy to 0.75 m when hard."""

    name: ClassVar[str] = "clutter"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw an area of 8 to 12 m by 8 to 12 m, to be crossed from one side to the other."""
        draft = WorldDraft.empty(rng, rng.uniform(8.0, 12.0), rng.uniform(8.0, 12.0))
        draft.enclose(draft.palette.draw("wall"))
        gap = blend(1.2, 0.75, difficulty)
        draft.description = f"A walled area with boxes and cylinders at least {gap:.2f} m apart."
        _set_clutter_ends(draft)
        textures = draft.palette.draw_many("thing", 5)
        area = draft.x[1] * draft.y[1]
        wanted = round(area * blend(0.12, 0.34, difficulty))
        for _ in range(40 * wanted):
            if len(draft.shapes) >= wanted:
                break
            _try_solid(draft, gap, draft.palette.pick(textures))
        return draft


def _set_clutter_ends(draft: WorldDraft) -> None:
    """Start and goal near opposite sides, along x or y, in either direction."""
    rng = draft.rng
    size = np.array([draft.x[1], draft.y[1]])
    axis, backwards = int(rng.integers(2)), bool(rng.integers(2))
    start, goal = rng.uniform(0.15, 0.85, (2, 2)) * size
    start[axis], goal[axis] = 0.9, size[axis] - 0.9
    if backwards:
        start, goal = goal, start
    draft.keep_free(start[0], start[1], 0.7)
    draft.keep_free(goal[0], goal[1], 0.6)
    draft.set_start_and_goal((start[0], start[1]), (goal[0], goal[1]))
    x, y, yaw = draft.start
    draft.start = (x, y, round(yaw + float(rng.uniform(-0.5, 0.5)), 3))


def _try_solid(draft: WorldDraft, gap: float, texture: str) -> None:
    """Add a box or cylinder at a random position, unless it leaves too narrow a gap."""
    rng = draft.rng
    number = len(draft.shapes) + 1
    height = rng.uniform(0.5, 1.8)
    x, y = rng.uniform(0.0, draft.x[1]), rng.uniform(0.0, draft.y[1])
    shape: Shape
    if rng.random() < 0.5:
        kind, shape = "cylinder", Circle(x, y, rng.uniform(0.1, 0.45))
    else:
        half_x, half_y = rng.uniform(0.12, 0.5, 2)
        kind, shape = "box", Rectangle(x, y, half_x, half_y, rng.uniform(0.0, math.pi))
    x0, y0, x1, y1 = shape.bounds
    beside = [away - WALL for away in (x0, y0, draft.x[1] - x1, draft.y[1] - y1)]
    # passable, or clearly impassable
    if all(0.01 < d < 0.2 or d >= gap for d in beside) and draft.fits(shape, gap):
        draft.add(f"{kind}-{number}", shape, height, texture)


CELL = 0.15
"""Edge of the automaton's cells [m], as in BARN."""
_ROWS, _LENGTH = 30, 36
"""Number of cells across and along the field."""
_RUN_UP = 1.6
"""Length of the free floor at both ends of the field [m]."""


class Poles(WorldFamily):
    """A field of thin poles between walls, as dense as BARN worlds."""

    name: ClassVar[str] = "poles"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw a field 4.5 m wide and 5.4 m long, to be crossed lengthwise."""
        width, length = _ROWS * CELL + 2 * WALL, _LENGTH * CELL + 2 * _RUN_UP
        draft = WorldDraft.empty(rng, length, width)
        draft.enclose(draft.palette.draw("wall"), height=1.6)
        filled = _automaton(rng, blend(0.17, 0.235, difficulty))
        draft.description = "A field of thin poles between walls, clustered as in BARN worlds."
        draft.robot, draft.stack = FAST_ROBOT, POLES_STACK
        draft.clearance = ROBOT.radius + blend(0.17, 0.09, difficulty)
        _set_poles_ends(draft)
        textures = draft.palette.draw_many("thing", 4)
        for number, (x, y, radius) in enumerate(_poles(rng, filled), start=1):
            texture = draft.palette.pick(textures)
            draft.add(f"pole-{number}", Circle(x, y, radius), rng.uniform(0.8, 1.5), texture)
        return draft


def _automaton(rng: np.random.Generator, fill: float) -> npt.NDArray[np.bool_]:
    """Filled cells (rows, columns): random, then smoothed.

    A cell with five or more filled neighbours is filled, one with at most one is cleared.
    """
    cells = rng.random((_ROWS, _LENGTH)) < fill
    for _ in range(int(rng.integers(2, 4))):
        padded = np.pad(cells, 1, constant_values=False).astype(int)
        around = sum(
            padded[1 + i : 1 + i + _ROWS, 1 + j : 1 + j + _LENGTH]
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
            if (i, j) != (0, 0)
        )
        cells = np.where(around >= 5, True, np.where(around <= 1, False, cells))
    return cells


def _poles(rng: np.random.Generator, filled: npt.NDArray[np.bool_]) -> list[list[float]]:
    """[x, y, radius] [m] of a pole in every filled cell, clear of other poles and the walls."""
    rows, columns = np.nonzero(filled)
    across = (rows + 0.5) * CELL + rng.uniform(-0.02, 0.02, rows.size)
    along = (columns + 0.5) * CELL + rng.uniform(-0.02, 0.02, rows.size)
    centres = np.stack([_RUN_UP + along, WALL + across], axis=1)
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    room = np.minimum(0.5 * apart.min(axis=1, initial=np.inf), across)
    room = np.minimum(room, _ROWS * CELL - across) - 0.002
    radius = np.minimum(rng.uniform(0.06, 0.08) * rng.uniform(0.85, 1.25, rows.size), room)
    poles: list[list[float]] = np.column_stack([centres, np.clip(radius, 0.05, 0.1)]).tolist()
    return poles


def _set_poles_ends(draft: WorldDraft) -> None:
    """Start and goal at opposite ends of the field, in either direction."""
    rng = draft.rng
    y_start, y_goal = rng.uniform(0.3, 0.7, 2) * draft.y[1]
    near, far = 0.8, draft.x[1] - 0.8
    if rng.random() < 0.5:
        near, far = far, near
    draft.set_start_and_goal((near, y_start), (far, y_goal), towards=(far, y_start))


_RADIUS, _HEIGHT = 0.25, 1.7
"""Radius and height of a person's cylinder [m]."""

_PEDESTRIANS_ROBOT = ROBOT.model_copy(update={"side_views": SideViews(), "max_v": 0.8})
"""The robot, with side views and 0.8 m/s, as people approach from the side and from behind."""

_PEDESTRIANS_STACK = "pedestrians"
"""The stack for worlds with moving obstacles."""


class Moving(WorldFamily):
    """A hall with walking people, some of whom yield to the robot."""

    name: ClassVar[str] = "moving"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw two to seven people; more, and a larger share that does not yield, when hard."""
        draft = WorldDraft.empty(rng, rng.uniform(8.0, 12.0), rng.uniform(6.5, 9.5))
        draft.enclose(draft.palette.draw("wall"))
        count = int(np.clip(round(blend(2, 6, difficulty) + rng.uniform(-1, 1)), 2, 7))
        _set_moving_ends(draft)
        _add_static(draft, round(blend(1, 5, difficulty)))
        clothes = draft.palette.draw_many("person", 4)
        plan = draft.geometry()
        hall = (0.6, draft.x[1] - 0.6), (0.6, draft.y[1] - 0.6)
        for number in range(1, count + 1):
            yields = bool(rng.random() >= blend(0.3, 0.6, difficulty))
            texture = draft.palette.pick(clothes)
            add_person(draft, plan, f"person-{number}", yields, texture, hall)
        unyielding = sum(not walker.yields for walker in draft.movers)
        draft.description = (
            f"A hall with {count} walking people, {unyielding} of whom do not yield."
        )
        draft.time_allowance = 45.0
        draft.robot, draft.stack = _PEDESTRIANS_ROBOT, _PEDESTRIANS_STACK
        return draft


def _set_moving_ends(draft: WorldDraft) -> None:
    """Start and goal at opposite ends of the hall."""
    rng = draft.rng
    width, depth = draft.x[1], draft.y[1]
    start = (0.9, float(rng.uniform(0.2, 0.8) * depth))
    goal = (width - 0.9, float(rng.uniform(0.2, 0.8) * depth))
    if rng.random() < 0.5:
        start, goal = goal, start
    draft.keep_free(*start, 0.9)
    draft.keep_free(*goal, 0.9)
    draft.set_start_and_goal(start, goal)


def _add_static(draft: WorldDraft, count: int) -> None:
    rng = draft.rng
    textures = draft.palette.draw_many("thing", 3)
    for _ in range(20 * count):
        if len(draft.shapes) >= count:
            return
        at = rng.uniform(1.5, draft.x[1] - 1.5), rng.uniform(1.5, draft.y[1] - 1.5)
        number, texture = len(draft.shapes) + 1, draft.palette.pick(textures)
        shape: Shape
        if rng.random() < 0.5:
            kind, heights = "column", (0.7, 2.2)
            shape = Circle(*at, rng.uniform(0.15, 0.4))
        else:
            kind, heights = "box", (0.5, 1.4)
            half_x, half_y = rng.uniform(0.2, 0.5, 2)
            shape = Rectangle(*at, half_x, half_y, rng.uniform(0.0, math.pi))
        if draft.fits(shape, 1.4):
            draft.add(f"{kind}-{number}", shape, rng.uniform(*heights), texture)


def add_person(
    draft: WorldDraft,
    plan: SceneGeometry,
    name: str,
    yields: bool,
    texture: str,
    area: tuple[Interval, Interval],
) -> None:
    """Add a person with a free path of two to four points in ``area`` (x and y [m]).

    The path keeps away from start and goal, where the robot may stand.

    Raises:
        Unsuitable: no such path was drawn.

    """
    rng = draft.rng
    (x0, x1), (y0, y1) = area
    for _ in range(60):
        path = [
            (round(float(x), 3), round(float(y), 3))
            for x, y in rng.uniform((x0, y0), (x1, y1), (int(rng.integers(2, 5)), 2))
        ]
        loop = len(path) > 2 and bool(rng.random() < 0.5)
        legs = list(pairwise([*path, path[0]] if loop else path))
        if min(math.dist(*leg) for leg in legs) < 1.5 or not _is_free(draft, plan, legs):
            continue
        draft.movers.append(
            WalkerSpec(
                name=name,
                path=tuple(path),
                speed=round(float(rng.uniform(0.2, 0.6)), 2),
                walk="loop" if loop else "back-and-forth",
                yields=yields,
                phase=round(float(rng.uniform(0.0, 0.99)), 3),
                radius=_RADIUS,
                height=_HEIGHT,
                texture=texture,
            )
        )
        return
    raise Unsuitable("no free path for a person")


def _is_free(draft: WorldDraft, plan: SceneGeometry, legs: list[tuple[Point, Point]]) -> bool:
    """Whether the legs are clear of solids, start and goal."""
    ends = np.array([draft.start[:2], draft.goal])
    for a, b in legs:
        line = np.linspace(a, b, max(int(math.dist(a, b) / 0.05), 2))
        if plan.clearances(line).min() < _RADIUS + 0.1:
            return False
        away = np.linalg.norm(line[:, None] - ends, axis=2).min(axis=0) - _RADIUS
        if away[0] < 1.0 or away[1] < 0.6:
            return False
    return True
