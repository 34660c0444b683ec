"""Read image sequences: a folder, a video file, or image files in natural order."""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from navfw.assumption import Assumption
from navfw.config.image_file import MAX_PIXELS, read_image
from navfw.config.input_file import is_file, is_folder, no_such_file, open_input, shown_path
from navfw.errors import InputError
from navfw.lenses import CameraCalibration, Undistortion
from navfw.numerics import Image
from navfw.perceive.image_times import ImageTimes, natural_key, require_order, times_in_names
from navfw.process.process_resources import redirected
from navfw.recording.image_messages import BITS
from navfw.recording.run_folder import FILES, RESULT, is_bag

FRAME_RATE = 10.0
"""Frame rate assumed if none is known [1/s]."""
FRAME_RATES = (0.01, 10_000.0)
"""Least and largest frame rate [1/s]."""
_ONE_THREAD = (cv2.CAP_PROP_N_THREADS, 1)
"""Limits decoders to one thread: others write messages that are not caught."""
_FRAME_SIZE = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
_MIN_RATE = 5.0
"""Frame rate [1/s] below which a file's value is doubted: moving cameras record faster."""
_FEW_FRAMES = 5
"""Frames by which a container's length may be wrong: it is an estimate."""

DeepImage: TypeAlias = npt.NDArray[np.uint8 | np.uint16]
"""An image (height, width, 3) of 8 or 16 bits."""


IMAGES = frozenset(
    {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".pnm", ".webp"}
    | {".heic", ".heif", ".hif", ".avif"}
)
"""Suffixes of image files; files of HEIC and AVIF are refused with a hint."""
_VIDEOS = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".wmv"})
"""Suffixes of video files."""
_STREAMS = frozenset({".h264", ".264", ".h265", ".265", ".hevc", ".mjpeg", ".mjpg"})
"""Suffixes of encoded frames without times: a decoder only guesses their rate."""
MAX_GAP = 0.5
"""Time [s] without an image after which images are not compared with those before, unless it is
less than ``_GAP_STEPS`` of the usual interval."""
_GAP_STEPS = 3.5
_SAMPLES = 9  # number of images from which the range of pixels of more than 8 bits is found
_NAMED = 3  # number of things of a kind that a note names


@dataclass(frozen=True, slots=True)
class SourceImage:
    """An image of a source: ``image`` (height, width, 3) uint8 BGR, at ``time`` [s].

    ``after_gap`` is True if the image before it is too old for comparing the two.
    """

    name: str
    time: float
    image: Image
    after_gap: bool = False


class ImageSource:
    """Images of the most frequent size in the order of time, to be iterated once.

    ``rate`` [1/s] is the usual frame rate, assumed if ``rate_known`` is False; ``total`` the number
    of images, 0 if unknown; ``duration`` [s] the time from the first to the last, inf if unknown;
    ``start`` [s] the time of the first image if the names of the files or a list give it, else
    None. ``notes`` are remarks for the user, on irregularities found while reading; ``assumed`` the
    choices made for them. With a ``calibration``, images are without lens distortion, and ``hfov``
    [rad] is their horizontal field of view from the first image on; otherwise it is None.
    """

    def __init__(
        self, rate: float, total: int, notes: Sequence[str], calibration: CameraCalibration | None
    ) -> None:
        self.rate = rate
        self.total = total
        self.duration = (total - 1) / rate if total else math.inf
        self.rate_known = True
        self.notes = list(notes)
        self.assumed: list[Assumption] = []
        self.start: float | None = None
        self.hfov: float | None = None
        self._shape: tuple[int, ...] | None = None
        self._calibration = calibration

    def __iter__(self) -> Iterator[SourceImage]:
        """Yield the images; times count from the first one.

        Raises:
            InputError: an image cannot be read, there are fewer than two of one size, or the
                calibration is not for them.

        """
        first: SourceImage | None = None
        others: list[str] = []
        straighten: Undistortion | None = None
        longest = max(MAX_GAP, _GAP_STEPS / self.rate)
        gaps: list[str] = []
        last, count = 0.0, 0
        for item in self._items():
            if self._shape is not None and item.image.shape != self._shape:
                others.append(f"{item.name} is {_size(item.image.shape)}")
                continue
            if first is None:
                first, last, self._shape = item, item.time, item.image.shape
                if self._calibration is not None:
                    straighten = Undistortion(self._calibration, *item.image.shape[1::-1])
                    self.hfov = straighten.hfov
                    self.notes += straighten.notes
            image = item.image if straighten is None else straighten.apply(item.image)
            after_gap = item.time - last > longest
            if after_gap:
                gaps.append(f"{item.time - last:.2f} s before {item.name}")
            last = item.time
            count += 1
            yield replace(item, image=image, after_gap=after_gap)
        if others and self._shape is not None:
            what = f"{len(others)} images are not {_size(self._shape)} as the others, and left out"
            self.notes.append(f"{what}: {_listed(others)}")
        if gaps:
            self.notes.append(f"not compared across gaps in time: {_listed(gaps)}")
        if count < 2:
            sizes = f" of one size: {_listed(others)}" if others else ""
            raise InputError(f"{self} has {count or 'no'} image{sizes}; flow needs at least two")

    def _items(self) -> Iterator[SourceImage]:
        raise NotImplementedError


