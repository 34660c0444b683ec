"""Nearest objects by zooming into the pyramid (paper sec 4.5 with Fig. 8, METHOD R7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from navfw.offis.distances import TERMS, Distances
from navfw.offis.planes import Planes
from navfw.offis.pyramid import NEIGHBOURS, Pyramid, position
from navfw.signals import Array

ALIKE = 0.7
"""Least size of a region that joins the nearest object, relative to the biggest region.

The rule base compares direct neighbours only; this limit also holds along a chain of neighbours."""


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
    found: dict[str, dict[str, str]] = {}
    families = [0]
    for layer in range(1, pyramid.layers + 1):
        chosen = [r for first in families for r in _biggest(first, sizes, shown, same)]
        found[f"layer{layer}"] = {pyramid.names[r]: TERMS[terms[r]] for r in sorted(chosen)}
        families = [child for r in chosen if (child := pyramid.first_child(r)) is not None]
    return found


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
    least = ALIKE * size[biggest]
    chosen = {biggest}
    # siblings form a ring: three rounds reach the end of every chain
    for k, (i, j) in enumerate(NEIGHBOURS * 3):
        one, other = first + i, first + j
        if same[first + k % 4] >= 0.5 and (one in chosen) != (other in chosen):
            new = other if one in chosen else one
            if shown[new] and size[new] >= least:
                chosen.add(new)
    return list(chosen)
