"""``navfw bench perception``: accuracy, flow, computing time, recorded images; result and page."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from navfw.bench import (
    flow_accuracy,
    flow_comparison,
    flow_report,
    perception_accuracy,
    perception_time,
    recorded_approach,
)
from navfw.errors import InputError
from navfw.process.atomic import AtomicFolder
from navfw.process.work_progress import ProgressCallback, silent

Table = tuple[str, Sequence[str], Sequence[Sequence[object]]]
"""Title, columns, rows."""


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
    flow_report.plot(dict(result["flow"]), folder / "flow.png")
    (folder / "index.md").write_text(page(result), encoding="utf-8")
    text = json.dumps(result, indent=2, allow_nan=False)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")


def find_data(folder: Path) -> dict[str, Path]:
    """The recorded data in ``folder`` by name: "approach", "tum_fr1" or both.

    Raises:
        InputError: the folder holds neither.

    """
    found = {name: folder / name for name in ("approach", "tum_fr1") if (folder / name).is_dir()}
    if not found:
        raise InputError("holds neither approach nor tum_fr1", file=folder, key="--data")
    return found


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
    costs = perception_time.run(extent.comparisons, extent.repeats, workers)
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

    def count(done: int) -> None:
        report("accuracy over views", done, extent.poses)

    count(0)
    accuracy = perception_accuracy.run(extent.poses, seed, workers, progress=count)
    return {
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


def tables(result: Mapping[str, Any]) -> Iterator[Table]:
    """Tables of the result for printing."""
    rows = []
    for target in TARGETS:
        value = result[target.key]
        good = target.met(value)
        rows.append(
            (
                target.what,
                _number(value),
                _number(result["ideal"].get(target.key)),
                f"{'at least' if target.more else 'at most'} {target.limit:g}",
                {None: "not measured", True: "yes", False: "no"}[good],
            )
        )
    yield "Perception", ("quantity", "measured", "with ideal flow", "target", "met"), rows
    processors = result["flow"]["processors"]
    yield (
        f"Flow on {result['flow']['pairs']} rendered pairs, end-point errors [px]",
        ("processor", "trusted", "median", "95 %", "over 0.5 px", "ms"),
        [
            (
                name,
                _share(p["coverage"]),
                _number(p["epe_median"]),
                _number(p["epe_p95"]),
                _share(p["over_half_px"]),
                _number(p["ms"]),
            )
            for name, p in processors.items()
        ],
    )
    for flow, part in (("", result["accuracy"]), (", ideal flow", result["accuracy"]["ideal"])):
        for name, confusion in part["confusion"].items():
            inferred = sorted({term for counts in confusion.values() for term in counts})
            yield (
                f"{name.capitalize()}{flow}: truth (rows), inferred (columns)",
                ("", *inferred),
                [
                    (truth, *(counts.get(term, "") for term in inferred))
                    for truth, counts in confusion.items()
                ],
            )


def page(result: Mapping[str, Any]) -> str:
    """The whole result in Markdown; refers to ``flow.png``."""
    parts = [
        "# Benchmark of perception\n",
        f"{result['accuracy']['poses']} random views of seed {result['accuracy']['seed']};"
        f" {result['speed']['comparisons']} random inputs of every rule base; times are medians"
        " of one thread.\n",
    ]
    for title, columns, rows in tables(result):
        parts.append(f"## {title}\n")
        parts += _markdown(columns, rows)
    parts.append("## Flow in full\n\n![error and time of the processors](flow.png)\n")
    parts.append(flow_report.table(dict(result["flow"])))
    if result["tum"] is not None:
        for title, columns, rows in flow_comparison.comparison_tables(result["tum"]):
            parts.append(f"## {title}\n")
            parts += _markdown(columns, rows)
    if result["approach"] is not None:
        parts.append(_approach(result["approach"]))
    return "\n".join(parts)


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """Lines of a table, and an empty one."""
    body = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|", *body, ""]


def _approach(approach: Mapping[str, Any]) -> str:
    lines = [
        "## Recorded approach: time to contact\n",
        "| time to impact [s] | frames | median relative error | unsmoothed |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {row['from_s']:g} to {row['to_s']:g} | {row['n']} | {_share(row['median_rel_error'])} |"
        f" {_share(row['raw_median'])} |"
        for row in approach["by_time"]
    ]
    return "\n".join([*lines, ""])


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"
