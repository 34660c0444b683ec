"""The family ``clutter``: a walled area with boxes and cylinders, without a map."""

from __future__ import annotations

import math

import numpy as np

from navfw.sim.shapes import Circle, Rectangle
from navfw.worldgen.world_draft import WALL, WorldDraft, blend


def build(rng: np.random.Generator, difficulty: float) -> WorldDraft:
    """An area of 8 to 12 m by 8 to 12 m, crossed from one side to the opposite one."""
    draft = WorldDraft.empty(rng, rng.uniform(8.0, 12.0), rng.uniform(8.0, 12.0))
    draft.enclose(draft.palette.draw("wall"))
    gap = blend(1.2, 0.75, difficulty)
    draft.description = f"A walled area with boxes and cylinders at least {gap:.2f} m apart."
    _set_start_and_goal(draft)
    textures = draft.palette.draw_many("thing", 5)
    area = draft.x[1] * draft.y[1]
    wanted = round(area * blend(0.12, 0.34, difficulty))
    for _ in range(40 * wanted):
        if len(draft.shapes) >= wanted:
            break
        _try_solid(draft, gap, draft.palette.pick(textures))
    return draft


def _set_start_and_goal(draft: WorldDraft) -> None:
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
    if rng.random() < 0.5:
        circle = Circle(x, y, rng.uniform(0.1, 0.45))
        if _off_walls(draft, circle.bounds, gap) and draft.fits(circle, gap):
            draft.add_cylinder(f"cylinder-{number}", circle, height, texture)
        return
    half_x, half_y = rng.uniform(0.12, 0.5, 2)
    box = Rectangle(x, y, half_x, half_y, rng.uniform(0.0, math.pi))
    if _off_walls(draft, box.bounds, gap) and draft.fits(box, gap):
        draft.add_box(f"box-{number}", box, height, texture)


def _off_walls(draft: WorldDraft, bounds: tuple[float, float, float, float], gap: float) -> bool:
    """Whether each distance to a wall is passable, or clearly impassable (below 0.2 m)."""
    x0, y0, x1, y1 = bounds
    distances = (x0, y0, draft.x[1] - x1, draft.y[1] - y1)
    return all(0.01 < d - WALL < 0.2 or d - WALL >= gap for d in distances)
