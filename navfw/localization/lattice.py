"""The lattice of the discrete Bayes filter: where along places and passages, and which way round.

Cells cover the passages in their width and the places around their points, a little more than
that: a robot that goes round an obstacle leaves the line. The third axis is the yaw of the frame
``odom`` in ``map``. Unlike the robot's own heading it stays as it is while the robot turns, so
turning costs the filter no certainty.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navfw.signals import Array
from navfw.topomap import TopoMap

__all__ = ["Lattice"]

Floats = npt.NDArray[np.float32]

HALF = 1.5
"""Passages whose width is unknown, or larger, count as half so wide [m]."""

ROUND = 1.0
"""Around a place the robot may be so far off it [m]."""

FRINGE = 0.75
"""So far [m] beside all that, it may be too, though less likely."""

FRINGE_LOSS = 0.9
"""Factor of probability for each cell's length driven in the fringe."""

MOST_STATES = 3_000_000
"""Maps too large for it get larger cells."""


class Lattice:
    """Cells of ``cell`` [m] over a map, times ``headings`` directions.

    ``domain`` (rows, columns) is True where the robot may be at all; ``keep`` (rows, columns) is
    the factor for a cell's length driven there: 1, ``FRINGE_LOSS``, or 0 outside of the domain.
    ``place`` (rows, columns) is the index of the nearest place.
    """

    def __init__(self, topo_map: TopoMap, cell: float, headings: int) -> None:
        points = np.array([(p.x, p.y) for p in topo_map.places.values()])
        margin = HALF + FRINGE + cell
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        area = float(np.prod(high - low))
        self.cell = max(cell, math.sqrt(area * headings / MOST_STATES))
        self.headings = headings
        columns, rows = (math.ceil(extent / self.cell) + 1 for extent in (high - low).tolist())
        self.shape = (rows, columns)
        self.x = low[0] + self.cell * np.arange(columns)
        self.y = low[1] + self.cell * np.arange(rows)
        #: (headings,) yaw of odom in map [rad]
        self.yaw = 2.0 * math.pi * np.arange(headings) / headings
        excess = self._excess(topo_map)
        self.place = self._nearest(points)
        self.domain = excess <= FRINGE
        inside = np.where(excess <= 0.0, 1.0, FRINGE_LOSS)
        self.keep: Floats = np.where(self.domain, inside, 0.0).astype(np.float32)

    @property
    def states(self) -> int:
        """How many states there are in the domain."""
        return int(self.domain.sum()) * self.headings

    def uniform(self) -> Floats:
        """(headings, rows, columns) the same probability everywhere in the domain."""
        layer = self.domain.astype(np.float32) / np.float32(self.states)
        return np.repeat(layer[None], self.headings, axis=0)

    def column(self, x: float) -> float:
        """The column, as a number with a fraction, of x [m]."""
        return float((x - self.x[0]) / self.cell)

    def row(self, y: float) -> float:
        """The row, as a number with a fraction, of y [m]."""
        return float((y - self.y[0]) / self.cell)

    def _excess(self, topo_map: TopoMap) -> Array:
        """(rows, columns) how far [m] each cell is outside of all passages and places."""
        excess = np.full(self.shape, np.inf)
        for place in topo_map.places.values():
            self._lower(excess, (place.x, place.y), (place.x, place.y), ROUND)
        for passage in topo_map.passages:
            a, b = topo_map.places[passage.a], topo_map.places[passage.b]
            self._lower(excess, (a.x, a.y), (b.x, b.y), min(0.5 * passage.width, HALF))
        return excess

    def _lower(
        self, excess: Array, a: tuple[float, float], b: tuple[float, float], half: float
    ) -> None:
        """Take the distance to the segment ``a`` to ``b``, less ``half``, where that is less."""
        reach = half + FRINGE
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
        """(rows, columns) the index of the nearest of ``points`` (n, 2)."""
        from scipy.spatial import cKDTree

        xx, yy = np.meshgrid(self.x, self.y)
        _, index = cKDTree(points).query(np.column_stack([xx.ravel(), yy.ravel()]))
        return np.asarray(index, dtype=np.intp).reshape(self.shape)
