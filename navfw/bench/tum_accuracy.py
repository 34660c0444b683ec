"""Flow on recorded images: real office frames with depth and pose, and a pure approach.

The data are not part of the repository: each function takes the folder that holds them.

- ``bench_approach``: see ``navfw.bench.recorded_approach``.
- ``bench_tum``: a piece of a sequence of the TUM RGB-D benchmark (Sturm et al. 2012, CC BY 4.0).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.flow_accuracy import TRUSTED, all_processors, statistics
from navfw.bench.flow_pairs import TruePair
from navfw.bench.recorded_approach import bench_approach, contact_times, read_image
from navfw.errors import ConfigError
from navfw.flow.grid import grid_points
from navfw.flow.ideal import Ideal, nearness_at, true_vectors
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Array, CameraMotion, Frame, FramePair, Image

__all__ = ["bench_approach", "bench_tum", "contact_times", "tum_pairs", "tum_table"]

FR1_MATRIX = np.array([[517.3, 0.0, 318.6], [0.0, 516.5, 255.3], [0.0, 0.0, 1.0]])
"""Colour camera of the sequences called freiburg1."""
FR1_DISTORTION = np.array([0.2624, -0.9531, -0.0054, 0.0026, 1.1633])
DEPTH_UNIT = 5000.0
"""Values of the depth images for one metre."""
TUM_SIZES = ((640, 480), (320, 240), (160, 120))
"""Image sizes the processors are tried at."""
LARGEST_GAP = 0.02
"""A depth image belongs to a colour image when taken within that time [s]."""


def bench_tum(
    folder: str | Path,
    sizes: Sequence[tuple[int, int]] = TUM_SIZES,
    processors: Callable[[RobotModel], Mapping[str, Any]] = all_processors,
) -> dict[str, Any]:
    """End-point errors of every processor on consecutive real frames, at several sizes.

    The truth is made of the depth images and the motion capture's poses; its own error is part of
    what is found. Most of that is a wrong rotation, which moves the whole image alike: the same
    errors are therefore given once more less the small rotation that explains each pair's best.
    Returns plain data: ``pairs``; ``sizes``: list of {``width``, ``height``, ``baseline_m`` and
    ``turn_deg`` (medians), ``flow_median_px``, ``processors``: by name ``statistics`` of the
    trusted vectors, ``ms``, and under ``less_rotation`` the statistics without that rotation}.

    Raises:
        ConfigError: the folder does not hold what it should.

    """
    recorded = _TumRecording(Path(folder))
    found = []
    for size in sizes:
        pairs = list(tum_pairs(folder, size, recorded))
        robot = RobotModel(camera=_tum_camera(size))
        results = {}
        for name, processor in processors(robot).items():
            if not isinstance(processor, Ideal):
                results[name] = _measure_tum(processor, pairs)
        found.append(
            {
                "width": size[0],
                "height": size[1],
                "baseline_m": median(p.motion.baseline for p in pairs),
                "turn_deg": median(_angle(p.motion.rotation) for p in pairs),
                "flow_median_px": _typical_flow(robot, pairs),
                "processors": results,
            }
        )
    return {"pairs": len(pairs), "sizes": found}


def tum_table(result: Mapping[str, Any]) -> str:
    """Markdown: the errors of ``bench_tum`` at every size."""
    lines = [
        f"End-point errors [px] on {result['pairs']} pairs of real frames; in brackets less the"
        " rotation that the poses are off:",
        "",
        "| size | processor | trusted | median | 95 % | within 2 sigma | ms |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for size in result["sizes"]:
        for name, p in size["processors"].items():
            if not p["n"]:
                lines.append(f"| {size['width']} x {size['height']} | {name} | 0 % | | | | |")
                continue
            less = p["less_rotation"]
            lines.append(
                f"| {size['width']} x {size['height']} | {name} | {100 * p['coverage']:.0f} %"
                f" | {p['epe_median']:.2f} ({less['epe_median']:.2f})"
                f" | {p['epe_p95']:.2f} ({less['epe_p95']:.2f})"
                f" | {100 * p['within_2_sigma']:.0f} % ({100 * less['within_2_sigma']:.0f} %)"
                f" | {p['ms']:.2f} |"
            )
    return "\n".join(lines) + "\n"


def tum_pairs(
    folder: str | Path, size: tuple[int, int], recorded: _TumRecording | None = None
) -> Iterator[TruePair]:
    """Pairs of consecutive colour frames, undistorted and at ``size`` (width, height).

    ``depth`` is that of the current frame, 0 where it is not known.
    """
    recorded = _TumRecording(Path(folder)) if recorded is None else recorded
    camera = _tum_camera(size)
    views = recorded.views
    images = [_rectified(read_image(view.colour), camera) for view in views]
    for k in range(1, len(views)):
        past, now = views[k - 1], views[k]
        motion = CameraMotion(
            rotation=now.axes.T @ past.axes,
            translation=now.axes.T @ (now.place - past.place),
            dt=now.time - past.time,
        )
        depth = _seen_depth(now, camera)
        pair = FramePair(Frame(past.time, images[k - 1]), Frame(now.time, images[k]), motion)
        yield TruePair("tum", "consecutive", pair, motion, depth)


@dataclass(frozen=True)
class _PosedImage:
    """A colour image with its pose, and the depth image next to it with its own pose.

    ``place`` (3,) [m] and ``axes`` (3, 3; columns: right, down, ahead) in the world.
    """

    time: float
    colour: Path
    place: Array
    axes: Array
    depth: Path
    depth_place: Array
    depth_axes: Array


class _TumRecording:
    """Associates colour, depth and pose by time."""

    def __init__(self, folder: Path) -> None:
        colour, depth = _listing(folder, "rgb.txt"), _listing(folder, "depth.txt")
        self._poses = _poses(folder / "groundtruth.txt")
        self.views: list[_PosedImage] = []
        for stamp, file in colour:
            at, near = min(depth, key=lambda item: abs(item[0] - stamp))
            if abs(at - stamp) <= LARGEST_GAP:
                self.views.append(
                    _PosedImage(stamp, file, *self._pose(stamp), near, *self._pose(at))
                )
        if len(self.views) < 2:
            raise ConfigError("has no two colour images with depth near in time", file=folder)

    def _pose(self, stamp: float) -> tuple[Array, Array]:
        """Place and axes at a time, between the poses around it."""
        from scipy.spatial.transform import Rotation, Slerp

        times = self._poses[:, 0]
        k = int(np.clip(np.searchsorted(times, stamp), 1, len(times) - 1))
        share = float((stamp - times[k - 1]) / (times[k] - times[k - 1]))
        place = (1.0 - share) * self._poses[k - 1, 1:4] + share * self._poses[k, 1:4]
        turn = Slerp([0.0, 1.0], Rotation.from_quat(self._poses[k - 1 : k + 1, 4:8]))
        return place, np.asarray(turn(min(max(share, 0.0), 1.0)).as_matrix(), dtype=np.float64)


def _listing(folder: Path, name: str) -> list[tuple[float, Path]]:
    """Time stamps and files of an index, those that are there."""
    try:
        lines = (folder / name).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ConfigError(f"expected {name}: {error.strerror}", file=folder) from None
    pairs = [line.split() for line in lines if line and not line.startswith("#")]
    return [(float(t), folder / f) for t, f in pairs if (folder / f).is_file()]


def _poses(file: Path) -> Array:
    """(n, 8) time, place, quaternion (x, y, z, w), in order of time."""
    try:
        poses = np.loadtxt(file, comments="#", ndmin=2, dtype=np.float64)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"expected lines of time, place, quaternion: {error}", file=file
        ) from None
    return poses[np.argsort(poses[:, 0])]


def _tum_camera(size: tuple[int, int]) -> CameraModel:
    """A pinhole camera of the same focal length, with its principal point in the middle."""
    hfov = 2.0 * math.atan(0.5 * 640 / FR1_MATRIX[0, 0])
    return CameraModel(width=size[0], height=size[1], hfov=hfov)


def _rectified(image: Image, camera: CameraModel) -> Image:
    """``image`` (480, 640) without distortion, reduced to the size of ``camera``."""
    full = _tum_camera((640, 480))
    matrix = _matrix(full)
    maps = cv2.initUndistortRectifyMap(
        FR1_MATRIX, FR1_DISTORTION, np.eye(3), matrix, (640, 480), cv2.CV_32FC1
    )
    straight = cv2.remap(image, maps[0], maps[1], cv2.INTER_LINEAR)
    reduced = cv2.resize(straight, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, dtype=np.uint8)


def _matrix(camera: CameraModel) -> Array:
    f = camera.focal
    x, y = 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)
    return np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])


def _seen_depth(view: _PosedImage, camera: CameraModel) -> npt.NDArray[np.float32]:
    """Depth (height, width) [m] from the colour image's own pose; 0 where nobody measured.

    The depth image was taken a little before or after: its points are carried to the colour
    image's pose, and of several that meet in a pixel the nearest stays.
    """
    measured = np.asarray(cv2.imread(str(view.depth), cv2.IMREAD_UNCHANGED), dtype=np.float64)
    measured /= DEPTH_UNIT
    rows, columns = np.nonzero(measured > 0.0)
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    straight = cv2.undistortPoints(pixels[:, None], FR1_MATRIX, FR1_DISTORTION)
    rays = np.concatenate([np.asarray(straight)[:, 0], np.ones((len(pixels), 1))], axis=1)
    world = (rays * measured[rows, columns, None]) @ view.depth_axes.T + view.depth_place
    points = (world - view.place) @ view.axes
    points = points[points[:, 2] > 0.1]
    at = np.rint(camera.focal * points[:, :2] / points[:, 2:] + _matrix(camera)[:2, 2])
    inside = ((at >= 0) & (at < (camera.width, camera.height))).all(axis=1)
    x, y = at[inside].astype(np.int64).T
    nearness = np.zeros((camera.height, camera.width))
    np.maximum.at(nearness, (y, x), 1.0 / points[inside, 2])
    filled = nearness > 0.0
    depth = np.zeros(nearness.shape, np.float32)
    depth[filled] = (1.0 / nearness[filled]).astype(np.float32)
    return depth


def _measure_tum(processor: Any, pairs: Sequence[TruePair]) -> dict[str, Any]:
    camera = processor.robot.camera
    parts: list[tuple[Array, Array, Array]] = []
    costs: list[float] = []
    cells = 0
    processor.compute(pairs[0].pair)
    for true in pairs:
        begun = time.thread_time()
        flow = processor.compute(true.pair)
        costs.append(1e3 * (time.thread_time() - begun))
        vectors, known = _tum_truth(flow.points, true, camera)
        off = flow.vectors - vectors
        trusted = (flow.confidence >= TRUSTED) & known & np.isfinite(off).all(axis=-1)
        cells += int(known.sum())
        if trusted.sum() < 3:
            continue
        less = _less_rotation(off[trusted], flow.points[trusted], camera.focal)
        parts.append((off[trusted], less, flow.sigma[trusted]))
    if not parts:
        return {**statistics(np.zeros((0, 2)), np.zeros(0), cells), "ms": median(costs)}
    off, less, sigma = (np.concatenate(part) for part in zip(*parts, strict=True))
    return {
        **statistics(off, sigma, cells),
        "ms": median(costs),
        "less_rotation": statistics(less, sigma, cells),
    }


def _tum_truth(
    points: Array, true: TruePair, camera: CameraModel
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """True vectors at ``points``, and where there is depth all round to make them of."""
    holes = np.where(true.depth > 0.0, true.depth, np.inf).astype(np.float32)
    nearness = nearness_at(points, holes, camera)
    blocked = cv2.dilate((true.depth <= 0.0).astype(np.uint8), np.ones((2, 2), np.uint8))
    x = np.clip(points[..., 0] + 0.5 * camera.width, 0, camera.width - 1).astype(np.int64)
    y = np.clip(points[..., 1] + 0.5 * camera.height, 0, camera.height - 1).astype(np.int64)
    known = np.asarray(blocked)[y, x] == 0
    return true_vectors(points, nearness, true.motion, camera.focal), known


def _less_rotation(off: Array, points: Array, focal: float) -> Array:
    """Errors (n, 2) less those of the small rotation that explains them best (robustly)."""
    x, y = points[:, 0], points[:, 1]
    zero = np.zeros_like(x)
    slopes = np.stack(
        [
            np.stack([x * y / focal, -(focal + x**2 / focal), y], axis=-1),
            np.stack([focal + y**2 / focal, -x * y / focal, -x], axis=-1),
        ],
        axis=1,
    )
    left, weight = off, zero + 1.0
    for _ in range(10):
        root = np.sqrt(weight)[:, None]
        system = (slopes * root[..., None]).reshape(-1, 3)
        turn = np.linalg.lstsq(system, (off * root).ravel(), rcond=None)[0]
        left = off - slopes @ turn
        size = np.linalg.norm(left, axis=1)
        weight = 1.0 / (1.0 + (size / (2.0 * max(float(np.median(size)), 1e-3))) ** 2)
    return np.asarray(left)


def _typical_flow(robot: RobotModel, pairs: Sequence[TruePair]) -> float:
    """Median length of the true vectors at the grid [px], rotation included."""
    points, lengths = grid_points(robot.camera, 12, 16), []
    for pair in pairs:
        vectors, known = _tum_truth(points, pair, robot.camera)
        lengths.append(np.linalg.norm(vectors[known], axis=-1))
    return float(np.median(np.concatenate(lengths)))


def _angle(rotation: Array) -> float:
    """Of a rotation matrix [deg]."""
    return math.degrees(math.acos(min(max(0.5 * (float(np.trace(rotation)) - 1.0), -1.0), 1.0)))
