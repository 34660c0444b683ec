"""A drive in a folder: images, ``gyro.csv``, ``wheels.csv``, and ``times.csv`` if need be.

The tables are those of ``navfw perceive --gyro`` and ``--times``; that of the wheels has the time
and the angles ``left`` and ``right`` [rad]. Both count time as the images do, or from the first.
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

_GYRO, _WHEELS, _TIMES = "gyro.csv", "wheels.csv", "times.csv"
_NEEDED = {
    _GYRO: f"a gyro: there is no {_GYRO} (time [s], yaw_rate [rad/s])",
    _WHEELS: f"wheels: there is no {_WHEELS} (time [s], left, right: angles [rad])",
}
"""What a folder lacks without each of the tables."""
_SIDES = ("left", "right")
_ANGLES = TableFormat((TIME, *_SIDES), 3, TIME_NAMES | {side: side for side in _SIDES})


class FolderDrive:
    """What the sensors in ``path`` measured, as of a ``Bag``; for a single iteration.

    Raises:
        InputError: a table is missing or wrong, or there are no images.

    """

    def __init__(self, path: Path) -> None:
        self.path, self.file = path, shown_path(path)
        missing = [what for name, what in _NEEDED.items() if not is_file(path / name)]
        if missing:
            raise ConfigError("a map needs " + "; and ".join(missing), file=self.file)
        listed = load_image_times(path / _TIMES) if is_file(path / _TIMES) else None
        self._images = open_source([path], listed=listed)
        read = load_gyro_record(path / _GYRO)
        record = read.on_clock_of(self._images)
        angles = TimedTable(path / _WHEELS, _ANGLES).array(TIME, *_SIDES)
        angles = angles[np.isfinite(angles).all(axis=1)]
        self.joints = angles - [float(read.times[0] - record.times[0]), 0.0, 0.0]
        self.gyro = np.column_stack([record.times, record.rates])
        self.odometry = np.empty((0, 4))
        self.duration = max(self._images.duration, float(self.joints[-1:, 0].sum()))
        self.notes = [*self._images.notes, *record.notes]

    def each_image(self) -> Generator[BagImage]:
        """The images in the order of their times."""
        for item in self._images:
            height, width = item.image.shape[:2]
            fields = {"encoding": "bgr8", "height": height, "width": width, "step": 3 * width}
            image = SimpleNamespace(**fields, data=item.image.ravel())
            yield BagImage(item.name, item.time, item.time, image)
