"""A bag as a folder of images and tables, and whether its camera moves as its wheels say."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from navfw.config.input_file import shown_path
from navfw.errors import InputError
from navfw.lenses import Undistortion, load_calibration
from navfw.numerics import Array
from navfw.perceive.pair_motion import TrackImage, track_points
from navfw.perceive.perceiver_options import WorkingSize
from navfw.process.atomic import scratch_folder
from navfw.recording.bag_reader import Bag, driven_way
from navfw.recording.image_messages import deep_image, ros_image
from navfw.robot import CameraModel

_MOVED = (0.05, 0.03)
"""Way [m] or turn [rad] of the wheels after which images are compared."""
_STILL = 0.3
"""Median flow [px] up to which nothing has moved in an image."""
_COMPARED = (10, 150)
"""Least and largest number of comparisons for a verdict."""
_SHARE, _LIKE = 0.8, 0.3
"""Share of comparisons without flow, and correlation of turns, that contradict the wheels."""
_RECTIFIED = re.compile(r"(?:^|[/_])rect(?:ified)?(?:[/_]|$)")
"""What the topics of images without distortion have in their names."""


@contextmanager
def unpacked_bag(bag: Bag, pitch: float = 0.0) -> Iterator[dict[str, Path]]:
    """Images and tables of ``bag`` in a temporary folder, by the options that take them.

    There are ``source``, a folder, and ``times``; ``calibration`` if the bag has one that fits its
    images; ``poses`` if it has wheels that the images do not contradict, turned by the gyro if
    there is one; ``gyro`` if there is only that. ``pitch`` [rad] is the camera's, where it is known
    otherwise than by the bag's transforms.

    Raises:
        InputError: there are no images, or one is none.

    """
    if not len(bag.images):
        shown = [f"{topic} shows {what}" for topic, what in bag.no_pictures.items()]
        shown += ["--topic takes one by name"] if shown else bag.notes[:-1]
        hint = f": {'; '.join(shown)}" if shown else ""
        raise InputError(f"has no images to perceive{hint}", file=bag.file)
    with scratch_folder("bag") as folder:
        files = {name: folder / name for name in ("source", "times")}
        files["source"].mkdir()
        lines = []
        shape: tuple[int, ...] = ()
        for number, (name, time, _, message) in enumerate(bag.each_image()):
            file, data = files["source"] / f"{number:06d}.png", message.data
            if not hasattr(message, "format"):
                image = deep_image(message, name)
                shape, data = image.shape, cv2.imencode(".png", image)[1]
            elif not shape:
                with suppress(InputError):  # reported when it is its turn
                    shape = deep_image(message, name).shape
            file.write_bytes(bytes(data))
            lines.append(f"{time!r},{file.name}")
        files["times"].write_text("time,file\n" + "\n".join(lines), encoding="utf-8")
        for name, text in _tables(bag, pitch).items():
            files[name] = folder / f"{name}.yaml"
            files[name].write_text(text, encoding="utf-8")
        problem = _misfit(bag, files["calibration"], shape) if bag.info and shape else ""
        if problem:
            bag.notes.append(f"{bag.info_topic} is not used: {problem}")
            del files["calibration"]
        yield files


def _misfit(bag: Bag, file: Path, shape: Sequence[int]) -> str:
    """Why the calibration in ``file`` is not that of images of ``shape``; "" if it may be."""
    try:
        lens = load_calibration(file)
        Undistortion(lens, shape[1], shape[0], key=None)
    except InputError as error:
        return re.sub(rf"^{re.escape(shown_path(file))}(:\d+)?: ", "", str(error))
    is_part = max(bag.info.binning_x, bag.info.binning_y, bag.info.roi.width) > 1
    if is_part and lens.size is not None and lens.size != (shape[1], shape[0]):
        sizes = f"{lens.size[0]} x {lens.size[1]} px, not {shape[1]} x {shape[0]}"
        return f"by its binning and its region of interest images have {sizes}"
    return ""


def _tables(bag: Bag, pitch: float) -> dict[str, str]:
    """The texts of calibration, gyro and poses, as far as the bag has them."""
    tables = {}
    optical = CameraModel(pitch=pitch).base_from_camera if bag.optical is None else bag.optical
    if bag.info is not None:
        tables["calibration"] = json.dumps(_lens(bag))
    contradiction = camera_contradiction(bag)
    bag.notes += [contradiction] if contradiction else []
    if len(bag.odometry) > 1 and not contradiction:
        tables["poses"] = _rows(_poses(bag, optical))
    elif len(bag.gyro) > 1:
        axes = [k for k in range(4) if np.isfinite(bag.gyro[:, k]).all()]
        rates = bag.gyro.copy()
        if len(axes) > 3:
            rates[:, 1:] @= optical @ CameraModel(pitch=pitch).base_from_camera.T
        names = ",".join(("time", "roll_rate", "pitch_rate", "yaw_rate")[k] for k in axes)
        tables["gyro"] = f"{names}\n" + _rows(rates[:, axes]).replace(" ", ",")
    return tables


def _lens(bag: Bag) -> dict[str, Any]:
    """The ``camera_info`` as a file; where images are rectified, of the projection matrix."""
    info, roi = bag.info, bag.info.roi
    matrix, bent = bag.matrix, np.asarray(info.d if hasattr(info, "d") else info.D)
    if _RECTIFIED.search(bag.image_topic):
        flat = np.asarray(info.p if hasattr(info, "p") else info.P).reshape(3, 4)[:, :3].ravel()
        matrix, bent = flat if flat.any() else matrix, np.empty(0)
    part = {name: getattr(roi, name) for name in ("x_offset", "y_offset", "width", "height")}
    binned = {name: getattr(info, name) for name in ("binning_x", "binning_y")}
    sizes = {"image_width": info.width, "image_height": info.height, "roi": part}
    model = info.distortion_model if bent.size else "plumb_bob"
    return {**sizes, **binned, "K": matrix.tolist(), "D": bent.tolist(), "distortion_model": model}


def _rows(table: Array) -> str:
    return "\n".join(" ".join(map(repr, row)) for row in table.tolist())


def _poses(bag: Bag, optical: Array) -> Array:
    """The camera's poses (n, 8) by the way of the wheels, and the turns of the gyro, if any."""
    times, yaw, gyro = bag.odometry[:, 0], bag.odometry[:, 3], bag.gyro
    if len(gyro) > 1:
        middle = 0.5 * (gyro[1:, 3] + gyro[:-1, 3]) * np.diff(gyro[:, 0])
        yaw = np.interp(times, gyro[:, 0], np.concatenate([[0.0], np.cumsum(middle)]))
    steps, along = np.diff(driven_way(bag.odometry)), 0.5 * (yaw[1:] + yaw[:-1])
    ways = np.stack([steps * np.cos(along), steps * np.sin(along), 0.0 * steps], axis=1)
    places = np.concatenate([np.zeros((1, 3)), np.cumsum(ways, axis=0)])
    turns = Rotation.from_euler("z", yaw[:, None]) * Rotation.from_matrix(optical)
    return np.column_stack([times, places, turns.as_quat()])


