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

SURFACE, RIDGE = 0.8, 0.9  # measured
"""Share of the strongest evidence nearby from which a cell is of the surface. In a tour of the
office 95 % of these cells lie within 0.08 m of a true surface, 95 % of all occupied ones within
0.14 m. With the second share they are 0.06 m, and there are gaps."""

_NEARBY = np.ones((7, 7), np.uint8)  # chosen
"""Cells around a cell in which the strongest evidence is searched: the width of a band."""

_BEFORE = 4  # chosen
"""Largest number of cells between the free ground and the surface."""

_STEP = np.ones((3, 3), np.uint8)  # defined


def sharpened(evidence: Evidence, share: float = SURFACE, *, continuous: bool = False) -> Evidence:
    """Return ``evidence`` (rows, columns) with bands of occupied cells reduced to surfaces.

    A cell is of a surface with ``share`` of the strongest evidence nearby. Where a wall was seen
    well in one part and hardly in the next, that leaves gaps; if ``continuous``, the middle lines
    of the bands are of surfaces, too.
    """
    occupied = evidence >= OCCUPIED_FROM
    strength = cv2.GaussianBlur(np.maximum(evidence, 0).astype(np.uint8), (0, 0), _BLUR)
    strongest = cv2.dilate(strength, _NEARBY)
    surface = occupied & (strength >= share * strongest)
    if continuous:
        surface |= thinned(occupied)
    before = _reached(evidence <= FREE_BELOW, occupied & ~surface)
    result = evidence.copy()
    result[occupied & ~surface] = 0
    result[before] = FREE_BELOW
    return result


def _reached(free: Mask, through: Mask) -> Mask:
    """Return which cells of ``through`` are connected with ``free`` ones, a few cells away."""
    reached = free.view(np.uint8)
    for _ in range(_BEFORE):
        reached = reached | (cv2.dilate(reached, _STEP) & through.view(np.uint8))
    return np.asarray((reached > 0) & through)
