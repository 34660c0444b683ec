"""Frame pairs with known depth and motion from recordings, which are not part of the repository.

``HololensRecording`` is a walk recorded by a head-worn camera (ardaduz/deep-video-mvs, MIT
licence): a folder with ``images/`` and ``depth/`` (files of the same names; depth in mm, 0 where
unknown), ``poses.txt`` (a row for each image: 4 x 4 matrix, camera to world) and ``K.txt``
(intrinsic matrix 3 x 3 [px]). The images have no distortion.

``TumRecording`` is a sequence of the freiburg1 camera of the TUM RGB-D benchmark (Sturm et al.
2012, CC BY 4.0): a folder with ``rgb.txt``, ``depth.txt``, ``groundtruth.txt`` and the images that
these list.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.recorded_approach import read_grey
from navfw.bench.true_pairs import TruePair
from navfw.config.image_file import read_image
from navfw.config.input_file import is_file, read_input_text
from navfw.errors import ConfigError
from navfw.numerics import Array, Image
from navfw.perceive.motion_record import load_pose_record
from navfw.perceive.working_size import WorkingSize
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, Frame, FramePair

_MAX_TEXT = 50_000_000
"""Largest size of a file of text [byte]; the originals have at most 0.3 MB."""
HOLOLENS_UNIT, TUM_UNIT = 1000.0, 5000.0
"""Values of depth images for one metre."""
PERIOD = 0.1
"""Time between two images of the walk [s]: it has no time stamps."""

FR1_MATRIX = np.array([[517.3, 0.0, 318.6], [0.0, 516.5, 255.3], [0.0, 0.0, 1.0]])
"""Intrinsic matrix [px] of the colour camera of the freiburg1 sequences, at 640 x 480."""
FR1_DISTORTION = np.array([0.2624, -0.9531, -0.0054, 0.0026, 1.1633])
"""Distortion coefficients of that camera (k1, k2, p1, p2, k3), as OpenCV has them."""
_ZOOM = 1.1
"""Focal length of the straightened images over that of the camera: no pixel of them is outside the
camera's image. A black border would be a texture that stands still."""
ONE_SURFACE = 0.9
"""Least nearness of a point of the nearest surface in a pixel, relative to the nearest point."""
MAX_GAP = 0.02
"""Largest time [s] between a colour image and the depth image assigned to it."""


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """A working image at ``time`` [s] with its depth (height, width) [m] and pose (4, 4).

    The depth is 0 where it is unknown; poses are those of the camera in the world.
    """

    time: float
    image: Image
    depth: npt.NDArray[np.float32]
    pose: Array


def frame_pairs(world: str, frames: Sequence[RecordedFrame], stride: int = 1) -> Iterator[TruePair]:
    """Pairs of frames ``stride`` apart; the measured motion is the true one."""
    for past, now in zip(frames, frames[stride:], strict=False):
        step = np.linalg.inv(now.pose) @ past.pose
        motion = CameraMotion(step[:3, :3], -step[:3, 3], now.time - past.time)
        pair = FramePair(Frame(past.time, past.image), Frame(now.time, now.image), motion)
        yield TruePair(world, f"stride {stride}", pair, motion, now.depth, past.depth)


@dataclass(frozen=True, slots=True)
class DepthFile:
    """A depth image of the size of its colour image, with ``unit`` values for a metre."""

    path: Path
    unit: float

    def read(self) -> Array:
        """Depth (height, width) [m], 0 where it is unknown.

        Raises:
            InputError: the file cannot be read.

        """
        return np.asarray(read_image(self.path, cv2.IMREAD_UNCHANGED), np.float64) / self.unit


# --- the walk -------------------------------------------------------------------------------------


