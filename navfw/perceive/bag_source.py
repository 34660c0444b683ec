"""A bag as a source: images, calibration and motion, and whether the camera moves as these say."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from navfw.camera_geometry.lens_models import CameraCalibration
from navfw.errors import InputError
from navfw.numerics import Array
from navfw.perceive.calibration import load_calibration
from navfw.perceive.image_sources import ImageSource, SourceImage
from navfw.perceive.motion_record import RATES, GyroRecord, gyro_record
from navfw.perceive.pair_motion import TrackImage, track_points
from navfw.perceive.working_size import WorkingSize
from navfw.process.atomic import scratch_folder
from navfw.recording.bag_contents import BagContents, camera_matrix, driven_way

_MOVED = (0.05, 0.03)
"""Way [m] or turn [rad] of the wheels after which images are compared."""
_STILL = 0.3
"""Median flow [px] up to which nothing has moved in an image."""
_LEAST = 10
"""Least number of comparisons for a verdict."""
_MOST = 150
"""Largest number of comparisons."""
_SHARE = 0.8
"""Share of comparisons without flow from which the camera does not move with the robot."""
_LIKE = 0.3
"""Least correlation between the turns of wheels and images."""
_TURNED = 0.1
"""Least spread of the turns between images [rad] for a correlation."""


class BagImages(ImageSource):
    """The images in the contents of a bag; ``fps`` [1/s] overrides their times.

    Raises:
        InputError: there are fewer than two.

    """

    def __init__(
        self,
        contents: BagContents,
        fps: float | None = None,
        calibration: CameraCalibration | None = None,
    ) -> None:
        times = contents.image_times if contents.images else np.zeros(0)
        if len(times) < 2:
            what = f"has {len(times) or 'no'} image; flow needs at least two"
            raise InputError(what, file=contents.bag.file)
        rate = 1.0 / float(np.median(np.diff(times))) if fps is None else fps
        super().__init__(rate, len(times), (), calibration)
        self._contents = contents
        self._times = times - times[0] if fps is None else np.arange(len(times)) / fps
        self.start = float(times[0])
        self.duration = float(self._times[-1])

    def __str__(self) -> str:
        return f"the bag {self._contents.bag.file}"

    def _items(self) -> Iterator[SourceImage]:
        images = zip(self._contents.each_image(), self._times.tolist(), strict=True)
        yield from self._readable((each.name, time, each.image) for each, time in images)


def bag_calibration(contents: BagContents) -> CameraCalibration | None:
    """The calibration in the bag's ``camera_info``; None without one, or if it is empty.

    Raises:
        InputError: it is no calibration, as ``load_calibration``.

    """
    info = contents.info
    if info is None:
        return None
    data = {
        "image_width": info.width,
        "image_height": info.height,
        "distortion_model": info.distortion_model,
        "camera_matrix": camera_matrix(info).tolist(),
        "distortion_coefficients": np.asarray(info.d if hasattr(info, "d") else info.D).tolist(),
    }
    with scratch_folder("calibration") as folder:
        file = folder / "camera_info.yaml"
        file.write_text(json.dumps(data), encoding="utf-8")
        return replace(load_calibration(file), file=f"camera_info of {contents.bag.file}")


def bag_motion(contents: BagContents) -> GyroRecord | None:
    """The turns by the bag's gyro, or else by its wheels, and the way by the wheels.

    Wheels that the images contradict are not used; notes of ``contents`` say so. None without
    either.
    """
    odometry = contents.odometry
    wheels = len(odometry) > 1
    if wheels and (contradiction := camera_contradiction(contents)):
        contents.notes.append(contradiction)
        wheels = False
    turning = contents.turning if wheels else contents.gyro
    if len(turning) < 2:
        return None
    measured = [bool(np.isfinite(rates).all()) for rates in turning[:, 1:].T]
    names = [name for name, there in zip(reversed(RATES), measured, strict=True) if there]
    ways = np.interp(turning[:, 0], odometry[:, 0], driven_way(odometry)) if wheels else None
    contents.notes += ["the speed is that of the bag's wheels"] if wheels else []
    interval = float(np.median(np.diff(turning[:, 0])))
    rates, file = np.nan_to_num(turning[:, 1:]), contents.bag.file
    return gyro_record(turning[:, 0], rates, interval, frozenset(names), (), file, ways)


def camera_contradiction(contents: BagContents) -> str:
    """Why the camera does not move with the robot, as its flow contradicts the wheels; "" if not.

    Images are compared as soon as the wheels have moved by ``_MOVED``.
    """
    odometry = contents.odometry
    if len(odometry) < 2 or not contents.images or len(contents.image_times) < 2:
        return ""
    way, yaw = driven_way(odometry), odometry[:, 3]
    moves: list[tuple[float, float, float]] = []
    past: tuple[float, float, TrackImage] | None = None
    for item in BagImages(contents):
        time = contents.image_times[0] + item.time
        at = [float(np.interp(time, odometry[:, 0], values)) for values in (way, yaw)]
        if past is None:
            past = at[0], at[1], TrackImage.of(item.image)
            continue
        turn = at[1] - past[1]
        if abs(at[0] - past[0]) < _MOVED[0] and abs(turn) < _MOVED[1]:
            continue
        now = TrackImage.of(item.image)
        shift = _shift(past[2], now)
        moves += [] if shift is None else [(turn, *shift)]
        past = at[0], at[1], now
        if len(moves) == _MOST:
            break
    return _verdict(np.array(moves).reshape(-1, 3))


def _shift(past: TrackImage, now: TrackImage) -> tuple[float, float] | None:
    """Median flow to the right, and its median length [px]; None where nothing is tracked."""
    height, width = now.grey.shape
    tracks = track_points(past, now, WorkingSize(width, height, now.scale, width, height))
    if len(tracks.points) < _LEAST:
        return None
    flow = tracks.points - tracks.past
    return float(np.median(flow[:, 0])), float(np.median(np.hypot(flow[:, 0], flow[:, 1])))


def _verdict(moves: Array) -> str:
    """What rows of turn [rad], flow to the right and length of the flow [px] say."""
    if len(moves) < _LEAST:
        return ""
    still = float((moves[:, 2] < _STILL).mean())
    what = "the camera does not move with the robot: its flow contradicts the wheels"
    if still >= _SHARE:
        return f"{what}, {still:.0%} of the images show no motion while these move"
    turning = moves[np.abs(moves[:, 0]) > _MOVED[1]]
    if len(turning) < _LEAST or turning[:, 0].std() < _TURNED:
        return ""
    like = float(np.corrcoef(turning[:, 0], turning[:, 1])[0, 1])
    # an image without any shift has no correlation
    return "" if like >= _LIKE else f"{what}, turns of the two have the correlation {like:.2f}"
