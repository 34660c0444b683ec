"""Who walks where two images meet shows one half in each: the halves are put together."""

from __future__ import annotations

import math
from collections.abc import Sequence

from navfw.robot import CameraModel
from navfw.signals import MovingObject

__all__ = ["merge_views"]

EDGE = math.radians(7.0)
"""Flow ends so far from an image's border, and what is seen of a mover with it [rad]."""
ALIKE = 2.0
"""Halves whose distances differ by more than this factor are of two movers."""


def merge_views(
    views: Sequence[Sequence[MovingObject]], cameras: Sequence[CameraModel]
) -> tuple[MovingObject, ...]:
    """All movers of ``views``, one for each of ``cameras`` (at one place); left to right."""
    bearings = [camera.bearing for camera in cameras]
    order = sorted(range(len(cameras)), key=lambda k: -bearings[k])
    joined: list[MovingObject] = []
    border = math.inf
    for k in order:
        axis, half = bearings[k], 0.5 * cameras[k].hfov
        fresh = sorted(views[k], key=lambda mover: -mover.bearing)
        if joined and fresh and border <= axis + half:
            left, right = joined[-1], fresh[0]
            touching = _right(left) < border + EDGE and _left(right) > axis + half - EDGE
            if touching and max(left.distance, right.distance) < ALIKE * min(
                left.distance, right.distance
            ):
                joined[-1:], fresh = [_join(left, right)], fresh[1:]
        joined += fresh
        border = axis - half
    return tuple(joined)


def _join(left: MovingObject, right: MovingObject) -> MovingObject:
    """The mover whose halves these are; of its distance the wider half says more."""
    edges = _left(left), min(_right(left), _right(right))
    share = left.width / max(left.width + right.width, 1e-9)
    return MovingObject(
        left.time,
        0.5 * sum(edges),
        0.5 * (edges[0] - edges[1]),
        share * left.distance + (1.0 - share) * right.distance,
        left.information + right.information,
        left.evidence + right.evidence,
    )


def _left(mover: MovingObject) -> float:
    return mover.bearing + mover.width


def _right(mover: MovingObject) -> float:
    return mover.bearing - mover.width
