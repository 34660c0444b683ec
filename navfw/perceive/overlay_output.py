"""Output of overlay images to a folder of PNG files or a video, replaced only when complete."""

from __future__ import annotations

import re
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import cv2

from navfw.errors import InputError
from navfw.perceive.image_sources import ImageSource
from navfw.process.atomic import AtomicFolder
from navfw.recording.video_output import VIDEO_SUFFIX, VideoOutput
from navfw.signals import Image

_NO_FOLDERS = {".avi", ".m4v", ".mov", ".mkv", ".webm", ".gif", ".png", ".jpg", ".jpeg"}
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


def open_output(target: Path, source: ImageSource) -> OverlayOutput:
    """Open a new ``.mp4``, otherwise a folder whose overlay images are replaced.

    Raises:
        InputError: the target is an existing file, a folder with other files, or of another type.
        MissingExtraError: the library that writes videos is not installed.

    """
    suffix = target.suffix.lower()
    if suffix == VIDEO_SUFFIX:
        if target.is_file():
            raise InputError("exists; remove it, or choose another --overlay", file=target)
        return VideoOutput(target, min(max(source.rate, 1.0), 120.0), "--overlay")
    if suffix in _NO_FOLDERS:
        expected = f"is neither a {VIDEO_SUFFIX} nor the name of a folder"
        raise InputError(expected, file=target, key="--overlay")
    return _Pictures(target)