def camera_contradiction(bag: Bag) -> str:
    """Why the camera does not move with the robot, as its flow contradicts the wheels; "" if not.

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
    """Median flow to the right, and its median length [px]; None where nothing is tracked."""
    height, width = now.grey.shape
    tracks = track_points(past, now, WorkingSize(width, height, now.scale, width, height))
    flow = tracks.points - tracks.past
    if len(flow) < _COMPARED[0]:
        return None
    return float(np.median(flow[:, 0])), float(np.median(np.hypot(flow[:, 0], flow[:, 1])))


def _verdict(moves: Array) -> str:
    """What rows of turn [rad], flow to the right and length of the flow [px] say."""
    what = "the camera does not move with the robot: its flow contradicts the wheels"
    still = float((moves[:, 2] < _STILL).mean()) if len(moves) else 0.0
    if len(moves) >= _COMPARED[0] and still >= _SHARE:
        return f"{what}, {still:.0%} of the images show no motion while these move"
    turning = moves[np.abs(moves[:, 0]) > _MOVED[1]]
    if len(turning) < _COMPARED[0] or turning[:, 0].std() < 2.0 * _MOVED[1]:
        return ""
    like = float(np.corrcoef(turning[:, 0], turning[:, 1])[0, 1])
    return "" if like >= _LIKE else f"{what}, turns of the two have the correlation {like:.2f}"
