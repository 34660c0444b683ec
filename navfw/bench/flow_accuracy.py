"""How far flow processors are off on rendered frames, how well they know it, what they cost.

Accuracy is measured on pairs with true depth and motion (``navfw.bench.flow_pairs``); where none
are given, on those of several worlds. Costs are processor times of single calls, which other
programs on the same cores disturb less than the clock on the wall.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.flow_pairs import MOTIONS, WORLDS, TruePair, load_worlds, rendered_pairs
from navfw.flow.block_matching import BlockMatching
from navfw.flow.dis import Dis
from navfw.flow.farneback import Farneback
from navfw.flow.ideal import Ideal, nearness_at, true_vectors
from navfw.flow.lucas_kanade import LucasKanade
from navfw.kinds import FlowProcessor
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Array, CameraMotion, FlowField, Frame, FramePair

__all__ = [
    "Errors",
    "PairTruth",
    "all_processors",
    "bench_flow",
    "match_template_ratio",
    "measure",
    "plot",
    "statistics",
    "table",
]

TRUSTED = 0.3
"""Vectors of at least this confidence count."""
EDGE_REACH = 12
"""A cell is at a depth edge when one lies within that distance of its point: in its window [px]."""
EDGE_STEP = 0.12
"""Neighbouring pixels whose nearness differs by that part show two surfaces."""
SIGMA_BINS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, np.inf)
"""Of the calibration table [px]."""


class PairTruth:
    """The truth of one pair at a time (``navfw.flow.ideal.TruthSource``)."""

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
class Errors:
    """What one processor gave, vector by vector, for the trusted ones; arrays of one length.

    ``off`` (n, 2) [px] is measured less true flow, ``sigma`` [px] what the processor said of it,
    ``edge`` whether a depth edge lies within the window, ``motion`` and ``world`` the indices in
    ``motions`` and ``worlds`` of the benchmark. ``cells`` counts all cells by motion, trusted or
    not; ``milliseconds`` are the costs of the calls.
    """

    off: Array
    sigma: Array
    edge: npt.NDArray[np.bool_]
    motion: npt.NDArray[np.int64]
    world: npt.NDArray[np.int64]
    cells: npt.NDArray[np.int64]
    milliseconds: list[float] = field(default_factory=list)


def all_processors(robot: RobotModel) -> dict[str, FlowProcessor]:
    """Every processor that ships, and block matching as the paper had it (the peak's top alone)."""
    return {
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
    processors: dict[str, FlowProcessor] | None = None,
    tick: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Measure ``processors`` (default: all) at ``places`` random poses of each world.

    ``tick`` is told what is going on. Returns plain data:

    - ``pairs``: number of frame pairs; ``places``, ``seed``, ``worlds``, ``motions``;
    - ``trusted_from``: the confidence from which vectors count;
    - ``processors``: by name, the ``statistics`` of all trusted vectors, and ``ms`` (median cost of
      one call), under ``by_motion``, ``by_world``, ``edges`` (cells with a depth edge in their
      window) and ``smooth`` (the others) the same of parts, and under ``calibration`` a list of
      {``sigma_from``, ``sigma_to``, ``n``, ``rms``, ``within_1_sigma``, ``within_2_sigma``};
    - ``block_matching_ratio``, ``match_template_ms``: see ``match_template_ratio``.
    """
    say = tick or (lambda _: None)
    robot = RobotModel() if robot is None else robot
    processors = all_processors(robot) if processors is None else processors
    say("rendering")
    pairs = list(rendered_pairs(load_worlds(worlds), robot, places, seed))
    measured = {}
    for name, processor in processors.items():
        say(name)
        measured[name] = _summary(measure(processor, pairs, worlds), worlds)
    say("matchTemplate")
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
) -> Errors:
    """Run ``processor`` over ``pairs`` and compare each trusted vector with the true one."""
    camera = processor.robot.camera
    motions, world_names = list(MOTIONS), list(worlds)
    truth = PairTruth()
    if isinstance(processor, Ideal):
        processor.trust(truth)
    parts: list[tuple[Array, ...]] = []
    cells = np.zeros(len(motions), np.int64)
    costs: list[float] = []
    for true in pairs:
        truth.now = true
        if not costs:
            processor.compute(true.pair)  # compiling is nobody's cost
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
    return Errors(
        off, sigma, edge.astype(bool), motion_of.astype(int), world_of.astype(int), cells, costs
    )


def _compare(
    flow: FlowField, true: TruePair, camera: CameraModel
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Errors (rows, cols, 2) [px], and which vectors are trusted and have a truth."""
    nearness = nearness_at(flow.points, true.depth, camera)
    off = flow.vectors - true_vectors(flow.points, nearness, true.motion, camera.focal)
    return off, (flow.confidence >= TRUSTED) & np.isfinite(off).all(axis=-1)


def _edges(depth: npt.NDArray[np.float32], points: Array, camera: CameraModel) -> Array:
    """1 (rows, cols) where a depth edge lies within EDGE_REACH of a point, 0 elsewhere."""
    nearness = 1.0 / depth.astype(np.float64)
    step = np.zeros_like(nearness)
    step[:, 1:] = np.abs(np.diff(nearness, axis=1))
    step[1:] = np.maximum(step[1:], np.abs(np.diff(nearness, axis=0)))
    jumps = (step > EDGE_STEP * np.maximum(nearness, 1e-3)).astype(np.uint8)
    near = cv2.dilate(jumps, np.ones((2 * EDGE_REACH, 2 * EDGE_REACH), np.uint8))
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


def _summary(errors: Errors, worlds: Sequence[str]) -> dict[str, Any]:
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


def _calibration(errors: Errors) -> list[dict[str, Any]]:
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


# --- the loop that block matching replaces ------------------------------------------------------


def match_template_ratio(
    robot: RobotModel, pairs: Sequence[FramePair], processor: BlockMatching | None = None
) -> dict[str, float]:
    """Cost of OpenCV's ``matchTemplate`` in a loop over the windows, against block matching's.

    The loop finds whole-pixel peaks alone; block matching does all of its work, confidence and
    registration included. Keys: ``match_template_ms``, ``block_matching_ms``,
    ``block_matching_peak_ms`` (without registration) and ``block_matching_ratio``, medians over
    ``pairs``, taken in turns.
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


# --- for people ---------------------------------------------------------------------------------


def table(result: dict[str, Any]) -> str:
    """Markdown: a table of all processors, one of their errors by motion, one of calibration."""
    processors: dict[str, dict[str, Any]] = result["processors"]
    head = ["processor", "trusted", "median", "95 %", "> 0.5 px", "within 2 sigma", "ms"]
    lines = [
        f"End-point errors [px] on {result['pairs']} rendered pairs"
        f" ({', '.join(result['worlds'])}), of vectors with confidence"
        f" {result['trusted_from']} or more:",
        "",
        *_rows(
            head,
            (
                [
                    name,
                    f"{100 * p['coverage']:.0f} %",
                    _number(p["epe_median"]),
                    _number(p["epe_p95"]),
                    _percent(p["over_half_px"]),
                    _percent(p["within_2_sigma"]),
                    _number(p["ms"]),
                ]
                for name, p in processors.items()
            ),
        ),
        "",
        "Median / 95 % by motion between the frames:",
        "",
        *_rows(
            ["motion", *processors],
            (
                [
                    motion,
                    *(
                        f"{_number(p['by_motion'][motion]['epe_median'])} /"
                        f" {_number(p['by_motion'][motion]['epe_p95'])}"
                        for p in processors.values()
                    ),
                ]
                for motion in result["motions"]
            ),
        ),
        "",
        "Root mean square error of the components [px], and the share within two sigma, by the"
        " sigma said:",
        "",
        *_rows(["sigma [px]", *processors], _calibration_rows(processors)),
    ]
    return "\n".join(lines) + "\n"


def _calibration_rows(processors: dict[str, dict[str, Any]]) -> Iterable[list[str]]:
    for low, high in itertools.pairwise(SIGMA_BINS):
        cells = []
        for p in processors.values():
            found = [row for row in p["calibration"] if row["sigma_from"] == low]
            cells.append(
                f"{found[0]['rms']:.2f}, {_percent(found[0]['within_2_sigma'])}" if found else "-"
            )
        yield [f"{low:g} to {high:g}" if np.isfinite(high) else f"above {low:g}", *cells]


def _rows(head: Sequence[str], body: Iterable[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *body]
    return ["| " + " | ".join(cells) + " |" for cells in lines]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"


def plot(result: dict[str, Any], path: str | Path) -> None:
    """Draw error against cost, errors by motion, and calibration into the file ``path``."""
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
        xlabel="cost [ms]",
        ylabel="end-point error [px]: median to 95 %",
        xscale="log",
        yscale="log",
    )
    cost.legend(fontsize=7)
    motion.set_xticks(range(len(result["motions"])), result["motions"], rotation=60, fontsize=7)
    motion.set(ylabel="95 % of errors below [px]")
    limits = [0.02, 1.0]
    calibration.plot(limits, limits, "k--", linewidth=0.8)
    calibration.set(xlabel="sigma said [px]", ylabel="error found (rms) [px]")
    calibration.set(xscale="log", yscale="log")
    for axes in (cost, motion, calibration):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
