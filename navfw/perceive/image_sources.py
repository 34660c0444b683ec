"""Image sequences: a folder, a video file, or image files in natural order."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from navfw.config.image_file import MAX_PIXELS, read_image
from navfw.config.input_file import is_file, is_folder, no_such_file, open_input, shown_path
from navfw.errors import InputError
from navfw.signals import Image

__all__ = [
    "FRAME_RATE",
    "IMAGES",
    "VIDEOS",
    "ImageSource",
    "SourceImage",
    "natural_key",
    "open_source",
]

IMAGES = frozenset(
    {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".pnm", ".webp"}
)
"""Suffixes of image files."""
VIDEOS = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".wmv"})
"""Suffixes of video files."""
FRAME_RATE = 10.0
"""Frame rate assumed if none is known [1/s]."""
_FRAME_RATES = (0.01, 10_000.0)
_MAX_VIDEO = 20_000_000_000
"""Largest size of a video file [byte]; it is read frame by frame."""
_FRAME_SIZE = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)


@dataclass(frozen=True, slots=True)
class SourceImage:
    """One image of a source: ``image`` (height, width, 3) uint8 BGR, at ``time`` [s]."""

    name: str
    time: float
    image: Image


class ImageSource:
    """Images of one size in the order of time, for a single iteration.

    ``rate`` [1/s] is the frame rate; ``notes`` are remarks for the user: assumptions, and
    irregularities found while reading.
    """

    def __init__(self, rate: float, notes: Sequence[str]) -> None:
        self.rate = rate
        self.notes = list(notes)

    def __iter__(self) -> Iterator[SourceImage]:
        """The images.

        Raises:
            InputError: an image cannot be read, sizes differ, or there are fewer than two.

        """
        first: SourceImage | None = None
        count = 0
        for item in self._items():
            if first is None:
                first = item
            elif item.image.shape != first.image.shape:
                raise InputError(
                    f"is {_size(item.image)}, but {first.name} is {_size(first.image)}: "
                    "all images must have one size",
                    file=item.name,
                )
            count += 1
            yield item
        if count < 2:
            raise InputError(f"{self} has {count or 'no'} image; flow needs at least two")

    def _items(self) -> Iterator[SourceImage]:
        raise NotImplementedError


class _Files(ImageSource):
    def __init__(self, paths: Sequence[Path], fps: float | None, named: str) -> None:
        notes: list[str] = []
        times = None if fps is not None else _times_in_names(paths)
        if times is None:
            rate = FRAME_RATE if fps is None else fps
            times = [i / rate for i in range(len(paths))]
            if fps is None:
                notes.append(f"no --fps given: {rate:g} images a second assumed")
        else:
            rate = (len(times) - 1) / (times[-1] - times[0])
            notes.append(f"times taken from the file names: {rate:.1f} images a second")
        super().__init__(rate, notes)
        self._paths, self._times, self._named = paths, times, named

    def __str__(self) -> str:
        return self._named

    def _items(self) -> Iterator[SourceImage]:
        for path, time in zip(self._paths, self._times, strict=True):
            yield SourceImage(path.name, time, np.asarray(read_image(path), np.uint8))


class _Video(ImageSource):
    def __init__(self, path: Path, fps: float | None) -> None:
        self._path = path
        with open_input(path, _MAX_VIDEO), _silent():
            self._film = cv2.VideoCapture(str(path))
        width, height = (self._film.get(side) for side in _FRAME_SIZE)
        if not (self._film.isOpened() and width * height > 0.0):
            raise InputError("is not a readable video or image", file=shown_path(path))
        if width * height > MAX_PIXELS:
            what = f"the video's frames are too large: {width:.0f} x {height:.0f} pixels"
            raise InputError(f"{what}, at most {MAX_PIXELS}", file=shown_path(path))
        rate, notes = fps, []
        if rate is None:
            rate = float(self._film.get(cv2.CAP_PROP_FPS))
            if not (math.isfinite(rate) and _FRAME_RATES[0] <= rate <= _FRAME_RATES[1]):
                rate = FRAME_RATE
                notes.append(f"the video has no frame rate: {rate:g} images a second assumed")
        super().__init__(rate, notes)

    def __str__(self) -> str:
        return str(self._path)

    def _items(self) -> Iterator[SourceImage]:
        promised = int(self._film.get(cv2.CAP_PROP_FRAME_COUNT))
        count = 0
        try:
            while True:
                with _silent():
                    good, image = self._film.read()
                if not good:
                    break
                yield SourceImage(f"frame {count}", count / self.rate, np.asarray(image, np.uint8))
                count += 1
        finally:
            self._film.release()
        if count == 0:
            raise InputError("is a video without a readable frame", file=self._path)
        # containers estimate their length; a difference of more than a few frames means truncation
        if promised > count + 5:
            self.notes.append(f"only {count} of {promised} frames of the video could be read")


def open_source(paths: Sequence[Path], fps: float | None = None) -> ImageSource:
    """The images in ``paths``: one folder, one video, or image files.

    Image files are read in natural order (``image_2`` before ``image_10``), unless ``paths`` is not
    sorted alphabetically: then its order is kept. ``fps`` [1/s] overrides the frame rate of a video
    and time stamps in file names.

    Raises:
        InputError: a path does not exist or cannot be read, or there are no images.

    """
    low, high = _FRAME_RATES
    if fps is not None and not low <= fps <= high:
        raise InputError(f"must be between {low:g} and {high:g}, got {fps:g}", key="--fps")
    for path in paths:
        if not is_file(path) and not is_folder(path):
            raise no_such_file(path)
    if len(paths) == 1 and is_folder(paths[0]):
        return _Files(_images_in(paths[0]), fps, f"the folder {paths[0]}")
    for path in paths:
        if is_folder(path):
            raise InputError("give one folder, or image files, not both", file=path)
    if len(paths) == 1 and paths[0].suffix.lower() not in IMAGES:
        return _Video(paths[0], fps)
    for path in paths:
        if path.suffix.lower() in VIDEOS:
            raise InputError("give one video, or image files, not both", file=path)
    ordered = list(paths)
    if ordered == sorted(ordered):
        ordered.sort(key=natural_key)
    return _Files(ordered, fps, str(paths[0]) if len(paths) == 1 else "the list of files")


def natural_key(path: Path) -> list[tuple[int, int, str]]:
    """Sort key of file names that compares the numbers in them by value."""
    return [
        (0, int(part), part) if part.isdigit() else (1, 0, part.lower())
        for part in re.split(r"([0-9]+)", path.name)
        if part
    ]


def _images_in(folder: Path) -> list[Path]:
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=folder) from None
    images = [e for e in entries if is_file(e) and e.suffix.lower() in IMAGES]
    if images:
        return sorted(images, key=natural_key)
    others = sorted(e.name for e in entries if is_folder(e) or e.suffix.lower() in VIDEOS)
    hint = f"; did you mean one of: {', '.join(others[:5])}?" if others else ""
    raise InputError(f"contains no images{hint}", file=folder)


def _times_in_names(paths: Sequence[Path]) -> list[float] | None:
    """Times [s] since the first image if all names are time stamps in seconds, otherwise None."""
    if len(paths) < 2 or not all(re.fullmatch(r"[0-9]+\.[0-9]+", path.stem) for path in paths):
        return None
    stamps = [float(path.stem) for path in paths]
    times = [stamp - stamps[0] for stamp in stamps]
    ascending = all(b > a for a, b in itertools.pairwise(times))
    return times if ascending else None


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Suppress the messages that video decoders write to stderr; errors are raised instead."""
    sys.stderr.flush()
    saved, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)


def _size(image: Image) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"
