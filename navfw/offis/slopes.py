"""Slope inference for the left and the right plane (paper sec 5.2 b; METHOD R9, R10, TRAP 1, 3).

A vertical plane at distance D whose outer side is turned towards the viewer by the angle ``t`` has
``q = (sin t * across + cos t * ahead) / D``. A robust fit of that to one half of the image gives
the angle, which the rule base turns into one of five codes; larger digits mean the nearer side. A
half that shows no single plane (a door in a wall, the mouth of a corridor) still gets the angle
that fits best, just as the paper's comparison of means would.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.offis.geometry import GridGeometry
from navfw.offis.inference import Evaluation, infer, load_system
from navfw.offis.kernels import fit_upright_planes
from navfw.offis.pyramid import RegionStatistics
from navfw.signals import Array

__all__ = ["CODES", "PlaneFits", "Slopes", "fit_planes", "slopes_of_fits", "slopes_of_means"]

CODES = {
    "very_slope": ("[3 1]", "[1 3]"),
    "slope": ("[2 1]", "[1 2]"),
    "orthogonal": ("[1 1]", "[1 1]"),
    "unusual_slope": ("[1 2]", "[2 1]"),
    "unusual_very_slope": ("[1 3]", "[3 1]"),
}
"""Slope codes of the left and of the right plane for each term of the rule base (METHOD R9)."""

SIDES = ("left", "right")


@dataclass(frozen=True, slots=True)
class PlaneFits:
    """Fits to left half, right half, left outer part, right outer part: arrays (4,).

    ``incline`` [rad] is positive where the outer side is nearer; ``centre`` [1/m] is the nearness
    the plane would have straight ahead; ``support`` in [0, 1] says how many cells carry it.
    """

    incline: Array
    centre: Array
    support: Array


@dataclass(frozen=True, slots=True)
class Slopes:
    """Slope of the left and the right plane, arrays (2,).

    ``value`` is the difference of the code's digits, outer minus inner (2 is "very slope"; negative
    is "unusual", METHOD R10); ``support`` in [0, 1]; ``codes`` e.g. ``("[3 1]", "[1 2]")``.
    """

    value: Array
    support: Array
    codes: tuple[str, str]
    evaluation: Evaluation


def fit_planes(geometry: GridGeometry, nearness: Array, weight: Array, sigma: Array) -> PlaneFits:
    """Fit upright planes to flat (n,) nearness with weights; cells of weight 0 are left out."""
    fits = fit_upright_planes(
        geometry.planes, geometry.across, geometry.ahead, nearness, weight, sigma
    )
    incline = np.arctan2(fits[:, 0], fits[:, 1]).clip(-0.5 * math.pi, 0.5 * math.pi)
    # a tenth of the cells is enough to trust a plane fully, unless it is at the end of the world
    carried = np.minimum(fits[:, 2] / (0.1 * geometry.planes.sum(1)), 1.0)
    nearness = np.hypot(fits[:, 0], fits[:, 1])
    support = carried * ((nearness - 0.05) / 0.05).clip(0.0, 1.0)
    return PlaneFits(incline, fits[:, 1], support)


def slopes_of_fits(fits: PlaneFits) -> Slopes:
    """Slopes from the fitted planes (mode ``nearness``)."""
    return _slopes("slope", fits.incline[:2], fits.support[:2])


def slopes_of_means(regions: RegionStatistics) -> Slopes:
    """Slopes from raw mean flow of the outer and inner half of each plane (mode ``paper``)."""
    mu = np.hypot(regions.mu_u[-4:], regions.mu_v[-4:])
    outer, inner = mu[[0, 3]], mu[[1, 2]]
    known = np.minimum(regions.known[[-4, -1]], regions.known[[-3, -2]])
    ratio = (outer - inner) / np.maximum(outer + inner, 1e-12)
    return _slopes("slope_paper", ratio, np.minimum(known / 0.2, 1.0))


def _slopes(system: str, outer: Array, support: Array) -> Slopes:
    evaluation = infer(load_system(system), {"outer": outer})
    degrees = np.stack([evaluation.degree("slope", term) for term in CODES])
    best = degrees.argmax(0)
    terms = list(CODES)
    left, right = (
        CODES[terms[best[side]]][side] if support[side] > 0.0 else "unknown" for side in (0, 1)
    )
    return Slopes(evaluation.result.outputs["slope"], support, (left, right), evaluation)
