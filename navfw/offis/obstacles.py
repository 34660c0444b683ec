"""Nearest objects by zooming into the pyramid (paper sec 4.5 with Fig. 8, METHOD R7)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from navfw.offis.distances import TERMS, Distances
from navfw.offis.planes import Planes
from navfw.offis.pyramid import Pyramid
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
    found: dict[str, dict[str, str]] = {}
    families = [0]
    for layer in range(1, pyramid.layers + 1):
        chosen = [r for f in families for r in _biggest(f, size, present, planes)]
        found[f"layer{layer}"] = {
            pyramid.names[r]: TERMS[int(distances.term[r])] for r in sorted(chosen)
        }
        families = [child for r in chosen if (child := pyramid.first_child(r)) is not None]
    return found


def _biggest(first: int, size: Array, present: np.ndarray, planes: Planes) -> list[int]:
    """The biggest of the four siblings from ``first`` on, and those that belong to it."""
    members = [r for r in range(first, first + 4) if present[r]]
    if not members:
        return []
    biggest = max(members, key=size.__getitem__)
    chosen = {biggest}
    # pairs stand in the order of families, four to a family (see planes.pairs_of), in a ring:
    # twice around reaches every neighbour of a neighbour
    for k in (*range(first, first + 4), *range(first, first + 4)):
        i, j = int(planes.pairs[k, 0]), int(planes.pairs[k, 1])
        if (i in chosen) == (j in chosen) or planes.same[k] < 0.5:
            continue
        other = j if i in chosen else i
        if present[other] and size[other] >= ALIKE * size[biggest]:
            chosen.add(other)
    return list(chosen)
