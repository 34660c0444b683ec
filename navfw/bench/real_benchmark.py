"""Perception on real frames: sentences by labels, headings and distances by depth and poses.

Each part of the labelled sequences is processed as ``navfw perceive`` does. The cameras' fields of
view are those in the table; nothing else about them is given.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfw.bench.real_labels import FrameLabel, SentenceVerdict, judge, load_labels
from navfw.bench.real_poses import camera_poses, heading_error
from navfw.config.input_file import is_folder
from navfw.errors import ConfigError
from navfw.perceive.image_order import natural_key
from navfw.perceive.image_sources import IMAGES, open_source
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver import Perceiver
from navfw.perceive.perceiver_options import PerceiverOptions
from navfw.plugins import Registry
from navfw.signals import Array

__all__ = ["CAMERAS", "RealCamera", "bench_real", "real_rows"]

LEAD = 6
"""Number of images before the first labelled one of a part that are processed as well."""


@dataclass(frozen=True, slots=True)
class RealCamera:
    """What is known of a recording: horizontal field of view [deg], frame rate [1/s]."""

    hfov: float
    rate: float


CAMERAS = {
    "donkeycar/images": RealCamera(100.0, 20.0),  # estimated from the lines on the floor
    "car_gyro_lab/images": RealCamera(91.4, 20.0),  # focal length 78 px by the gyro
    "hololens_office/images": RealCamera(57.2, 10.0),
    "tum_fr1/rgb": RealCamera(63.5, 30.0),
    "approach": RealCamera(65.0, 10.0),  # not known
}
"""The recordings with labels, by folder."""


def bench_real(
    data: Path,
    split: str,
    flows: Sequence[str],
    registry: Registry,
    tick: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Verdicts of the labelled frames of ``split`` ("tuning", "test" or "all").

    ``flows`` are the flow processors to compare. For each of them and each part: counts of the
    verdicts and of the statements, how many headings are known, and the
    medians of the heading's standard deviation [deg] and error [deg] where it is known.

    Raises:
        ConfigError: ``data`` lacks a recording or a labelled image.

    """
    report = tick or (lambda _: None)
    parts: dict[str, list[FrameLabel]] = {}
    for label in load_labels():
        if not label.single and split in (label.split, "all"):
            parts.setdefault(label.part, []).append(label)
    found: dict[str, Any] = {}
    for flow in flows:
        rows = {}
        for part, labels in parts.items():
            report(f"{flow}: {part}")
            rows[part] = _part(data, labels, flow, registry)
        found[flow] = {"parts": rows, "total": _total(list(rows.values()))}
    return {"split": split, "frames": sum(map(len, parts.values())), "flows": found}


def real_rows(result: dict[str, Any]) -> list[list[str]]:
    """Rows of text: flow, part, verdicts, share right or partly, headings known, sigma, error."""
    rows = []
    for flow, found in result["flows"].items():
        for part, row in [*found["parts"].items(), ("all", found["total"])]:
            verdicts = row["verdicts"]
            frames = max(sum(verdicts.values()), 1)
            good = verdicts["right"] + verdicts["partly"]
            headings = (row["heading_sigma_deg"], row["heading_error_deg"])
            rows.append(
                [
                    flow,
                    part,
                    *(str(verdicts[verdict]) for verdict in SentenceVerdict),
                    f"{good / frames:.0%}",
                    f"{row['headings_known']} of {row['pairs']}",
                    *("-" if angle is None else f"{angle:.1f}" for angle in headings),
                ]
            )
    return rows


def _part(
    data: Path, labels: Sequence[FrameLabel], flow: str, registry: Registry
) -> dict[str, Any]:
    """The row of one part."""
    images = _images(data / labels[0].folder, labels)
    camera = CAMERAS[labels[0].folder]
    source = open_source(images, camera.rate)
    perceiver = Perceiver(PerceiverOptions(hfov=camera.hfov, flow=flow), source, registry)
    results = {Path(item.name).name: result for item, result in perceiver.results()}
    verdicts: Counter[str] = Counter(dict.fromkeys(SentenceVerdict, 0))
    statements: Counter[str] = Counter()
    for label in labels:
        result = results.get(label.file)
        if result is None:
            verdicts[SentenceVerdict.SILENT] += 1
            continue
        percept = result.percept
        judged = judge(percept.sentence, percept.obstacles.get("layer1", {}), label)
        verdicts[judged.verdict] += 1
        statements.update(
            f"{name} {'right' if true else 'wrong'}" for name, true in judged.statements.items()
        )
    return {
        "verdicts": dict(verdicts),
        "statements": dict(sorted(statements.items())),
        **_headings(list(results.values()), camera_poses(data, labels[0].folder)),
    }


def _headings(results: Sequence[PairResult], poses: Mapping[str, Array]) -> dict[str, Any]:
    """How many headings are known, the median of their sigma, and of their error by ``poses``."""
    known = [result for result in results if math.isfinite(result.egomotion.heading_sigma)]
    sigmas = [math.degrees(result.egomotion.heading_sigma) for result in known]
    errors = [
        heading_error(result, poses[Path(result.past).name], poses[Path(result.now).name])
        for result in known
        if {Path(result.past).name, Path(result.now).name} <= poses.keys()
    ]
    return {
        "pairs": len(results),
        "headings_known": len(known),
        "heading_sigma_deg": round(float(np.median(sigmas)), 2) if sigmas else None,
        "heading_error_deg": round(float(np.median(errors)), 2) if errors else None,
    }


def _total(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """All parts together."""
    verdicts: Counter[str] = Counter(dict.fromkeys(SentenceVerdict, 0))
    statements: Counter[str] = Counter()
    for row in rows:
        verdicts.update(row["verdicts"])
        statements.update(row["statements"])
    return {
        "verdicts": dict(verdicts),
        "statements": dict(sorted(statements.items())),
        "pairs": sum(row["pairs"] for row in rows),
        "headings_known": sum(row["headings_known"] for row in rows),
        "heading_sigma_deg": None,
        "heading_error_deg": None,
    }


def _images(folder: Path, labels: Sequence[FrameLabel]) -> list[Path]:
    """The images of a part, in order, with some before the first labelled one."""
    if not is_folder(folder):
        raise ConfigError("there is no such folder; --data names the folder above", file=folder)
    images = sorted(
        (path for path in folder.iterdir() if path.suffix.lower() in IMAGES), key=natural_key
    )
    names = [path.name for path in images]
    for label in labels:
        if label.file not in names:
            raise ConfigError("the labelled image is missing", file=folder / label.file)
    first, last = names.index(labels[0].file), names.index(labels[-1].file)
    return images[max(first - LEAD, 0) : last + 1]