class _Files(ImageSource):
    def __init__(
        self,
        paths: Sequence[Path],
        fps: float | None,
        calibration: CameraCalibration | None,
        listed: ImageTimes | None,
        named: str,
    ) -> None:
        super().__init__(FRAME_RATE if fps is None else fps, len(paths), (), calibration)
        self._paths, self._named = paths, named
        times = listed.of(paths) if listed is not None else None
        self.assumed += listed.assumed if listed is not None else ()
        if times is None and fps is None:
            times = times_in_names(paths)
            if times is not None:
                what = Assumption("times", "those in the names of the images", "", "--fps, --times")
                self.assumed.append(what)
        if times is None or len(times) < 2:
            self._times = [k / self.rate for k in range(len(paths))]
            self.rate_known = fps is not None
            if fps is None:
                self.assumed.append(assumed_rate(self.rate, "no file says when they were taken"))
        else:
            self.start = times[0]
            self._times = [time - times[0] for time in times]
            self.rate = 1.0 / float(np.median(np.diff(self._times)))
        self.duration = self._times[-1]
        self._bits = self._brighter = 0

    def __str__(self) -> str:
        return self._named

    def _items(self) -> Iterator[SourceImage]:
        """Yield the readable images; the others are left out, if at least two remain."""
        broken: list[InputError] = []
        shapes = Counter(sample.shape for sample in self._samples())
        self._shape = shapes.most_common(1)[0][0] if shapes else None
        for path, time in zip(self._paths, self._times, strict=True):
            try:
                image = self._in_8_bits(_read(path))
            except InputError as error:
                broken.append(error)
                continue
            yield SourceImage(path.name, time, image)
        if len(self._paths) - len(broken) < 2 and broken:
            raise broken[0]
        if broken:
            which = _listed([str(error) for error in broken])
            self.notes.append(f"{len(broken)} of {len(self._paths)} images left out: {which}")
        if self._brighter:
            what = f"{self._brighter} images have pixels beyond {self._bits} bits, cut off"
            self.notes.append(what)

    def _in_8_bits(self, image: DeepImage) -> Image:
        """Scale ``image`` by the least number of bits that holds the samples of the sequence.

        Pixels of other images that are brighter are cut off.
        """
        if image.dtype == np.uint8:
            return np.asarray(image, np.uint8)
        if not self._bits:
            deep = (sample for sample in self._samples() if sample.dtype == np.uint16)
            brightest = max(int(sample.max()) for sample in (image, *deep))
            self._bits = next(bits for bits in BITS if brightest < 1 << bits)
            what = f"images of 16 bits with values up to {brightest}"
            self.notes.append(f"{what}: taken as {self._bits} bits")
        white = (1 << self._bits) - 1
        self._brighter += int(image.max()) > white
        return np.asarray(np.minimum(image, white) >> (self._bits - 8), dtype=np.uint8)

    def _samples(self) -> Iterator[DeepImage]:
        """Yield readable images spread over the sequence."""
        steps = np.linspace(0, len(self._paths) - 1, min(_SAMPLES, len(self._paths)))
        for k in sorted({round(step) for step in steps.tolist()}):
            with contextlib.suppress(InputError):  # reported when it is its turn
                yield _read(self._paths[k])


