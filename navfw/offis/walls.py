"""The walls that make the left and the right plane: robust fits to all that is seen (TRAP 3).

A vertical plane shows ``q = slant * lateral + front * ahead`` along the rays (lateral, ahead) of
unit depth. The plane of each half image is the one that explains most of its cells, found by
reweighted least squares from three starts, each cell weighted by its confidence and sigma:
furniture in front of a wall, or a door in it, does not turn the plane. Where one plane explains
both halves nearly as well as two do, it is one wall, and the fit to the whole image is taken for
both. The planes also bridge the hole around the focus of expansion (METHOD 2.10).

What does not lie in the planes tells doors. ``opening`` says how much farther the middle of the
image is than the planes predict, at heights where a door is open; ``step`` how much nearer the
border of each half is, as the frame of a near door. Both are relative, and less one standard error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.offis.grid_geometry import GridGeometry
from navfw.offis.nearness import Nearness
from navfw.offis.wall_kernels import find_wall_planes
from navfw.signals import Array

__all__ = ["Walls", "find_walls"]

ENOUGH = 0.06
"""Share of a half's cells that must lie in a plane to trust it fully."""

FARTHEST_WALL, SURE_WALL = 0.05, 0.10
"""Nearness [1/m] of a plane below which it says nothing, and from which on it counts fully."""


@dataclass(frozen=True, slots=True)
class Walls:
    """The left and the right plane, arrays (2,).

    ``slant`` and ``front`` [1/m] are the planes' coefficients; ``incline`` [rad] is their angle to
    the image plane, positive where the outer side is nearer; ``explained`` is the share of the
    half's object cells that lie in the plane; ``support`` in [0, 1] says how many cells carry it.
    ``shared`` in [0, 1] is the degree to which both are one plane. ``opening`` and ``step`` (2,) in
    [-1, 1]: see the module. ``nearer`` (columns,) is the factor by which what each column shows is
    surely nearer than the planes, 1 where it is not.
    """

    slant: Array
    front: Array
    incline: Array
    explained: Array
    support: Array
    shared: float
    opening: float
    step: Array
    nearer: Array

    @property
    def gap(self) -> float:
        """How surely a gap parts the planes: the middle behind, or both borders before them."""
        return max(self.opening, float(self.step.min()))


def find_walls(geometry: GridGeometry, seen: Nearness, weight: Array, mount: float) -> Walls:
    """Fit the walls to ``seen`` with weights (n,); cells of weight 0 are left out of the fits.

    ``mount`` [m] is the camera's height above the floor.
    """
    found, nearer = find_wall_planes(
        geometry.lateral,
        geometry.ahead,
        geometry.fall,
        geometry.halves,
        geometry.column,
        seen.nearness.reshape(-1),
        weight,
        seen.sigma.reshape(-1),
        seen.confidence.reshape(-1),
        mount,
    )
    (left, right, (shared, opening, *step)) = found.tolist()
    most = max(left[2], right[2])
    cells = ENOUGH * geometry.half_cells
    inclines, explained, support = [], [], []
    for slant, front, part, total in ((-left[0], *left[1:]), right):
        inclines.append(min(max(math.atan2(slant, front), -0.5 * math.pi), 0.5 * math.pi))
        explained.append(part / max(total, 1e-9))
        # one wall is carried by the cells of both halves
        carried = min((part + shared * (most - part)) / cells, 1.0)
        near = (math.hypot(slant, front) - FARTHEST_WALL) / (SURE_WALL - FARTHEST_WALL)
        support.append(carried * min(max(near, 0.0), 1.0))
    return Walls(
        slant=found[:2, 0],
        front=found[:2, 1],
        incline=np.array(inclines),
        explained=np.array(explained),
        support=np.array(support),
        shared=shared,
        opening=opening,
        step=np.array(step),
        nearer=nearer,
    )
