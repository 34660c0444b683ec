"""``navfw bench flow``: every flow processor beside OpenCV's, on real and on rendered pairs.

The true flow follows from depth and motion, on real pairs without the error of the recording that
OpenCV's DIS shows (``true_pairs``). On real pairs no processor is told anything about
the motion, as by ``navfw perceive`` without a gyro; on rendered pairs all use the simulated gyro.
Times are CPU times of single calls, the processors called in turns on each pair.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from navfw.errors import InputError
from navfw.flow.block_matching import BlockMatching
from navfw.flow.grid_flow import SIGMA_UNKNOWN, GridFlow, MatchedFlow
from navfw.flow.opencv_flow import PRESETS, Dis
from navfw.flow.registration import Registered
from navfw.interfaces import FlowProcessor
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats, Mask
from navfw.perceive.perceiver_options import WorkingSize
from navfw.process.result_table import Column, ResultTable, named
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FramePair
from navfw_benchmarks.bench import true_pairs
from navfw_benchmarks.bench.recorded_pairs import (
    RecordedFrame,
    frame_pairs,
    hololens_frames,
    tum_frames,
)
from navfw_benchmarks.plugins.opencv_flow import Farneback, LucasKanade

ResultT = TypeVar("ResultT")

TRUSTED = 0.3
"""Least confidence of the vectors that are evaluated."""


class FlowAnswer(NamedTuple):
    """The answer of a processor on one pair, or on n: arrays (rows, cols) or (n, rows, cols).

    ``error`` [px] is the end-point error, ``length`` [px] that of the true flow, ``sigma`` [px] the
    processor's own estimate of the error. ``valid`` is where there is a truth, ``trusted`` where
    the processor has a confidence of TRUSTED as well; ``ms`` the CPU time of the call, or (n,).
    """

    error: Array
    length: Array
    sigma: Array
    valid: Mask
    trusted: Mask
    ms: Array


def answer(processor: FlowProcessor, pair: true_pairs.TruePair) -> FlowAnswer:
    """The answer of ``processor`` on a pair, compared with the true flow."""
    spent, flow = cpu_ms(processor.compute, pair.pair)
    true, valid = true_pairs.true_flow(flow.points, pair, processor.robot.camera)
    error, length = (np.hypot(v[..., 0], v[..., 1]) for v in (flow.vectors - true, true))
    trusted = (flow.confidence >= TRUSTED) & valid
    return FlowAnswer(error, length, flow.sigma, valid, trusted, np.array(spent))


def all_processors(robot: RobotModel) -> dict[str, FlowProcessor]:
    """Every shipped processor, and block matching as in the paper (peak only, no subpixel fit)."""
    return {
        "registered": Registered(robot),
        "block_matching": BlockMatching(robot),
        "block_matching, peak only": BlockMatching(robot, BlockMatching.Params(subpixel="peak")),
        "lucas_kanade": LucasKanade(robot),
        "dis": Dis(robot),
        "farneback": Farneback(robot),
    }


def cpu_ms(method: Callable[[FramePair], ResultT], pair: FramePair) -> tuple[float, ResultT]:
    """CPU time [ms] of a call, and its result."""
    begun = time.thread_time()
    result = method(pair)
    return 1e3 * (time.thread_time() - begun), result


_DenseMethod = Callable[[Image, Image], Floats]
"""Displacement (height, width, 2) [px] of each pixel of the first image in the second."""


class PlainDense(MatchedFlow):
    """A dense method of OpenCV, at the pixels of the cells' centres."""

    name: ClassVar[str] = "plain_dense"

    def __init__(self, robot: RobotModel, method: _DenseMethod) -> None:
        super().__init__(robot, GridFlow.Params())
        self._method = method

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        dense = self._method(now, past)
        height, width = now.shape
        # a cell's centre lies between pixels where the cell has an even number of them
        x = (self._points[..., 0] + 0.5 * width - 0.5).astype(np.float32)
        y = (self._points[..., 1] + 0.5 * height - 0.5).astype(np.float32)
        back = cv2.remap(dense, x, y, cv2.INTER_LINEAR)
        shape = self._points.shape[:2]
        return -np.asarray(back, dtype=np.float64), np.ones(shape), np.full(shape, SIGMA_UNKNOWN)


class PlainPoints(MatchedFlow):
    """OpenCV's pyramidal Lucas-Kanade at the cells' centres; confidence 1 where it finds a point.

    ``window`` [px] is the side of a window, ``levels`` the number of halvings of the image.
    """

    name: ClassVar[str] = "plain_points"

    def __init__(self, robot: RobotModel, window: int, levels: int) -> None:
        super().__init__(robot, GridFlow.Params())
        self._size, self._levels = (window, window), levels
        pixels = self._points + 0.5 * np.array([robot.camera.width, robot.camera.height]) - 0.5
        self._seeds = pixels.reshape(-1, 1, 2).astype(np.float32)

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        matches, status, _ = cv2.calcOpticalFlowPyrLK(
            now, past, self._seeds, self._seeds.copy(), winSize=self._size, maxLevel=self._levels
        )
        shape = self._points.shape[:2]
        vectors = (self._seeds - np.asarray(matches)).reshape(self._points.shape).astype(np.float64)
        confidence = np.asarray(status).reshape(shape).astype(np.float64)
        return vectors, confidence, np.full(shape, SIGMA_UNKNOWN)