class HololensRecording:
    """A sequence, reduced to working images of a grid, with their camera.

    The images are cropped around the principal point first: ``CameraModel`` has it in the centre.

    Raises:
        ConfigError: the folder lacks a file, or a file cannot be read.

    """

    def __init__(self, folder: Path, rows: int, cols: int) -> None:
        matrix = _numbers(folder / "K.txt", 3)
        if matrix.shape != (3, 3):
            raise ConfigError("expected 3 rows of 3 numbers", file=folder / "K.txt")
        files = sorted((folder / "images").glob("*.png"))
        poses = read_poses(folder)
        if len(files) != len(poses) or len(files) < 2:
            raise ConfigError(
                f"expected a row for each of two or more images, found {len(poses)} rows for "
                f"{len(files)} images",
                file=folder / "poses.txt",
            )
        for file in files:
            if not is_file(folder / "depth" / file.name):
                raise ConfigError("there is no such file", file=folder / "depth" / file.name)
        height, width = np.asarray(read_image(files[0], cv2.IMREAD_COLOR)).shape[:2]
        middle = matrix[:2, 2] + 0.5
        half = np.floor(np.minimum(middle, (width, height) - middle)).astype(int)
        left, top = np.rint(middle - half).astype(int)
        size = WorkingSize.of(2 * int(half[0]), 2 * int(half[1]), rows, cols)
        cut = np.s_[top : top + size.height, left : left + size.width]
        hfov = 2.0 * math.atan(0.5 * size.width / matrix[0, 0])
        self.camera = size.camera(hfov, 1.0, 0.0, 1.0 / PERIOD)
        self.frames: list[RecordedFrame] = []
        for number, (file, pose) in enumerate(zip(files, poses, strict=True)):
            colour = np.asarray(read_image(file, cv2.IMREAD_COLOR), dtype=np.uint8)
            depth = _reduced_depth(folder / "depth" / file.name, matrix, self.camera)
            image = size.prepare(colour[cut])
            self.frames.append(RecordedFrame(number * PERIOD, image, depth, pose))


def read_poses(folder: Path) -> Array:
    """Poses (n, 4, 4), camera to world, of the images in their order.

    Raises:
        ConfigError: the file of poses cannot be read.

    """
    return _numbers(folder / "poses.txt", 16).reshape(-1, 4, 4)


def _numbers(file: Path, columns: int) -> Array:
    """Rows of ``columns`` numbers each."""
    lines = read_input_text(file, _MAX_TEXT).splitlines()
    try:
        rows = np.loadtxt(lines, ndmin=2, dtype=np.float64)
        if rows.shape[1] != columns or not np.isfinite(rows).all():
            raise ValueError(f"{rows.shape[1]} columns")
    except ValueError as error:
        raise ConfigError(f"expected rows of {columns} numbers: {error}", file=file) from None
    return rows


def _reduced_depth(file: Path, matrix: Array, camera: CameraModel) -> npt.NDArray[np.float32]:
    """Depth (height, width) [m] of a depth image of the original size; 0 where it is unknown."""
    measured = DepthFile(file, HOLOLENS_UNIT).read()
    rows, columns = np.nonzero(measured > 0.0)
    pixels = np.stack([columns, rows, np.ones(len(rows))], axis=-1)
    rays = pixels @ np.linalg.inv(matrix).T
    points = np.asarray(rays * measured[rows, columns, None], dtype=np.float64)
    return project_depth(points, camera)


# --- TUM ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _PosedImage:
    """A colour image, and the nearest depth image in time, with the poses (4, 4) of the camera."""

    time: float
    colour: Path
    pose: Array
    depth: DepthFile
    depth_pose: Array


class TumRecording:
    """A sequence: colour images, each with the depth image and the pose nearest in time.

    Raises:
        InputError: the folder lacks a file, or a file cannot be read.

    """

    def __init__(self, folder: Path) -> None:
        colour, depth = _listing(folder, "rgb.txt"), _listing(folder, "depth.txt")
        poses = load_pose_record(folder / "groundtruth.txt")
        self.images: list[_PosedImage] = []
        for stamp, file in colour if depth else ():
            at, nearest = min(depth, key=lambda item: abs(item[0] - stamp))
            posed = poses.poses_at(stamp, at)
            if abs(at - stamp) <= MAX_GAP and posed is not None:
                pose, depth_pose = (
                    np.block([[axes, place[:, None]], [np.zeros(3), 1.0]])
                    for place, axes in zip(posed[0], posed[1].as_matrix(), strict=True)
                )
                measured = DepthFile(nearest, TUM_UNIT)
                self.images.append(_PosedImage(stamp, file, pose, measured, depth_pose))
        if len(self.images) < 2:
            raise ConfigError(
                f"expected two colour images with a pose, and a depth image within {MAX_GAP} s",
                file=folder,
            )

    def frames(self, size: tuple[int, int]) -> list[RecordedFrame]:
        """The images, undistorted and scaled to ``size`` (width, height).

        Raises:
            InputError: an image cannot be read.

        """
        camera = tum_camera(size)
        return [
            RecordedFrame(
                image.time,
                _rectified(read_grey(image.colour), camera),
                _registered_depth(image, camera),
                image.pose,
            )
            for image in self.images
        ]


