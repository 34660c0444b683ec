"""Surfaces out of evidence: the bands that walls leave in a grid become as thin as walls.

A hit counts within its uncertainty, so the evidence of a wall is a band of 0.15 to 0.3 m around its
surface, and strongest at it. What lies before the strongest evidence is free, what lies behind it
unseen.
"""

from __future__ import annotations

import cv2
import numpy as np

from navfw.numerics import Mask
from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, Evidence
from navfw.topomap.clearance_grid import thinned

_BLUR = 1.5  # measured
"""Standard deviation [cells] of the smoothing: 1 and 2 give surfaces that are as exact."""

_SURFACE = 0.9  # measured
"""Share of the strongest evidence nearby from which a cell is of the surface. With 0.8 there is a
cell more on each side of it, and 95 % of the cells of rooms with furniture lie within 0.12 m of a
true surface instead of 0.1 m; with 0.95 there are gaps."""

_NEARBY = np.ones((7, 7), np.uint8)  # chosen
"""Cells around a cell in which the strongest evidence is searched: the width of a band."""

_BEFORE = 4  # chosen
"""Largest number of cells between the free ground and the surface."""

_SPUR = 3  # chosen
"""Largest number of cells of a branch of a middle line that is none of a wall: bands are ragged."""

_STEP = np.ones((3, 3), np.uint8)  # defined


def sharpened(evidence: Evidence, *, continuous: bool = False) -> Evidence:
    """Return ``evidence`` (rows, columns) with bands of occupied cells reduced to surfaces.

    Where a wall was seen well in one part and hardly in the next, that leaves gaps; if
    ``continuous``, the middle lines of the bands are of surfaces, too.
    """
    occupied = evidence >= OCCUPIED_FROM
    strength = cv2.GaussianBlur(np.maximum(evidence, 0).astype(np.uint8), (0, 0), _BLUR)
    strongest = cv2.dilate(strength, _NEARBY)
    surface = occupied & (strength >= _SURFACE * strongest)
    if continuous:
        surface = _without_spurs(surface | thinned(occupied), surface)
    before = _reached(evidence <= FREE_BELOW, occupied & ~surface)
    result = evidence.copy()
    result[occupied & ~surface] = 0
    result[before] = FREE_BELOW
    return result


def _without_spurs(lines: Mask, kept: Mask) -> Mask:
    """Return ``lines`` without short branches that end in the open; all of ``kept`` stay."""
    left = lines
    for _ in range(_SPUR):
        left = left & (kept | ~_ends(left))
    ends = _ends(left)  # of long lines, to be as long again
    for _ in range(_SPUR):
        ends = (cv2.dilate(ends.view(np.uint8), _STEP) > 0) & lines & ~left
        left = left | ends
    return left


def _ends(lines: Mask) -> Mask:
    """Return the cells of ``lines`` with at most one other beside them."""
    cells = lines.view(np.uint8)
    around = cv2.boxFilter(cells, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(lines & (around <= 2))


def _reached(free: Mask, through: Mask) -> Mask:
    """Return which cells of ``through`` are connected with ``free`` ones, a few cells away."""
    reached = free.view(np.uint8)
    for _ in range(_BEFORE):
        reached = reached | (cv2.dilate(reached, _STEP) & through.view(np.uint8))
    return np.asarray((reached > 0) & through)
