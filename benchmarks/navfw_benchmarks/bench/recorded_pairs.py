"""Frame pairs with known depth and motion from recordings, which are not part of the repository.

``hololens_office`` is a walk recorded by a head-worn camera (ardaduz/deep-video-mvs, MIT licence):
a folder with ``images/`` and ``depth/`` (files of the same names; depth in mm, 0 where unknown),
``poses.txt`` (a row for each image: 4 x 4 matrix, camera to world) and ``K.txt`` (intrinsic matrix
3 x 3 [px]). The images have no distortion.

``tum_fr1`` is a sequence of the freiburg1 camera of the TUM RGB-D benchmark (Sturm et al. 2012,
CC BY 4.0): a folder with ``rgb.txt``, ``depth.txt``, ``groundtruth.txt`` and the images that these
list.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from navfw.config.image_file import read_image
from navfw.config.input_file import is_file, read_input_text
from navfw.errors import ConfigError
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats
from navfw.perceive.motion_record import load_pose_record
from navfw.perceive.perceiver_options import WorkingSize
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, Frame, FramePair
from navfw_benchmarks.bench.true_pairs import TruePair

_HOLOLENS_UNIT, _TUM_UNIT = 1000.0, 5000.0
"""Values of depth images for one metre."""
_PERIOD = 0.1
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
    depth: Floats
    pose: Array


def frame_pairs(world: str, frames: Sequence[RecordedFrame], stride: int = 1) -> Iterator[TruePair]:
    """Pairs of frames ``stride`` apart; the measured motion is the true one."""
    for past, now in zip(frames, frames[stride:], strict=False):
        step = np.linalg.inv(now.pose) @ past.pose
        motion = CameraMotion(step[:3, :3], -step[:3, 3], now.time - past.time)
        pair = FramePair(Frame(past.time, past.image), Frame(now.time, now.image), motion)
        yield TruePair(world, f"stride {stride}", pair, motion, now.depth, past.depth)


@dataclass(frozen=True, slots=True)
class PosedImage:
    """A colour image at ``time`` [s] from a ``pose`` (4, 4), camera to world, and a depth image.

    ``depth_file`` has the size of the colour image and ``unit`` values for a metre; ``step`` (4, 4)
    is the pose from which it was taken, in camera axes of the colour image.
    """

    time: float
    file: Path
    pose: Array
    depth_file: Path
    step: Array
    unit: float

    def depth(self) -> Array:
        """Depth (height, width) [m] of the depth image, 0 where it is unknown.

        Raises:
            InputError: the file cannot be read.

        """
        depth = np.asarray(read_image(self.depth_file, cv2.IMREAD_UNCHANGED), np.float64)
        return depth / self.unit

    def reduced_depth(self, rays_of: Callable[[Array], Array], camera: CameraModel) -> Floats:
        """Depth (height, width) [m] in the image of a ``camera`` at ``pose``; 0: unknown.

        ``rays_of`` gives the rays (n, 3), of depth 1, of pixels (n, 2) of the depth image.
        """
        depth = self.depth()
        rows, columns = np.nonzero(depth > 0.0)
        rays = rays_of(np.stack([columns, rows], axis=-1).astype(np.float64))
        points = (rays * depth[rows, columns, None]) @ self.step[:3, :3].T + self.step[:3, 3]
        return project_depth(points, camera)


def hololens_images(folder: Path) -> list[PosedImage]:
    """The images of a walk in their order.

    Raises:
        ConfigError: the folder lacks a file, or a file cannot be read.

    """
    files = sorted((folder / "images").glob("*.png"))
    poses = _numbers(folder / "poses.txt", 16).reshape(-1, 4, 4)
    if len(files) != len(poses) or len(files) < 2:
        raise ConfigError(
            f"expected a row for each of two or more images, found {len(poses)} rows for "
            f"{len(files)} images",
            file=folder / "poses.txt",
        )
    images = []
    for number, (file, pose) in enumerate(zip(files, poses, strict=True)):
        depth = folder / "depth" / file.name
        if not is_file(depth):
            raise ConfigError("there is no such file", file=depth)
        images.append(PosedImage(number * _PERIOD, file, pose, depth, np.eye(4), _HOLOLENS_UNIT))
    return images


def hololens_frames(folder: Path, rows: int, cols: int) -> tuple[CameraModel, list[RecordedFrame]]:
    """The images of a walk, reduced to working images of a grid, with their camera.

    They are cropped around the principal point first: ``CameraModel`` has it in the centre.

    Raises:
        ConfigError: the folder lacks a file, or a file cannot be read.

    """
    matrix = _numbers(folder / "K.txt", 3)
    if matrix.shape != (3, 3):
        raise ConfigError("expected 3 rows of 3 numbers", file=folder / "K.txt")
    images = hololens_images(folder)
    height, width = np.asarray(read_image(images[0].file, cv2.IMREAD_COLOR)).shape[:2]
    middle = matrix[:2, 2] + 0.5
    half = np.floor(np.minimum(middle, (width, height) - middle)).astype(int)
    left, top = np.rint(middle - half).astype(int)
    size = WorkingSize.of(2 * int(half[0]), 2 * int(half[1]), rows, cols)
    cut = np.s_[top : top + size.height, left : left + size.width]
    hfov = 2.0 * math.atan(0.5 * size.width / matrix[0, 0])
    camera = size.camera(hfov, 1.0, 0.0, 1.0 / _PERIOD)

    def rays_of(pixels: Array) -> Array:
        return np.insert(pixels, 2, 1.0, axis=1) @ np.linalg.inv(matrix).T

    frames = []
    for image in images:
        colour = np.asarray(read_image(image.file, cv2.IMREAD_COLOR), dtype=np.uint8)
        depth = image.reduced_depth(rays_of, camera)
        frames.append(RecordedFrame(image.time, size.prepare(colour[cut]), depth, image.pose))
    return camera, frames


def _numbers(file: Path, columns: int) -> Array:
    lines = read_input_text(file).splitlines()
    try:
        rows = np.loadtxt(lines, ndmin=2, dtype=np.float64)
        if rows.shape[1] != columns or not np.isfinite(rows).all():
            raise ValueError(f"{rows.shape[1]} columns")
    except ValueError as error:
        raise ConfigError(f"expected rows of {columns} numbers: {error}", file=file) from None
    return rows


def tum_images(folder: Path) -> list[PosedImage]:
    """The colour images of a sequence with a pose and a depth image within ``MAX_GAP``.

    Raises:
        InputError: the folder lacks a file, or a file cannot be read.

    """
    colour, depth = _listing(folder, "rgb.txt"), _listing(folder, "depth.txt")
    record = load_pose_record(folder / "groundtruth.txt")
    images = []
    for stamp, file in colour if depth else ():
        at, nearest = min(depth, key=lambda item: abs(item[0] - stamp))
        poses = record.poses_at(stamp, at)
        if abs(at - stamp) <= MAX_GAP and poses is not None:
            pose, depth_pose = (
                np.block([[axes, place[:, None]], [np.zeros(3), 1.0]])
                for place, axes in zip(poses[0], poses[1].as_matrix(), strict=True)
            )
            step = np.linalg.inv(pose) @ depth_pose
            images.append(PosedImage(stamp, file, pose, nearest, step, _TUM_UNIT))
    if len(images) < 2:
        raise ConfigError(
            f"expected two colour images with a pose, and a depth image within {MAX_GAP} s",
            file=folder,
        )
    return images


def tum_frames(folder: Path, size: tuple[int, int]) -> tuple[CameraModel, list[RecordedFrame]]:
    """The images of a sequence, undistorted and scaled to ``size`` (width, height).

    Raises:
        InputError: the folder lacks a file, or a file cannot be read.

    """
    camera = _tum_camera(size)
    maps = cv2.initUndistortRectifyMap(
        *(FR1_MATRIX, FR1_DISTORTION, np.eye(3), _matrix(_tum_camera((640, 480)))),
        *((640, 480), cv2.CV_32FC1),
    )

    def rays_of(pixels: Array) -> Array:
        straight = cv2.undistortPoints(pixels[:, None], FR1_MATRIX, FR1_DISTORTION)
        return np.insert(np.asarray(straight)[:, 0], 2, 1.0, axis=1)

    frames = []
    for image in tum_images(folder):
        grey = read_image(image.file, cv2.IMREAD_GRAYSCALE)
        straight = cv2.remap(grey, maps[0], maps[1], cv2.INTER_LINEAR)
        reduced = np.asarray(cv2.resize(straight, size, interpolation=cv2.INTER_AREA), np.uint8)
        depth = image.reduced_depth(rays_of, camera)
        frames.append(RecordedFrame(image.time, reduced, depth, image.pose))
    return camera, frames


def _listing(folder: Path, name: str) -> list[tuple[float, Path]]:
    lines = read_input_text(folder / name).splitlines()
    pairs = [line.split() for line in lines if line and not line.startswith("#")]
    try:
        return [(float(t), folder / f) for t, f in pairs if is_file(folder / f)]
    except ValueError as error:
        raise ConfigError(f"expected lines of time, file: {error}", file=folder / name) from None


def _tum_camera(size: tuple[int, int]) -> CameraModel:
    """The pinhole camera of the straightened images, with a central principal point."""
    hfov = 2.0 * math.atan(0.5 * 640 / (_ZOOM * FR1_MATRIX[0, 0]))
    return CameraModel(width=size[0], height=size[1], hfov=hfov)


def _matrix(camera: CameraModel) -> Array:
    """Intrinsic matrix (3, 3) [px]."""
    f = camera.focal
    x, y = 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)
    return np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])


def project_depth(points: Array, camera: CameraModel) -> Floats:
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
