"""The layer of low things in the occupancy grid: log-odds that rays to the floor do not clear."""

from __future__ import annotations

import cv2
import numpy as np

from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices

_BOUNDS, _OCCUPIED = (-0.5, 4.0), 1.5  # chosen
"""Bounds of the log-odds, and those from which on a cell is occupied: two images must show it."""
_BESIDE = np.ones((3, 3), np.uint8)  # chosen
"""Cells beside what is occupied anyway show its foot, blurred: they would narrow gaps."""
_AROUND = np.ones((5, 5), np.uint8)  # chosen
"""Cells around a low thing that are occupied unless floor was seen there: not all of it shows."""


def add_low_things(layer: Array, cells: tuple[Indices, Indices], evidence: Array) -> None:
    """Add ``evidence`` (n,) [log-odds] at ``cells`` to ``layer``: of a cell's the largest."""
    order = np.argsort(evidence, kind="stable")
    at = cells[0][order], cells[1][order]
    layer[at] = np.clip(layer[at] + evidence[order], *_BOUNDS)


def with_low_things(occupied: Mask, layer: Array) -> Mask:
    """Return ``occupied`` with the cells of low things, and with what is around them.

    That is free once floor was seen there. The foot of what is occupied anyway is left out.
    """
    cells = occupied.view(np.uint8)
    low = (layer >= _OCCUPIED).view(np.uint8)
    if low.any():
        low &= cv2.dilate(cells, _BESIDE) == 0
    if not low.any():
        return occupied
    grown = low & (cv2.dilate(cells, _AROUND) == 0)
    grown = np.asarray(cv2.dilate(grown, _AROUND) > 0) & (layer > 0.5 * _BOUNDS[0])
    return np.asarray(occupied | grown | (low > 0))
