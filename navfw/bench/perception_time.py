"""Computing time of OFFIS, of the same rule bases in scikit-fuzzy, and of block matching.

Times are medians of one thread. Both sides of a ratio are measured in the same run, so that
machine and load affect them alike.
"""

from __future__ import annotations

import multiprocessing
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np

from navfw.bench.flow_accuracy import match_template_ratio
from navfw.bench.perception_samples import samples_of_world
from navfw.fuzzy import load_rule_base
from navfw.fuzzy.fis_benchmark import FisComparison, compare
from navfw.fuzzy.reference_fis import ReferenceFis
from navfw.offis.fuzzy_systems import RULES, FuzzyEvaluation, infer
from navfw.offis.offis import Offis
from navfw.offis.percept_explanation import PerceptExplanation, evaluations_of
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Twist

MAX_DIFFERENCE = 1e-6
"""Largest allowed difference between a compiled rule base and scikit-fuzzy, in output units."""

_SEED, _WORLD = 7, 0
_REFERENCE_FRAMES = 6


def run(comparisons: int = 10_000, repeats: int = 1000, workers: int = 1) -> dict[str, Any]:
    """Measure all times, and compare every rule base with scikit-fuzzy; plain data.

    Keys: ``offis_ms`` (one call of ``perceive``: obstacles and situation), ``inference_ms`` (its
    fuzzy inferences alone), ``skfuzzy_ms`` (the same inferences by scikit-fuzzy),
    ``offis_skfuzzy_ratio`` (skfuzzy_ms / inference_ms), ``offis_whole_ratio`` (skfuzzy_ms /
    offis_ms), ``inferences`` (samples evaluated per frame); ``offis_max_abs_diff`` over
    ``comparisons`` random inputs of every rule base, and ``rule_bases`` one by one; the keys of
    ``flow_accuracy.match_template_ratio``.

    scikit-fuzzy takes about 20 ms per input; ``workers`` processes share the comparison.
    """
    compared = compare_rule_bases(comparisons, workers)
    return {
        **time_offis(repeats),
        "offis_max_abs_diff": max(result["max_abs_diff"] for result in compared),
        "comparisons": comparisons,
        "rule_bases": {result["name"]: dict(result) for result in compared},
        **time_flow(max(repeats // 5, 1)),
    }


def time_offis(repeats: int = 1000) -> dict[str, Any]:
    """Times of OFFIS on rendered views: 12 x 16 vectors, two layers, default parameters."""
    flows = [(sample.flow, sample.twist) for sample in samples_of_world(_SEED, _WORLD)]
    offis = Offis(RobotModel())
    whole = _median_ms(lambda k: offis.perceive(*flows[k % len(flows)]), repeats)
    frames = [_evaluations(offis, *frame) for frame in flows]
    inference = _median_ms(lambda k: _repeat(frames[k % len(frames)]), repeats)
    references = {
        evaluation.system.rule_base.name: ReferenceFis(evaluation.system.rule_base)
        for evaluation in frames[0]
    }
    reference = _median_ms(
        lambda k: _by_reference(frames[k % len(frames)], references), _REFERENCE_FRAMES
    )
    return {
        "offis_ms": whole,
        "inference_ms": inference,
        "skfuzzy_ms": reference,
        "offis_skfuzzy_ratio": reference / inference,
        "offis_whole_ratio": reference / whole,
        "inferences": sum(_samples(evaluation) for evaluation in frames[0]),
    }


def _evaluations(offis: Offis, flow: FlowField, twist: Twist) -> tuple[FuzzyEvaluation, ...]:
    explanation = offis.perceive(flow, twist).explanation
    if not isinstance(explanation, PerceptExplanation):
        raise TypeError(f"expected an explanation by OFFIS, got {type(explanation).__name__}")
    return evaluations_of(explanation)


def _samples(evaluation: FuzzyEvaluation) -> int:
    return len(evaluation.result)


def _repeat(evaluations: Sequence[FuzzyEvaluation]) -> None:
    for evaluation in evaluations:
        infer(evaluation.system, evaluation.inputs)


def _by_reference(
    evaluations: Sequence[FuzzyEvaluation], references: dict[str, ReferenceFis]
) -> None:
    for evaluation in evaluations:
        reference = references[evaluation.system.rule_base.name]
        for k in range(_samples(evaluation)):
            reference.compute({name: float(x[k]) for name, x in evaluation.inputs.items()})


def compare_rule_bases(samples: int, workers: int = 1) -> list[FisComparison]:
    """Every rule base of OFFIS against scikit-fuzzy on ``samples`` random inputs each."""
    jobs = [(path.stem, samples) for path in sorted(RULES.glob("*.yaml"))]
    if workers <= 1:
        return [_compare(job) for job in jobs]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return pool.map(_compare, jobs, chunksize=1)


def _compare(job: tuple[str, int]) -> FisComparison:
    name, samples = job
    return compare(load_rule_base(RULES / f"{name}.yaml"), samples, np.random.default_rng(_SEED))


def time_flow(repeats: int = 200) -> dict[str, float]:
    """Block matching, 12 x 16 windows of 24 px, search of 8 px, against a loop of matchTemplate."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return match_template_ratio(RobotModel(), [_textured_pair()] * repeats)
    finally:
        cv2.setNumThreads(threads)


def _textured_pair() -> FramePair:
    """Two frames of smooth noise, displaced by (3, 2) px."""
    rng = np.random.default_rng(_SEED)
    noise = cv2.GaussianBlur(rng.normal(0.0, 1.0, (140, 180)), (0, 0), 1.5)
    picture = np.clip(128.0 + 40.0 * noise / noise.std(), 0, 255).astype(np.uint8)
    motion = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.06]), 0.2)
    past, now = (picture[10 + dy : 130 + dy, 10 + dx : 170 + dx] for dx, dy in ((0, 0), (3, 2)))
    return FramePair(Frame(0.0, past.copy()), Frame(0.2, now.copy()), motion)


def _median_ms(call: Callable[[int], object], repeats: int) -> float:
    call(0)
    seconds = []
    for k in range(repeats):
        start = time.perf_counter()
        call(k)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds) * 1e3
