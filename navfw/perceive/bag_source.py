"""Unpack a bag to images with times, lens and motion; check its camera against its wheels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from navfw.errors import InputError, locating
from navfw.lenses import CameraCalibration
from navfw.lenses.camera_info import info_text, info_undistortion
from navfw.numerics import Array
from navfw.perceive.image_times import ImageTimes
from navfw.perceive.motion_record import (
    RATES,
    GyroRecord,
    MotionRecord,
    PoseRecord,
    longest_gap,
)
from navfw.perceive.pair_motion import TrackImage, track_points
from navfw.perceive.perceiver_options import WorkingSize
from navfw.process.atomic import scratch_folder
from navfw.recording.bag_reader import Bag, driven_way
from navfw.recording.image_messages import deep_image, ros_image
from navfw.robot import CameraModel

_MOVED = (0.05, 0.03)
"""Distance [m] or rotation [rad] by the wheels after which images are compared."""
_STILL = 0.3
"""Median flow [px] up to which an image counts as unmoved."""
_COMPARED = (10, 150)
"""Least and largest number of comparisons for a verdict."""
_SHARE, _LIKE = 0.8, 0.3
"""Share of comparisons without flow, and correlation of rotations, that contradict the wheels."""


class BagInputs(NamedTuple):
    """A folder of a bag's images, their ``times``, its ``lens`` and motion ``record`` if known."""

    folder: Path
    times: ImageTimes
    lens: CameraCalibration | None
    record: MotionRecord | None


@contextmanager
def unpacked_bag(bag: Bag, pitch: float = 0.0) -> Iterator[BagInputs]:
    """Write the images of ``bag`` to a temporary folder; add the bag's data on its camera.

    The lens is that of ``camera_info`` if it fits the images. The record has the camera's poses by
    the wheels if the images do not contradict these, turned by the gyro if there is one; the rates
    of the gyro if there is only that. ``pitch`` [rad], nose down, is used if the bag's transforms
    do not give the camera's.

    Raises:
        InputError: there are no images, or one is none.

    """
    if not len(bag.images):
        shown = [f"{topic} shows {what}" for topic, what in bag.no_pictures.items()]
        shown += ["--topic takes one by name"] if shown else bag.notes[:-1]
        hint = f": {'; '.join(shown)}" if shown else ""
        raise InputError(f"has no images to perceive{hint}", file=bag.file)
    with scratch_folder("bag") as folder:
        times = list[float]()
        shape: tuple[int, ...] = ()
        with locating(file=bag.file):
            for number, (name, time, _, message) in enumerate(bag.each_image()):
                data = message.data
                if not hasattr(message, "format"):
                    image = deep_image(message, name)
                    shape, data = image.shape, cv2.imencode(".png", image)[1]
                elif not shape:
                    with suppress(InputError):  # reported when it is its turn
                        shape = deep_image(message, name).shape
                (folder / f"{number:06d}.png").write_bytes(bytes(data))
                times.append(time)
        lens = _lens(bag, shape)
        yield BagInputs(folder, ImageTimes(bag.file, tuple(times), {}), lens, _record(bag, pitch))


def _lens(bag: Bag, shape: Sequence[int]) -> CameraCalibration | None:
    """Read the lens of ``camera_info``; None if it contradicts the images."""
    if bag.info is None or not shape:
        return None
    text = info_text(bag.info, bag.image_topic)
    try:
        return info_undistortion(text, bag.info_topic, shape[1], shape[0]).calibration
    except InputError as error:
        bag.notes.append(f"{bag.info_topic} is not used: {error}")
        return None


