"""``navfw reproduce``: render, interpret, compare, draw, time, and write the folder."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.lookup import find
from navfw.missions.run_drawing import outline_of
from navfw.numerics import Image
from navfw.offis.pyramid import position
from navfw.perceive.overlay import draw_flow, write
from navfw.plugins import default_registry
from navfw.process.atomic import AtomicFolder
from navfw.process.result_table import shown
from navfw.process.work_progress import ProgressCallback, silent
from navfw.recording.plan_picture import draw_arrow, draw_shapes, plan_axes
from navfw.recording.run_folder import plain_json
from navfw.recording.top_view import Line, Marks, Style
from navfw.report import report_page
from navfw.signals import FlowField, Pose
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import WorldSpec
from navfw_benchmarks.bench.real_labels import SentenceVerdict
from navfw_benchmarks.bench.true_pairs import MovingPose
from navfw_benchmarks.reproduce import paper_tables
from navfw_benchmarks.reproduce.metric_comparison import compare_metrics
from navfw_benchmarks.reproduce.paper_scenes import drive
from navfw_benchmarks.reproduce.photographs import chosen_frames, real_as_data, real_scenes

with extra_imports("report", key="navfw reproduce"):
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

SIGNIFICANT = 0.05
"""Largest p of a difference that is taken for more than chance."""

_KINDS = tuple(product(("ideal", "block matching"), ("normalised", "raw means")))
"""Flow and mode of the sentences."""


def summary(result: Mapping[str, Any]) -> dict[str, list[str]]:
    """What came out of each experiment, as sentences by its title.

    ``result`` has ``table2``, ``table3``, ``real`` and ``metrics`` as plain data.
    """
    return {
        "Table 2": list(_table2(result["table2"])),
        "Table 3, rendered": list(_table3(result["table3"])),
        "Table 3, photographs": list(_real(result["real"])),
        "Section 4.3": list(_claims(result["metrics"]["claims"])),
    }


def _table2(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield f"All {len(rows)} places are judged."
    for flow, mode in _KINDS:
        counts = [
            f"{_counts(_chosen(rows, flow=flow, mode=mode, rotation=rotation))} with the rotation"
            f" {rotation}"
            for rotation in ("removed", "left in")
        ]
        yield f"{flow.capitalize()} flow, {mode}: {'; '.join(counts)}."
    fast = [row for row in rows if row["waypoint"] == paper_tables.FAST]
    verdicts = "; ".join(
        f"{reading['flow']} flow, rotation {reading['rotation']}: {reading['verdict']}"
        for reading in _chosen(fast, mode="normalised")
    )
    false = f"Waypoint {paper_tables.FAST}, where the paper's conclusion is false"
    yield f"{false}, normalised: {verdicts}."
    none = [str(row["waypoint"]) for row in rows if row["truth"]["no_situation"]]
    if none:
        yield (
            f"At {len(none)} places (waypoints {', '.join(none)}) the geometry forms none of Table"
            " 1's situations; the reason stands beside each."
        )


def _table3(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield f"All {len(rows)} situations are judged."
    for flow, mode in _KINDS:
        yield f"{flow.capitalize()} flow, {mode}: {_counts(_chosen(rows, flow=flow, mode=mode))}."


def _real(real: Mapping[str, Any] | None) -> Iterator[str]:
    if real is None:
        yield "Missing: no recordings were given (--data DIR)."
        return
    sequences = [row for row in real["recordings"] if not row["single"]]
    yield (
        f"{sum(real['total'].values())} labelled frames of {len(sequences)} recordings:"
        f" {_verdicts(real['total'])}."
    )
    yield from (
        f"{sum(row['verdicts'].values())} single photographs, about which nothing should be said:"
        f" {_verdicts(row['verdicts'])}."
        for row in real["recordings"]
        if row["single"]
    )


def _verdicts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)


def _claims(claims: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    held = [claim for claim in claims if claim["confirmed"]]
    missed = [claim for claim in claims if not claim["confirmed"]]
    yield (
        "The paper's claim, that two layers of means classify at least as well as one layer of"
        f" means and variances, is confirmed in {len(held)} of {len(claims)} comparisons: better by"
        f" more than chance (p < {SIGNIFICANT:g}) in {_significant(held)}, alike on every view in"
        f" {sum(claim['differ'] == 0 for claim in held)}. It is not confirmed in {len(missed)}:"
        f" worse by more than chance in {_significant(missed)}."
    )
    yield from (f"Not confirmed: {_claim_text(claim)}." for claim in missed)


def _significant(claims: Sequence[Mapping[str, Any]]) -> int:
    """How many of the ``claims`` rest on differences that are more than chance."""
    return sum(claim["p"] < SIGNIFICANT for claim in claims)


def _claim_text(claim: Mapping[str, Any]) -> str:
    question = {
        "quadrant": "nearest quadrant",
        "distance": "distance of the nearest object",
        "situation": "situation in front",
    }[claim["what"]]
    figures = f"{claim['two_layers_right']} against {claim['one_layer_right']} of {claim['views']}"
    chance = f"answers that differ: {claim['differ']}, p = {claim['p']:.2g}"
    return f"{question} by {claim['by']}, {claim['flow']} flow: {figures} right ({chance})"


def _counts(readings: Sequence[Mapping[str, Any]]) -> str:
    """How many of the ``readings`` have which verdict: "8 right, 2 partly"."""
    verdicts = [reading["verdict"] for reading in readings]
    return _verdicts({str(verdict): verdicts.count(verdict) for verdict in SentenceVerdict})


def _chosen(rows: Sequence[Mapping[str, Any]], **wanted: str) -> list[Mapping[str, Any]]:
    return [
        reading
        for row in rows
        for reading in row["readings"]
        if all(reading[key] == value for key, value in wanted.items())
    ]


_GAIN = 4
_STRIP = 30
_PAPER, _INK = (255, 255, 255), (40, 40, 40)
_WAYPOINT = "#D00000"


def waypoint_picture(row: paper_tables.PaperRow) -> Image:
    """The image; its ideal flow without and with rotation; the flow of block matching."""
    image = row.view.pair.now.image
    parts = [_panel(image, None, f"waypoint {row.number}")]
    for kind, rotation, title in (
        ("ideal", "removed", "ideal flow, rotation removed"),
        ("ideal", "left in", "ideal flow, rotation left in"),
        ("block matching", "removed", "block matching, rotation removed"),
    ):
        parts.append(_panel(image, row.flows[kind, rotation], title))
    return np.concatenate([_beside(parts[:2]), _beside(parts[2:])])


def scene_picture(row: paper_tables.PaperRow) -> Image:
    """The image, and the flow of block matching over it, as in the paper's Fig. 18."""
    image = row.view.pair.now.image
    flow = row.flows["block matching",]
    return _beside(
        [
            _panel(image, None, f"situation {row.number}"),
            _panel(image, flow, "block matching, 10 x 15"),
        ]
    )


