"""``navfw bench flow``: every flow processor beside OpenCV's, on real and on rendered pairs.

The true flow follows from depth and motion, on real pairs without the error of the recording that
OpenCV's DIS shows (``navfw.bench.true_flow``). On real pairs no processor is told anything about
the motion, as by ``navfw perceive`` without a gyro; on rendered pairs all use the simulated gyro.
Times are CPU times of single calls, the processors called in turns on each pair.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.bench.flow_accuracy import TRUSTED, all_processors
from navfw.bench.flow_pairs import WORLDS, TruePair, load_worlds, rendered_pairs
from navfw.bench.hololens_recording import HololensRecording, hololens_pairs
from navfw.bench.plain_opencv import plain_processors, reference_processor
from navfw.bench.true_flow import true_flow, with_recording_error
from navfw.bench.tum_recording import TumRecording, tum_camera, tum_pairs
from navfw.errors import InputError
from navfw.flow.ideal import Ideal
from navfw.interfaces import FlowProcessor
from navfw.perceive.working_size import WorkingSize
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import RobotModel
from navfw.signals import Array, CameraMotion

_Processors = Callable[[RobotModel], Mapping[str, FlowProcessor]]
"""_Processors by name, for the camera of a robot."""
PARTS = {"all": slice(None), "odd": slice(0, None, 2), "even": slice(1, None, 2)}
"""Parts of the pairs of each sequence, by their number from 1: parameters are tuned on odd ones."""
Table = tuple[str, Sequence[str], Sequence[Sequence[object]]]

_RECORDED = {"hololens_office": (1, 2), "tum_fr1": (1, 2, 3)}
"""Folders of recorded pairs, and the distances between the images of a pair [images]."""
ROWS, COLS = 12, 16
"""The grid, that of all processors by default."""


@dataclass(frozen=True, slots=True)
class TrueSet:
    """Pairs of one camera with their truth."""

    name: str
    robot: RobotModel
    pairs: list[TruePair]


def recorded_sets(
    folder: Path, part: slice = PARTS["all"], only: str | None = None
) -> list[TrueSet]:
    """The sets of ``_RECORDED`` in ``folder``, or ``only`` one, reduced to perceive's working size.

    Raises:
        InputError: the folder holds none of them.
        ConfigError: a set lacks a file, or a file cannot be read.

    """
    found = []
    there = [name for name in _RECORDED if (folder / name).is_dir() and only in (None, name)]
    if "hololens_office" in there:
        recorded = HololensRecording(folder / "hololens_office", ROWS, COLS)
        strides = [hololens_pairs(recorded, stride) for stride in _RECORDED["hololens_office"]]
        robot = RobotModel(camera=recorded.camera)
        found.append(TrueSet("hololens_office", robot, _unaided(strides, part, robot)))
    if "tum_fr1" in there:
        working = WorkingSize.of(640, 480, ROWS, COLS)
        size, sequence = (working.cut_width, working.cut_height), TumRecording(folder / "tum_fr1")
        strides = [
            tum_pairs(folder / "tum_fr1", size, sequence, stride) for stride in _RECORDED["tum_fr1"]
        ]
        robot = RobotModel(camera=tum_camera(size))
        found.append(TrueSet("tum_fr1", robot, _unaided(strides, part, robot)))
    if not found:
        raise InputError(f"holds none of {', '.join(_RECORDED)}", file=folder, key="--data")
    return found


def rendered_set(
    places: int, seed: int, part: slice = PARTS["all"], worlds: Sequence[str] = WORLDS
) -> TrueSet:
    """All motions at ``places`` random poses of each of ``worlds``, with the default camera."""
    robot = RobotModel()
    pairs = list(rendered_pairs(load_worlds(worlds), robot, places, seed))
    return TrueSet("rendered", robot, pairs[part])


def _unaided(
    strides: Sequence[Iterator[TruePair]], part: slice, robot: RobotModel
) -> list[TruePair]:
    """The pairs without the measured motion, and without the error of the recorded one."""
    reference, found = reference_processor(robot), []
    for true in itertools.chain.from_iterable(list(pairs)[part] for pairs in strides):
        still = CameraMotion(np.eye(3), np.zeros(3), true.pair.motion.dt)
        unaided = replace(true, pair=replace(true.pair, motion=still))
        flow = reference.compute(unaided.pair)
        found.append(with_recording_error(unaided, flow, robot.camera))
    return found


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
    shipped = {k: p for k, p in all_processors(robot).items() if not isinstance(p, Ideal)}
    return {**shipped, **plain_processors(robot)}


@dataclass
class _Answers:
    """Answers of one processor on all pairs; lists of arrays (rows, cols), one for each pair."""

    error: list[Array] = field(default_factory=list)
    trusted: list[npt.NDArray[np.bool_]] = field(default_factory=list)
    known: list[npt.NDArray[np.bool_]] = field(default_factory=list)
    within: list[npt.NDArray[np.bool_]] = field(default_factory=list)
    milliseconds: list[float] = field(default_factory=list)


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
    - ``within_2_sigma``: share of its trusted vectors within two of their sigmas of the truth (0.86
      is right for a normal error in two dimensions); None for OpenCV's, which have no sigma;
    - ``beaten_by``: names of OpenCV's processors that cost less and have a smaller mean error at
      the points that this one trusts.

    Values without any point are None.
    """
    camera = chosen.robot.camera
    answers = {name: _Answers() for name in processors}
    lengths = []
    for processor in processors.values():
        processor.compute(chosen.pairs[0].pair)  # compiles kernels, which is not timed
    for true in with_progress(chosen.pairs, f"pairs of {chosen.name}", report):
        for name, processor in processors.items():
            begun = time.thread_time()
            flow = processor.compute(true.pair)
            answers[name].milliseconds.append(1e3 * (time.thread_time() - begun))
            vectors, known = true_flow(flow.points, true, camera)
            error = np.hypot(*np.moveaxis(flow.vectors - vectors, -1, 0))
            answers[name].error.append(error)
            answers[name].known.append(known)
            answers[name].trusted.append((flow.confidence >= TRUSTED) & known)
            answers[name].within.append(error < 2.0 * flow.sigma)
        lengths.append(np.hypot(vectors[..., 0], vectors[..., 1])[known])
    plain = frozenset(plain_processors(chosen.robot))
    common = np.logical_and.reduce([a.trusted for k, a in answers.items() if k not in plain])
    return {
        "pairs": len(chosen.pairs),
        "width": camera.width,
        "height": camera.height,
        "flow_median_px": float(np.median(np.concatenate(lengths))),
        "common": int(common.sum()),
        "processors": {name: _figures(name, answers, common, plain) for name in processors},
    }


