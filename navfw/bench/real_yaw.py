"""Yaw rates estimated on recorded sequences, beside those of the recording's gyro."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.input_file import is_file
from navfw.errors import ConfigError
from navfw.perceive.gyro_record import GyroRecord, load_gyro_record
from navfw.perceive.image_times import ImageTimes, load_image_times
from navfw.perceive.pair_result import PairResult
from navfw.signals import Array

_READINGS = "readings.csv"
"""File of a recording with a gyro: a row for each image, with its time and the gyro's rates."""

MIN_PAIRS = 10
"""Least number of pairs for a correlation."""


@dataclass(frozen=True, slots=True)
class RecordedGyro:
    """The ``times`` of a recording's images by name, and the ``record`` of its gyro."""

    times: ImageTimes
    record: GyroRecord


def recorded_gyro(folder: Path, images: Iterable[Path]) -> RecordedGyro | None:
    """The gyro of the recording in ``folder``; None without one.

    ``images`` are all images of the recording in their order.

    Raises:
        ConfigError: the readings are not one for each image.
        InputError: the readings cannot be read.

    """
    file = folder / _READINGS
    if not is_file(file):
        return None
    listed = load_image_times(file)
    names = [image.name for image in images]
    if len(names) != len(listed.times):
        raise ConfigError(
            f"expected a row for each of {len(names)} images, found {len(listed.times)}", file=file
        )
    by_name = dict(zip(names, listed.times, strict=True))
    return RecordedGyro(ImageTimes(listed.file, listed.times, by_name), load_gyro_record(file))


def yaw_rates(results: Iterable[PairResult], start: float, record: GyroRecord) -> Array:
    """Yaw rates (n, 2) [rad/s] of pairs: by the camera, by the gyro; positive to the left.

    ``start`` [s] is the time of the first image on the gyro's clock. Pairs in gaps of the
    ``record`` are left out.
    """
    rows = []
    for result in results:
        end = start + result.time
        measured = record.rotation_between(end - result.dt, end)
        if measured is not None:
            rows.append((result.rotation_vector[2] / result.dt, measured[2] / result.dt))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def yaw_summary(rates: Array) -> dict[str, Any]:
    """Number of pairs, and correlation and slope of the camera's ``rates`` over the gyro's."""
    summary: dict[str, Any] = {"yaw_pairs": len(rates), "yaw_correlation": None, "yaw_slope": None}
    if len(rates) >= MIN_PAIRS and float(rates.std(axis=0).min()) > 0.0:
        camera, gyro = rates.T
        summary["yaw_correlation"] = round(float(np.corrcoef(camera, gyro)[0, 1]), 4)
        summary["yaw_slope"] = round(float(camera @ gyro / (gyro @ gyro)), 4)
    return summary
