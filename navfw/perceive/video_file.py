"""Frames of a video file with their times, upright."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from navfw.config.image_file import MAX_PIXELS
from navfw.config.input_file import open_input, shown_path
from navfw.errors import InputError
from navfw.numerics import Image
from navfw.process.process_resources import redirected

FRAME_RATE = 10.0
"""Frame rate assumed if none is known [1/s]."""
FRAME_RATES = (0.01, 10_000.0)
"""Least and largest frame rate [1/s]."""
_ONE_THREAD = (cv2.CAP_PROP_N_THREADS, 1)
"""Others write messages when nobody listens."""
_FRAME_SIZE = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
_MIN_RATE = 5.0
"""Frame rate [1/s] below which what a file says is doubted: cameras that move take more."""
_FEW_FRAMES = 5
"""Frames by which a container's length may be wrong: it is an estimate."""


class VideoFile:
    """A video, for a single iteration; telephones turn theirs by a flag, which is obeyed.

    ``rate`` [1/s] is ``fps`` if given, otherwise the file's, assumed unless ``rate_known``;
    ``promised`` the number of frames by the file, 0 if it does not say it. ``notes`` are remarks
    for the user.

    Raises:
        InputError: the file is no readable video, or its frames are too large.

    """

    def __init__(self, path: Path, fps: float | None) -> None:
        self._path = path
        self._fps = fps
        self.notes: list[str] = []
        with (
            open_input(path),
            tempfile.TemporaryFile() as said,
            redirected(said.fileno(), 2),
        ):
            self._capture = cv2.VideoCapture(str(path), cv2.CAP_ANY, _ONE_THREAD)
        width, height = (self._capture.get(side) for side in _FRAME_SIZE)
        if not (self._capture.isOpened() and width * height > 0.0):
            raise InputError(
                "is not a readable video or image; if the recording was cut off, its index is "
                "missing: copy it again, or save it as .mp4 with another program",
                file=shown_path(path),
            )
        if width * height > MAX_PIXELS:
            what = f"the video's frames are too large: {width:.0f} x {height:.0f} pixels"
            raise InputError(f"{what}, at most {MAX_PIXELS}", file=shown_path(path))
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
        turned = int(self._capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
        if turned:
            self.notes.append(f"the video is turned by {turned} degrees, as its file says")
        self.rate_known = True
        self.rate = self._frame_rate()
        self.promised = max(int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0)

    def frames(self) -> Iterator[tuple[float, Image]]:
        """Time [s] since the first frame and image (height, width, 3) BGR of each frame.

        Raises:
            InputError: there is no readable frame.

        """
        count, first, last = 0, 0.0, 0.0
        damaged = list[float]()
        try:
            with tempfile.TemporaryFile() as said:
                while True:
                    before = said.tell()
                    with redirected(said.fileno(), 2):
                        good, image = self._capture.read()
                    if not good:
                        break
                    # the frame rate of telephones varies: the file has the time of each frame
                    stamp = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
                    first = first if count else stamp
                    last = self._time(count, stamp - first, last)
                    damaged += [last] if said.seek(0, os.SEEK_END) > before else []
                    yield last, np.asarray(image, np.uint8)
                    count += 1
        finally:
            self._capture.release()
        if count == 0:
            raise InputError("is a video without a readable frame", file=shown_path(self._path))
        if self.promised > count + _FEW_FRAMES:
            self.notes.append(
                f"the video ends early: only {count} of {self.promised} frames could be read, "
                f"its first {last:.1f} s are used"
            )
        if damaged:
            what = (
                f"the video is damaged: its decoder met errors at {len(damaged)} of {count} frames"
            )
            self.notes.append(f"{what}, from {damaged[0]:.1f} s on; its images may be wrong there")

    def _time(self, count: int, stamp: float, last: float) -> float:
        """Time [s] of frame ``count``; by the rate if it was given or the ``stamp`` is of no use.

        A usable stamp comes after ``last``, the frame before, by less than a whole video.
        """
        if self._fps is not None:
            return count / self._fps
        if count == 0 or last < stamp < last + 60.0:
            return stamp
        return last + 1.0 / self.rate

    def _frame_rate(self) -> float:
        if self._fps is not None:
            return self._fps
        rate = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.rate_known = math.isfinite(rate) and _MIN_RATE <= rate <= FRAME_RATES[1]
        if self.rate_known:
            return rate
        if FRAME_RATES[0] <= rate < _MIN_RATE:
            what = f"the video says {rate:g} images a second, few for a camera that moves"
            self.notes.append(f"{what}: times are by that, or give --fps")
            return rate
        self.notes.append(f"the video has no frame rate: {FRAME_RATE:g} images a second assumed")
        return FRAME_RATE
