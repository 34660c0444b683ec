"""Frame pairs with known depth and motion from a sequence of the TUM RGB-D benchmark.

The data (Sturm et al. 2012, CC BY 4.0) are not part of the repository: the functions take the
folder of a sequence of the freiburg1 camera, with ``rgb.txt``, ``depth.txt``, ``groundtruth.txt``
and the images that these list.
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
from navfw.bench.recorded_approach import read_grey
from navfw.config.image_file import read_image
from navfw.config.input_file import is_file, read_input_text
from navfw.errors import ConfigError
from navfw.perceive.pose_record import load_pose_record
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, Frame, FramePair, Image

_MAX_LIST = 50_000_000
"""Largest size of a list of images or poses [byte]; those of freiburg1 have 0.3 MB."""

FR1_MATRIX = np.array([[517.3, 0.0, 318.6], [0.0, 516.5, 255.3], [0.0, 0.0, 1.0]])
"""Intrinsic matrix [px] of the colour camera of the freiburg1 sequences, at 640 x 480."""
FR1_DISTORTION = np.array([0.2624, -0.9531, -0.0054, 0.0026, 1.1633])
"""Distortion coefficients of that camera (k1, k2, p1, p2, k3), as OpenCV has them."""
_ZOOM = 1.1
"""Focal length of the straightened images over that of the camera: no pixel of them is outside the
camera's image. A black border would be a texture that stands still."""
DEPTH_UNIT = 5000.0
"""Value of a depth image for one metre."""
ONE_SURFACE = 0.9
"""Least nearness of a point of the nearest surface in a pixel, relative to the nearest point."""
MAX_GAP = 0.02
"""Largest time [s] between a colour image and the depth image assigned to it."""


def tum_pairs(
    folder: str | Path,
    size: tuple[int, int],
    recorded: TumRecording | None = None,
    stride: int = 1,
) -> Iterator[TruePair]:
    """Pairs of colour frames ``stride`` apart, undistorted and scaled to ``size`` (width, height).

    Raises:
        InputError: the folder lacks a file, or a file cannot be read.

    """
    recorded = TumRecording(Path(folder)) if recorded is None else recorded
    camera = tum_camera(size)
    posed = recorded.images
    images = [_rectified(read_grey(image.colour), camera) for image in posed]
    depths = [_registered_depth(image, camera) for image in posed]
    for k in range(stride, len(posed)):
        past, now = posed[k - stride], posed[k]
        motion = CameraMotion(
            rotation=now.axes.T @ past.axes,
            translation=now.axes.T @ (now.place - past.place),
            dt=now.time - past.time,
        )
        pair = FramePair(Frame(past.time, images[k - stride]), Frame(now.time, images[k]), motion)
        yield TruePair("tum", f"stride {stride}", pair, motion, depths[k], depths[k - stride])


@dataclass(frozen=True)
class _PosedImage:
    """A colour image with the camera's pose, and the nearest depth image in time with its pose.

    ``place`` (3,) [m] is the camera's position in the world, the columns of ``axes`` (3, 3) are
    its right, down and forward directions. ``time`` [s].
    """

    time: float
    colour: Path
    place: Array
    axes: Array
    depth: Path
    depth_place: Array
    depth_axes: Array


class TumRecording:
    """A sequence: colour images, each with the depth image and the pose nearest in time."""

    def __init__(self, folder: Path) -> None:
        colour, depth = _listing(folder, "rgb.txt"), _listing(folder, "depth.txt")
        poses = load_pose_record(folder / "groundtruth.txt")
        self.images: list[_PosedImage] = []
        for stamp, file in colour if depth else ():
            at, near = min(depth, key=lambda item: abs(item[0] - stamp))
            posed = poses.poses_at(stamp, at)
            if abs(at - stamp) <= MAX_GAP and posed is not None:
                (place, depth_place), turns = posed
                axes, depth_axes = turns.as_matrix()
                self.images.append(
                    _PosedImage(stamp, file, place, axes, near, depth_place, depth_axes)
                )
        if len(self.images) < 2:
            raise ConfigError(
                f"expected two colour images with a pose, and a depth image within {MAX_GAP} s",
                file=folder,
            )


def _listing(folder: Path, name: str) -> list[tuple[float, Path]]:
    """Time stamps [s] and existing files of an index file."""
    lines = read_input_text(folder / name, _MAX_LIST).splitlines()
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
    measured = np.asarray(read_image(image.depth, cv2.IMREAD_UNCHANGED), dtype=np.float64)
    measured /= DEPTH_UNIT
    rows, columns = np.nonzero(measured > 0.0)
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    straight = cv2.undistortPoints(pixels[:, None], FR1_MATRIX, FR1_DISTORTION)
    rays = np.concatenate([np.asarray(straight)[:, 0], np.ones((len(pixels), 1))], axis=1)
    world = (rays * measured[rows, columns, None]) @ image.depth_axes.T + image.depth_place
    points = (world - image.place) @ image.axes
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
