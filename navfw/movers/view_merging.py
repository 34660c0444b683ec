"""View merging: one detection for an object that shows in two adjacent images."""

from __future__ import annotations

import math
from collections.abc import Sequence

from navfw.robot import CameraModel
from navfw.signals import MovingObject

BORDER_ANGLE = math.radians(7.0)
"""Angle [rad] from an image's border within which flow is not computed: a detection that ends there
may be cut off."""
_MAX_RATIO = 2.0
"""Largest ratio of the distances of two parts of one object."""


def merge_views(
    views: Sequence[Sequence[MovingObject]], cameras: Sequence[CameraModel]
) -> tuple[MovingObject, ...]:
    """All detections of ``views``, one for each of ``cameras`` (at one place); left to right.

    Two detections that end at the border between adjacent views, at similar distances, become one.
    """
    bearings = [camera.bearing for camera in cameras]
    order = sorted(range(len(cameras)), key=lambda k: -bearings[k])
    merged: list[MovingObject] = []
    border = math.inf
    for k in order:
        axis, half = bearings[k], 0.5 * cameras[k].hfov
        fresh = sorted(views[k], key=lambda detection: -detection.bearing)
        if merged and fresh and border <= axis + half:
            left, right = merged[-1], fresh[0]
            touching = (
                _right_edge(left) < border + BORDER_ANGLE
                and _left_edge(right) > axis + half - BORDER_ANGLE
            )
            if touching and max(left.distance, right.distance) < _MAX_RATIO * min(
                left.distance, right.distance
            ):
                merged[-1:], fresh = [_merge(left, right)], fresh[1:]
        merged += fresh
        border = axis - half
    return tuple(merged)


def _merge(left: MovingObject, right: MovingObject) -> MovingObject:
    """The object of two adjacent parts; its distance is their mean, weighted by width."""
    edges = _left_edge(left), min(_right_edge(left), _right_edge(right))
    share = left.width / max(left.width + right.width, 1e-9)
    return MovingObject(
        left.time,
        0.5 * sum(edges),
        0.5 * (edges[0] - edges[1]),
        share * left.distance + (1.0 - share) * right.distance,
        left.information + right.information,
        left.evidence + right.evidence,
    )


def _left_edge(detection: MovingObject) -> float:
    return detection.bearing + detection.width


def _right_edge(detection: MovingObject) -> float:
    return detection.bearing - detection.width