def _record(bag: Bag, pitch: float) -> MotionRecord | None:
    """Return the camera's poses by the wheels, or the gyro's rates; None if both are missing."""
    level = CameraModel(pitch=pitch).base_from_camera
    optical = level if bag.optical is None else bag.optical
    contradiction = camera_contradiction(bag)
    bag.notes += [contradiction] if contradiction else []
    if len(bag.odometry) > 1 and not contradiction:
        times, places, turns = _poses(bag, optical)
        gap = longest_gap(times)
        return PoseRecord(times, gap, places, turns, axes=level, file=bag.file)
    if len(bag.gyro) < 2:
        return None
    times, rates = bag.gyro[:, 0], bag.gyro[:, 1:]
    known = np.asarray(np.isfinite(rates).all(axis=0))
    rates = rates @ optical @ level.T if known.all() else np.where(known, rates, 0.0)
    names = frozenset(name for name, one in zip(reversed(RATES), known, strict=True) if one)
    return GyroRecord(
        times, longest_gap(times), rates, measured=names, axes=bag.axes, file=bag.file
    )


def _poses(bag: Bag, optical: Array) -> tuple[Array, Array, Array]:
    """Return times, places and quaternions by the wheels' distance and the gyro's turns, if any."""
    times, yaw, gyro = bag.odometry[:, 0], bag.odometry[:, 3], bag.gyro
    if len(gyro) > 1:
        middle = 0.5 * (gyro[1:, 3] + gyro[:-1, 3]) * np.diff(gyro[:, 0])
        yaw = np.interp(times, gyro[:, 0], np.concatenate([[0.0], np.cumsum(middle)]))
    steps, along = np.diff(driven_way(bag.odometry)), 0.5 * (yaw[1:] + yaw[:-1])
    ways = np.stack([steps * np.cos(along), steps * np.sin(along), 0.0 * steps], axis=1)
    places = np.concatenate([np.zeros((1, 3)), np.cumsum(ways, axis=0)])
    turns = Rotation.from_euler("z", yaw[:, None]) * Rotation.from_matrix(optical)
    return times, places, turns.as_quat()


def camera_contradiction(bag: Bag) -> str:
    """Return why the camera's flow contradicts the wheels; "" if it does not.

    Images are compared as soon as the wheels have moved by ``_MOVED``.
    """
    if len(bag.odometry) < 2:
        return ""
    state = np.column_stack([driven_way(bag.odometry), bag.odometry[:, 3]])
    moves: list[tuple[float, float, float]] = []
    past: tuple[Array, TrackImage] | None = None
    with closing(bag.each_image()) as images:
        for name, time, _, message in images:
            at = np.array([np.interp(time, bag.odometry[:, 0], values) for values in state.T])
            if past is not None and (np.abs(at - past[0]) < _MOVED).all():
                continue
            now = TrackImage.of(ros_image(message, name))
            shift = None if past is None else _shift(past[1], now)
            if past is not None and shift is not None:
                moves.append((float(at[1] - past[0][1]), *shift))
            past = at, now
            if len(moves) == _COMPARED[1]:
                break
    return _verdict(np.array(moves).reshape(-1, 3))


def _shift(past: TrackImage, now: TrackImage) -> tuple[float, float] | None:
    """Return the median flow to the right, and its median length [px]; None without tracks."""
    height, width = now.grey.shape
    tracks = track_points(past, now, WorkingSize(width, height, now.scale, width, height))
    flow = tracks.points - tracks.past
    if len(flow) < _COMPARED[0]:
        return None
    return float(np.median(flow[:, 0])), float(np.median(np.hypot(flow[:, 0], flow[:, 1])))


def _verdict(moves: Array) -> str:
    """Judge rows of rotation [rad], flow to the right and length of the flow [px]."""
    what = "the camera does not move with the robot: its flow contradicts the wheels"
    still = float((moves[:, 2] < _STILL).mean()) if len(moves) else 0.0
    if len(moves) >= _COMPARED[0] and still >= _SHARE:
        return f"{what}, {still:.0%} of the images show no motion while these move"
    turning = moves[np.abs(moves[:, 0]) > _MOVED[1]]
    if len(turning) < _COMPARED[0] or turning[:, 0].std() < 2.0 * _MOVED[1]:
        return ""
    like = float(np.corrcoef(turning[:, 0], turning[:, 1])[0, 1])
    return "" if like >= _LIKE else f"{what}, turns of the two have the correlation {like:.2f}"
