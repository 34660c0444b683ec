"""Points tracked between two images at nearly full resolution, for the egomotion.

The flow processors work on small images, on a grid. Rotation and heading are better determined by
corners at the resolution of the original: their positions are more exact, and pyramids follow
rotations that exceed the search range of the flow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from navfw.egomotion.flow_egomotion import PointMotion
from navfw.perceive.working_size import WorkingSize
from navfw.signals import Array, Image

MAX_WIDTH = 640
"""Largest width of the images in which points are tracked [px]."""

POINTS = 400
"""Largest number of points."""

QUALITY = 0.005
"""Least eigenvalue of a corner's structure tensor, relative to the best corner's."""

WINDOW = 21
"""Side of the window of a point at the width MAX_WIDTH [px]; at least _MIN_WINDOW."""
_MIN_WINDOW = 11

_LEVELS = 4
"""Levels of the pyramid."""

_RETURN = 0.5
"""Largest distance [px] between a point and where tracking it forth and back ends."""

SIGMA = 0.15
"""Standard deviation of a track [px of the track image]."""

_TRACK_OVERLAP = 2.0
"""Number of tracks with a common error."""


@dataclass(frozen=True, slots=True)
class TrackImage:
    """A grey image (height, width) for tracking, and its ``scale`` relative to the original."""

    grey: Image
    scale: float

    @classmethod
    def of(cls, image: Image) -> TrackImage:
        """The track image of an original (height, width, 3)."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        scale = min(MAX_WIDTH / grey.shape[1], 1.0)
        if scale < 1.0:
            grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        return cls(np.ascontiguousarray(grey, dtype=np.uint8), scale)


def track_points(past: TrackImage, now: TrackImage, size: WorkingSize) -> PointMotion:
    """Corners of ``now`` found again in ``past``, in pixels of the working image."""
    found: Any = cv2.goodFeaturesToTrack(now.grey, POINTS, QUALITY, _distance(now.grey))
    if found is None:
        none = np.empty((0, 2))
        return PointMotion(none, none, np.empty(0), np.empty(0))
    back, there = _tracked(now.grey, past.grey, found)
    again, here = _tracked(past.grey, now.grey, back)
    good = there & here & (np.linalg.norm((again - found).reshape(-1, 2), axis=1) < _RETURN)
    factor = size.scale / now.scale
    return PointMotion(
        _centred(found.reshape(-1, 2)[good], now.grey) * factor,
        _centred(back.reshape(-1, 2)[good], past.grey) * factor,
        np.full(int(good.sum()), SIGMA * factor),
        np.full(int(good.sum()), 1.0 / _TRACK_OVERLAP),
    )


def _tracked(image: Image, other: Image, points: Any) -> tuple[Any, Any]:
    """Where ``points`` (n, 1, 2) of ``image`` are in the ``other``, and which were found (n,)."""
    side = max(WINDOW * image.shape[1] // MAX_WIDTH | 1, _MIN_WINDOW)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        image,
        other,
        points,
        np.empty_like(points),
        winSize=(side, side),
        maxLevel=_LEVELS,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01),
    )
    return moved, np.asarray(found).ravel() > 0


def _distance(grey: Image) -> float:
    """Least distance between two points [px]: that of POINTS spread evenly, halved."""
    return max(0.5 * float(np.sqrt(grey.size / POINTS)), 3.0)


def _centred(points: Array, grey: Image) -> Array:
    """``points`` (n, 2) [px, centre of the first pixel at 0] relative to the image's centre."""
    height, width = grey.shape
    return np.asarray(points, dtype=np.float64) - 0.5 * (np.array([width, height]) - 1.0)
