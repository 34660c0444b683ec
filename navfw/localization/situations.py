"""How likely the places of a map make what OFFIS says of the way ahead (METHOD 4.4)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from navfw.signals import Array
from navfw.topomap.model import TopoMap

__all__ = ["FLOOR", "situation_likelihoods"]

FLOOR = 0.05
"""The least likelihood: OFFIS is a weak witness and never vetoes."""

_SEEN_AT: Mapping[str, Mapping[str, float]] = {
    # how probable it is that OFFIS says so, at a place of this kind
    "corridor": {"corridor": 0.45, "junction": 0.35, "corner": 0.15, "door": 0.2, "room": 0.1},
    "door": {"corridor": 0.2, "junction": 0.25, "corner": 0.2, "door": 0.4, "room": 0.25},
    "corner": {"corridor": 0.1, "junction": 0.12, "corner": 0.3, "door": 0.12, "room": 0.25},
    "wall": {"corridor": 0.1, "junction": 0.12, "corner": 0.2, "door": 0.1, "room": 0.2},
    "left wall": {"corridor": 0.05, "junction": 0.06, "corner": 0.06, "door": 0.06, "room": 0.08},
    "right wall": {"corridor": 0.05, "junction": 0.06, "corner": 0.06, "door": 0.06, "room": 0.08},
}
"""A smoothed confusion table, set by hand. "unknown" says nothing, and the kind ``danger`` has no
row: a robot seldom is there."""

_ELSE = 0.1


def situation_likelihoods(topo_map: TopoMap, situations: Mapping[str, float]) -> Array | None:
    """(places,) likelihood of the ``situations`` (degrees) at each place, in [FLOOR, 1].

    None where they say nothing.
    """
    degrees = {name: d for name, d in situations.items() if name in _SEEN_AT and d > 0.0}
    total = sum(degrees.values())
    if total < 1e-6:
        return None
    kinds = {place.kind for place in topo_map.places.values()}
    of_kind = {
        kind: sum(d * _SEEN_AT[name].get(kind, _ELSE) for name, d in degrees.items()) / total
        for kind in kinds
    }
    best = max(of_kind.values())
    sure = min(1.0, total)
    scaled = {kind: 1.0 - sure * (1.0 - value / best) for kind, value in of_kind.items()}
    return np.array([max(FLOOR, scaled[place.kind]) for place in topo_map.places.values()])
