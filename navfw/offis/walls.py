"""The walls that form the left and the right plane: robust fits to all object cells (TRAP 3).

A vertical plane has the nearness ``q = slant * lateral + front * ahead`` along the ray (lateral,
ahead) of unit depth. The plane of each image half is the one that explains most of its cells, found
by reweighted least squares from three starts, with cells weighted by confidence and sigma.
Furniture in front of a wall or a door in it therefore does not turn the plane. If one plane
explains both halves nearly as well as two planes do, both are one wall, and the fit to the whole
image replaces both. The planes also fill the gap around the focus of expansion (METHOD 2.10).

Cells outside the planes indicate doors. ``opening`` is the relative distance of the middle of the
image behind the planes, at the heights of an open door; ``step`` is the relative distance of the
border of each half in front of its plane, as for the frame of a near door. One standard error is
subtracted from both.

The slope of a plane (paper sec 5.2 b; METHOD R9, R10, TRAP 1, 3): at distance D, with its outer
side turned towards the camera by the angle ``t``, a plane has the nearness
``q = (sin t * lateral + cos t * ahead) / D``. The rule base maps the fitted angle to one of five
codes; the larger digit marks the nearer side. A door in the plane makes the mean flow of the inner
side much smaller than that of the outer side: a gap therefore counts as very slope, as in the
paper's comparison of means.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer, load_system
from navfw.offis.grid_geometry import GridGeometry
from navfw.offis.nearness import Nearness
from navfw.offis.pyramid import RegionStatistics
from navfw.offis.wall_kernels import find_wall_planes

_ENOUGH = 0.06  # chosen
"""Share of the cells of a half in its plane above which the plane has full support."""

_MAX_WALL_OFFSET, _SURE_WALL = 0.05, 0.10  # chosen
"""Nearness [1/m] of a plane: its support rises from 0 at the first to full at the second value."""


@dataclass(frozen=True, slots=True)
class Walls:
    """The left and the right plane, arrays (2,).

    ``slant`` and ``front`` [1/m] are the planes' coefficients; ``incline`` [rad] is their angle to
    the image plane, positive where the outer side is nearer; ``explained`` is the share of the
    half's object cells that lie in the plane; ``support`` in [0, 1] is the trust in the plane by
    the number of these cells. ``shared`` in [0, 1] is the degree to which both are one plane.
    ``opening`` and ``step`` (2,) in [-1, 1]: see the module. ``nearer`` (columns,) is the factor by
    which the contents of each column are significantly nearer than the planes, otherwise 1.
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
        """Evidence of a gap between the planes: the middle behind or both borders before them."""
        return max(self.opening, float(self.step.min()))


def find_walls(geometry: GridGeometry, seen: Nearness, weight: Array) -> Walls:
    """Fit the walls to the cells of ``seen`` with ``weight`` (n,); weight 0 leaves a cell out."""
    planes, nearer = find_wall_planes(
        geometry.lateral,
        geometry.ahead,
        geometry.fall,
        geometry.halves,
        geometry.column,
        *seen.flat,
        weight,
        geometry.mount_height,
    )
    (left, right, (shared, opening, *step)) = planes.tolist()
    most = max(left[2], right[2])
    cells = _ENOUGH * geometry.half_cells
    inclines, explained, support = [], [], []
    for slant, front, inliers, total in ((-left[0], *left[1:]), right):
        inclines.append(min(max(math.atan2(slant, front), -0.5 * math.pi), 0.5 * math.pi))
        explained.append(inliers / max(total, 1e-9))
        # one wall across both halves is supported by the cells of both
        carried = min((inliers + shared * (most - inliers)) / cells, 1.0)
        near = (math.hypot(slant, front) - _MAX_WALL_OFFSET) / (_SURE_WALL - _MAX_WALL_OFFSET)
        support.append(carried * min(max(near, 0.0), 1.0))
    return Walls(
        slant=planes[:2, 0],
        front=planes[:2, 1],
        incline=np.array(inclines),
        explained=np.array(explained),
        support=np.array(support),
        shared=shared,
        opening=opening,
        step=np.array(step),
        nearer=nearer,
    )


_CODES = {
    "very_slope": ("[3 1]", "[1 3]"),
    "slope": ("[2 1]", "[1 2]"),
    "orthogonal": ("[1 1]", "[1 1]"),
    "unusual_slope": ("[1 2]", "[2 1]"),
    "unusual_very_slope": ("[1 3]", "[3 1]"),
}
"""Slope codes of the left and of the right plane for each term of the rule base (METHOD R9)."""

SIDES = ("left", "right")


@dataclass(frozen=True, slots=True)
class Slopes:
    """Slope of the left and the right plane, arrays (2,).

    ``value`` is the difference of the code's digits, outer minus inner (2 is "very slope"; negative
    is "unusual", METHOD R10); ``support`` in [0, 1] is the trust in it; ``codes`` are, for example,
    ``("[3 1]", "[1 2]")``.
    """

    value: Array
    support: Array
    codes: tuple[str, str]
    evaluation: FuzzyEvaluation


def slopes_of_walls(walls: Walls) -> Slopes:
    """Infer slopes from the fitted planes and the gaps in them (mode ``nearness``)."""
    gap = np.full(2, walls.gap)
    facing = np.full(2, walls.incline.sum())
    inputs = {"outer": walls.incline, "gap": gap, "facing": facing}
    return _slopes("slope", inputs, walls.support)


def slopes_of_means(regions: RegionStatistics) -> Slopes:
    """Infer slopes from raw mean flow of each plane's outer and inner half (mode ``paper``)."""
    mu = np.hypot(regions.mu_u[-4:], regions.mu_v[-4:])
    outer, inner = mu[[0, 3]], mu[[1, 2]]
    known = np.minimum(regions.known[[-4, -1]], regions.known[[-3, -2]])
    ratio = (outer - inner) / np.maximum(outer + inner, 1e-12)
    return _slopes("slope_paper", {"outer": ratio}, np.minimum(known / 0.2, 1.0))


def _slopes(system: str, inputs: dict[str, Array], support: Array) -> Slopes:
    evaluation = infer(load_system(system), inputs)
    degrees = np.array([evaluation.degree("slope", term) for term in _CODES])
    best = degrees.argmax(0)
    terms = list(_CODES)
    left, right = (
        _CODES[terms[best[side]]][side] if support[side] > 0.0 else "unknown" for side in (0, 1)
    )
    return Slopes(evaluation.result.crisp("slope"), support, (left, right), evaluation)
