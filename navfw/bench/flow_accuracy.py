"""Errors of flow processors on rendered frames, calibration of their sigma, computing time.

The truth follows from the depth and motion of rendered pairs (``navfw.bench.true_pairs``). Times
are CPU times of single calls, since other programs on the same cores disturb wall times more.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from statistics import median
from typing import Any, TypeVar

import cv2
import numpy as np

from navfw.bench import true_pairs
from navfw.flow.block_matching import BlockMatching
from navfw.flow.ideal import Ideal
from navfw.flow.opencv_flow import Dis, Farneback, LucasKanade
from navfw.flow.registration import Registered
from navfw.interfaces import FlowProcessor
from navfw.numerics import Array
from navfw.numerics.arrays import Floats, Mask
from navfw.process.result_table import Column, ResultTable, named, shown
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame, FramePair

ResultT = TypeVar("ResultT")

SIGMA_BINS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, np.inf)
"""Limits [px] of the intervals of sigma in the calibration table."""
TRUSTED = 0.3
"""Least confidence of the vectors that are evaluated."""
_EDGE_REACH = 12
"""Largest distance [px] of a depth edge from a cell's point for the cell to count as at an edge:
half the matching window."""
_EDGE_STEP = 0.12
"""Relative difference of the nearness of two neighbouring pixels from which on they show two
surfaces."""


@dataclass(frozen=True, slots=True)
class _PairTruth:
    """A ``navfw.flow.ideal.TruthSource`` for one pair."""

    pair: true_pairs.TruePair

    def depth(self, frame: Frame) -> Floats:
        return self.pair.depth

    def motion(self, pair: FramePair) -> CameraMotion:
        return self.pair.motion


@dataclass(frozen=True, slots=True)
class FlowAnswer:
    """The answer of a processor on one pair, or on n: arrays (rows, cols) or (n, rows, cols).

    ``off`` (..., 2) [px] is measured minus true flow at ``points``, ``true`` (..., 2) [px] the
    latter, ``sigma`` [px] the processor's own estimate of the error. ``valid`` is where there is a
    truth, ``trusted`` where the processor has a confidence of TRUSTED as well; ``ms`` the CPU time
    of the call, or the median of n.
    """

    points: Array
    off: Array
    true: Array
    sigma: Array
    valid: Mask
    trusted: Mask
    ms: float

    @classmethod
    def stacked(cls, answers: Sequence[FlowAnswer]) -> FlowAnswer:
        """The answers on n pairs as one."""
        names = [field.name for field in fields(cls) if field.name != "ms"]
        arrays: dict[str, Any] = {n: np.stack([getattr(a, n) for a in answers]) for n in names}
        return cls(**arrays, ms=median(a.ms for a in answers))

    @property
    def error(self) -> Array:
        """End-point errors [px]."""
        return np.asarray(np.hypot(self.off[..., 0], self.off[..., 1]))


def answer(processor: FlowProcessor, pair: true_pairs.TruePair) -> FlowAnswer:
    """The answer of ``processor`` on a pair, compared with the true flow."""
    spent, flow = _cpu_ms(processor.compute, pair.pair)
    true, valid = true_pairs.true_flow(flow.points, pair, processor.robot.camera)
    trusted = (flow.confidence >= TRUSTED) & valid
    return FlowAnswer(flow.points, flow.vectors - true, true, flow.sigma, valid, trusted, spent)


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
    worlds: Sequence[str] = true_pairs.WORLDS,
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
    rendered = true_pairs.rendered_pairs(true_pairs.load_worlds(worlds), robot, places, seed)
    pairs = list(
        with_progress(
            rendered, "flow: rendering", report, len(worlds) * places * len(true_pairs.MOTIONS)
        )
    )
    measured = {}
    for name, processor in processors.items():
        counted = with_progress(pairs, f"flow: {name}", report)
        measured[name] = measure(processor, counted, worlds)
    report("flow: matchTemplate")
    return {
        "pairs": len(pairs),
        "places": places,
        "seed": seed,
        "worlds": list(worlds),
        "motions": list(true_pairs.MOTIONS),
        "trusted_from": TRUSTED,
        "processors": measured,
        **match_template_ratio(robot, [p.pair for p in pairs[:: max(1, len(pairs) // 60)]]),
    }


def measure(
    processor: FlowProcessor,
    pairs: Iterable[true_pairs.TruePair],
    worlds: Sequence[str] = true_pairs.WORLDS,
) -> dict[str, Any]:
    """Run ``processor`` over ``pairs`` and compare each trusted vector with the true one.

    Plain data: the values of a processor in ``bench_flow``.
    """
    answers: list[FlowAnswer] = []
    is_edge, names = [], []
    for pair in pairs:
        if isinstance(processor, Ideal):
            processor.set_truth(_PairTruth(pair))
        if not answers:
            processor.compute(pair.pair)  # compiles kernels, which is not timed
        answers.append(answer(processor, pair))
        is_edge.append(_edges(pair.depth, answers[-1].points, processor.robot.camera))
        names.append((pair.name, pair.world))
    edges, whole = np.stack(is_edge), FlowAnswer.stacked(answers)
    off, sigma, trusted = whole.off, whole.sigma, whole.trusted

    def of(chosen: Mask, cells: int) -> dict[str, Any]:
        return statistics(off[trusted & chosen], sigma[trusted & chosen], cells)

    def with_name(name: str, cells: int | None = None) -> dict[str, Any]:
        chosen = np.array([name in pair for pair in names])[:, None, None]
        return of(chosen, int(chosen.sum()) * trusted[0].size if cells is None else cells)

    return {
        **statistics(off[trusted], sigma[trusted], trusted.size),
        "ms": whole.ms,
        "by_motion": {name: with_name(name) for name in true_pairs.MOTIONS},
        "by_world": {name: with_name(name, trusted.size // len(worlds)) for name in worlds},
        "edges": of(edges, 0),
        "smooth": of(~edges, 0),
        "calibration": _calibration(off[trusted], sigma[trusted]),
    }


def _edges(depth: Floats, points: Array, camera: CameraModel) -> Mask:
    """Where (rows, cols) a depth edge lies within _EDGE_REACH of a point."""
    nearness = 1.0 / depth.astype(np.float64)
    step = np.zeros_like(nearness)
    step[:, 1:] = np.abs(np.diff(nearness, axis=1))
    step[1:] = np.maximum(step[1:], np.abs(np.diff(nearness, axis=0)))
    jumps = (step > _EDGE_STEP * np.maximum(nearness, 1e-3)).astype(np.uint8)
    near = cv2.dilate(jumps, np.ones((2 * _EDGE_REACH, 2 * _EDGE_REACH), np.uint8))
    return np.asarray(near, dtype=np.bool_)[true_pairs.pixels(points, camera)]


def statistics(off: Array, sigma: Array, cells: int) -> dict[str, Any]:
    """Of errors ``off`` (n, 2) with their ``sigma`` (n,), among ``cells`` cells.

    Keys: ``n``; ``coverage``, the part of the cells that is trusted; of the end-point errors [px]
    ``epe_median``, ``epe_p95``, ``epe_mean``, ``over_half_px`` (share); of the components
    ``within_1_sigma`` and ``within_2_sigma`` (shares; 0.68 and 0.95 if normal); ``sigma_median``.
    All None when there are no vectors.
    """
    length = np.hypot(off[:, 0], off[:, 1])
    ratio = np.abs(off) / sigma[:, None]
    figures: dict[str, Callable[[], Any]] = {
        "epe_median": lambda: np.median(length),
        "epe_p95": lambda: np.percentile(length, 95),
        "epe_mean": length.mean,
        "over_half_px": (length > 0.5).mean,
        "within_1_sigma": (ratio < 1.0).mean,
        "within_2_sigma": (ratio < 2.0).mean,
        "sigma_median": lambda: np.median(sigma),
    }
    return {
        "n": len(off),
        "coverage": len(off) / cells if cells else 0.0,
        **{key: float(value()) if len(off) else None for key, value in figures.items()},
    }


def _calibration(off: Array, sigma: Array) -> list[dict[str, Any]]:
    rows = []
    for low, high in itertools.pairwise(SIGMA_BINS):
        chosen = (sigma >= low) & (sigma < high)
        if not chosen.any():
            continue
        figures = statistics(off[chosen], sigma[chosen], 0)
        row = {"sigma_from": float(low), "sigma_to": float(high) if np.isfinite(high) else None}
        row |= {"n": figures["n"], "rms": float(np.sqrt((off[chosen] ** 2).mean()))}
        rows.append(row | {key: figures[key] for key in ("within_1_sigma", "within_2_sigma")})
    return rows


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """Tables of all processors, of their errors by motion, and of the calibration of sigma."""
    processors: dict[str, dict[str, Any]] = result["processors"]
    columns = [
        Column("processor", "name"),
        Column("trusted", "coverage", ".1%"),
        Column("median", "epe_median", ".3g"),
        Column("95 %", "epe_p95", ".3g"),
        Column("over 0.5 px", "over_half_px", ".1%"),
        Column("within 2 sigma", "within_2_sigma", ".1%"),
        Column("ms", "ms", ".3g"),
    ]
    title = f"Flow on {result['pairs']} rendered pairs, end-point errors [px]"
    yield ResultTable(title, columns, named(processors))
    motions = [
        {"motion": motion}
        | {name: _spread(processor["by_motion"][motion]) for name, processor in processors.items()}
        for motion in result["motions"]
    ]
    columns = [Column(name, name) for name in ("motion", *processors)]
    yield ResultTable("End-point errors [px], median / 95 %, by motion", columns, motions)
    title = "Root mean square error of the components [px], share within two sigma, by sigma"
    columns = [Column(name, name) for name in ("sigma [px]", *processors)]
    yield ResultTable(title, columns, list(_calibration_rows(processors)))


def _spread(errors: Mapping[str, Any]) -> str:
    return " / ".join(shown(errors[key], ".2f") for key in ("epe_median", "epe_p95"))


def _calibration_rows(processors: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, str]]:
    for low, high in itertools.pairwise(SIGMA_BINS):
        sigma = f"{low:g} to {high:g}" if np.isfinite(high) else f"above {low:g}"
        row = {"sigma [px]": sigma, **dict.fromkeys(processors, "-")}
        for name, processor in processors.items():
            for interval in processor["calibration"]:
                if interval["sigma_from"] == low:
                    within = shown(interval["within_2_sigma"], ".1%")
                    row[name] = f"{interval['rms']:.2f}, {within}"
        yield row


# --- reference: a loop over matchTemplate - ------------------------------------------------------


def match_template_ratio(robot: RobotModel, pairs: Sequence[FramePair]) -> dict[str, float]:
    """CPU time of a loop of OpenCV's ``matchTemplate`` over the windows, against block matching.

    The loop finds whole-pixel peaks only; block matching includes confidence and subpixel
    registration. Keys: ``match_template_ms``, ``block_matching_ms``, ``block_matching_peak_ms``
    (without registration) and ``block_matching_ratio``; medians over ``pairs``, with the three
    methods called in turns.
    """
    matcher = BlockMatching(robot)
    peak = BlockMatching(robot, BlockMatching.Params(subpixel="peak"))
    methods: dict[str, Callable[[FramePair], object]] = {
        "match_template_ms": matcher.whole_pixel_loop,
        "block_matching_ms": matcher.compute,
        "block_matching_peak_ms": peak.compute,
    }
    matcher.compute(pairs[0])
    peak.compute(pairs[0])
    spent = [[_cpu_ms(method, pair)[0] for method in methods.values()] for pair in pairs]
    times = dict(zip(methods, np.median(spent, axis=0).tolist(), strict=True))
    ratio = times["match_template_ms"] / times["block_matching_ms"]
    return {**times, "block_matching_ratio": ratio}


def _cpu_ms(method: Callable[[FramePair], ResultT], pair: FramePair) -> tuple[float, ResultT]:
    begun = time.thread_time()
    result = method(pair)
    return 1e3 * (time.thread_time() - begun), result
