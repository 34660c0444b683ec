"""Write pictures as a video that browsers play: H.264 in MP4, complete or not at all."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.extras import extra_imports
from navfw.errors import InputError
from navfw.numerics import Image
from navfw.process.atomic import AtomicTarget, output_file

VIDEO_SUFFIX = ".mp4"
"""The suffix that a video's file must have."""
_OPTIONS = {"crf": "26", "preset": "veryfast"}
"""Quality (0 to 51, less is better) and effort of the encoder."""


def check_video(target: Path, option: str) -> None:
    """Check before the work that a video can be written to ``target``, the value of ``option``.

    Raises:
        InputError: it has another suffix, or cannot be written.
        MissingExtraError: the library that writes videos is not installed.

    """
    if target.suffix.lower() != VIDEO_SUFFIX:
        what = f"expected a file {VIDEO_SUFFIX}, got {target.suffix or 'no suffix'}"
        raise InputError(what, file=target, key=option)
    output_file(target, option)
    _library(option)


class VideoOutput(AtomicTarget):
    """A context manager that writes pictures of one size as a video, replacing an earlier one.

    Of an odd width or height the last column or row is left out, as the colours are those of 2 x 2
    pixels. ``rate`` is the number of pictures per second of the video.

    Raises:
        InputError: as ``check_video``, or another process writes the target.
        MissingExtraError: the library that writes videos is not installed.

    """

    def __init__(self, target: Path, rate: float, option: str) -> None:
        check_video(target, option)
        super().__init__(target, option)
        self._rate = Fraction(rate).limit_denominator(1000)
        self._video: Any = None
        self._stream: Any = None

    def add(self, picture: Image) -> None:
        """Append a picture (height, width, 3), blue, green, red."""
        av = _library(self.option)
        picture = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
        if self._video is None:
            options = {"movflags": "faststart"}
            self._video = av.open(self.path / self.target.name, "w", options=options)
            self._stream = self._video.add_stream("libx264", rate=self._rate, options=_OPTIONS)
            self._stream.height, self._stream.width = picture.shape[:2]
            self._stream.pix_fmt = "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
        self._video.mux(self._stream.encode(frame))

    def _finish(self) -> None:
        if self._video is not None:
            self._video.mux(self._stream.encode(None))
            self._video.close()

    def _move_into_place(self) -> None:
        (self.path / self.target.name).replace(self.place)


def _library(option: str) -> Any:
    with extra_imports("video", key=option):
        import av
    return av
