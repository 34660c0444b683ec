"""The lattice of the discrete Bayes filter: cells over places and passages, times headings.

Cells cover the passages in their width, the surroundings of the places, and a fringe beside them,
for robots that pass an obstacle. The third axis is the yaw of the frame ``odom`` in ``map``. Unlike
the robot's heading it stays constant while the robot turns, so turning does not blur the belief.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.numerics.arrays import Floats
from navfw.topomap import TopoMap

_MAX_HALF_WIDTH = 1.5  # chosen
"""Upper bound on a passage's half width [m]; also used where the width is unknown."""

PLACE_RADIUS = 1.0  # chosen
"""Radius of the domain around a place [m]."""

_FRINGE = 0.75  # chosen
"""Width of the fringe beside passages and places [m], where the robot is less likely."""

_FRINGE_LOSS = 0.9  # chosen
"""Factor on the probability for each cell's length driven in the fringe."""

MAX_STATES = 3_000_000  # chosen
"""Bound on the number of states: larger maps get larger cells."""


class Lattice:
    """Cells of ``cell`` [m] over a map (larger on a large map), times ``headings`` directions.

    ``domain`` (rows, columns) is True where the robot can be; ``keep`` (rows, columns) is the
    factor on the probability for each cell's length driven: 1, 0.9 in the fringe, or 0 outside.
    ``place`` (rows, columns) is the index of the nearest place. ``x`` (columns,) and ``y`` (rows,)
    are the cells' centres [m, map].
    """

    def __init__(self, topo_map: TopoMap, cell: float, headings: int) -> None:
        points = np.array([(p.x, p.y) for p in topo_map.places.values()])
        margin = _MAX_HALF_WIDTH + _FRINGE + cell
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        area = float(np.prod(high - low))
        self.cell = max(cell, math.sqrt(area * headings / MAX_STATES))
        self.headings = headings
        columns, rows = (math.ceil(extent / self.cell) + 1 for extent in (high - low).tolist())
        self.shape = (rows, columns)
        self.x = low[0] + self.cell * np.arange(columns)
        self.y = low[1] + self.cell * np.arange(rows)
        #: (headings,) yaw of odom in map [rad]
        self.yaw = 2.0 * math.pi * np.arange(headings) / headings
        excess = self._excess(topo_map)
        self.place = self._nearest(points)
        self.domain = excess <= _FRINGE
        inside = np.where(excess <= 0.0, 1.0, _FRINGE_LOSS)
        self.keep: Floats = np.where(self.domain, inside, 0.0).astype(np.float32)

    @property
    def states(self) -> int:
        """Number of states in the domain."""
        return int(self.domain.sum()) * self.headings

    def uniform(self) -> Floats:
        """Return the uniform distribution (headings, rows, columns) over the domain."""
        layer = self.domain.astype(np.float32) / np.float32(self.states)
        return np.repeat(layer[None], self.headings, axis=0)

    def column(self, x: float) -> float:
        """Return the fractional column index of ``x`` [m, map]."""
        return float((x - self.x[0]) / self.cell)

    def row(self, y: float) -> float:
        """Return the fractional row index of ``y`` [m, map]."""
        return float((y - self.y[0]) / self.cell)

    def _excess(self, topo_map: TopoMap) -> Array:
        """Compute the distance (rows, columns) [m] to the nearest passage or place; inside < 0."""
        excess = np.full(self.shape, np.inf)
        for place in topo_map.places.values():
            self._lower(excess, (place.x, place.y), (place.x, place.y), PLACE_RADIUS)
        for passage in topo_map.passages:
            a, b = topo_map.places[passage.a], topo_map.places[passage.b]
            self._lower(excess, (a.x, a.y), (b.x, b.y), min(0.5 * passage.width, _MAX_HALF_WIDTH))
        return excess

    def _lower(
        self, excess: Array, a: tuple[float, float], b: tuple[float, float], half: float
    ) -> None:
        """Lower ``excess`` to the distance to the segment ``a`` to ``b``, minus ``half``."""
        reach = half + _FRINGE
        rows, columns = (
            slice(
                max(0, math.floor((min(ends) - reach - axis[0]) / self.cell)),
                math.ceil((max(ends) + reach - axis[0]) / self.cell) + 1,
            )
            for ends, axis in (((a[1], b[1]), self.y), ((a[0], b[0]), self.x))
        )
        px, py = self.x[columns][None, :] - a[0], self.y[rows][:, None] - a[1]
        dx, dy = b[0] - a[0], b[1] - a[1]
        squared = dx * dx + dy * dy
        share = np.clip((px * dx + py * dy) / squared, 0.0, 1.0) if squared > 0.0 else 0.0
        distance = np.hypot(px - share * dx, py - share * dy) - half
        np.minimum(excess[rows, columns], distance, out=excess[rows, columns])

    def _nearest(self, points: Array) -> npt.NDArray[np.intp]:
        """Find the index (rows, columns) of the nearest of ``points`` (n, 2)."""
        from scipy.spatial import cKDTree

        xx, yy = np.meshgrid(self.x, self.y)
        _, index = cKDTree(points).query(np.column_stack([xx.ravel(), yy.ravel()]))
        return np.asarray(index, dtype=np.intp).reshape(self.shape)
