"""``navfw bench perception``: accuracy, flow, computing time, recorded images; result and page."""

from __future__ import annotations

import json
import multiprocessing
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.bench import flow_accuracy, flow_comparison, perception_accuracy, recorded_approach
from navfw.bench.flow_accuracy import match_template_ratio
from navfw.bench.perception_samples import samples_of_world
from navfw.errors import InputError
from navfw.fuzzy import load_rule_base
from navfw.fuzzy.fis_benchmark import FisComparison, ReferenceFis, compare, median_ms
from navfw.offis.fuzzy_systems import RULES, FuzzyEvaluation, infer
from navfw.offis.offis import Offis
from navfw.offis.percept_explanation import PerceptExplanation, evaluations_of
from navfw.process.atomic import AtomicFolder
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent
from navfw.recording.run_folder import plain_json
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Twist

MAX_DIFFERENCE = 1e-6
"""Largest allowed difference between a compiled rule base and scikit-fuzzy, in output units."""

_SEED, _WORLD = 7, 0
_REFERENCE_FRAMES = 6


def time_perception(
    comparisons: int = 10_000, repeats: int = 1000, workers: int = 1
) -> dict[str, Any]:
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


def compare_rule_bases(samples: int, workers: int = 1) -> list[FisComparison]:
    """Every rule base of OFFIS against scikit-fuzzy on ``samples`` random inputs each."""
    files, compared = sorted(RULES.glob("*.yaml")), partial(_compare, samples=samples)
    if workers <= 1:
        return [compared(file) for file in files]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return pool.map(compared, files, chunksize=1)


def _compare(file: Path, samples: int) -> FisComparison:
    return compare(load_rule_base(file), samples, np.random.default_rng(_SEED))


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
    Target("ttc_median_rel_error", 0.15, False, "time to contact below 5 s, median relative error"),
)
"""The limits that perception has to meet."""

_ACCURACY = (
    "nearest_quadrant_accuracy",
    "distance_accuracy",
    "far_for_near",
    "situation_contains_truth",
    "situation_top1",
)


@dataclass(frozen=True, slots=True)
class SampleSizes:
    """Numbers of samples: random views, inputs of each rule base, poses in each world for the flow.

    ``repeats`` is the number of timed calls.
    """

    poses: int = 1000
    comparisons: int = 10_000
    places: int = 20
    repeats: int = 1000


def page_folder(out: Path) -> AtomicFolder:
    """The folder of the page, as a context manager; an earlier page in it is replaced.

    Raises:
        InputError: the folder holds other files.

    """
    return AtomicFolder(out, re.compile(r"index\.md|result\.json|flow\.png"), "--out")


def write_page(result: Mapping[str, Any], folder: Path) -> None:
    """Write ``index.md``, ``result.json`` and ``flow.png``."""
    plot(result["flow"], folder / "flow.png")
    (folder / "index.md").write_text(page(result), encoding="utf-8")
    text = json.dumps(result, indent=2, allow_nan=False)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")


def find_data(folder: Path) -> dict[str, Path]:
    """The recorded data in ``folder`` by name: "approach", "tum_fr1" or both.

    Raises:
        InputError: the folder holds neither.

    """
    names = [name for name in ("approach", "tum_fr1") if (folder / name).is_dir()]
    if not names:
        raise InputError("holds neither approach nor tum_fr1", file=folder, key="--data")
    return {name: folder / name for name in names}


