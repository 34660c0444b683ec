"""Errors of flow processors on rendered frames, calibration of their sigma, computing time.

The truth follows from the depth and motion of rendered pairs (``navfw.bench.flow_pairs``). Times
are CPU times of single calls, since other programs on the same cores disturb wall times more.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.flow_pairs import MOTIONS, WORLDS, TruePair, load_worlds, rendered_pairs
from navfw.bench.flow_report import SIGMA_BINS
from navfw.bench.true_flow import true_flow
from navfw.flow.block_matching import BlockMatching
from navfw.flow.dis import Dis
from navfw.flow.farneback import Farneback
from navfw.flow.ideal import Ideal
from navfw.flow.lucas_kanade import LucasKanade
from navfw.flow.registered import Registered
from navfw.interfaces import FlowProcessor
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Array, CameraMotion, FlowField, Frame, FramePair

TRUSTED = 0.3
"""Least confidence of the vectors that are evaluated."""
_EDGE_REACH = 12
"""Largest distance [px] of a depth edge from a cell's point for the cell to count as at an edge:
half the matching window."""
_EDGE_STEP = 0.12
"""Relative difference of the nearness of two neighbouring pixels from which on they show two
surfaces."""


class TruePairSource:
    """True depth and motion of one pair at a time (``navfw.flow.ideal.TruthSource``)."""

    def __init__(self) -> None:
        self.now: TruePair | None = None

    def depth(self, frame: Frame) -> npt.NDArray[np.float32]:
        """True depth of the pair's current frame."""
        if self.now is None:
            raise ValueError("no pair has been set")
        return self.now.depth

    def motion(self, pair: FramePair) -> CameraMotion:
        """True motion of the pair."""
        if self.now is None:
            raise ValueError("no pair has been set")
        return self.now.motion


@dataclass
class FlowErrors:
    """Errors of the trusted vectors of one processor; arrays of the same length n.

    ``off`` (n, 2) [px] is measured minus true flow, ``sigma`` [px] the processor's own estimate of
    the error, ``edge`` whether a depth edge lies within the window, ``motion`` and ``world``
    indices into ``motions`` and ``worlds`` of the benchmark. ``cells`` counts all cells by motion,
    trusted or not; ``milliseconds`` are the times of the calls.
    """

    off: Array
    sigma: Array
    edge: npt.NDArray[np.bool_]
    motion: npt.NDArray[np.int64]
    world: npt.NDArray[np.int64]
    cells: npt.NDArray[np.int64]
    milliseconds: list[float] = field(default_factory=list)


def all_processors(robot: RobotModel) -> dict[str, FlowProcessor]:
    """Every shipped processor, and block matching as in the paper (peak only, no subpixel fit)."""
    return {
        "registered": Registered(robot),
        "block_matching": BlockMatching(robot),
        "block_matching, peak only": BlockMatching(robot, BlockMatching.Params(subpixel="peak")),
        "lucas_kanade": LucasKanade(robot),
        "dis": Dis(robot),
        "farneback": Farneback(robot),
        "ideal": Ideal(robot),
    }


