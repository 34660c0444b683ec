"""Plane inference: which neighbouring regions show one plane (paper sec 5.2 a, METHOD R8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfw.offis.inference import Evaluation, infer, load_system
from navfw.offis.pyramid import NEIGHBOURS, Pyramid, RegionStatistics
from navfw.signals import Array

__all__ = ["Planes", "find_planes", "pairs_of"]


@dataclass(frozen=True, slots=True)
class Planes:
    """Plane property of all pairs of neighbouring sibling regions, arrays (n_pairs,).

    ``pairs`` (n_pairs, 2) are region indices, four pairs per family in ``pyramid.families`` order;
    ``plane`` is the degree to which both show one plane, ``same`` the degree to which both also
    belong to the same nearest object.
    """

    pairs: np.ndarray
    plane: Array
    same: Array
    evaluation: Evaluation


def pairs_of(pyramid: Pyramid) -> np.ndarray:
    """(n_pairs, 2) indices of all neighbouring siblings."""
    return np.array([(f + i, f + j) for f in pyramid.families for i, j in NEIGHBOURS])


def find_planes(pairs: np.ndarray, regions: RegionStatistics, size: Array) -> Planes:
    """Degrees for ``pairs``; ``size`` (n_regions,) is what "biggest" is judged by."""
    i, j = pairs.T
    evaluation = infer(
        load_system("plane"),
        {
            "width": _difference(regions.mu_u[i], regions.mu_u[j]),
            "height": _difference(regions.mu_v[i], regions.mu_v[j]),
            "size": np.minimum(size[i], size[j]) / np.maximum(np.maximum(size[i], size[j]), 1e-12),
        },
    )
    # regions without an object have no plane to share
    present = (regions.objects[i] > 0.0) & (regions.objects[j] > 0.0)
    return Planes(
        pairs,
        present * evaluation.degree("plane", "common"),
        present * evaluation.degree("object", "same"),
        evaluation,
    )


def _difference(a: Array, b: Array) -> Array:
    """|a - b| / (a + b) of values >= 0; 0 where both are 0."""
    result: Array = np.abs(a - b) / np.maximum(a + b, 1e-12)
    return result
