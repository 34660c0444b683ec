"""Plane inference: which neighbouring regions show one plane (paper sec 5.2 a, METHOD R8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer_rows, load_system
from navfw.offis.percept_kernels import compare_pairs
from navfw.offis.pyramid import NEIGHBOURS, Pyramid, RegionStatistics


@dataclass(frozen=True, slots=True)
class Planes:
    """Plane property of all pairs of neighbouring sibling regions, arrays (n_pairs,).

    ``pairs`` (n_pairs, 2) are region indices, four pairs per family in ``pyramid.families`` order;
    ``plane`` is the degree to which both regions show one plane, ``same`` the degree to which both
    also belong to the same nearest object.
    """

    pairs: np.ndarray
    plane: Array
    same: Array
    evaluation: FuzzyEvaluation


def pairs_of(pyramid: Pyramid) -> np.ndarray:
    """(n_pairs, 2) indices of all neighbouring siblings."""
    return np.array([(f + i, f + j) for f in pyramid.families for i, j in NEIGHBOURS])


def find_planes(pairs: np.ndarray, regions: RegionStatistics, size: Array) -> Planes:
    """Plane property of ``pairs``; ``size`` (n_regions,) is the size of each region."""
    rows, present = compare_pairs(pairs, regions.mu_u, regions.mu_v, size, regions.objects)
    evaluation = infer_rows(load_system("plane"), rows)
    return Planes(
        pairs,
        present * evaluation.degree("plane", "common"),
        present * evaluation.degree("object", "same"),
        evaluation,
    )