def bench_flow(
    places: int = 20,
    seed: int = 0,
    robot: RobotModel | None = None,
    worlds: Sequence[str] = WORLDS,
    processors: Mapping[str, FlowProcessor] | None = None,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """Measure ``processors`` (default: all) at ``places`` random poses of each world.

    ``report`` is called with each part. Returns plain data:

    - ``pairs``: number of frame pairs; ``places``, ``seed``, ``worlds``, ``motions``;
    - ``trusted_from``: least confidence of the vectors evaluated;
    - ``processors``: by name, the ``statistics`` of all trusted vectors and ``ms`` (median time of
      a call); the same of subsets in ``by_motion``, ``by_world``, ``edges`` (cells with a depth
      edge in their window) and ``smooth`` (the other cells); and ``calibration``, a list of
      {``sigma_from``, ``sigma_to``, ``n``, ``rms``, ``within_1_sigma``, ``within_2_sigma``};
    - ``block_matching_ratio``, ``match_template_ms``: see ``match_template_ratio``.
    """
    robot = RobotModel() if robot is None else robot
    processors = all_processors(robot) if processors is None else processors
    rendered = rendered_pairs(load_worlds(worlds), robot, places, seed)
    pairs = list(
        with_progress(rendered, "flow: rendering", report, len(worlds) * places * len(MOTIONS))
    )
    measured = {}
    for name, processor in processors.items():
        shown = with_progress(pairs, f"flow: {name}", report)
        measured[name] = _summary(measure(processor, shown, worlds), worlds)
    report("flow: matchTemplate")
    return {
        "pairs": len(pairs),
        "places": places,
        "seed": seed,
        "worlds": list(worlds),
        "motions": list(MOTIONS),
        "trusted_from": TRUSTED,
        "processors": measured,
        **match_template_ratio(robot, [p.pair for p in pairs[:: max(1, len(pairs) // 60)]]),
    }


def measure(
    processor: FlowProcessor, pairs: Iterable[TruePair], worlds: Sequence[str] = WORLDS
) -> FlowErrors:
    """Run ``processor`` over ``pairs`` and compare each trusted vector with the true one."""
    camera = processor.robot.camera
    motions, world_names = list(MOTIONS), list(worlds)
    truth = TruePairSource()
    if isinstance(processor, Ideal):
        processor.set_truth(truth)
    parts: list[tuple[Array, ...]] = []
    cells = np.zeros(len(motions), np.int64)
    costs: list[float] = []
    for true in pairs:
        truth.now = true
        if not costs:
            processor.compute(true.pair)  # compiles kernels, which is not timed
        begun = time.thread_time()
        flow = processor.compute(true.pair)
        costs.append(1e3 * (time.thread_time() - begun))
        off, trusted = _compare(flow, true, camera)
        motion, world = motions.index(true.name), world_names.index(true.world)
        cells[motion] += trusted.size
        edge = _edges(true.depth, flow.points, camera)[trusted]
        count = int(trusted.sum())
        parts.append(
            (off[trusted], flow.sigma[trusted], edge, np.full(count, motion), np.full(count, world))
        )
    off, sigma, edge, motion_of, world_of = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    return FlowErrors(
        off, sigma, edge.astype(bool), motion_of.astype(int), world_of.astype(int), cells, costs
    )


def _compare(
    flow: FlowField, true: TruePair, camera: CameraModel
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Errors (rows, cols, 2) [px], and which vectors are trusted and have a truth."""
    vectors, known = true_flow(flow.points, true, camera)
    return flow.vectors - vectors, (flow.confidence >= TRUSTED) & known


def _edges(depth: npt.NDArray[np.float32], points: Array, camera: CameraModel) -> Array:
    """1 (rows, cols) where a depth edge lies within _EDGE_REACH of a point, 0 elsewhere."""
    nearness = 1.0 / depth.astype(np.float64)
    step = np.zeros_like(nearness)
    step[:, 1:] = np.abs(np.diff(nearness, axis=1))
    step[1:] = np.maximum(step[1:], np.abs(np.diff(nearness, axis=0)))
    jumps = (step > _EDGE_STEP * np.maximum(nearness, 1e-3)).astype(np.uint8)
    near = cv2.dilate(jumps, np.ones((2 * _EDGE_REACH, 2 * _EDGE_REACH), np.uint8))
    x = np.clip(points[..., 0] + 0.5 * camera.width, 0, camera.width - 1).astype(np.int64)
    y = np.clip(points[..., 1] + 0.5 * camera.height, 0, camera.height - 1).astype(np.int64)
    return np.asarray(near, dtype=np.float64)[y, x]


def statistics(off: Array, sigma: Array, cells: int) -> dict[str, Any]:
    """Of errors ``off`` (n, 2) with their ``sigma`` (n,), among ``cells`` cells.

    Keys: ``n``; ``coverage``, the part of the cells that is trusted; of the end-point errors [px]
    ``epe_median``, ``epe_p95``, ``epe_mean``, ``over_half_px`` (share); of the components
    ``within_1_sigma`` and ``within_2_sigma`` (shares; 0.68 and 0.95 if normal); ``sigma_median``.
    All None when there are no vectors.
    """
    keys = ("epe_median", "epe_p95", "epe_mean", "over_half_px")
    rest = ("within_1_sigma", "within_2_sigma", "sigma_median")
    if not len(off):
        return {"n": 0, "coverage": 0.0, **dict.fromkeys((*keys, *rest))}
    length = np.hypot(off[:, 0], off[:, 1])
    ratio = np.abs(off) / sigma[:, None]
    values = (
        *(np.median(length), np.percentile(length, 95), length.mean(), (length > 0.5).mean()),
        *((ratio < 1.0).mean(), (ratio < 2.0).mean(), np.median(sigma)),
    )
    return {
        "n": len(off),
        "coverage": len(off) / cells if cells else 0.0,
        **{key: float(value) for key, value in zip((*keys, *rest), values, strict=True)},
    }


def _summary(errors: FlowErrors, worlds: Sequence[str]) -> dict[str, Any]:
    total = int(errors.cells.sum())

    def of(chosen: npt.NDArray[np.bool_], cells: int) -> dict[str, Any]:
        return statistics(errors.off[chosen], errors.sigma[chosen], cells)

    return {
        **statistics(errors.off, errors.sigma, total),
        "ms": median(errors.milliseconds),
        "by_motion": {
            name: of(errors.motion == k, int(errors.cells[k])) for k, name in enumerate(MOTIONS)
        },
        "by_world": {
            name: of(errors.world == k, total // len(worlds)) for k, name in enumerate(worlds)
        },
        "edges": of(errors.edge, 0),
        "smooth": of(~errors.edge, 0),
        "calibration": _calibration(errors),
    }


def _calibration(errors: FlowErrors) -> list[dict[str, Any]]:
    rows = []
    for low, high in itertools.pairwise(SIGMA_BINS):
        chosen = (errors.sigma >= low) & (errors.sigma < high)
        if not chosen.any():
            continue
        off, sigma = errors.off[chosen], errors.sigma[chosen]
        part = statistics(off, sigma, 0)
        rows.append(
            {
                "sigma_from": float(low),
                "sigma_to": float(high) if np.isfinite(high) else None,
                "n": part["n"],
                "rms": float(np.sqrt((off**2).mean())),
                "within_1_sigma": part["within_1_sigma"],
                "within_2_sigma": part["within_2_sigma"],
            }
        )
    return rows


# --- reference: a loop over matchTemplate - ------------------------------------------------------


def match_template_ratio(
    robot: RobotModel, pairs: Sequence[FramePair], processor: BlockMatching | None = None
) -> dict[str, float]:
    """CPU time of a loop of OpenCV's ``matchTemplate`` over the windows, against block matching.

    The loop finds whole-pixel peaks only; block matching includes confidence and subpixel
    registration. Keys: ``match_template_ms``, ``block_matching_ms``, ``block_matching_peak_ms``
    (without registration) and ``block_matching_ratio``; medians over ``pairs``, with the three
    methods called in turns.
    """
    matcher = processor or BlockMatching(robot)
    peak = BlockMatching(robot, matcher.params.model_copy(update={"subpixel": "peak"}))
    spent: dict[str, list[float]] = {"loop": [], "matcher": [], "peak": []}
    matcher.compute(pairs[0])
    peak.compute(pairs[0])
    for pair in pairs:
        for name, work in (
            ("loop", matcher.whole_pixel_loop),
            ("matcher", matcher.compute),
            ("peak", peak.compute),
        ):
            begun = time.thread_time()
            work(pair)
            spent[name].append(1e3 * (time.thread_time() - begun))
    return {
        "match_template_ms": median(spent["loop"]),
        "block_matching_ms": median(spent["matcher"]),
        "block_matching_peak_ms": median(spent["peak"]),
        "block_matching_ratio": median(spent["loop"]) / median(spent["matcher"]),
    }
