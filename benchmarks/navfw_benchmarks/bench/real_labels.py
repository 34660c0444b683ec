"""Truth of real frames: labels (benchmarks/real-frames.md), judgement of a sentence, and records.

Headings, nearness and yaw rates on recorded sequences are compared with poses, depth images and the
gyro.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.input_file import is_file, read_input_text
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.offis.percept_explanation import front_in
from navfw.perceive.image_times import ImageTimes, load_image_times
from navfw.perceive.motion_record import GyroRecord, load_gyro_record
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver_options import WorkingSize
from navfw.signals import Label
from navfw_benchmarks.bench.recorded_pairs import PosedImage, hololens_images, tum_images

QUADRANTS = {"P1": "upper_right", "P2": "upper_left", "P3": "lower_left", "P4": "lower_right"}
"""Names in the labels of the quadrants of layer 1."""

_FRONTS = frozenset({"wall", "door", "corner", "corridor", "open"})
"""Names in the labels of the fronts: the last words of theirs, such as "left slope wall"."""

_SETS = ("nearest", "nearest_also", "front_also")
"""Columns with any number of names."""


class SentenceVerdict(StrEnum):
    """What the statements of a sentence are worth together."""

    RIGHT = "right"
    PARTLY = "partly"
    WRONG = "wrong"
    SILENT = "silent"


@dataclass(frozen=True, slots=True)
class FrameLabel:
    """What can be seen in one real frame; the fields are the columns of ``real_frames.csv``.

    ``nearest`` and ``nearest_also`` are quadrants, or ``none`` or ``unknown``; ``front`` and
    ``front_also`` what stands in front; ``single`` says that the frame has no neighbour for flow.
    """

    part: str
    split: str
    folder: str
    file: str
    single: bool
    nearest: frozenset[str]
    nearest_also: frozenset[str]
    floor_in_front: str
    front: str
    front_also: frozenset[str]


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether each statement of a sentence is true, such as ``nearest``, ``front``, ``floor``."""

    statements: Mapping[str, bool]

    @property
    def verdict(self) -> SentenceVerdict:
        """All statements together."""
        true = sum(self.statements.values())
        if not self.statements:
            return SentenceVerdict.SILENT
        if true == len(self.statements):
            return SentenceVerdict.RIGHT
        return SentenceVerdict.PARTLY if true else SentenceVerdict.WRONG


def load_labels() -> list[FrameLabel]:
    """All labels, in the order of the file."""
    file = Path(__file__).with_name("real_frames.csv")
    text = read_input_text(file)
    return [
        FrameLabel(
            **row
            | {name: frozenset(row[name].split()) for name in _SETS}
            | {"single": row["single"] == "yes"}
        )
        for row in csv.DictReader(text.splitlines(), strict=True)
    ]


def judge(sentence: str, nearest: Mapping[str, str], label: FrameLabel) -> Judgement:
    """The statements of a ``sentence`` judged by ``label``.

    ``nearest`` has the distance term of each quadrant that layer 1 names. What the label leaves
    open is not judged.
    """
    statements = {
        "nearest": _nearest(sentence, nearest, label),
        "front": _front(sentence, label),
        "floor": _floor(sentence, label),
    }
    return Judgement({name: true for name, true in statements.items() if true is not None})


def _nearest(sentence: str, nearest: Mapping[str, str], label: FrameLabel) -> bool | None:
    if label.nearest == {"unknown"}:
        return None
    if "no object in sight" in sentence:
        return label.nearest == {"none"}
    named = {QUADRANTS[quadrant]: term for quadrant, term in nearest.items()}
    if not named:
        return None
    if label.nearest == {"none"}:
        return all(place in label.nearest_also and term == "far" for place, term in named.items())
    return named.keys() <= label.nearest | label.nearest_also


def _front(sentence: str, label: FrameLabel) -> bool | None:
    alternatives = front_in(sentence).split(" or ")
    named = _FRONTS & {name.rpartition(" ")[2] for name in alternatives}
    if not named or label.front == "unknown":
        return None
    return bool(named & (label.front_also | {label.front}))


def _floor(sentence: str, label: FrameLabel) -> bool | None:
    if "Floor in front" not in sentence or label.floor_in_front == "unknown":
        return None
    return label.floor_in_front == "yes"


_READINGS = "readings.csv"
"""File of a recording with a gyro: a row for each image, with its time and the gyro's rates."""

MIN_PAIRS = 10
"""Least number of pairs for a correlation."""


