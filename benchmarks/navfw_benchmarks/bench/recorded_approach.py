"""Time to contact on a recorded straight approach to a wall, against the recorded time to impact.

The data are not part of the repository: ``bench_approach`` takes the folder with the frames
``image_1.jpg`` ... and ``TTI.mat`` (Huizerd, AE4317_Autonomous_Flight_of_MAVs, MIT licence).
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.config.image_file import read_image
from navfw.config.input_file import is_file, open_input
from navfw.errors import ConfigError
from navfw.flow.block_matching import BlockMatching
from navfw.numerics import Array, Image
from navfw.process.result_table import Column, ResultTable
from navfw.recording.run_folder import plain_json
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame, FramePair
from navfw_benchmarks.bench.expansion import ContactFilter, Expansion, fit_expansion

_ZOOM_FROM = 0.05
"""Expected relative growth of the image between two frames above which the past frame is magnified
before matching: the displacements that remain then stay within the search range."""
STILL = CameraMotion(np.eye(3), np.zeros(3), 0.0)
"""No camera motion: the matcher must not predict any displacement."""


def bench_approach(folder: str | Path) -> dict[str, Any]:
    """Error of the time to contact in every frame of the approach.

    Each frame is matched to the previous one by block matching; the time to contact follows from
    a fit of the expansion about a focus. Neither speed nor focal length is used. ``_paired``
    assigns the recorded times to the frames. Returns plain data:

    - ``frames``, ``values``: number of frames and of recorded times; ``step_s``: frame interval;
    - ``pairing_offset_frames``: shift of the estimates along the recorded times that fits best, in
      frames (0: the assignment of times to frames is right);
      ``other_pairing_median_rel_error``: ``ttc_median_rel_error`` if the first frame had the first
      recorded time instead;
    - ``ttc_median_rel_error``, ``ttc_p95_rel_error``: relative error of the causally smoothed
      estimate where the true time is below 5 s; ``raw_median_rel_error``,
      ``raw_p95_rel_error``: of the unsmoothed estimate; ``all_median_rel_error``: of the smoothed
      estimate over all frames;
    - ``answered``: share of the frames below 5 s with a measurement of their own;
    - ``by_time``: list of {``from_s``, ``to_s``, ``n``, ``median_rel_error``, ``raw_median``};
    - ``truth_s``, ``smoothed_s``, ``raw_s``: a value [s] per frame from the second on, or None.

    Raises:
        ConfigError: frames or times are missing, or their numbers do not match.

    """
    images, truth, step, count = _paired(Path(folder))
    raw, smoothed = _contact_times(images, step)
    true = truth[1:]
    errors = np.abs(smoothed - true) / true
    raw_errors = np.abs(raw - true) / true
    close = true < 5.0
    measured = np.isfinite(raw)
    return {
        "frames": len(images),
        "values": count,
        "step_s": step,
        "pairing_offset_frames": _offset(raw, true, step),
        "other_pairing_median_rel_error": _quantile(
            np.abs(smoothed[close] / (true[close] + step) - 1.0), 0.5
        ),
        "ttc_median_rel_error": _quantile(errors[close], 0.5),
        "ttc_p95_rel_error": _quantile(errors[close], 0.95),
        "raw_median_rel_error": _quantile(raw_errors[close & measured], 0.5),
        "raw_p95_rel_error": _quantile(raw_errors[close & measured], 0.95),
        "all_median_rel_error": _quantile(errors, 0.5),
        "answered": float(measured[close].mean()),
        "by_time": _by_time(true, errors, np.where(measured, raw_errors, np.nan)),
        "truth_s": true.tolist(),
        "smoothed_s": plain_json(smoothed),
        "raw_s": plain_json(raw),
    }


def _by_time(true: Array, errors: Array, raw_errors: Array) -> list[dict[str, Any]]:
    """Median errors by intervals of the true time [s]; NaN in ``raw_errors``: not measured."""
    return [
        {
            "from_s": low,
            "to_s": high,
            "n": int(chosen.sum()),
            "median_rel_error": _quantile(errors[chosen], 0.5),
            "raw_median": _quantile(raw_errors[chosen & np.isfinite(raw_errors)], 0.5),
        }
        for low, high in ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0))
        if (chosen := (true >= low) & (true < high)).any()
    ]


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """The errors by intervals of the true time."""
    columns = [
        Column("time to impact [s]", lambda row: f"{row['from_s']:g} to {row['to_s']:g}"),
        Column("frames", "n"),
        Column("median relative error", "median_rel_error", ".1%"),
        Column("unsmoothed", "raw_median", ".1%"),
    ]
    yield ResultTable("Recorded approach: time to contact", columns, result["by_time"])


def _paired(folder: Path) -> tuple[list[Image], Array, float, int]:
    """Frames in order, time to impact [s] of each, frame interval [s], number of recorded times.

    The recording has 101 times, 10.0 to 0.0 s in steps of 0.1 s, and 99 frames numbered from 1.
    Frame k has the time of index k (from 0): the first time, at the start, and the last, at the
    impact, have no frame. ``pairing_offset_frames`` confirms this assignment from the images.
    """
    named = {}
    for file in folder.glob("image_*.jpg"):
        number = re.fullmatch(r"image_(\d+)", file.stem)
        if number:
            named[int(number[1])] = file
    if not named or not is_file(folder / "TTI.mat"):
        raise ConfigError("expected image_1.jpg, image_2.jpg, ... and TTI.mat", file=folder)
    values = _recorded_times(folder / "TTI.mat")
    numbers = sorted(named)
    if numbers != list(range(1, len(numbers) + 1)) or numbers[-1] >= len(values):
        raise ConfigError(
            f"{len(values)} times do not go with frames {numbers[0]} to {numbers[-1]}", file=folder
        )
    images = [read_grey(named[number]) for number in numbers]
    return images, values[numbers], float(np.median(-np.diff(values))), len(values)


def _contact_times(images: Sequence[Image], step: float) -> tuple[Array, Array]:
    """Times to contact [s] from the second frame on: of single frame pairs, and smoothed.

    ``step`` [s] is the frame interval. The value of a single pair is NaN without a measurement.
    Earlier pairs are used only to predict how much the image has grown.
    """
    height, width = images[0].shape
    camera = CameraModel(width=width, height=height)
    matcher = BlockMatching(
        RobotModel(camera=camera), BlockMatching.Params(rows=_cells(height), cols=_cells(width))
    )
    smoother = ContactFilter()
    raw, smoothed = [], []
    for past, now in itertools.pairwise(images):
        predicted = smoother.time_to_contact - step
        rate = step / (predicted + step) if math.isfinite(predicted) and predicted > 0.0 else 0.0
        growth = _growth(matcher, past, now, min(rate, 0.7))
        smoothed.append(smoother.update(step, growth, step))
        raw.append(growth.time_to_contact(step) if growth is not None else math.nan)
    return np.array(raw), np.array(smoothed)


def _growth(matcher: BlockMatching, past: Image, now: Image, predicted: float) -> Expansion | None:
    """Relative growth of the image from ``past`` to ``now``.

    ``past`` is magnified by the ``predicted`` growth first, if that exceeds ``_ZOOM_FROM``.
    """
    zoom = predicted if predicted > _ZOOM_FROM else 0.0
    height, width = past.shape
    centre_x, centre_y = 0.5 * (width - 1), 0.5 * (height - 1)
    keep = 1.0 - zoom
    from_now = np.array(
        [[keep, 0.0, zoom * centre_x], [0.0, keep, zoom * centre_y]], dtype=np.float64
    )
    magnified = cv2.warpAffine(
        past, from_now, (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )
    seen = np.asarray(magnified, dtype=np.uint8) if zoom else past
    rest = fit_expansion(matcher.compute(FramePair(Frame(0.0, seen), Frame(1.0, now), STILL)))
    if rest is None:
        return None
    # compose the predicted growth with the measured remainder
    rate = 1.0 - keep * (1.0 - rest.rate)
    focus = keep * rest.rate * rest.focus / rate if rate else rest.focus
    return Expansion(rate, keep * rest.sigma, focus, rest.support)


def _cells(size: int) -> int:
    """Number of cells along an image side of ``size`` [px]: the divisor nearest to 16."""
    return min((n for n in range(4, size // 8 + 1) if size % n == 0), key=lambda n: abs(n - 16))


def _offset(raw: Array, true: Array, step: float) -> float:
    """Median of true minus estimated time, in frames."""
    good = np.isfinite(raw) & (true > 1.0)
    return float(np.median(true[good] - raw[good]) / step)


def _quantile(values: Array, share: float) -> float | None:
    return float(np.quantile(values, share)) if len(values) else None


def _recorded_times(file: Path) -> Array:
    """The times to impact (n,) [s] in a file of MATLAB."""
    from scipy.io import loadmat

    with open_input(file) as stream:
        try:
            return np.asarray(loadmat(stream)["TTI"], dtype=np.float64).ravel()
        except Exception as error:  # a damaged file makes scipy raise errors of many kinds
            raise ConfigError(f"expected times to impact, TTI: {error}", file=file) from None


def read_grey(file: Path) -> Image:
    """Luminance (height, width) of an image file.

    Raises:
        ConfigError: the file is no readable image.

    """
    return read_image(file, cv2.IMREAD_GRAYSCALE).astype(np.uint8, copy=False)
