"""``navfw bench perception``: accuracy and computing time; result and tables."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.flow.block_matching import BlockMatching
from navfw.fuzzy import load_rule_base
from navfw.numerics.arrays import Indices
from navfw.offis.fuzzy_systems import RULES, FuzzyEvaluation, infer
from navfw.offis.offis import Offis
from navfw.offis.percept_explanation import PerceptExplanation, evaluations_of
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent
from navfw.recording.run_folder import plain_json
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Twist
from navfw_benchmarks.bench import perception_accuracy
from navfw_benchmarks.bench.flow_comparison import cpu_ms
from navfw_benchmarks.bench.fuzzy_reference import ReferenceFis, compare, median_ms
from navfw_benchmarks.bench.perception_samples import samples_of_world

MAX_DIFFERENCE = 1e-6
"""Largest allowed difference between a compiled rule base and scikit-fuzzy, in output units."""

_SEED, _WORLD = 7, 0
_REFERENCE_FRAMES = 6


def time_perception(comparisons: int, workers: int) -> dict[str, Any]:
    """Measure all times, and compare every rule base with scikit-fuzzy; plain data.

    Keys: ``offis_ms`` (one call of ``perceive``: obstacles and situation), ``inference_ms`` (its
    fuzzy inferences alone), ``skfuzzy_ms`` (the same inferences by scikit-fuzzy),
    ``offis_skfuzzy_ratio`` (skfuzzy_ms / inference_ms), ``offis_whole_ratio`` (skfuzzy_ms /
    offis_ms), ``inferences`` (samples evaluated per frame); ``offis_max_abs_diff`` over
    ``comparisons`` random inputs of every rule base, and ``rule_bases`` one by one; the keys of
    ``time_flow``.

    scikit-fuzzy takes about 20 ms per input; ``workers`` processes share the comparison.
    """
    compared = compare_rule_bases(comparisons, workers)
    return {
        **time_offis(),
        "offis_max_abs_diff": max(result["max_abs_diff"] for result in compared),
        "comparisons": comparisons,
        "rule_bases": {result["name"]: result for result in compared},
        **time_flow([_textured_pair()] * 200),
    }


def time_offis(repeats: int = 1000) -> dict[str, Any]:
    """Times of OFFIS on rendered views: 12 x 16 vectors, two layers, default parameters."""
    flows = [(sample.flow, sample.twist) for sample in samples_of_world(_SEED, _WORLD)]
    offis = Offis(RobotModel())
    whole = median_ms(lambda k: offis.perceive(*flows[k % len(flows)]), repeats)
    frames = [_evaluations(offis, *frame) for frame in flows]
    inference = median_ms(
        lambda k: [infer(one.system, one.inputs) for one in frames[k % len(frames)]], repeats
    )
    references = {
        evaluation.system.rule_base.name: ReferenceFis(evaluation.system.rule_base)
        for evaluation in frames[0]
    }
    reference = median_ms(
        lambda k: _by_reference(frames[k % len(frames)], references), _REFERENCE_FRAMES
    )
    return {
        "offis_ms": whole,
        "inference_ms": inference,
        "skfuzzy_ms": reference,
        "offis_skfuzzy_ratio": reference / inference,
        "offis_whole_ratio": reference / whole,
        "inferences": sum(len(evaluation.result) for evaluation in frames[0]),
    }


def _evaluations(offis: Offis, flow: FlowField, twist: Twist) -> tuple[FuzzyEvaluation, ...]:
    explanation = offis.perceive(flow, twist).explanation
    if not isinstance(explanation, PerceptExplanation):
        raise TypeError(f"expected an explanation by OFFIS, got {type(explanation).__name__}")
    return evaluations_of(explanation)


def _by_reference(
    evaluations: Sequence[FuzzyEvaluation], references: dict[str, ReferenceFis]
) -> None:
    for evaluation in evaluations:
        reference = references[evaluation.system.rule_base.name]
        for k in range(len(evaluation.result)):
            reference.compute({name: float(x[k]) for name, x in evaluation.inputs.items()})


def compare_rule_bases(samples: int, workers: int = 1) -> list[dict[str, Any]]:
    """Every rule base of OFFIS against scikit-fuzzy on ``samples`` random inputs each."""
    files, compared = sorted(RULES.glob("*.yaml")), partial(_compare, samples=samples)
    if workers <= 1:
        return [compared(file) for file in files]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return pool.map(compared, files, chunksize=1)


def _compare(file: Path, samples: int) -> dict[str, Any]:
    return compare(load_rule_base(file), samples, np.random.default_rng(_SEED))


def match_windows(matcher: BlockMatching, pair: FramePair) -> Indices:
    """Displacements (rows, cols, 2) [px], now - past, by OpenCV's matcher, window by window.

    Finds the same peaks as the compiled correlation: its reference in tests and the baseline
    of its speed. The search is centred on zero displacement.
    """
    now, past = np.asarray(pair.now.image), np.asarray(pair.past.image)
    search, (height, width) = matcher.params.search, past.shape
    peaks: Indices = np.zeros((len(matcher._y_windows), len(matcher._x_windows), 2), np.int64)
    for r, (top, bottom) in enumerate(matcher._y_windows):
        y0, y1 = max(0, top - search), min(height, bottom + search)
        for c, (left, right) in enumerate(matcher._x_windows):
            x0, x1 = max(0, left - search), min(width, right + search)
            scores = cv2.matchTemplate(
                past[y0:y1, x0:x1], now[top:bottom, left:right], cv2.TM_CCOEFF_NORMED
            )
            _, _, _, (x, y) = cv2.minMaxLoc(scores)
            peaks[r, c] = left - x0 - x, top - y0 - y
    return peaks


def time_flow(pairs: Sequence[FramePair]) -> dict[str, float]:
    """CPU time of a loop of OpenCV's ``matchTemplate`` over the windows, against block matching.

    The loop finds whole-pixel peaks only; block matching includes confidence and subpixel
    registration. Keys: ``match_template_ms``, ``block_matching_ms``, ``block_matching_peak_ms``
    (without registration) and ``block_matching_ratio``; medians over ``pairs``, with the three
    methods called in turns.
    """
    matcher = BlockMatching(RobotModel())
    peak = BlockMatching(RobotModel(), BlockMatching.Params(subpixel="peak"))
    methods: dict[str, Callable[[FramePair], object]] = {
        "match_template_ms": partial(match_windows, matcher),
        "block_matching_ms": matcher.compute,
        "block_matching_peak_ms": peak.compute,
    }
    matcher.compute(pairs[0])
    peak.compute(pairs[0])
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        spent = [[cpu_ms(method, pair)[0] for method in methods.values()] for pair in pairs]
    finally:
        cv2.setNumThreads(threads)
    times = dict(zip(methods, np.median(spent, axis=0).tolist(), strict=True))
    ratio = times["match_template_ms"] / times["block_matching_ms"]
    return {**times, "block_matching_ratio": ratio}


def _textured_pair() -> FramePair:
    """Two frames of smooth noise, displaced by (3, 2) px."""
    rng = np.random.default_rng(_SEED)
    noise = cv2.GaussianBlur(rng.normal(0.0, 1.0, (140, 180)), (0, 0), 1.5)
    picture = np.clip(128.0 + 40.0 * noise / noise.std(), 0, 255).astype(np.uint8)
    motion = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.06]), 0.2)
    past, now = (picture[10 + dy : 130 + dy, 10 + dx : 170 + dx] for dx, dy in ((0, 0), (3, 2)))
    return FramePair(Frame(0.0, past.copy()), Frame(0.2, now.copy()), motion)


@dataclass(frozen=True, slots=True)
class Target:
    """A limit for one value of the result.

    ``key`` names the value; it has to be at least ``limit`` if ``more``, else at most ``limit``.
    """

    key: str
    limit: float
    more: bool
    what: str

    def met(self, value: float | None) -> bool | None:
        """Whether ``value`` is within the limit; None when it was not measured."""
        if value is None:
            return None
        return value >= self.limit if self.more else value <= self.limit

    def __str__(self) -> str:
        return f"{'at least' if self.more else 'at most'} {self.limit:g}"


TARGETS = (
    Target("offis_ms", 0.5, False, "OFFIS, obstacles and situation, 12 x 16, two layers [ms]"),
    Target("offis_skfuzzy_ratio", 500.0, True, "OFFIS, times faster than scikit-fuzzy"),
    Target("offis_max_abs_diff", 1e-6, False, "largest difference from scikit-fuzzy"),
    Target("block_matching_ratio", 2.5, True, "block matching, times faster than matchTemplate"),
    Target("nearest_quadrant_accuracy", 0.95, True, "nearest quadrant correct"),
    Target("distance_accuracy", 0.90, True, "distance term correct"),
    Target("far_for_near", 0.01, False, "far inferred, near true"),
    Target("situation_contains_truth", 0.95, True, "Table 1's alternatives contain the truth"),
    Target("situation_top1", 0.85, True, "most probable situation correct"),
)
"""The limits that perception has to meet."""

_ACCURACY = (
    "nearest_quadrant_accuracy",
    "distance_accuracy",
    "far_for_near",
    "situation_contains_truth",
    "situation_top1",
)


def bench_perception(
    poses: int, comparisons: int, seed: int, workers: int, report: ProgressCallback = silent
) -> dict[str, Any]:
    """Measure accuracy and computing time; plain data.

    Keys: those of ``TARGETS`` (None: not measured); ``ideal``, the accuracies with ideal flow; and
    the complete parts ``accuracy`` and ``speed``. ``poses`` is the number of random views, drawn by
    ``seed``; ``comparisons`` that of random inputs of each rule base; ``workers`` that of processes
    for what is not timed. ``report`` is called with each part.
    """
    report(f"time, and {comparisons} inputs of every rule base by scikit-fuzzy")
    costs = time_perception(comparisons, workers)
    accuracy = perception_accuracy.run(poses, seed, workers, report)
    result = {
        "offis_ms": costs["offis_ms"],
        "offis_skfuzzy_ratio": costs["offis_skfuzzy_ratio"],
        "offis_max_abs_diff": costs["offis_max_abs_diff"],
        "block_matching_ratio": costs["block_matching_ratio"],
        **{key: accuracy[key] for key in _ACCURACY},
        "ideal": {key: accuracy["ideal"][key] for key in _ACCURACY},
        "accuracy": accuracy,
        "speed": costs,
    }
    return dict(plain_json(result))


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """Tables of the result for printing."""
    columns = [
        Column("quantity", lambda target: target.what),
        Column("measured", lambda target: result[target.key], ".3g"),
        Column("with ideal flow", lambda target: result["ideal"].get(target.key), ".3g"),
        Column("target", str),
        Column("met", lambda target: _MET[target.met(result[target.key])]),
    ]
    yield ResultTable("Perception", columns, TARGETS)
    for flow, accuracy in (
        ("", result["accuracy"]),
        (", ideal flow", result["accuracy"]["ideal"]),
    ):
        for name, confusion in accuracy["confusion"].items():
            inferred = sorted({term for counts in confusion.values() for term in counts})
            empty = dict.fromkeys(inferred, "")
            rows = [{"": truth, **empty, **counts} for truth, counts in confusion.items()]
            title = f"{name.capitalize()}{flow}: truth (rows), inferred (columns)"
            yield ResultTable(title, [Column(term, term) for term in ("", *inferred)], rows)


_MET = {None: "not measured", True: "yes", False: "no"}