def _listing(folder: Path, name: str) -> list[tuple[float, Path]]:
    """Time stamps [s] and existing files of an index file."""
    lines = read_input_text(folder / name, _MAX_TEXT).splitlines()
    pairs = [line.split() for line in lines if line and not line.startswith("#")]
    try:
        return [(float(t), folder / f) for t, f in pairs if is_file(folder / f)]
    except ValueError as error:
        raise ConfigError(f"expected lines of time, file: {error}", file=folder / name) from None


def tum_camera(size: tuple[int, int]) -> CameraModel:
    """The pinhole camera of the straightened images, with a central principal point."""
    hfov = 2.0 * math.atan(0.5 * 640 / (_ZOOM * FR1_MATRIX[0, 0]))
    return CameraModel(width=size[0], height=size[1], hfov=hfov)


def _rectified(image: Image, camera: CameraModel) -> Image:
    """``image`` (480, 640) without lens distortion, scaled to the size of ``camera``."""
    full = tum_camera((640, 480))
    matrix = _matrix(full)
    maps = cv2.initUndistortRectifyMap(
        FR1_MATRIX, FR1_DISTORTION, np.eye(3), matrix, (640, 480), cv2.CV_32FC1
    )
    straight = cv2.remap(image, maps[0], maps[1], cv2.INTER_LINEAR)
    reduced = cv2.resize(straight, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, dtype=np.uint8)


def _matrix(camera: CameraModel) -> Array:
    """Intrinsic matrix (3, 3) [px]."""
    f = camera.focal
    x, y = 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)
    return np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])


def _registered_depth(image: _PosedImage, camera: CameraModel) -> npt.NDArray[np.float32]:
    """Depth (height, width) [m] seen from the colour image's pose; 0 where it is unknown.

    The depth image was taken slightly earlier or later: its points are transformed to the pose of
    the colour image.
    """
    measured = image.depth.read()
    rows, columns = np.nonzero(measured > 0.0)
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    straight = cv2.undistortPoints(pixels[:, None], FR1_MATRIX, FR1_DISTORTION)
    rays = np.concatenate([np.asarray(straight)[:, 0], np.ones((len(pixels), 1))], axis=1)
    step = np.linalg.inv(image.pose) @ image.depth_pose
    points = (rays * measured[rows, columns, None]) @ step[:3, :3].T + step[:3, 3]
    return project_depth(points, camera)


def project_depth(points: Array, camera: CameraModel) -> npt.NDArray[np.float32]:
    """Depth image (height, width) [m] of ``points`` (n, 3) [m] in the axes of ``camera``.

    A pixel has the mean nearness of the points of the nearest surface in it; 0 where there is none.
    """
    points = points[points[:, 2] > 0.1]
    at = np.rint(camera.focal * points[:, :2] / points[:, 2:] + _matrix(camera)[:2, 2])
    inside = ((at >= 0) & (at < (camera.width, camera.height))).all(axis=1)
    x, y = at[inside].astype(np.int64).T
    pixel, near = y * camera.width + x, 1.0 / points[inside, 2]
    largest = np.zeros(camera.height * camera.width)
    np.maximum.at(largest, pixel, near)
    front = near > ONE_SURFACE * largest[pixel]
    count = np.bincount(pixel[front], minlength=largest.size)
    total = np.bincount(pixel[front], near[front], minlength=largest.size)
    depth = count / np.where(count > 0, total, 1.0)
    return depth.reshape(camera.height, camera.width).astype(np.float32)
