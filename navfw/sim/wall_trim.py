"""Skirting boards and door frames: strips on the faces of walls with textures of their own.

They are drawn on the faces and add no solid: real ones project by one or two centimetres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array
from navfw.sim.solids import Solid, opening_segment, wall_segments
from navfw.sim.worldspec import DoorFrameSpec, OpeningSpec, WallSpec, WorldSpec

_PARALLEL = 0.99
"""Least cosine between a face and a wall's line along it."""
_AT_OPENING = 0.01
"""Largest distance [m] of a wall's end from the side of the opening at which it ends."""


@dataclass(frozen=True, slots=True)
class TrimStrip:
    """A strip of a face: ``columns`` from, to along it, ``rows`` above its lower edge [m]."""

    columns: tuple[float, float]
    rows: tuple[float, float]
    texture: str


def trim_strips(
    world: WorldSpec, wall: Solid, start: Array, right: Array, length: float
) -> list[TrimStrip]:
    """The strips of one vertical face of a wall piece or lintel; later ones cover earlier ones.

    The face begins at ``start`` (2,) [m] and extends ``length`` [m] along the unit vector ``right``
    (2,).
    """
    strips: list[TrimStrip] = []
    height = wall.top - wall.bottom
    if world.skirting is not None and wall.kind == "wall":
        high = min(world.skirting.height, height)
        strips.append(TrimStrip((0.0, length), (0.0, high), world.skirting.texture))
    if world.door_frames is not None:
        spec = next(spec for spec in world.walls if spec.name == wall.name)
        for opening in spec.openings:
            strips += _frame_strips(world.door_frames, spec, opening, wall, (start, right, length))
    return strips


def texture_at(strips: Sequence[TrimStrip], along: float, above: float) -> str | None:
    """Texture of the uppermost strip at a point of a face [m]; None beside all strips."""
    for strip in reversed(strips):
        (left, right), (low, high) = strip.columns, strip.rows
        if left <= along <= right and low <= above <= high:
            return strip.texture
    return None


def _frame_strips(
    frame: DoorFrameSpec,
    spec: WallSpec,
    opening: OpeningSpec,
    wall: Solid,
    face: tuple[Array, Array, float],
) -> Iterator[TrimStrip]:
    """The strips of one opening's frame on a face (start, right, length) of its wall."""
    start, right, length = face
    index = opening_segment(spec, opening)
    assert index is not None  # noqa: S101 - check_world guarantees it
    yaw = wall_segments(spec)[index].yaw
    dx, dy = np.subtract(opening.at, start)
    along, off = dx * right[0] + dy * right[1], abs(dx * right[1] - dy * right[0])
    half, top = 0.5 * opening.width, min(opening.height, spec.height)
    if abs(math.cos(yaw) * right[0] + math.sin(yaw) * right[1]) < _PARALLEL:
        ends_here = abs(off - half) < _AT_OPENING and abs(along - 0.5 * length) < _AT_OPENING
        if ends_here and wall.kind == "wall":
            yield TrimStrip((0.0, length), (0.0, top), frame.texture)
    elif abs(off - 0.5 * spec.thickness) < 0.5 * spec.thickness:
        if wall.kind == "lintel":
            if abs(along - 0.5 * length) < half:
                yield TrimStrip((0.0, length), (0.0, frame.width), frame.texture)
            return
        upper = min(top + frame.width, spec.height)
        for left in (along - half - frame.width, along + half):
            yield TrimStrip((left, left + frame.width), (0.0, upper), frame.texture)
