"""Tracked pairs of images, spread over a sequence, that tell a lens."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable

import numpy as np

from navfw.errors import InputError
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.lens_fit import TrackedPair
from navfw.perceive.point_tracks import TrackImage, track_points
from navfw.perceive.working_size import WorkingSize

_LOOKED_AT = 120
"""Number of pairs that are looked at."""
_MAX_PAIRS = 100
"""Largest number of pairs that are used."""
MAX_PIXELS = 600_000_000
"""Number of pixels after which no more images are read: 2000 images of 640 x 480."""
MIN_POINTS = 60
"""Least number of points of a pair."""
FLOW, MIN_FLOW = 0.1, 0.01
"""Median flow of a pair that the distance between its images aims at, and least one, as shares of
the image's width."""
_MAX_PAIR = 15
"""Largest distance between the images of a pair [images]."""


def lens_pairs(
    images: ImageSource, tick: Callable[[], None]
) -> tuple[list[TrackedPair], tuple[int, int]]:
    """Pairs with enough points and flow, and the images' size (width, height) [px].

    Images are read up to the first that is no good, which is told when it is its turn; ``tick`` is
    called after each.
    """
    sampler: _PairSampler | None = None
    with contextlib.suppress(InputError):
        for item in images:
            if sampler is None:
                sampler = _PairSampler(item.image.shape[1], item.image.shape[0], images.total)
            if sampler.full:
                break
            sampler.add(TrackImage.of(item.image), item.after_gap)
            tick()
    if sampler is None:
        return [], (0, 0)
    return sampler.pairs[:: 1 + len(sampler.pairs) // _MAX_PAIRS], (sampler.width, sampler.height)


class _PairSampler:
    """Tracks every so many images of ``width`` x ``height`` px; ``total`` is their number or 0."""

    def __init__(self, width: int, height: int, total: int) -> None:
        self.width, self.height = width, height
        self.pairs: list[TrackedPair] = []
        self._size = WorkingSize(width, height, 1.0, width, height)
        self._most = MAX_PIXELS // (width * height)
        self._spacing = max(min(total or self._most, self._most) // _LOOKED_AT, 1)
        self._earlier: deque[TrackImage] = deque(maxlen=_MAX_PAIR)
        self._count = 0
        self._stride = 2

    @property
    def full(self) -> bool:
        """Whether enough images were read."""
        return self._count > self._most

    def add(self, now: TrackImage, after_gap: bool) -> None:
        """Add the next image."""
        if after_gap:
            self._earlier.clear()
        if self._count % self._spacing == 0 and self._earlier:
            self._track(now)
        self._earlier.append(now)
        self._count += 1

    def _track(self, now: TrackImage) -> None:
        """Track points to an earlier image, and choose the distance of the next pair."""
        apart = min(self._stride, len(self._earlier))
        tracks = track_points(self._earlier[-apart], now, self._size)
        if len(tracks.points) < MIN_POINTS:
            self._stride = max(self._stride // 2, 1)
            return
        flow = float(np.median(np.hypot(*(tracks.points - tracks.past).T))) / self.width
        if flow > MIN_FLOW:
            self.pairs.append(TrackedPair(tracks.points, tracks.past))
        wanted = apart * min(max(FLOW / max(flow, 1e-3), 0.5), 2.0)
        self._stride = min(max(round(wanted), 1), _MAX_PAIR)
