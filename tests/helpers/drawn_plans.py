"""Floor plans of several kinds, drawn cell by cell: what imports of floor plans are tried on.

Each is drawn in metres with cells of 5 cm, occupied walls and furniture on free ground.
"""

import math

import cv2
import numpy as np

from navfw.numerics import Array
from navfw.signals import Pose
from navfw.topomap.occupancy_map import FREE, OCCUPIED, UNKNOWN, OccupancyMap

CELL = 0.05
Point = tuple[float, float]


class _Drawing:
    """Cells that are drawn on, in metres from the lower left corner."""

    def __init__(self, width: float, depth: float, state: int = FREE) -> None:
        self.cells = np.full((round(depth / CELL), round(width / CELL)), state, np.int8)

    def box(self, x0: float, y0: float, x1: float, y1: float, state: int = OCCUPIED) -> None:
        i0, i1, j0, j1 = (round(v / CELL) for v in (y0, y1, x0, x1))
        self.cells[i0:i1, j0:j1] = state

    def polygon(self, points: list[Point], state: int = OCCUPIED) -> None:
        corners = np.round(np.array(points) / CELL).astype(np.int32)
        image = self.cells.astype(np.int16)
        cv2.fillPoly(image, [corners], state)
        self.cells[:] = image

    def away(self, x: float, y: float) -> Array:
        """The distance [m] of each cell from a point."""
        rows, columns = np.indices(self.cells.shape)
        return np.asarray(np.hypot((columns + 0.5) * CELL - x, (rows + 0.5) * CELL - y))

    def border(self, thickness: float) -> None:
        edge = round(thickness / CELL)
        for side in (np.s_[:edge], np.s_[-edge:], np.s_[:, :edge], np.s_[:, -edge:]):
            self.cells[side] = OCCUPIED

    def plan(self) -> OccupancyMap:
        return OccupancyMap(self.cells, CELL, Pose(0.0, 0.0, 0.0))


def _thick_walls() -> OccupancyMap:
    """Six rooms around a hall, walls of 0.6 m, openings of 1.2 m."""
    drawn = _Drawing(18.0, 12.0)
    drawn.border(0.6)
    for y in (4.0, 7.4):
        drawn.box(0, y, 18, y + 0.6)
    for x in (6.0, 11.4):
        drawn.box(x, 0, x + 0.6, 4.6)
        drawn.box(x, 7.4, x + 0.6, 12)
    for x in (2.6, 8.4, 14.2):
        drawn.box(x, 4.0, x + 1.2, 4.6, FREE)
        drawn.box(x + 0.8, 7.4, x + 2.0, 8.0, FREE)
    return drawn.plan()


def _long_corridors() -> OccupancyMap:
    """Two corridors of 24 m joined at their ends, with rooms between them."""
    drawn = _Drawing(26.0, 12.0)
    drawn.border(0.2)
    drawn.box(2.2, 1.8, 23.8, 10.2)
    for k in range(5):
        x = 2.4 + 4.25 * k
        drawn.box(x, 2.0, x + 4.1, 10.0, FREE)
        drawn.box(x, 5.9, x + 4.1, 6.1)
        drawn.box(x + 1.5, 1.8, x + 2.5, 2.0, FREE)
        drawn.box(x + 1.5, 10.0, x + 2.5, 10.2, FREE)
    return drawn.plan()


def _open_hall() -> OccupancyMap:
    """A hall of 20 x 14 m with rows of columns and a kiosk."""
    drawn = _Drawing(20.0, 14.0)
    drawn.border(0.2)
    for x in (4.0, 8.0, 12.0, 16.0):
        for y in (4.0, 10.0):
            drawn.box(x - 0.25, y - 0.25, x + 0.25, y + 0.25)
    drawn.polygon([(8.0, 6.0), (11.5, 6.6), (11.2, 8.4), (7.7, 7.8)])
    return drawn.plan()


def _curved_walls() -> OccupancyMap:
    """A round gallery around a round room, unknown ground outside."""
    drawn = _Drawing(16.0, 16.0, UNKNOWN)
    away = drawn.away(8.0, 8.0)
    drawn.cells[away < 7.4] = FREE
    for radius in (7.5, 4.2):
        drawn.cells[np.abs(away - radius) < 0.1] = OCCUPIED
    for angle in (0.3, 2.4, 4.5):
        x, y = 8.0 + 4.2 * math.cos(angle), 8.0 + 4.2 * math.sin(angle)
        drawn.cells[drawn.away(x, y) < 0.55] = FREE
    return drawn.plan()


def _clutter() -> OccupancyMap:
    """Four slanted rooms; tests add furniture to the world that the plan does not show."""
    drawn = _Drawing(17.0, 15.0, UNKNOWN)
    turn, at = 0.3, (4.2, 0.6)

    def turned(x0: float, y0: float, x1: float, y1: float) -> list[Point]:
        c, s = math.cos(turn), math.sin(turn)
        ends = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        return [(at[0] + c * x - s * y, at[1] + s * x + c * y) for x, y in ends]

    drawn.polygon(turned(0, 0, 12, 10), OCCUPIED)
    for x, y in ((0.2, 0.2), (6.1, 0.2), (0.2, 5.1), (6.1, 5.1)):
        drawn.polygon(turned(x, y, x + 5.7, y + 4.7), FREE)
    for opening in ((5.7, 2.0, 6.3, 3.0), (5.7, 7.0, 6.3, 8.0), (2.5, 4.7, 3.5, 5.3)):
        drawn.polygon(turned(*opening), FREE)
    return drawn.plan()


def hall_of_columns(apart: float) -> OccupancyMap:
    """A hall of 24 x 16 m with columns ``apart`` [m], and three doors to a corridor below."""
    drawn = _Drawing(24.0, 19.0)
    drawn.border(0.2)
    drawn.box(0, 2.5, 24, 2.7)
    for x in (3.0, 12.0, 20.0):
        drawn.box(x, 2.5, x + 1.0, 2.7, FREE)
    for x in np.arange(apart, 23.0, apart):
        for y in np.arange(3.0 + apart, 18.0, max(apart, 3.0)):
            drawn.box(x - 0.2, y - 0.2, x + 0.2, y + 0.2)
    return drawn.plan()


PLANS = {
    "thick-walls": _thick_walls,
    "long-corridors": _long_corridors,
    "open-hall": _open_hall,
    "curved-walls": _curved_walls,
    "clutter": _clutter,
}


def with_noise(plan: OccupancyMap, rng: np.random.Generator) -> OccupancyMap:
    """The plan as by SLAM: jagged walls, single wrong cells, gaps of a cell in walls."""
    cells = plan.cells.copy()
    walls = plan.occupied.astype(np.uint8)
    beside = (cv2.dilate(walls, np.ones((3, 3), np.uint8)) > 0) & plan.free
    cells[beside & (rng.random(cells.shape) < 0.3)] = OCCUPIED
    cells[plan.free & (rng.random(cells.shape) < 0.001)] = OCCUPIED
    cells[plan.free & (rng.random(cells.shape) < 0.001)] = UNKNOWN
    return OccupancyMap(cells, plan.resolution, plan.origin)
