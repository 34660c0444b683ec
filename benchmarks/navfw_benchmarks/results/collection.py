"""From what commands leave behind to results: suite folders, run folders, JSON of benchmarks."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from navfw.config.input_file import is_file, is_folder, read_json_object
from navfw.config.yamlfile import rewording
from navfw.errors import ConfigError, InputError
from navfw.recording.provenance import files_in
from navfw.recording.run_folder import RESULT, plain_json, read_result
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SUMMARY, SuiteFolder
from navfw.suite.suite_summary import summarize
from navfw.suite.suitefile import Expect
from navfw_benchmarks.results.result_file import (
    Figures,
    Machine,
    StoredResult,
    StoredSuiteResult,
    StoredValues,
)

MAX_DEPTH = 5
"""Depth of nested objects up to which the values of a benchmark are kept."""

_MAX_LIST = 4
"""Length up to which lists of values are kept: longer ones are raw data, not results."""

_OF_RUNS = {
    "config",
    "machine",
    "overrides",
    "revision",
    "run_folder",
    "stack",
    "trace",
    "versions",
}
"""Keys of ``result.json`` that are not measured values."""


def collect(source: Path, name: str | None = None, *, total: bool = False) -> list[StoredResult]:
    """The results in a suite's folder, a run folder, or the JSON that a command printed.

    A suite with variants gives one result for each; with ``total`` one for all. ``name`` replaces
    the default name: suite and seeds, world, mission and seed, or the benchmark's command.

    Raises:
        InputError: there is nothing of that kind, it is incomplete, or of several revisions.

    """
    with rewording(file=source):
        if is_file(source / "suite.json"):
            return _of_suite(SuiteFolder(source), name, total=total)
        if is_folder(source):
            return [_of_run(read_result(source), name)]
        data = read_json_object(source)
        if "run_folder" in data:
            return [_of_run(read_result(str(data["run_folder"])), name)]
        return [_of_bench(data, source, name)]


def seed_range(seeds: Iterable[int], file: str | Path | None = None) -> str:
    """Seeds as a range A:B, B excluded.

    >>> seed_range([4, 1, 2, 3, 1])
    '1:5'

    Raises:
        InputError: seeds are missing in between.

    """
    numbers = set(seeds)
    first, last = min(numbers), max(numbers)
    if missing := set(range(first, last + 1)) - numbers:
        what = f"expected one range of seeds, but {min(missing)} is missing in {first}:{last + 1}"
        raise InputError(what, file=file)
    return f"{first}:{last + 1}"


# --- suites --------------------------------------------------------------------------------------


def _of_suite(folder: SuiteFolder, name: str | None, *, total: bool) -> list[StoredResult]:
    about, summary = folder.about(), read_json_object(folder.path / SUMMARY)
    if not summary.get("complete"):
        raise InputError("is incomplete: run the rest with --resume", file=folder.path)
    for key in ("revisions", "machines"):
        if len(about.get(key, [])) != 1:
            what = f"expected one, got {about.get(key, 'none')}; run the whole suite anew"
            raise ConfigError(what, file=folder.path / "suite.json", key=key)
    rows = folder.rows()
    size = sum(file.stat().st_size for file, _ in files_in(folder.path))
    entries = summary["by_entry"]
    expect = {entry: figures["expect"] for entry, figures in entries.items() if "expect" in figures}
    compared = {} if total else summarize(rows).get("by_variant", {})
    results: list[StoredResult] = []
    for variant in [""] if total else dict.fromkeys(row.variant for row in rows):
        own = [row for row in rows if total or row.variant == variant]
        if len({row.key._replace(stack="") for row in own}) < len(own):
            what = "holds the same runs with several stacks; run each --stack into a folder of its"
            raise InputError(f"{what} own", file=folder.path)
        seeds = seed_range((row.seed for row in own), folder.table)
        of_variant = ["--variant", variant] if variant else []
        words = ["navfw", "suite", about["suite"], "--seeds", seeds, *about["options"]]
        first = next(iter(compared), variant)
        default = _name([about["suite"], *seeds.split(":"), *about["options"], variant])
        results.append(
            StoredSuiteResult(
                name=f"{name}-{variant}" if name and variant else name or default,
                command=shlex.join([*words, *of_variant]),
                revision=about["revisions"][0],
                seeds=seeds,
                stacks=tuple(dict.fromkeys(row.stack for row in own)),
                machine=Machine(**about["machines"][0]),
                suite=about["suite"],
                suite_hash=about["suite_hash"],
                variant=variant,
                figures=_figures(own, expect),
                parts=_parts(own, expect),
                disk_kb=round(size / 1000.0 / len(rows), 2),
                p=compared[variant]["p"] if variant != first else None,
                against=first if variant != first else "",
            )
        )
    return results


def _name(words: Iterable[str]) -> str:
    """A file's name from words; those that only name an option are left out."""
    kept = [re.sub(r"[^\w.+]+", "-", word) for word in words if not word.startswith("--")]
    return "-".join(filter(None, kept))


