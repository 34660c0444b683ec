"""What records of the camera's motion have in common: gyro rates and poses."""

from __future__ import annotations

from typing import Protocol, Self

from navfw.errors import InputError
from navfw.perceive.image_sources import ImageSource
from navfw.signals import Array

_MAX_DURATION = 86_400.0
"""Longest recording [s], where its length is unknown: a day."""


class MotionRecord(Protocol):
    """A record that tells the camera's rotation between two times."""

    @property
    def times(self) -> Array:
        """Times (n,) of the readings, ascending [s]."""
        ...

    @property
    def measured(self) -> frozenset[str]:
        """Names of the rates of rotation ("yaw_rate", ...) that it has."""
        ...

    @property
    def source(self) -> str:
        """What measured the rotation, such as "gyro"."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the user."""
        ...

    @property
    def file(self) -> str:
        """The file that it was read from."""
        ...

    @property
    def option(self) -> str:
        """The command line option that names the file."""
        ...

    def rotation_between(self, begin: float, end: float) -> Array | None:
        """Rotation vector (3,) [rad] about base_link's x, y, z; None without readings for it."""
        ...

    def translation_between(self, begin: float, end: float) -> Array | None:
        """Translation (3,) [m] along base_link's axes at ``begin``; None if it is not known."""
        ...

    def shifted(self, seconds: float) -> Self:
        """The same record with times later by ``seconds``."""
        ...


def on_clock_of(images: ImageSource, record: MotionRecord) -> MotionRecord:
    """``record`` with times since the first of the ``images``.

    Its times are on the clock of the images' names or list where these overlap, otherwise they
    already count from the first image.

    Raises:
        InputError: the record and the images have no time in common, or the images' frame rate is
            only assumed.

    """
    first, last = float(record.times[0]), float(record.times[-1])
    start, duration = images.start, min(images.duration, _MAX_DURATION)
    clock = None
    if start is not None and first < start + duration and last > start:
        clock = start
    elif not (first < duration and last > 0.0):
        named = (
            "" if start is None else f" ({start:.2f} to {start + duration:.2f} s on their clock)"
        )
        raise InputError(
            f"expected readings within the time of the images, 0 to {duration:.2f} s{named}; got "
            f"{first:.2f} to {last:.2f} s. Count times from the first image, or give those of "
            "the images by their names or --times",
            file=record.file,
            key=record.option,
        )
    if not images.rate_known:
        raise InputError(
            "the times of the images are not known, so readings cannot be assigned to them; give "
            "--fps or --times",
            file=record.file,
            key=record.option,
        )
    return record if clock is None else record.shifted(-clock)
