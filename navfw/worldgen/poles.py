"""The family ``poles``: thin poles, clustered by a cellular automaton as in BARN.

BARN (Perille et al. 2020) fills 30 x 30 cells of 0.15 m at random, smooths them, and puts a pole
in every filled cell, between two rows of poles. Here walls replace the rows, and radii vary.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navfw.sim.shapes import Circle
from navfw.worldgen.world_draft import FAST_ROBOT, POLES_STACK, ROBOT, WALL, WorldDraft, blend

CELL = 0.15
"""Edge of the automaton's cells [m], as in BARN."""
_ROWS, _LENGTH = 30, 36
"""Cells across and along the field."""
_RUN_UP = 1.6
"""Length of the free floor at both ends of the field [m]."""


def build(rng: np.random.Generator, difficulty: float) -> WorldDraft:
    """A field 4.5 m wide and 5.4 m long, crossed lengthwise."""
    width, length = _ROWS * CELL + 2 * WALL, _LENGTH * CELL + 2 * _RUN_UP
    draft = WorldDraft.empty(rng, length, width)
    draft.enclose(draft.palette.draw("wall"), height=1.6)
    filled = _automaton(rng, blend(0.17, 0.235, difficulty))
    draft.description = "A field of thin poles between walls, clustered as in BARN worlds."
    draft.robot, draft.stack = FAST_ROBOT, POLES_STACK
    draft.clearance = ROBOT.radius + blend(0.17, 0.09, difficulty)
    _set_start_and_goal(draft)
    textures = draft.palette.draw_many("thing", 4)
    for number, (x, y, radius) in enumerate(_poles(rng, filled), start=1):
        texture = draft.palette.pick(textures)
        draft.add_cylinder(f"pole-{number}", Circle(x, y, radius), rng.uniform(0.8, 1.5), texture)
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


def _set_start_and_goal(draft: WorldDraft) -> None:
    """Start and goal at opposite ends of the field, in either direction."""
    rng = draft.rng
    y_start, y_goal = rng.uniform(0.3, 0.7, 2) * draft.y[1]
    near, far = 0.8, draft.x[1] - 0.8
    if rng.random() < 0.5:
        near, far = far, near
    draft.set_start_and_goal((near, y_start), (far, y_goal), towards=(far, y_start))
