"""Perception on real frames: sentences by labels, headings, nearness and yaw by the recordings.

Each part of the labelled sequences is processed as ``navfw perceive`` does. The cameras' fields of
view are those in the table; the rest of a lens is estimated from its whole recording. Photographs
without a neighbour for flow are processed as a sequence, too: nothing should be said about them.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from navfw.config.input_file import is_folder
from navfw.errors import ConfigError
from navfw.lenses import CameraCalibration
from navfw.numerics import Array
from navfw.perceive.image_sources import IMAGES, ImageSource, open_source
from navfw.perceive.image_times import ImageTimes, natural_key
from navfw.perceive.lens_estimate import LensEstimate, estimate_lens
from navfw.perceive.motion_record import GyroRecord
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver import Perceiver
from navfw.perceive.perceiver_options import PerceiverOptions
from navfw.plugins import Registry
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent
from navfw_benchmarks.bench.real_labels import (
    FrameLabel,
    Judgement,
    NearnessErrors,
    SentenceVerdict,
    camera_displacement,
    heading_error,
    judge,
    load_labels,
    nearness_errors,
    posed_images,
    recorded_gyro,
    yaw_rates,
    yaw_summary,
)
from navfw_benchmarks.bench.rendered_scenes import KINDS, RATE, render_scenes

_LEAD = 6
"""Number of images before the first labelled one of a part that are processed as well."""


@dataclass(frozen=True, slots=True)
class LabelledRecording:
    """A recording: its camera, what it shows, its source, its licence.

    ``hfov`` is the camera's horizontal field of view [deg] or None, ``rate`` the frame rate [1/s].
    Without a ``licence`` no frame may be shown. ``vertical`` is the axis of the gyro that is up.
    """

    hfov: float | None
    rate: float
    what: str
    source: str
    licence: str | None
    vertical: str = "z"


RECORDINGS = {
    "donkeycar/images": LabelledRecording(
        None, 20.0, "a small car on an indoor track", "autorope/donkeycar, tub of its tests", "MIT"
    ),
    "car_gyro_lab/images": LabelledRecording(
        None, 20.0, "a small car in the aisle of a computer lab", "unnamed", None
    ),
    "car_gyro_hall/images": LabelledRecording(
        None, 20.0, "a small car on a track in an open hall", "unnamed", None, "y"
    ),
    "hololens_office/images": LabelledRecording(
        57.2, 10.0, "a walk along an office corridor", "ardaduz/deep-video-mvs", "MIT"
    ),
    "tum_fr1/rgb": LabelledRecording(
        63.5,
        30.0,
        "desks of an office, camera in the hand",
        "TUM RGB-D benchmark, Sturm et al. 2012",
        "CC BY 4.0",
    ),
    "approach": LabelledRecording(
        None, 10.0, "an approach to a wall", "Huizerd/AE4317_Autonomous_Flight_of_MAVs", "MIT"
    ),
    "corridor_udes": LabelledRecording(
        None,
        1.0,
        "single photographs of university corridors, without flow",
        "introlab/rtabmap",
        "BSD",
    ),
}
"""The recordings with labels, by folder."""


@dataclass
class _Findings:
    """What was found in one part, or in several."""

    verdicts: Counter[str] = field(default_factory=Counter)
    statements: Counter[str] = field(default_factory=Counter)
    pairs: int = 0
    heading_sigmas: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    nearness: list[NearnessErrors] = field(default_factory=list)
    yaw: list[Array] = field(default_factory=list)

    def __add__(self, other: _Findings) -> _Findings:
        names = [field.name for field in fields(self)]
        return _Findings(*(getattr(self, name) + getattr(other, name) for name in names))

    def row(self) -> dict[str, Any]:
        """The findings as plain data; None for what cannot be judged."""
        cells = sum(errors.number for errors in self.nearness)
        by_way = [error for errors in self.nearness for error in errors.by_way]
        up_to_scale = [error for errors in self.nearness for error in errors.up_to_scale]
        return {
            "verdicts": {str(verdict): self.verdicts[verdict] for verdict in SentenceVerdict},
            "statements": dict(sorted(self.statements.items())),
            "pairs": self.pairs,
            "headings_known": len(self.heading_sigmas),
            "heading_sigma_deg": _median(self.heading_sigmas, 2),
            "heading_error_deg": _median(self.heading_errors, 2),
            "nearness_trusted": round(len(by_way) / cells, 3) if cells else None,
            "nearness_error": _median(up_to_scale, 3),
            "nearness_error_by_way": _median(by_way, 3),
            **yaw_summary(np.concatenate([np.empty((0, 2)), *self.yaw])),
        }


def bench_real(
    data: Path,
    split: str,
    flows: Sequence[str],
    registry: Registry,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """Verdicts of the labelled frames of ``split`` ("tuning", "test" or "all").

    ``flows`` are the flow processors to compare. For each of them and each part: counts of the
    verdicts and of the statements, how many headings are known, and the medians of the heading's
    standard deviation [deg] and error [deg] where it is known; the share of cells with trusted
    nearness and the median of their relative error, up to scale and by the recorded displacement;
    and the correlation and slope of the yaw rate over the gyro's. ``singles`` are parts of
    photographs without a neighbour; they are not in the total.

    Raises:
        ConfigError: ``data`` lacks a recording or a labelled image.
        InputError: a file of a recording cannot be read.

    """
    parts = labelled_parts(split)
    by_flow: dict[str, Any] = {}
    for flow in flows:
        rows: dict[str, dict[str, Any]] = {"parts": {}, "singles": {}}
        total = _Findings()
        for part, labels in parts.items():
            report(f"{flow}: {part}")
            findings = _part(data, labels, flow, registry)
            single = labels[0].single
            rows["singles" if single else "parts"][part] = findings.row()
            if not single:
                total += findings
        by_flow[flow] = {**rows, "total": total.row()}
    frames = sum(len(labels) for labels in parts.values() if not labels[0].single)
    return {"split": split, "frames": frames, "flows": by_flow}


def bench_scenes(
    count: int,
    split: str,
    flows: Sequence[str],
    registry: Registry,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """As ``bench_real``, on ``count`` rendered sequences of each kind in ``split``.

    The field of view is known, as of real cameras. Parts are the kinds.
    """
    found = {flow: defaultdict[str, _Findings](_Findings) for flow in flows}
    kinds = [kind for kind, what in KINDS.items() if split in (what.split, "all")]
    frames = 0
    for kind in kinds:
        with TemporaryDirectory() as name:
            for number, (hfov, labels) in enumerate(render_scenes(kind, count, Path(name))):
                report(f"{kind}, {number + 1} of {count}")
                frames += len(labels)
                for flow, parts in found.items():
                    source = open_source([Path(name, labels[0].folder)], RATE)
                    perceiver = Perceiver(PerceiverOptions(hfov, flow=flow), source, registry)
                    parts[kind] += _judged(_by_name(perceiver), labels)
    by_flow = {
        flow: {
            "parts": {kind: findings.row() for kind, findings in parts.items()},
            "singles": {},
            "total": sum(parts.values(), _Findings()).row(),
        }
        for flow, parts in found.items()
    }
    return {"split": split, "frames": frames, "flows": by_flow}


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """The parts, their total and the single photographs, by flow processor."""
    rows = [
        {"flow": flow, "part": part, "good": _good(row["verdicts"]), **row, **row["verdicts"]}
        for flow, measured in result["flows"].items()
        for part, row in (
            *measured["parts"].items(),
            ("all", measured["total"]),
            *((f"{part} (single)", row) for part, row in measured["singles"].items()),
        )
    ]
    columns = [
        Column("flow", "flow"),
        Column("part", "part"),
        *(Column(verdict, verdict) for verdict in SentenceVerdict),
        Column("good", "good", ".0%"),
        Column("headings", lambda row: f"{row['headings_known']} of {row['pairs']}"),
        Column("sigma [deg]", "heading_sigma_deg", ".1f"),
        Column("error [deg]", "heading_error_deg", ".1f"),
        Column("trusted", "nearness_trusted", ".0%"),
        Column("nearness error", "nearness_error", ".1%"),
        Column("yaw r", "yaw_correlation", ".3f"),
        Column("yaw slope", "yaw_slope", ".3f"),
    ]
    yield ResultTable(f"{result['frames']} frames of the split {result['split']}", columns, rows)


def _good(counts: Mapping[str, int]) -> float:
    return (counts["right"] + counts["partly"]) / max(sum(counts.values()), 1)


def _median(values: Sequence[float], digits: int) -> float | None:
    return round(float(np.median(values)), digits) if values else None


def labelled_parts(split: str) -> dict[str, list[FrameLabel]]:
    """The labels of ``split`` ("tuning", "test" or "all") by part."""
    parts: dict[str, list[FrameLabel]] = {}
    for label in load_labels():
        if split in (label.split, "all"):
            parts.setdefault(label.part, []).append(label)
    return parts


def open_part(
    data: Path, labels: Sequence[FrameLabel], flow: str, registry: Registry
) -> tuple[Perceiver, GyroRecord | None]:
    """The perceiver of one part of the recordings in ``data``, and the gyro's record if any.

    It has some images before the first labelled one, and all up to the last.

    Raises:
        ConfigError: ``data`` lacks the recording or a labelled image.
        InputError: a file of the recording cannot be read.

    """
    folder = labels[0].folder
    recording = _recording(data, folder)
    images = _images_of(recording.images, data / folder, labels)
    lens, hfov = recording.lens, recording.about.hfov
    source = recording.opened(images, lens.calibration)
    options = PerceiverOptions(hfov=lens.known_hfov(hfov), flow=flow)
    return Perceiver(options, source, registry), recording.gyro


@dataclass(frozen=True)
class _Recording:
    """All ``images`` of a recording, their ``times``, what is known ``about`` it, and its gyro."""

    images: list[Path]
    about: LabelledRecording
    times: ImageTimes | None
    gyro: GyroRecord | None

    def opened(self, images: list[Path], calibration: CameraCalibration | None) -> ImageSource:
        """Some of its images with their times."""
        rate = self.about.rate if self.times is None else None
        return open_source(images, rate, calibration, self.times)

    @cached_property
    def lens(self) -> LensEstimate:
        """The lens by all images: it is the same in all parts."""
        return estimate_lens(self.opened(self.images, None), self.about.hfov)


@lru_cache(maxsize=len(RECORDINGS))
def _recording(data: Path, folder: str) -> _Recording:
    if not is_folder(data / folder):
        what = "there is no such folder; --data names the folder above"
        raise ConfigError(what, file=data / folder)
    images = [path for path in (data / folder).iterdir() if path.suffix.lower() in IMAGES]
    images.sort(key=natural_key)
    about = RECORDINGS[folder]
    gyro = recorded_gyro(data / folder.split("/", maxsplit=1)[0], images, about.vertical)
    return _Recording(images, about, *(gyro or (None, None)))


def judge_result(result: PairResult | None, label: FrameLabel) -> Judgement:
    """The sentence of a pair judged by the label of its second image; silent without a result."""
    if result is None:
        return Judgement({})
    return judge(result.percept.sentence, result.percept.obstacles.get("layer1", {}), label)


def _part(data: Path, labels: Sequence[FrameLabel], flow: str, registry: Registry) -> _Findings:
    folder = labels[0].folder
    perceiver, gyro = open_part(data, labels, flow, registry)
    source = perceiver.source
    results = _by_name(perceiver)
    findings = _judged(results, labels)
    if gyro is not None and source.start is not None:
        findings.yaw.append(yaw_rates(results.values(), source.start, gyro))
    posed = posed_images(data, folder)
    for name, result in results.items():
        past, now = posed.get(Path(result.past).name), posed.get(name)
        if past is None or now is None:
            continue
        if math.isfinite(result.motion.egomotion.heading_sigma):
            findings.heading_errors.append(heading_error(result, past.pose, now.pose))
        # depth images are those of the images as they were taken
        if perceiver.size is not None and source.hfov is None:
            moved = camera_displacement(past.pose, now.pose)
            findings.nearness.append(nearness_errors(result, perceiver.size, now.depth(), moved))
    return findings


def _by_name(perceiver: Perceiver) -> dict[str, PairResult]:
    """The results of all pairs by the name of their second image."""
    return {Path(item.name).name: result for item, result in perceiver.results()}


def _judged(results: Mapping[str, PairResult], labels: Sequence[FrameLabel]) -> _Findings:
    """Verdicts by the labels, and the headings, of ``results`` by the name of the image."""
    findings = _Findings(pairs=len(results))
    for label in labels:
        judged = judge_result(results.get(label.file), label)
        findings.verdicts[judged.verdict] += 1
        findings.statements.update(
            f"{name} {'right' if true else 'wrong'}" for name, true in judged.statements.items()
        )
    sigmas = [result.motion.egomotion.heading_sigma for result in results.values()]
    findings.heading_sigmas += [math.degrees(sigma) for sigma in sigmas if math.isfinite(sigma)]
    return findings


def _images_of(images: Sequence[Path], folder: Path, labels: Sequence[FrameLabel]) -> list[Path]:
    names = [path.name for path in images]
    for label in labels:
        if label.file not in names:
            raise ConfigError("the labelled image is missing", file=folder / label.file)
    chosen = [names.index(label.file) for label in labels]
    return list(images[max(min(chosen) - _LEAD, 0) : max(chosen) + 1])
