"""The grid of all that has been observed so far: what the growing map hands to the planner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.numerics.arrays import Array, Indices, Mask
from navfw.signals.immutability import Frozen

Evidence = npt.NDArray[np.int8]
"""Log-odds of occupancy in steps of 1 / ``SCALE``; 0 where nothing was observed."""

SCALE = 32.0  # chosen
"""Steps per unit of log-odds: int8 holds log-odds from -4 to 4."""

FREE_BELOW, OCCUPIED_FROM = -8, 22  # derived
"""Evidence up to which a cell is free, and from which it is occupied: the local map's log-odds
-0.25 and 0.7, times ``SCALE``."""


@dataclass(frozen=True, slots=True)
class GrownGrid(Frozen):
    """What was observed of the floor, cell by cell, in the frame ``map``.

    ``log_odds`` (rows, columns) is the evidence; the centre of cell (i, j) is at ``origin`` +
    (j, i) * ``cell`` [m]. A cell is free, occupied, or unseen.
    """

    log_odds: Evidence
    origin: tuple[float, float]
    cell: float

    @property
    def free(self) -> Mask:
        """Which cells (rows, columns) were observed free."""
        free: Mask = self.log_odds <= FREE_BELOW
        return free

    @property
    def occupied(self) -> Mask:
        """Which cells (rows, columns) were observed occupied."""
        occupied: Mask = self.log_odds >= OCCUPIED_FROM
        return occupied

    @property
    def unseen(self) -> Mask:
        """Which cells (rows, columns) are neither free nor occupied."""
        unseen: Mask = ~(self.free | self.occupied)
        return unseen

    def cells_at(self, points: Array) -> Indices:
        """Return the cells (n, 2: row, column) at ``points`` (n, 2) [m, map], outside it too."""
        return np.rint((points[:, ::-1] - self.origin[::-1]) / self.cell).astype(np.int64)

    def evidence_at(self, points: Array) -> Evidence:
        """Return the evidence (n,) at ``points`` (n, 2) [m, map]; 0 outside the grid."""
        cells = self.cells_at(points)
        inside = ((cells >= 0) & (cells < self.log_odds.shape)).all(axis=1)
        evidence = np.zeros(len(points), np.int8)
        evidence[inside] = self.log_odds[cells[inside, 0], cells[inside, 1]]
        return evidence

    def centres(self, cells: Indices) -> Array:
        """Return the centres (n, 2) [m, map] of ``cells`` (n, 2: row, column)."""
        return np.asarray(cells[:, ::-1] * self.cell + self.origin, dtype=np.float64)
