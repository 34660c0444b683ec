"""Unknown starts: the places in question, and the draw of one of them by the seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from navfw.errors import WorldError
from navfw.signals import Pose
from navfw.topomap import Place, TopoMap

_STREAM = 1 << 20
"""Spawn key of the random stream that draws starts; the sensors' streams have other keys."""


def start_candidates(topo_map: TopoMap, goals: Sequence[str]) -> list[Place]:
    """The places for a start anywhere in the map: all but doors, dangers and goals."""
    return [
        place
        for place in topo_map.places.values()
        if place.kind not in {"door", "danger"} and place.name not in goals
    ]


def draw_start(places: Sequence[Place], seed: int, check: Callable[[Place], None]) -> Pose:
    """A pose at one of ``places``, with a yaw, both drawn by ``seed``.

    Places for which ``check`` raises WorldError are skipped.

    Raises:
        WorldError: ``check`` refuses all places; its first error is raised.

    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_STREAM,)))
    order = rng.permutation(len(places)).tolist()
    yaw = float(rng.uniform(-math.pi, math.pi))
    refusal: WorldError | None = None
    for index in order:
        place = places[index]
        try:
            check(place)
        except WorldError as error:
            refusal = refusal or error
        else:
            return Pose(place.x, place.y, yaw)
    raise refusal or WorldError("no place to start from: the map has only doors and goals")
