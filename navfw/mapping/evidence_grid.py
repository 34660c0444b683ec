"""The global grid of evidence, which grows where submaps are merged into it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navfw.mapping.evidence_kernels import merge_submap
from navfw.mapping.submaps import Submap
from navfw.numerics import Array
from navfw.signals import Pose
from navfw.signals.grown_grid import Evidence

_BLOCK = 128  # chosen
"""Number of cells by which the grid grows at a time."""


@dataclass(frozen=True, slots=True)
class KeyPose:
    """A submap, and the robot's ``pose`` in ``map`` when it was taken (at the key pose).

    ``path`` [m] is the distance driven by then.
    """

    submap: Submap
    pose: Pose
    path: float = 0.0

    @property
    def correction(self) -> Pose:
        """The pose of the frame ``odom`` in ``map`` at which the submap is placed."""
        return self.pose.frame_of(self.submap.key)


class EvidenceGrid:
    """A grid of evidence that grows by blocks where submaps are merged into it."""

    def __init__(self, cell: float) -> None:
        self.cell = cell
        self.cells: Evidence = np.zeros((0, 0), np.int8)
        self._first = 0, 0  # row and column, counted from the frame's origin, of cell [0, 0]

    @property
    def origin(self) -> tuple[float, float]:
        """Position (x, y) [m] of the centre of cell [0, 0]."""
        row, column = self._first
        return column * self.cell, row * self.cell

    def copy(self) -> EvidenceGrid:
        """Return an independent copy."""
        copy = EvidenceGrid(self.cell)
        copy.cells, copy._first = self.cells.copy(), self._first
        return copy

    def merge(self, key: KeyPose) -> None:
        """Merge the submap of ``key`` at its pose."""
        corners = self._corners(key)
        self._cover(corners)
        row, column = self._first
        merge_submap(self.cells, key.submap.evidence, *_placed(key, corners[0], column, row))

    def renew(self, keys: Sequence[KeyPose], moved: Sequence[KeyPose]) -> None:
        """Recompute the cells that ``moved`` key poses, old and new, cover, from all ``keys``."""
        if not moved:
            return
        corners = np.concatenate([self._corners(key) for key in moved])
        self._cover(corners)
        low, high = np.floor(corners.min(axis=0)) - 1, np.ceil(corners.max(axis=0)) + 2
        window: Evidence = np.zeros((int(high[1] - low[1]), int(high[0] - low[0])), np.int8)
        for key in keys:
            at = self._corners(key)
            if (at.max(axis=0) >= low).all() and (at.min(axis=0) <= high).all():
                merge_submap(window, key.submap.evidence, *_placed(key, at[0], low[0], low[1]))
        row, column = int(low[1]) - self._first[0], int(low[0]) - self._first[1]
        rows, columns = window.shape
        top, left = max(row, 0), max(column, 0)
        inside = self.cells[top : row + rows, left : column + columns]
        inside[:] = window[top - row :, left - column :][: inside.shape[0], : inside.shape[1]]

    def _corners(self, key: KeyPose) -> Array:
        """Return the centres (4, 2: x, y) [cells, map] of the corner cells of a key's submap."""
        rows, columns = key.submap.evidence.shape
        x, y = key.submap.corner
        far_x, far_y = x + (columns - 1) * self.cell, y + (rows - 1) * self.cell
        corners = np.array([(x, y), (far_x, y), (x, far_y), (far_x, far_y)])
        return np.asarray(key.correction.points_to_parent(corners) / self.cell)

    def _cover(self, points: Array) -> None:
        """Grow so that ``points`` (n, 2: x, y) [cells] lie inside."""
        low, high = np.floor(points.min(axis=0)) - 1, np.ceil(points.max(axis=0)) + 1
        first = [int(v) // _BLOCK * _BLOCK for v in low[::-1]]
        end = [-(-int(v) // _BLOCK) * _BLOCK for v in high[::-1]]
        if self.cells.size:
            first = [min(a, b) for a, b in zip(first, self._first, strict=True)]
            old_end = [a + n for a, n in zip(self._first, self.cells.shape, strict=True)]
            end = [max(a, b) for a, b in zip(end, old_end, strict=True)]
        shape = end[0] - first[0], end[1] - first[1]
        if shape == self.cells.shape:
            return
        grown: Evidence = np.zeros(shape, np.int8)
        row, column = self._first[0] - first[0], self._first[1] - first[1]
        rows, columns = self.cells.shape
        if self.cells.size:
            grown[row : row + rows, column : column + columns] = self.cells
        self.cells, self._first = grown, (first[0], first[1])


def _placed(key: KeyPose, at: Array, column: float, row: float) -> tuple[float, float, float]:
    """Return where ``merge_submap`` puts a submap: its cell [0, 0] is ``at`` (x, y) [cells]."""
    return float(at[0] - column), float(at[1] - row), key.correction.yaw