def bench_perception(
    extent: SampleSizes,
    seed: int | None = None,
    workers: int = 1,
    data: Mapping[str, Path] | None = None,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """Measure accuracy, flow, computing time and recorded images; plain data.

    Keys: those of ``TARGETS`` (None: not measured); ``ideal``, the accuracies with ideal flow; and
    the complete parts ``accuracy``, ``speed``, ``flow``, ``approach`` and ``tum`` (the last two
    None without their ``data``). ``seed`` is the seed of the random views, ``workers`` the number
    of processes for what is not timed. ``report`` is called with each part.
    """
    seed = perception_accuracy.HELD_OUT_SEED if seed is None else seed
    report(f"time, and {extent.comparisons} inputs of every rule base by scikit-fuzzy")
    costs = time_perception(extent.comparisons, extent.repeats, workers)
    flow = flow_accuracy.bench_flow(extent.places, seed=seed, report=report)
    approach = tum = None
    if data is not None and "approach" in data:
        report("the recorded approach")
        approach = recorded_approach.bench_approach(data["approach"])
    if data is not None and "tum_fr1" in data:
        report("the recorded office")
        tum = flow_comparison.bench_flow_sets(
            flow_comparison.recorded_sets(data["tum_fr1"].parent, only="tum_fr1"), report=report
        )
    accuracy = perception_accuracy.run(extent.poses, seed, workers, report)
    result = {
        "offis_ms": costs["offis_ms"],
        "offis_skfuzzy_ratio": costs["offis_skfuzzy_ratio"],
        "offis_max_abs_diff": costs["offis_max_abs_diff"],
        "block_matching_ratio": flow["block_matching_ratio"],
        **{key: accuracy[key] for key in _ACCURACY},
        "ttc_median_rel_error": None if approach is None else approach["ttc_median_rel_error"],
        "ideal": {key: accuracy["ideal"][key] for key in _ACCURACY},
        "accuracy": accuracy,
        "speed": costs,
        "flow": flow,
        "approach": approach,
        "tum": tum,
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
    yield next(flow_accuracy.tables(result["flow"]))
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


def page(result: Mapping[str, Any]) -> str:
    """The whole result in Markdown; refers to ``flow.png``."""
    _, *flow_in_full = flow_accuracy.tables(result["flow"])
    recorded: list[ResultTable] = []
    if result["tum"] is not None:
        recorded += flow_comparison.tables(result["tum"])
    if result["approach"] is not None:
        recorded += recorded_approach.tables(result["approach"])
    return "\n".join(
        [
            "# Benchmark of perception\n",
            f"{result['accuracy']['poses']} random views of seed {result['accuracy']['seed']};"
            f" {result['speed']['comparisons']} random inputs of every rule base; times are medians"
            " of one thread.\n",
            *(table.section() for table in tables(result)),
            "## Flow in full\n\n![error and time of the processors](flow.png)\n",
            f"Vectors with confidence {result['flow']['trusted_from']} or more,"
            f" in {', '.join(result['flow']['worlds'])}.\n",
            *(table.section() for table in (*flow_in_full, *recorded)),
        ]
    )


def plot(result: Mapping[str, Any], path: str | Path) -> None:
    """Plot error over time, errors by motion, and calibration into the file ``path``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    processors: dict[str, dict[str, Any]] = result["processors"]
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    cost, motion, calibration = figure.subplots(1, 3)
    colours = {name: f"C{k}" for k, name in enumerate(processors)}
    for name, p in processors.items():
        if p["epe_median"] is None:
            continue
        low, high = p["epe_median"], p["epe_p95"]
        cost.plot([p["ms"]] * 2, [low, high], "-", color=colours[name], linewidth=1)
        cost.plot(p["ms"], low, "o", color=colours[name], label=name)
        cost.plot(p["ms"], high, "_", color=colours[name], markersize=10)
        values = [p["by_motion"][m]["epe_p95"] for m in result["motions"]]
        motion.plot(range(len(values)), values, "o-", color=colours[name], markersize=3)
        rows = [row for row in p["calibration"] if row["sigma_to"] and row["n"] >= 50]
        calibration.plot(
            [0.5 * (row["sigma_from"] + row["sigma_to"]) for row in rows],
            [row["rms"] for row in rows],
            "o-",
            color=colours[name],
            markersize=3,
        )
    cost.set(
        xlabel="CPU time [ms]",
        ylabel="end-point error [px]: median to 95 %",
        xscale="log",
        yscale="log",
    )
    cost.legend(fontsize=7)
    motion.set_xticks(range(len(result["motions"])), result["motions"], rotation=60, fontsize=7)
    motion.set(ylabel="95 % of errors below [px]")
    limits = [0.02, 1.0]
    calibration.plot(limits, limits, "k--", linewidth=0.8)
    calibration.set(xlabel="sigma of the processor [px]", ylabel="root mean square error [px]")
    calibration.set(xscale="log", yscale="log")
    for axes in (cost, motion, calibration):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
