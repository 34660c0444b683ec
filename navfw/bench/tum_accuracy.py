"""Errors of flow processors on real frames with depth and pose (TUM RGB-D benchmark)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.flow_accuracy import TRUSTED, all_processors, statistics
from navfw.bench.flow_pairs import TruePair
from navfw.bench.tum_recording import TumRecording, tum_camera, tum_pairs
from navfw.flow.grid import grid_points
from navfw.flow.ideal import Ideal, nearness_at, true_vectors
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Array

__all__ = ["bench_tum", "tum_table"]

TUM_SIZES = ((640, 480), (320, 240), (160, 120))
"""Image sizes (width, height) [px] at which the processors are measured."""


def bench_tum(
    folder: str | Path,
    sizes: Sequence[tuple[int, int]] = TUM_SIZES,
    processors: Callable[[RobotModel], Mapping[str, Any]] = all_processors,
) -> dict[str, Any]:
    """End-point errors of every processor on consecutive real frames, at several image sizes.

    The true flow follows from the depth images and the poses of the motion capture system, so the
    errors include theirs. Most of that part is a rotation error, which moves the whole image
    alike: ``less_rotation`` has the same statistics after removing the small rotation that fits
    the errors of each pair best. Returns plain data: ``pairs``; ``sizes``: list of {``width``,
    ``height``, ``baseline_m`` and ``turn_deg`` (medians), ``flow_median_px``, ``processors``: by
    name ``statistics`` of the trusted vectors, ``ms`` (median time of a call), ``less_rotation``}.

    Raises:
        ConfigError: the folder lacks a file, or a file cannot be read.

    """
    recorded = TumRecording(Path(folder))
    found = []
    for size in sizes:
        pairs = list(tum_pairs(folder, size, recorded))
        robot = RobotModel(camera=tum_camera(size))
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
    """The errors of ``bench_tum`` at every size, as Markdown."""
    lines = [
        f"End-point errors [px] on {result['pairs']} pairs of real frames; in brackets"
        " without the rotation error of the recorded poses:",
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


def _measure_tum(processor: Any, pairs: Sequence[TruePair]) -> dict[str, Any]:
    """Statistics of the trusted vectors of one processor over all pairs, and its time."""
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
    """True vectors at ``points`` [px], and where all four neighbouring pixels have depth."""
    holes = np.where(true.depth > 0.0, true.depth, np.inf).astype(np.float32)
    nearness = nearness_at(points, holes, camera)
    blocked = cv2.dilate((true.depth <= 0.0).astype(np.uint8), np.ones((2, 2), np.uint8))
    x = np.clip(points[..., 0] + 0.5 * camera.width, 0, camera.width - 1).astype(np.int64)
    y = np.clip(points[..., 1] + 0.5 * camera.height, 0, camera.height - 1).astype(np.int64)
    known = np.asarray(blocked)[y, x] == 0
    return true_vectors(points, nearness, true.motion, camera.focal), known


def _less_rotation(off: Array, points: Array, focal: float) -> Array:
    """Errors (n, 2) [px] without the flow of the small rotation that fits them best.

    The fit is iteratively reweighted least squares with Cauchy weights.
    """
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
    """Median length [px] of the true vectors on a 12 x 16 grid, rotation included."""
    points, lengths = grid_points(robot.camera, 12, 16), []
    for pair in pairs:
        vectors, known = _tum_truth(points, pair, robot.camera)
        lengths.append(np.linalg.norm(vectors[known], axis=-1))
    return float(np.median(np.concatenate(lengths)))


def _angle(rotation: Array) -> float:
    """Angle [deg] of a rotation matrix."""
    return math.degrees(math.acos(min(max(0.5 * (float(np.trace(rotation)) - 1.0), -1.0), 1.0)))