def _panel(image: Image, flow: FlowField | None, title: str) -> Image:
    height, width = image.shape
    size = (_GAIN * width, _GAIN * height)
    large = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
    colour = np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    if flow is not None:
        colour = np.asarray(0.45 * colour + 20.0, dtype=np.uint8)
        # all vectors are drawn, also those that OFFIS rejects
        shown = np.maximum(flow.confidence, 0.4 * (flow.sigma < 5.0))
        draw_flow(colour, dataclasses.replace(flow, confidence=shown), float(_GAIN))
    strip = np.full((_STRIP, colour.shape[1], 3), _PAPER, dtype=np.uint8)
    write(strip, title, (4.0, 21.0), 17.0, _INK)
    return np.concatenate([strip, colour])


def _beside(panels: list[Image]) -> Image:
    gaps = [((0, 0), (8 * (number > 0), 0), (0, 0)) for number in range(len(panels))]
    padded = [np.pad(p, gap, constant_values=255) for p, gap in zip(panels, gaps, strict=True)]
    return np.concatenate(padded, axis=1)


def draw_map(
    world: WorldSpec, trajectory: list[MovingPose], rows: list[paper_tables.PaperRow]
) -> Image:
    """The room from above with trajectory and waypoints (Fig. 16)."""
    outline = outline_of(SceneGeometry.from_world(world, 2.0))
    low, high = np.array([world.x, world.y]).T
    figure, axes = plan_axes((9.0, 5.4), (0.04, 0.06, 0.94, 0.92), low, high)
    path = Line(np.array([(m.pose.x, m.pose.y) for m in trajectory]), Style("#0072B2", width=1.5))
    points = np.array([row.about["pose"][:2] for row in rows])
    waypoints = Marks(points, Style(_WAYPOINT, size=7.0))
    draw_shapes(axes, [*outline.shapes(), path, waypoints], zorder=1.0)
    for row in rows:
        pose = Pose(*row.about["pose"])
        fast = row.number == paper_tables.FAST
        draw_arrow(axes, pose.to_parent(0.2, 0.0), pose.yaw, _WAYPOINT, zorder=3.0)
        # label beside the trajectory
        side = 14.0 * math.sin(pose.yaw) - 4.0, -14.0 * math.cos(pose.yaw) - 4.0
        axes.annotate(
            f"{row.number}{' fast left turn' if fast else ''}",
            (pose.x, pose.y),
            (-34.0, -36.0) if fast else side,
            textcoords="offset points",
            fontsize=10,
        )
    code = BytesIO()
    figure.savefig(code, format="png", dpi=130)
    picture = cv2.imdecode(np.frombuffer(code.getvalue(), np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(picture, dtype=np.uint8)


_QUALITY = 82
"""Quality of the pictures, of 100: flow arrows stay sharp, and the page stays below 8 MB."""


def write_page(result: Mapping[str, Any], pictures: Mapping[str, Image]) -> str:
    """The page of a ``result`` as HTML.

    ``pictures`` (height, width, 3) have the names ``map``, ``waypoint-N``, ``scene-N``, and
    ``real-K`` for the K-th frame of the recordings if it may be shown.
    """
    environment = Environment(
        loader=FileSystemLoader([Path(__file__).parent, Path(report_page.__file__).parent]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(percent=partial(shown, form=".0%"), positions=_positions)
    return environment.get_template("reproduction.html").render(
        title="The paper's experiments, repeated",
        **result,
        pictures={name: _embedded(picture) for name, picture in pictures.items()},
        fast=paper_tables.FAST,
        period=paper_tables.PERIOD,
        flows=("ideal", "block matching"),
        rotations=("removed", "left in"),
        modes=("normalised", "raw means"),
    )


def _embedded(picture: Image) -> dict[str, Any]:
    height, width = picture.shape[:2]
    source = report_page.reduced_source(picture, width, quality=_QUALITY)
    return {"source": source, "width": width, "height": height}


def _positions(names: list[str]) -> str:
    """Quadrants in words: ``["P2", "P3"]`` as "upper left and lower left"."""
    return " and ".join(position(name) for name in names)


_PAPER_TIMES = {"obstacles_s": 0.16, "situation_synthetic_s": 0.58, "situation_real_s": 0.62}
"""Times of OFFIS [s] in the paper, on an Athlon XP 2600+ at 2.09 GHz."""

_OURS = re.compile(r"index\.html|result\.json")


def reproduce(
    out: Path,
    seed: int,
    views: int,
    data: Path | None = None,
    report: ProgressCallback = silent,
) -> dict[str, Any]:
    """Write the reproduction to the folder ``out``, atomically; returns the result as plain data.

    ``views`` is the number of views in the comparison of section 4.3; ``data`` is the folder of
    the recordings for Table 3 on photographs, None to leave them out. Everything except
    ``timings`` depends on these and ``seed`` only; ``digest`` is the SHA-256 of it. ``report`` is
    called with each part.

    Raises:
        InputError: ``out`` holds other files, or cannot be written; ``data`` lacks recordings.

    """
    with AtomicFolder(out, _OURS, "--out") as folder:
        # first, since it can fail
        real, photographs = real_scenes(data, default_registry(), report) if data else ({}, {})
        report("Table 2: the trajectory")
        rows = paper_tables.table2(seed)
        report("Table 3: the office")
        scenes = paper_tables.table3(seed)
        experiments = {
            "seed": seed,
            "table2": [row.as_data() for row in rows],
            "table3": [row.as_data() for row in scenes],
            "real": None if data is None else real_as_data(real),
            "metrics": compare_metrics(views, seed, report),
            "checks": paper_tables.checks(rows),
        }
        result = plain_json({**experiments, "summary": summary(experiments)})
        digest = hashlib.sha256(json.dumps(result, sort_keys=True).encode()).hexdigest()
        report("times")
        times = {**paper_tables.timings(rows, scenes), "paper": dict(_PAPER_TIMES)}
        result |= {"digest": digest, "timings": times}
        report("pictures")
        pictures = {
            "map": draw_map(load_world(find("world", "paper-room")), drive(), rows),
            **{f"waypoint-{row.number}": waypoint_picture(row) for row in rows},
            **{f"scene-{row.number}": scene_picture(row) for row in scenes},
            **{
                f"real-{k}": photographs[label]
                for k, label in enumerate(chosen_frames(list(real)))
                if label in photographs
            },
        }
        page = write_page(result, pictures)
        (folder.path / "index.html").write_text(page, encoding="utf-8")
        text = json.dumps(result, indent=2, allow_nan=False)
        (folder.path / "result.json").write_text(text + "\n", encoding="utf-8")
    return dict(result)