def _parts(rows: Sequence[RunRow], expect: Mapping[str, Expect]) -> dict[str, Figures]:
    missions: dict[str, set[str]] = {}
    for row in rows:
        missions.setdefault(row.entry, set()).add(row.mission)
    parts: dict[str, list[RunRow]] = {}
    for row in rows:
        several = len(missions[row.entry]) > 1
        parts.setdefault(f"{row.entry} {row.mission}" if several else row.entry, []).append(row)
    return {part: _figures(own, expect) for part, own in parts.items() if len(parts) > 1}


def _figures(rows: Sequence[RunRow], expect: Mapping[str, Expect]) -> Figures:
    wanted = {entry: expect[entry] for entry in {row.entry for row in rows} & expect.keys()}
    summary = plain_json(summarize(rows, wanted))
    errors = [row.estimate_error_m for row in rows if row.estimate_error_m is not None]
    passed = [own.get("passed", own["reached"]) for own in summary["by_entry"].values()]
    kinds = {wanted.get(row.entry) for row in rows}
    return Figures(
        **{key: summary[key] for key in Figures.model_fields if key in summary},
        runs=len(rows),
        estimate_error_max_m=max(errors, default=None),
        expect=kinds.pop() if len(kinds) == 1 else None,
        passed=sum(passed) if wanted else None,
    )


# --- single runs and benchmarks ------------------------------------------------------------------


def _of_run(result: Mapping[str, Any], name: str | None) -> StoredValues:
    try:
        where = [str(result[key]) for key in ("world", "mission", "seed")]
        stack, changes = result["stack"], result["overrides"]
        options = ["--stack", stack, *(word for text in changes for word in ("--set", text))]
        return StoredValues(
            name=name or _name([*where, *options]),
            command=shlex.join(["navfw", "run", *where[:2], "--seed", where[2], *options]),
            revision=result["revision"],
            seeds=str(result["seed"]),
            stacks=(stack,),
            machine=Machine(**result["machine"]),
            kind="run",
            values=_values({key: v for key, v in result.items() if key not in _OF_RUNS}),
        )
    except KeyError as error:
        what = f"has no {error}: it was made by an older navfw; run the mission anew"
        raise ConfigError(what, file=RESULT) from None


def _of_bench(data: Mapping[str, Any], file: Path, name: str | None) -> StoredValues:
    origin = data.get("provenance")
    if not isinstance(origin, dict):
        what = "expected a suite's folder, a run folder, or what navfw bench ... --json printed"
        raise ConfigError(what, file=file)
    words = shlex.split(origin["command"])
    return StoredValues(
        name=name or "-".join(words[1:3]),
        command=origin["command"],
        revision=origin["revision"],
        seeds=origin["seeds"],
        machine=Machine(**origin["machine"]),
        kind="bench",
        values=_values({key: v for key, v in data.items() if key != "provenance"}),
    )


def _values(data: Mapping[str, Any], depth: int = MAX_DEPTH) -> dict[str, Any]:
    """Numbers, texts and short lists of them, in objects nested at most ``depth`` deep."""
    kept: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            inner = _values(value, depth - 1) if depth > 1 else {}
            kept |= {key: inner} if inner else {}
            continue
        items = value if isinstance(value, list) else [value]
        if len(items) <= _MAX_LIST and not any(isinstance(item, dict | list) for item in items):
            kept[key] = value
    return kept
