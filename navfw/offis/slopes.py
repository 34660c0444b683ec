"""Slope inference for the left and the right plane (paper sec 5.2 b; METHOD R9, R10, TRAP 1, 3).

A vertical plane at distance D whose outer side is turned towards the camera by the angle ``t`` has
the nearness ``q = (sin t * lateral + cos t * ahead) / D``. A robust fit of this model to one half
of the image yields the angle (``walls``), which the rule base maps to one of five codes; the larger
digit marks the nearer side. A door in the plane makes the mean flow of the inner side much smaller
than that of the outer side: a gap therefore counts as very slope, as in the paper's comparison of
means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer, load_system
from navfw.offis.pyramid import RegionStatistics
from navfw.offis.walls import Walls

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
    """Slopes from the fitted planes and the gaps in them (mode ``nearness``)."""
    gap = np.full(2, walls.gap)
    facing = np.full(2, walls.incline.sum())
    inputs = {"outer": walls.incline, "gap": gap, "facing": facing}
    return _slopes("slope", inputs, walls.support)


def slopes_of_means(regions: RegionStatistics) -> Slopes:
    """Slopes from raw mean flow of the outer and inner half of each plane (mode ``paper``)."""
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
