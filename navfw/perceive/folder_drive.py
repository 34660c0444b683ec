"""Read a drive from a folder: images, ``gyro.csv``, ``wheels.csv``, and ``times.csv`` if need be.

The tables are those of ``navfw perceive --gyro`` and ``--times``; that of the wheels has the time
and the angles ``left`` and ``right`` [rad]. Both have the clock of the images, or count from the
first image.
"""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from navfw.config.input_file import is_file, shown_path
from navfw.errors import ConfigError
from navfw.perceive.image_sources import open_source
from navfw.perceive.image_times import load_image_times
from navfw.perceive.motion_record import load_gyro_record
from navfw.perceive.timed_table import TIME, TIME_NAMES, TableFormat, TimedTable
from navfw.recording.bag_reader import BagImage
from navfw.recording.bag_topics import unwrapped

_GYRO, _WHEELS, _TIMES = "gyro.csv", "wheels.csv", "times.csv"
_SIDES = ("left", "right")
_ANGLES = TableFormat((TIME, *_SIDES), 3, TIME_NAMES | {side: side for side in _SIDES})


class FolderDrive:
    """The sensor data in the folder ``path``, with the attributes of a ``Bag``; iterable once.

    Raises:
        InputError: a table is wrong, there are no images, or their times are not known.

    """

    def __init__(self, path: Path) -> None:
        self.path, self.file = path, shown_path(path)
        has = {name: is_file(path / f"{name}.csv") for name in ("gyro", "wheels", "times")}
        listed = load_image_times(path / _TIMES) if has["times"] else None
        self._images = open_source([path], listed=listed)
        if not (has["gyro"] or has["wheels"] or self._images.rate_known):
            what = f"the times of the images are not known: write {_TIMES} (time [s], file)"
            raise ConfigError(what, file=self.file)
        angles = np.empty((0, 3))
        if has["wheels"]:
            angles = TimedTable(path / _WHEELS, _ANGLES).array(TIME, *_SIDES)
            angles = angles[np.isfinite(angles).all(axis=1)]
            angles[:, 1:] = unwrapped(angles[:, 1:])
        self.gyro, self.odometry = np.empty((0, 4)), np.empty((0, 4))
        self.notes, offset = list(self._images.notes), 0.0
        self.assumed = list(self._images.assumed)
        if has["gyro"]:
            read = load_gyro_record(path / _GYRO).without_offsets()
            record = read.on_clock_of(self._images)
            offset = float(read.times[0] - record.times[0])
            self.gyro = np.column_stack([record.times, record.rates])
            self.notes += record.notes
            self.assumed += record.assumed
        elif len(angles) and self._images.start is not None:
            offset = self._images.start if angles[-1, 0] > self._images.start else 0.0
        self.joints = angles - [offset, 0.0, 0.0]
        self.duration = max(self._images.duration, float(self.joints[-1:, 0].sum()))

    def each_image(self) -> Generator[BagImage]:
        """Yield the images in the order of their times."""
        for item in self._images:
            height, width = item.image.shape[:2]
            fields = {"encoding": "bgr8", "height": height, "width": width, "step": 3 * width}
            image = SimpleNamespace(**fields, data=item.image.ravel())
            yield BagImage(item.name, item.time, item.time, image)
