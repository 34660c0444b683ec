"""Detection schedule: when to look for moving objects, as the search is the dearest stage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from navfw.signals import MovingObject

DetectionMode = Literal["full", "coarse", "idle"]
"""``full``: search the frame; ``coarse``: search it at low resolution first, and fully only if that
finds something; ``idle``: leave it out."""

QUIET_TIME = 2.0
"""Time without a detection [s] after which frames are searched coarsely, and every other one
not."""
NEAR = 0.9
"""Distance [m] below which moving objects are searched for over a shorter time between frames."""


class DetectionSchedule:
    """Searches every frame fully while something moves; else every other frame, coarsely.

    The price is a delay of a few frames when an object enters the view. With ``always_full`` every
    frame is searched fully.
    """

    def __init__(self, always_full: bool = False) -> None:
        self._always_full = always_full
        self.reset()

    def reset(self) -> None:
        """Back to the state before the first detection."""
        self._last_detection = -math.inf
        self._skipped = False
        self._nearest = math.inf

    @property
    def near(self) -> bool:
        """Whether the frame searched last showed a moving object that is near."""
        return self._nearest < NEAR

    def next_mode(self, time: float) -> DetectionMode:
        """How to search the next frame, of ``time`` [s]; to be called once a frame."""
        quiet = not self._always_full and time - self._last_detection > QUIET_TIME
        self._skipped = quiet and not self._skipped
        if self._skipped:
            return "idle"
        return "coarse" if quiet else "full"

    def update(self, detections: Sequence[MovingObject], time: float) -> None:
        """Set what the search of the frame of ``time`` [s] found."""
        if detections:
            self._last_detection = time
        self._nearest = min((detection.distance for detection in detections), default=math.inf)