class _Video(ImageSource):
    """A video; it is turned upright if its file says so, as those of telephones."""

    def __init__(
        self, path: Path, fps: float | None, calibration: CameraCalibration | None
    ) -> None:
        self._path, self._fps = path, fps
        with open_input(path), tempfile.TemporaryFile() as f, redirected(f.fileno(), 2):
            self._capture = cv2.VideoCapture(str(path), cv2.CAP_ANY, _ONE_THREAD)
        width, height = (self._capture.get(side) for side in _FRAME_SIZE)
        if not (self._capture.isOpened() and width * height > 0.0):
            what = "is not a readable video or image; if the recording was cut off, its index is"
            how = "missing: copy it again, or save it as .mp4 with another program"
            raise InputError(f"{what} {how}", file=shown_path(path))
        if width * height > MAX_PIXELS:
            what = f"the video's frames are too large: {width:.0f} x {height:.0f} pixels"
            raise InputError(f"{what}, at most {MAX_PIXELS}", file=shown_path(path))
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
        turned = int(self._capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
        notes = [f"the video is turned by {turned} degrees, as its file says"] if turned else []
        total = max(int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
        rate = self._capture.get(cv2.CAP_PROP_FPS) if fps is None else fps
        known = math.isfinite(rate) and _MIN_RATE <= rate <= FRAME_RATES[1]
        known = fps is not None or (known and path.suffix.lower() not in _STREAMS)
        if not known and FRAME_RATES[0] <= rate < _MIN_RATE:
            notes.append(f"the video says {rate:g} images a second, few for a camera that moves")
        elif not (known or FRAME_RATES[0] <= rate <= FRAME_RATES[1]):
            rate = FRAME_RATE
        super().__init__(rate, total, notes, calibration)
        self.rate_known = known
        if not known:
            self.assumed.append(assumed_rate(rate, "the video does not say another"))

    def __str__(self) -> str:
        return str(self._path)

    def _items(self) -> Iterator[SourceImage]:
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
                    yield SourceImage(f"frame {count}", last, np.asarray(image, np.uint8))
                    count += 1
        finally:
            self._capture.release()
        if count == 0:
            raise InputError("is a video without a readable frame", file=shown_path(self._path))
        if self.total > count + _FEW_FRAMES:
            what = f"only {count} of {self.total} frames could be read"
            self.notes.append(f"the video ends early: {what}, its first {last:.1f} s are used")
        if damaged:
            what = f"its decoder met errors at {len(damaged)} of {count} frames"
            where = f"from {damaged[0]:.1f} s on; its images may be wrong there"
            self.notes.append(f"the video is damaged: {what}, {where}")

    def _time(self, count: int, stamp: float, last: float) -> float:
        """Return the time [s] of frame ``count``; by the rate if given, or ``stamp`` is unusable.

        A usable stamp comes after ``last``, the frame before, by less than a whole video.
        """
        if self._fps is not None:
            return count / self._fps
        if count == 0 or last < stamp < last + 60.0:
            return stamp
        return last + 1.0 / self.rate


def assumed_rate(rate: float, reason: str) -> Assumption:
    """Return the assumption of ``rate`` images per second, for ``reason``."""
    return Assumption("frame rate", f"{rate:g} images a second", reason, "--fps, --times")


def open_source(
    paths: Sequence[Path],
    fps: float | None = None,
    calibration: CameraCalibration | None = None,
    listed: ImageTimes | None = None,
) -> ImageSource:
    """Open the images in ``paths``: one folder, one video, or image files.

    Image files are read in natural order (``image_2`` before ``image_10``), unless ``paths`` is not
    sorted alphabetically: then its order is kept. ``fps`` [1/s] overrides the frame rate of a video
    and time stamps in file names; ``listed`` are times of image files. With a ``calibration`` the
    lens distortion is removed.

    Raises:
        InputError: a path does not exist or cannot be read, there are no images, or they are not in
            the order of time.

    """
    low, high = FRAME_RATES
    if fps is not None and not low <= fps <= high:
        raise InputError(f"must be between {low:g} and {high:g}, got {fps:g}", key="--fps")
    for path in paths:
        if not is_file(path) and not is_folder(path):
            raise no_such_file(path)
    named = str(paths[0]) if len(paths) == 1 else "the list of files"
    if len(paths) == 1 and is_folder(paths[0]):
        paths, named = sorted(_images_in(paths[0])), f"the folder {paths[0]}"
    if len(paths) == 1 and paths[0].suffix.lower() not in IMAGES:
        if listed is not None:
            raise InputError("is for image files; a video has its own times", key="--times")
        return _Video(paths[0], fps, calibration)
    for path in paths:
        if is_folder(path) or path.suffix.lower() in _VIDEOS:
            what = "folder" if is_folder(path) else "video"
            raise InputError(f"give one {what}, or image files, not both", file=path)
    ordered = sorted(paths, key=natural_key) if [*paths] == sorted(paths) else list(paths)
    require_order(ordered)
    return _Files(ordered, fps, calibration, listed, named)


def _images_in(folder: Path) -> list[Path]:
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=folder) from None
    images = [e for e in entries if is_file(e) and e.suffix.lower() in IMAGES]
    if any(entry.name == RESULT for entry in entries):
        images = [image for image in images if image.name not in FILES]
        if not images:
            what = "is a run folder without images: its pictures are plans, not the camera's"
            raise InputError(f"{what}; see navfw report and navfw replay", file=folder)
    if images:
        return images
    others = sorted(
        e.name for e in entries if is_folder(e) or is_bag(e) or e.suffix.lower() in _VIDEOS
    )
    hint = f"; did you mean one of: {', '.join(others[:5])}?" if others else ""
    raise InputError(f"contains no images{hint}", file=folder)


def _read(path: Path) -> DeepImage:
    """Read the image in a file, upright by its EXIF data, with 8 or 16 bits."""
    return read_image(path, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)


def _listed(things: Sequence[str]) -> str:
    """Return the first of ``things``, and how many more there are."""
    more = [f"and {len(things) - _NAMED} more"] if len(things) > _NAMED else []
    return "; ".join([*things[:_NAMED], *more])


def _size(shape: Sequence[int]) -> str:
    return f"{shape[1]} x {shape[0]}"
