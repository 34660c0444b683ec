"""The family ``moving``: a hall with person-sized moving obstacles and a few static ones."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from navfw.robot import SideViews
from navfw.sim.floorplan import FloorPlan
from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.worldspec import MoverSpec
from navfw.worldgen.world_draft import ROBOT, Point, Unsuitable, WorldDraft, blend

_RADIUS, _HEIGHT = 0.25, 1.7
"""Size of a person's cylinder [m]."""

_PEDESTRIANS_ROBOT = ROBOT.model_copy(update={"side_views": SideViews(), "max_v": 0.8})
"""The robot: side views and 0.8 m/s, since people approach from the side and from behind."""

_PEDESTRIANS_STACK = "pedestrians"
"""The stack for worlds with moving obstacles."""


def build(rng: np.random.Generator, difficulty: float) -> WorldDraft:
    """Two to seven people; more, and a larger share that does not yield, when difficult."""
    draft = WorldDraft.empty(rng, rng.uniform(8.0, 12.0), rng.uniform(6.5, 9.5))
    draft.enclose(draft.palette.draw("wall"))
    count = int(np.clip(round(blend(2, 6, difficulty) + rng.uniform(-1, 1)), 2, 7))
    _set_start_and_goal(draft)
    _add_static(draft, round(blend(1, 5, difficulty)))
    clothes = draft.palette.draw_many("person", 4)
    plan = draft.floor_plan()
    for number in range(1, count + 1):
        yields = bool(rng.random() >= blend(0.3, 0.6, difficulty))
        _add_person(draft, plan, f"person-{number}", yields, draft.palette.pick(clothes))
    unyielding = sum(not mover.yields for mover in draft.movers)
    draft.description = f"A hall with {count} walking people, {unyielding} of whom do not yield."
    draft.time_allowance = 45.0
    draft.robot, draft.stack = _PEDESTRIANS_ROBOT, _PEDESTRIANS_STACK
    return draft


def _set_start_and_goal(draft: WorldDraft) -> None:
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
        if rng.random() < 0.5:
            circle = Circle(*at, rng.uniform(0.15, 0.4))
            if draft.fits(circle, 1.4):
                draft.add_cylinder(f"column-{number}", circle, rng.uniform(0.7, 2.2), texture)
            continue
        half_x, half_y = rng.uniform(0.2, 0.5, 2)
        box = Rectangle(*at, half_x, half_y, rng.uniform(0.0, math.pi))
        if draft.fits(box, 1.4):
            draft.add_box(f"box-{number}", box, rng.uniform(0.5, 1.4), texture)


def _add_person(draft: WorldDraft, plan: FloorPlan, name: str, yields: bool, texture: str) -> None:
    """Add a person with a free path of two to four points.

    The path keeps away from start and goal, where the robot may stand.
    """
    rng = draft.rng
    for _ in range(60):
        path = [
            (round(float(x), 3), round(float(y), 3))
            for x, y in rng.uniform(
                (0.6, 0.6), (draft.x[1] - 0.6, draft.y[1] - 0.6), (int(rng.integers(2, 5)), 2)
            )
        ]
        loop = len(path) > 2 and bool(rng.random() < 0.5)
        legs = list(pairwise([*path, path[0]] if loop else path))
        if min(math.dist(*leg) for leg in legs) < 1.5 or not _is_free(draft, plan, legs):
            continue
        draft.movers.append(
            MoverSpec(
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


def _is_free(draft: WorldDraft, plan: FloorPlan, legs: list[tuple[Point, Point]]) -> bool:
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
