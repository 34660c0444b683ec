"""Where pictures go: a folder of PNG files or a video, whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2

from navfw.errors import InputError
from navfw.perceive.sources import Source
from navfw.signals import Image

__all__ = ["Output", "open_output"]

_CODECS = {".mp4": "mp4v", ".m4v": "mp4v", ".avi": "MJPG"}
_OURS = re.compile(r"view-[0-9]{5,}\.png")


class Output:
    """A context manager that takes pictures; leaving it with an exception leaves nothing."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self._count = 0

    def __enter__(self) -> Self:
        parent = self.target.absolute().parent
        try:
            parent.mkdir(parents=True, exist_ok=True)
            self._work = Path(tempfile.mkdtemp(prefix=f".{self.target.name}.", dir=parent))
            self._work.chmod(0o755)
        except OSError as error:
            raise _unwritable(self.target, error) from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._finish()
            if kind is None:
                self._move_into_place()
        except OSError as failure:
            raise _unwritable(self.target, failure) from failure
        finally:
            shutil.rmtree(self._work, ignore_errors=True)

    def add(self, picture: Image) -> None:
        """Take the next picture; all must have one size."""
        self._count += 1
        self._write(picture)

    def _write(self, picture: Image) -> None:
        raise NotImplementedError

    def _finish(self) -> None:
        pass

    def _move_into_place(self) -> None:
        raise NotImplementedError


class _Folder(Output):
    def _write(self, picture: Image) -> None:
        path = self._work / f"view-{self._count:05d}.png"
        if not cv2.imwrite(str(path), picture):
            raise InputError("cannot be written", file=self.target)

    def _move_into_place(self) -> None:
        if self.target.exists():
            _refuse_foreign(self.target)
            shutil.rmtree(self.target)
        self._work.rename(self.target)


class _Film(Output):
    def __init__(self, target: Path, rate: float) -> None:
        super().__init__(target)
        self._rate = rate
        self._film: cv2.VideoWriter | None = None

    def _write(self, picture: Image) -> None:
        if self._film is None:
            codec = _CODECS[self.target.suffix.lower()]
            self._film = cv2.VideoWriter(
                str(self._work / self.target.name),
                cv2.VideoWriter.fourcc(*codec),
                self._rate,
                (picture.shape[1], picture.shape[0]),
            )
            if not self._film.isOpened():
                raise InputError("OpenCV here cannot write such a video", file=self.target)
        self._film.write(picture)

    def _finish(self) -> None:
        if self._film is not None:
            self._film.release()

    def _move_into_place(self) -> None:
        # umask applies to what others may read, as if written in place
        with contextlib.suppress(OSError):
            (self._work / self.target.name).chmod(0o644)
        (self._work / self.target.name).replace(self.target)


def open_output(target: Path, source: Source) -> Output:
    """Where to draw: an ``.mp4`` or ``.avi``, else a folder. An earlier one is replaced.

    Raises:
        InputError: the target holds something else, or is what is being read.

    """
    suffix = target.suffix.lower()
    if suffix in _CODECS:
        if target.is_dir():
            raise InputError("is a folder, not a video", file=target)
        if source.reads(target):
            raise InputError("is what is being read; choose another --overlay", file=target)
        return _Film(target, min(max(source.rate, 1.0), 120.0))
    if suffix in {".mov", ".mkv", ".webm", ".gif", ".png", ".jpg", ".jpeg"}:
        raise InputError(
            "is neither .mp4 nor .avi, nor a folder's name", file=target, key="--overlay"
        )
    _refuse_foreign(target)
    return _Folder(target)


def _refuse_foreign(target: Path) -> None:
    if not os.path.lexists(target):
        return
    if not target.is_dir():
        raise InputError("is a file; the pictures need a folder", file=target)
    foreign = sorted(e.name for e in target.iterdir() if not _OURS.fullmatch(e.name))
    if foreign:
        raise InputError(
            f"holds {foreign[0]!r}, so it is not replaced; choose another --overlay", file=target
        )


def _unwritable(target: Path, error: OSError) -> InputError:
    return InputError(f"cannot be written: {error.strerror or error}", file=target)
