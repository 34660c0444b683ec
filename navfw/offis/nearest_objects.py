"""Nearest objects by zooming into the pyramid (paper sec 4.5 with Fig. 8, METHOD R7)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from navfw.offis.distances import TERMS, Distances
from navfw.offis.planes import Planes
from navfw.offis.pyramid import NEIGHBOURS, Pyramid
from navfw.signals import Array

__all__ = ["nearest_objects"]

ALIKE = 0.7
"""How big, relative to the biggest, a part that joins through other parts must be.

Direct neighbours are judged by the rule base; this keeps a chain of them from drifting away."""


def nearest_objects(
    pyramid: Pyramid, size: Array, present: np.ndarray, planes: Planes, distances: Distances
) -> Mapping[str, Mapping[str, str]]:
    """Regions of the nearest object per layer with their distance term.

    ``{"layer1": {"P2": "middle"}, "layer2": {"sP23": "middle"}}``. In each family of four siblings
    the biggest (by ``size``) is the candidate; neighbours that share its plane and are about as
    big join it, and theirs; the next layer zooms into all of these. Regions that are not
    ``present`` (no object seen) are left out, so a layer may be empty.
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


def _biggest(first: int, size: list[float], shown: list[bool], same: list[float]) -> list[int]:
    """The biggest of the four siblings from ``first`` on, and those that belong to it.

    ``same`` stands in the order of ``planes.pairs_of``: four to a family, as ``NEIGHBOURS``.
    """
    members = [r for r in range(first, first + 4) if shown[r]]
    if not members:
        return []
    biggest = max(members, key=size.__getitem__)
    least = ALIKE * size[biggest]
    chosen = {biggest}
    # siblings stand in a ring: three times around reaches the last of a chain
    for k, (i, j) in enumerate(NEIGHBOURS * 3):
        one, other = first + i, first + j
        if same[first + k % 4] >= 0.5 and (one in chosen) != (other in chosen):
            new = other if one in chosen else one
            if shown[new] and size[new] >= least:
                chosen.add(new)
    return list(chosen)
