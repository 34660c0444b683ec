"""Output of overlay images to a folder of PNG files or a video, replaced only when complete."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import cv2

from navfw.atomic import AtomicFolder, AtomicTarget
from navfw.errors import InputError
from navfw.perceive.image_sources import ImageSource
from navfw.signals import Image

__all__ = ["OverlayOutput", "open_output"]

_CODECS = {".mp4": "mp4v", ".m4v": "mp4v", ".avi": "MJPG"}
_OURS = re.compile(r"view-[0-9]{5,}\.png")


class OverlayOutput(Protocol):
    """Writer of images of one size; a context manager."""

    def add(self, picture: Image) -> None:
        """Append the next image."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


class _Pictures(AtomicFolder):
    def __init__(self, target: Path) -> None:
        super().__init__(target, _OURS, "--overlay")
        self._count = 0

    def add(self, picture: Image) -> None:
        self._count += 1
        if not cv2.imwrite(str(self.path / f"view-{self._count:05d}.png"), picture):
            raise InputError("is not writable", file=self.target)


class _Film(AtomicTarget):
    def __init__(self, target: Path, rate: float) -> None:
        super().__init__(target)
        self._rate = rate
        self._film: cv2.VideoWriter | None = None

    def add(self, picture: Image) -> None:
        if self._film is None:
            codec = _CODECS[self.target.suffix.lower()]
            self._film = cv2.VideoWriter(
                str(self.path / self.target.name),
                cv2.VideoWriter.fourcc(*codec),
                self._rate,
                (picture.shape[1], picture.shape[0]),
            )
            if not self._film.isOpened():
                raise InputError(
                    "the installed OpenCV cannot write this kind of video", file=self.target
                )
        self._film.write(picture)

    def _finish(self) -> None:
        if self._film is not None:
            self._film.release()

    def _move_into_place(self) -> None:
        # temporary files are private: give the file the usual permissions
        with contextlib.suppress(OSError):
            (self.path / self.target.name).chmod(0o644)
        (self.path / self.target.name).replace(self.target)


def open_output(target: Path, source: ImageSource) -> OverlayOutput:
    """Open a new ``.mp4`` or ``.avi``, otherwise a folder whose overlay images are replaced.

    Raises:
        InputError: the target is an existing file, a folder with other files, or of another type.

    """
    suffix = target.suffix.lower()
    if suffix in _CODECS:
        if target.is_dir():
            raise InputError("is a folder, not a video", file=target)
        if target.exists():
            raise InputError("exists; remove it, or choose another --overlay", file=target)
        return _Film(target, min(max(source.rate, 1.0), 120.0))
    if suffix in {".mov", ".mkv", ".webm", ".gif", ".png", ".jpg", ".jpeg"}:
        raise InputError(
            "is neither .mp4 nor .avi, nor the name of a folder", file=target, key="--overlay"
        )
    return _Pictures(target)