def recorded_gyro(
    folder: Path, images: Iterable[Path], vertical: str = "z"
) -> tuple[ImageTimes, GyroRecord] | None:
    """The times of a recording's images by name, and the record of its gyro; None without one.

    ``images`` are all images of the recording in ``folder``, in their order; ``vertical`` is the
    gyro's axis that is up: "x", "y" or "z".

    Raises:
        ConfigError: the readings are not one for each image.
        InputError: the readings cannot be read.

    """
    file = folder / _READINGS
    if not is_file(file):
        return None
    listed = load_image_times(file)
    names = [image.name for image in images]
    if len(names) != len(listed.times):
        raise ConfigError(
            f"expected a row for each of {len(names)} images, found {len(listed.times)}", file=file
        )
    by_name = dict(zip(names, listed.times, strict=True))
    axes = np.roll(np.eye(3), 2 - "xyz".index(vertical), axis=0)
    return replace(listed, by_name=by_name), load_gyro_record(file, axes).without_offsets()


def yaw_rates(results: Iterable[PairResult], start: float, record: GyroRecord) -> Array:
    """Yaw rates (n, 2) [rad/s] of pairs: by the camera, by the gyro; positive to the left.

    ``start`` [s] is the time of the first image on the gyro's clock. Pairs in gaps of the
    ``record`` are left out.
    """
    rows = []
    for result in results:
        end, dt = start + result.time, result.motion.dt
        measured = record.rotation_between(end - dt, end)
        if measured is not None:
            rows.append((result.rotation_vector[2] / dt, measured[2] / dt))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def yaw_summary(rates: Array) -> dict[str, Any]:
    """Number of pairs, and correlation and slope of the camera's ``rates`` over the gyro's."""
    summary: dict[str, Any] = {"yaw_pairs": len(rates), "yaw_correlation": None, "yaw_slope": None}
    if len(rates) >= MIN_PAIRS and float(rates.std(axis=0).min()) > 0.0:
        camera, gyro = rates.T
        summary["yaw_correlation"] = round(float(np.corrcoef(camera, gyro)[0, 1]), 4)
        summary["yaw_slope"] = round(float(camera @ gyro / (gyro @ gyro)), 4)
    return summary


def posed_images(data: Path, folder: str) -> dict[str, PosedImage]:
    """The images in ``folder`` with a pose and a depth image, by file name; may be empty.

    Raises:
        InputError: a file of the recording is missing or cannot be read.

    """
    root = data / folder.split("/", maxsplit=1)[0]
    readers = {"hololens_office": hololens_images, "tum_fr1": tum_images}
    if root.name not in readers:
        return {}
    return {image.file.name: image for image in readers[root.name](root)}


def heading_error(result: PairResult, past: Array, now: Array) -> float:
    """Angle [deg] between the heading of a pair and the true one, from the poses (4, 4)."""
    shift = now[:3, :3].T @ (now[:3, 3] - past[:3, 3])
    length = float(np.linalg.norm(shift))
    cosine = float(result.motion.egomotion.direction @ shift) / max(length, 1e-12)
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))


def camera_displacement(past: Array, now: Array) -> float:
    """Distance [m] between the places of two poses (4, 4)."""
    return float(np.linalg.norm(now[:3, 3] - past[:3, 3]))


TRUSTED_SIGMA = 0.15
"""Largest standard deviation of a trusted cell, relative to its nearness: the median of a normal
error is then 10 %."""

MIN_CELLS = 8
"""Least number of trusted cells of a pair for its scale."""


@dataclass(frozen=True, slots=True)
class NearnessErrors:
    """Of the cells with a truth: their ``number``, and the relative errors of the trusted ones.

    ``by_way`` (n,) are the errors if the camera's displacement between the images is known;
    ``up_to_scale`` (n,) those after one common factor for the cells of a pair: images lack scale.
    """

    number: int
    by_way: Array
    up_to_scale: Array


def nearness_errors(
    result: PairResult, size: WorkingSize, depth: Array, displacement: float
) -> NearnessErrors:
    """Errors of the cells of a pair, by ``depth`` (height, width) [m] of its second image.

    ``displacement`` [m] is the camera's true one between the images.
    """
    percept = result.percept
    x, y = np.floor(size.to_image(percept.points)).astype(np.int64).transpose(2, 0, 1)
    true = depth[np.clip(y, 0, depth.shape[0] - 1), np.clip(x, 0, depth.shape[1] - 1)]
    measured = true > 0.0
    trusted = measured & (percept.label != Label.UNKNOWN) & result.known
    trusted &= percept.sigma <= TRUSTED_SIGMA * percept.nearness
    number = int(measured.sum())
    if int(trusted.sum()) < MIN_CELLS:
        return NearnessErrors(number, np.empty(0), np.empty(0))
    # both in displacements of the camera: the percept's metres are nominal
    ratio = percept.nearness[trusted] * result.flow.motion.baseline * true[trusted] / displacement
    common = float(np.median(ratio))
    return NearnessErrors(number, np.abs(ratio - 1.0), np.abs(ratio / common - 1.0))