def _figures(
    name: str,
    answers: Mapping[str, _Answers],
    common: npt.NDArray[np.bool_],
    plain: frozenset[str],
) -> dict[str, Any]:
    own = answers[name]
    trusted, error, cost = np.array(own.trusted), np.array(own.error), median(own.milliseconds)
    mean, points = _mean(error[trusted]), int(np.sum(own.known))
    beaten_by = []
    for other in plain & answers.keys() - {name}:
        rival = answers[other]
        better = _mean(np.array(rival.error)[trusted & np.array(rival.trusted)])
        if mean is None or better is None:
            continue
        if median(rival.milliseconds) < cost and better < mean:
            beaten_by.append(other)
    return {
        "ms": cost,
        "coverage": float(trusted.sum()) / points if points else 0.0,
        "epe": mean,
        "epe_median": float(np.median(error[trusted])) if trusted.any() else None,
        "epe_common": _mean(error[common]),
        "epe_at_first": _mean(error[trusted & np.array(next(iter(answers.values())).trusted)]),
        "within_2_sigma": None if name in plain else _mean(np.array(own.within)[trusted]),
        "beaten_by": sorted(beaten_by),
    }


def _mean(values: npt.NDArray[Any]) -> float | None:
    return float(values.mean()) if values.size else None


def comparison_tables(result: Mapping[str, Any]) -> Iterator[Table]:
    """A table of each set for printing."""
    for name, facts in result["sets"].items():
        measured = result[name]
        title = (
            f"{name}: {facts['pairs']} pairs of {facts['width']} x {facts['height']} px,"
            f" flow {facts['flow_median_px']:.1f} px (median),"
            f" {facts['common']} common points; mean end-point errors [px]"
        )
        errors = ("own points", "median", f"points of {next(iter(measured))}", "common points")
        keys = ("epe", "epe_median", "epe_at_first", "epe_common")
        rows = [
            (
                processor,
                f"{found['ms']:.2f}",
                f"{100 * found['coverage']:.0f} %",
                *(_number(found[key]) for key in keys),
                _percent(found["within_2_sigma"]),
                len(found["beaten_by"]),
            )
            for processor, found in measured.items()
        ]
        yield (
            title,
            ("processor", "ms", "trusted", *errors, "within 2 sigma", "beaten by, of OpenCV"),
            rows,
        )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
