"""Where a mission begins: a pose, a place, or somewhere that the robot is not told."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.errors import WorldError
from navfw.signals import Pose
from navfw.topomap import Place, TopoMap

__all__ = ["Unknown", "UnknownStart", "draw_start", "start_candidates"]

Unknown = Literal["unknown"]
"""What a mission file says when the robot may begin anywhere in the map."""

_STREAM = 1 << 20
"""Key of the random stream that draws starts, apart from those of the sensors."""


class UnknownStart(BaseModel):
    """A start at one of these places, which the robot is not told; the seed draws place and yaw."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    unknown: Annotated[
        tuple[str, ...], Field(min_length=1, max_length=1000, description="places of the map")
    ]


def start_candidates(topo_map: TopoMap, goals: Sequence[str]) -> list[Place]:
    """Where a robot may be put down that may begin anywhere: no door, danger or goal."""
    return [
        place
        for place in topo_map.places.values()
        if place.kind not in {"door", "danger"} and place.name not in goals
    ]


def draw_start(places: Sequence[Place], seed: int, check: Callable[[Place], None]) -> Pose:
    """One of ``places`` and a yaw, by the seed; places that ``check`` refuses are passed over.

    Raises:
        WorldError: it refuses all of them; the first refusal.

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
    raise refusal or WorldError("there is no place to start from: the map has only doors and goals")
