"""Yield the images of a webcam while they come."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from navfw.errors import InputError
from navfw.lenses import CameraCalibration
from navfw.perceive.image_sources import FRAME_RATE, FRAME_RATES, ImageSource, SourceImage
from navfw.process.process_resources import redirected


class Webcam(ImageSource):
    """Images of the webcam ``number`` until an interruption; each has the time when it came.

    With a ``calibration`` lens distortion is removed.

    Raises:
        InputError: there is no such webcam, or another program uses it.

    """

    def __init__(self, number: int, calibration: CameraCalibration | None) -> None:
        with tempfile.TemporaryFile() as f, redirected(f.fileno(), 2):
            self._capture = cv2.VideoCapture(number)
        if not self._capture.isOpened():
            what = f"no webcam answers as number {number}; the first one is 0"
            raise InputError(f"{what}, and no other program may use it", key="--camera")
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the newest image, not the oldest
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        usual = math.isfinite(rate) and FRAME_RATES[0] <= rate <= FRAME_RATES[1]
        super().__init__(rate if usual else FRAME_RATE, 0, (), calibration)
        self._number = number

    def __str__(self) -> str:
        return f"webcam {self._number}"

    def _items(self) -> Iterator[SourceImage]:
        begun, count = time.monotonic(), 0
        try:
            while (read := self._capture.read())[0]:
                now = time.monotonic() - begun
                yield SourceImage(f"image {count}", now, np.asarray(read[1], np.uint8))
                count += 1
        finally:
            self._capture.release()
        self.notes.append("the webcam gives no more images")


def webcam_number(camera: str | None, recorded: Sequence[str]) -> int:
    """Return the number of the webcam that ``--camera`` names in place of a source.

    Raises:
        InputError: it is no number; or there are options that are for ``recorded`` images.

    """
    if camera is None or not camera.isdecimal():
        what = "expected a folder of images, a video, image files or a bag"
        raise InputError(f"{what}; for a webcam, --camera N", key="SOURCE")
    if recorded:
        raise InputError("is for recorded images, not for a webcam", key=f"--{recorded[0]}")
    return int(camera)