def plain_processors(robot: RobotModel) -> dict[str, MatchedFlow]:
    """OpenCV's processors by name: DIS by preset and finest scale, LK and Farneback by window."""
    dis = {
        f"cv_dis_{preset}_{finest}": _dis(robot, preset, finest)
        for preset in PRESETS
        for finest in (0, 1, 2)
    }
    points = {f"cv_lk_{window}": PlainPoints(robot, window, 3) for window in (11, 15, 21)}
    farneback = {
        f"cv_farneback_{n}": PlainDense(robot, Farneback(robot, Farneback.Params(window=n)).dense)
        for n in (9, 15)
    }
    return {**dis, **points, **farneback}


def _dis(robot: RobotModel, preset: str, finest: int) -> PlainDense:
    params = Dis.Params.model_validate({"preset": preset, "finest_scale": finest})
    return PlainDense(robot, Dis(robot, params).dense)


_Processors = Callable[[RobotModel], Mapping[str, FlowProcessor]]
"""_Processors by name, for the camera of a robot."""
PARTS = {"all": slice(None), "odd": slice(0, None, 2), "even": slice(1, None, 2)}
"""Parts of the pairs of each sequence, by their number from 1: parameters are tuned on odd ones."""

_RECORDED = {"hololens_office": (1, 2), "tum_fr1": (1, 2, 3)}
"""Folders of recorded pairs, and the distances between the images of a pair [images]."""
ROWS, COLS = 12, 16
"""The grid, that of all processors by default."""


@dataclass(frozen=True, slots=True)
class TrueSet:
    """Pairs of one camera with their truth."""

    name: str
    robot: RobotModel
    pairs: list[true_pairs.TruePair]


def recorded_sets(folder: Path, part: slice = PARTS["all"]) -> list[TrueSet]:
    """The sets of ``_RECORDED`` in ``folder``, reduced to perceive's working size.

    Raises:
        InputError: the folder holds none of them.
        ConfigError: a set lacks a file, or a file cannot be read.

    """
    names = [name for name in _RECORDED if (folder / name).is_dir()]
    if not names:
        raise InputError(f"holds none of {', '.join(_RECORDED)}", file=folder, key="--data")
    sets = []
    for name in names:
        camera, frames = _recorded_frames(name, folder / name)
        robot = RobotModel(camera=camera)
        pairs = [list(frame_pairs(name, frames, stride))[part] for stride in _RECORDED[name]]
        unaided = _unaided(itertools.chain.from_iterable(pairs), robot)
        sets.append(TrueSet(name, robot, unaided))
    return sets


def _recorded_frames(name: str, folder: Path) -> tuple[CameraModel, list[RecordedFrame]]:
    if name == "hololens_office":
        return hololens_frames(folder, ROWS, COLS)
    working = WorkingSize.of(640, 480, ROWS, COLS)
    return tum_frames(folder, (working.cut_width, working.cut_height))


def rendered_set(
    places: int, seed: int, part: slice = PARTS["all"], worlds: Sequence[str] = true_pairs.WORLDS
) -> TrueSet:
    """All motions at ``places`` random poses of each of ``worlds``, with the default camera."""
    robot = RobotModel()
    pairs = list(true_pairs.rendered_pairs(true_pairs.load_worlds(worlds), robot, places, seed))
    return TrueSet("rendered", robot, pairs[part])


def _unaided(pairs: Iterable[true_pairs.TruePair], robot: RobotModel) -> list[true_pairs.TruePair]:
    """The pairs without the measured motion, and without the error of the recorded one."""
    reference = _dis(robot, "medium", 0)  # the most accurate of OpenCV's
    corrected = []
    for true in pairs:
        still = CameraMotion(np.eye(3), np.zeros(3), true.pair.motion.dt)
        unaided = replace(true, pair=replace(true.pair, motion=still))
        flow = reference.compute(unaided.pair)
        corrected.append(true_pairs.with_recording_error(unaided, flow, robot.camera))
    return corrected


