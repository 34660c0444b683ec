"""Frame pairs with known depth and motion from a walk recorded by a head-worn camera.

The data (ardaduz/deep-video-mvs, MIT licence) are not part of the repository: the functions take
the folder of a sequence with ``images/`` and ``depth/`` (files of the same names; depth in mm, 0
where unknown), ``poses.txt`` (a row for each image: 4 x 4 matrix, camera to world) and ``K.txt``
(intrinsic matrix 3 x 3 [px]). The images have no distortion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.flow_pairs import TruePair
from navfw.bench.tum_recording import project_depth
from navfw.config.image_file import read_image
from navfw.config.input_file import is_file, read_input_text
from navfw.errors import ConfigError
from navfw.perceive.working_size import WorkingSize
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, Frame, FramePair, Image

_MAX_TEXT = 10_000_000
"""Largest size of the files of poses and intrinsics [byte]; the originals have 9 kB."""
PERIOD = 0.1
"""Time between two images [s]: the sequence has no time stamps."""
DEPTH_UNIT = 1000.0
"""Value of a depth image for one metre."""


@dataclass(frozen=True, slots=True)
class _WalkImage:
    """A working image with its depth (height, width) [m] and the camera's pose (4, 4)."""

    image: Image
    depth: npt.NDArray[np.float32]
    pose: Array


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
        self.frames: list[_WalkImage] = []
        for file, pose in zip(files, poses, strict=True):
            colour = np.asarray(read_image(file, cv2.IMREAD_COLOR), dtype=np.uint8)
            depth = _reduced_depth(folder / "depth" / file.name, matrix, self.camera)
            self.frames.append(_WalkImage(size.prepare(colour[cut]), depth, pose))


def hololens_pairs(recorded: HololensRecording, stride: int = 1) -> Iterator[TruePair]:
    """Pairs of working images ``stride`` apart; the measured motion is the true one."""
    for k in range(stride, len(recorded.frames)):
        past, now = recorded.frames[k - stride], recorded.frames[k]
        axes = now.pose[:3, :3].T
        motion = CameraMotion(
            rotation=axes @ past.pose[:3, :3],
            translation=axes @ (now.pose[:3, 3] - past.pose[:3, 3]),
            dt=stride * PERIOD,
        )
        frames = Frame((k - stride) * PERIOD, past.image), Frame(k * PERIOD, now.image)
        pair = FramePair(*frames, motion)
        yield TruePair("hololens", f"stride {stride}", pair, motion, now.depth, past.depth)


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
    measured = np.asarray(read_image(file, cv2.IMREAD_UNCHANGED), dtype=np.float64) / DEPTH_UNIT
    rows, columns = np.nonzero(measured > 0.0)
    pixels = np.stack([columns, rows, np.ones(len(rows))], axis=-1)
    rays = pixels @ np.linalg.inv(matrix).T
    points = np.asarray(rays * measured[rows, columns, None], dtype=np.float64)
    return project_depth(points, camera)
