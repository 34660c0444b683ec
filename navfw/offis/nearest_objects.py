"""Nearest objects: regions of one plane, and the search by zooming into the pyramid.

Which neighbouring regions show one plane is inferred (paper sec 5.2 a, METHOD R8). The nearest
objects are searched layer by layer (paper sec 4.5, Fig. 8, METHOD R7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer_rows, load_system
from navfw.offis.nearness import TERMS, Distances
from navfw.offis.percept_kernels import compare_pairs
from navfw.offis.pyramid import NEIGHBOURS, Pyramid, RegionStatistics, position

_ALIKE = 0.7
"""Least size of a region that joins the nearest object, relative to the biggest region.

The rule base compares direct neighbours only; this limit also holds along a chain of neighbours."""


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


def nearest_objects(
    pyramid: Pyramid, size: Array, present: np.ndarray, planes: Planes, distances: Distances
) -> Mapping[str, Mapping[str, str]]:
    """Regions of the nearest object per layer with their distance term.

    ``{"layer1": {"P2": "middle"}, "layer2": {"sP23": "middle"}}``. Of four siblings the biggest (by
    ``size``) belongs to the nearest object. Neighbours of about the same size that share its plane
    belong to it too, and so on along the neighbours. The next layer zooms into these regions.
    Regions without an object (not ``present``) are left out, so a layer may be empty.
    """
    sizes, shown, same = size.tolist(), present.tolist(), planes.same.tolist()
    terms = distances.term.tolist()
    obstacles: dict[str, dict[str, str]] = {}
    families = [0]
    for layer in range(1, pyramid.layers + 1):
        chosen = [r for first in families for r in _biggest(first, sizes, shown, same)]
        obstacles[f"layer{layer}"] = {pyramid.names[r]: TERMS[terms[r]] for r in sorted(chosen)}
        families = [child for r in chosen if (child := pyramid.first_child(r)) is not None]
    return obstacles


def common_regions(
    obstacles: Mapping[str, Mapping[str, str]], others: Sequence[Mapping[str, Mapping[str, str]]]
) -> Mapping[str, Mapping[str, str]]:
    """``obstacles`` in the quadrants that layer 1 of all ``others`` names, too."""
    places = {
        position(region)
        for region in obstacles["layer1"]
        if all(region in other["layer1"] for other in others)
    }
    return {
        layer: {region: term for region, term in regions.items() if position(region) in places}
        for layer, regions in obstacles.items()
    }


def _biggest(first: int, size: list[float], shown: list[bool], same: list[float]) -> list[int]:
    """The biggest of the four siblings from index ``first`` on, and those that belong to it.

    ``same`` has the order of ``planes.pairs_of``: four pairs per family, as in ``NEIGHBOURS``.
    """
    members = [r for r in range(first, first + 4) if shown[r]]
    if not members:
        return []
    biggest = max(members, key=size.__getitem__)
    least = _ALIKE * size[biggest]
    chosen = {biggest}
    # siblings form a ring: three rounds reach the end of every chain
    for k, (i, j) in enumerate(NEIGHBOURS * 3):
        one, other = first + i, first + j
        if same[first + k % 4] >= 0.5 and (one in chosen) != (other in chosen):
            new = other if one in chosen else one
            if shown[new] and size[new] >= least:
                chosen.add(new)
    return list(chosen)