def bench_flow_sets(
    sets: Sequence[TrueSet],
    processors: _Processors | None = None,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """The processors (default: all that ship, and OpenCV's) on each set; plain data.

    Keys: ``trusted_from``; ``sets``: by name what ``measure_set`` says of the pairs; and by the
    name of each set its ``processors``.
    """
    facts, figures = {}, {}
    for chosen in sets:
        measured = measure_set(chosen, (processors or _every_processor)(chosen.robot), report)
        figures[chosen.name] = measured.pop("processors")
        facts[chosen.name] = measured
    return {"trusted_from": TRUSTED, "sets": facts, **figures}


def _every_processor(robot: RobotModel) -> dict[str, FlowProcessor]:
    return {**all_processors(robot), **plain_processors(robot)}


def measure_set(
    chosen: TrueSet, processors: Mapping[str, FlowProcessor], report: ProgressCallback = silent
) -> dict[str, Any]:
    """Cost and errors of ``processors`` on one set; plain data.

    Keys: ``pairs``, ``width``, ``height``; ``flow_median_px``, the median length of the true flow;
    ``common``, the number of common points: those with a truth that all processors with a sigma
    trust; ``processors``: by name

    - ``ms``: median CPU time of a call;
    - ``coverage``: share of the points with a truth that it trusts (confidence at least TRUSTED);
    - ``epe``, ``epe_median`` [px]: mean and median end-point error at the points that it trusts;
    - ``epe_common`` [px]: mean end-point error at the common points;
    - ``epe_at_first`` [px]: mean end-point error at the points that it and the first one trust;
    - ``within_1_sigma``, ``within_2_sigma``: shares of its trusted vectors within one and two of
      their sigmas of the truth (0.39 and 0.86 are right for a normal error in two dimensions); None
      for OpenCV's, which have no sigma;
    - ``beaten_by``: names of OpenCV's processors that cost less and have a smaller mean error at
      the points that this one trusts.

    Values without any point are None.
    """
    answers: dict[str, list[FlowAnswer]] = {name: [] for name in processors}
    for processor in processors.values():
        processor.compute(chosen.pairs[0].pair)  # compiles kernels, which is not timed
    for pair in with_progress(chosen.pairs, f"pairs of {chosen.name}", report):
        for name, processor in processors.items():
            answers[name].append(answer(processor, pair))
    plain = frozenset(plain_processors(chosen.robot))
    stacked = {n: FlowAnswer(*map(np.stack, zip(*of, strict=True))) for n, of in answers.items()}
    common = np.logical_and.reduce([s.trusted for name, s in stacked.items() if name not in plain])
    last = [*stacked.values()][-1]
    return {
        "pairs": len(chosen.pairs),
        "width": chosen.robot.camera.width,
        "height": chosen.robot.camera.height,
        "flow_median_px": float(np.median(last.length[last.valid])),
        "common": int(common.sum()),
        "processors": {name: _figures(name, stacked, common, plain) for name in processors},
    }


def _figures(
    name: str, answers: Mapping[str, FlowAnswer], common: Mask, plain: frozenset[str]
) -> dict[str, Any]:
    own, first = answers[name], next(iter(answers.values()))
    error, ms = own.error, float(np.median(own.ms))
    mean, points = _mean(error[own.trusted]), int(own.valid.sum())
    beaten_by = []
    for other in plain & answers.keys() - {name}:
        rival = answers[other]
        better = _mean(rival.error[own.trusted & rival.trusted])
        if mean is not None and better is not None and np.median(rival.ms) < ms and better < mean:
            beaten_by.append(other)
    return {
        "ms": ms,
        "coverage": float(own.trusted.sum()) / points if points else 0.0,
        "epe": mean,
        "epe_median": float(np.median(error[own.trusted])) if own.trusted.any() else None,
        "epe_common": _mean(error[common]),
        "epe_at_first": _mean(error[own.trusted & first.trusted]),
        "within_1_sigma": None if name in plain else _mean((error < own.sigma)[own.trusted]),
        "within_2_sigma": None if name in plain else _mean((error < 2 * own.sigma)[own.trusted]),
        "beaten_by": sorted(beaten_by),
    }


def _mean(values: npt.NDArray[Any]) -> float | None:
    return float(values.mean()) if values.size else None


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """A table of each set."""
    for name, facts in result["sets"].items():
        processors = result[name]
        columns = [
            Column("processor", "name"),
            Column("ms", "ms", ".2f"),
            Column("trusted", "coverage", ".0%"),
            Column("own points", "epe", ".3f"),
            Column("median", "epe_median", ".3f"),
            Column(f"points of {next(iter(processors))}", "epe_at_first", ".3f"),
            Column("common points", "epe_common", ".3f"),
            Column("within 1 sigma", "within_1_sigma", ".1%"),
            Column("within 2 sigma", "within_2_sigma", ".1%"),
            Column("beaten by, of OpenCV", lambda processor: len(processor["beaten_by"])),
        ]
        title = (
            f"{name}: {facts['pairs']} pairs of {facts['width']} x {facts['height']} px,"
            f" flow {facts['flow_median_px']:.1f} px (median),"
            f" {facts['common']} common points; mean end-point errors [px]"
        )
        yield ResultTable(title, columns, named(processors))
