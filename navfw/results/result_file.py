"""Measured results as JSON files, and from what commands leave behind to results.

Commands leave suite folders, run folders, and JSON of benchmarks. A result has its data model, its
checks, reading and writing.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Field, JsonValue

from navfw.config.document import load_yaml
from navfw.config.input_file import is_file, is_folder, read_json_object
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import rewording, validate
from navfw.errors import ConfigError, InputError
from navfw.process.atomic import write_text
from navfw.recording.provenance import DIRTY, files_in
from navfw.recording.run_folder import RESULT, plain_json, read_result
from navfw.suite.run_journal import RunRow
from navfw.suite.suite_folder import SUMMARY, SuiteFolder
from navfw.suite.suite_summary import summarize
from navfw.suite.suitefile import Expect

FORMAT: Final = 1
"""Version of the keys below. Results of another version are refused, not converted."""

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Machine(StrictModel):
    """The kind of machine that a result was measured on; nothing that names one machine."""

    processor: str
    cores: Annotated[int, Field(ge=1)]
    python: str
    system: str


class Figures(StrictModel):
    """What a number of runs come to; see ``navfw.suite.suite_summary.summarize`` for each figure.

    ``estimate_error_m`` is the median, ``estimate_error_max_m`` the largest, over the runs' ends.
    ``passed`` counts the runs that did what the suite's ``expect`` asks for, where it asks. Older
    results lack ``cpu_time_s`` and ``memory_mb``.
    """

    runs: Count
    reached: Count
    success_low: Share
    success_high: Share
    collisions: Count
    collisions_by_robot: Count
    spl: float | None
    sct: float | None
    barn_score: float | None
    mean_time_s: float | None
    min_clearance_m: float | None
    estimate_error_m: float | None
    estimate_error_max_m: float | None
    cpu_time_s: float | None = None
    memory_mb: float | None = None
    causes: Mapping[str, Count] = Field(default_factory=dict)
    expect: Literal["arrival", "stop"] | None = None
    passed: Count | None = None


class _StoredBase(StrictModel):
    """What every result records of its origin.

    ``command`` repeats the measurement. ``seeds`` is a range A:B, B excluded, or a single seed.
    """

    format: Literal[1] = FORMAT
    name: Annotated[str, Field(pattern=r"^[\w.+-]+$")]
    command: str
    revision: Annotated[str, Field(min_length=1)]
    seeds: str = ""
    stacks: tuple[str, ...] = ()
    machine: Machine

    @property
    def dirty(self) -> bool:
        """Whether the code had uncommitted changes, so that the revision alone repeats nothing."""
        return self.revision.endswith(DIRTY)


class StoredSuiteResult(_StoredBase):
    """All runs of a suite, or of one of its variants.

    ``suite_hash`` is the SHA-256 of the suite's file. ``parts`` has the figures of each entry, of
    an entry with several missions each mission's; it is empty when there is only one. ``p`` is of
    McNemar's exact test of success against the variant ``against``, over the same runs.
    ``disk_kb`` is the size of the suite's folder [kB] by its number of runs.
    """

    kind: Literal["suite"] = "suite"
    seeds: Annotated[str, Field(pattern=r"^\d+:\d+$")]
    suite: str
    suite_hash: str
    variant: str = ""
    figures: Figures
    parts: Mapping[str, Figures]
    p: Share | None = None
    disk_kb: Annotated[float, Field(ge=0.0)] | None = None
    against: str = ""

    @property
    def seed_range(self) -> range:
        """``seeds`` as numbers."""
        first, _, last = self.seeds.partition(":")
        return range(int(first), int(last))


class StoredValues(_StoredBase):
    """The values that one call of ``navfw bench ...`` or ``navfw run`` printed as JSON."""

    kind: Literal["bench", "run"]
    values: Mapping[str, JsonValue]


StoredResult: TypeAlias = StoredSuiteResult | StoredValues


def load_results(folder: Path) -> list[StoredResult]:
    """All results of a folder, by name.

    Raises:
        ConfigError: a file is no JSON, breaks the schema, is of another version or is named unlike
            its result, or two results share runs; the message names file, line and key.

    """
    results = [_load(file) for file in sorted(folder.glob("*.json"))]
    _check_overlaps(folder, [r for r in results if isinstance(r, StoredSuiteResult)])
    return results


def _check_overlaps(folder: Path, results: Sequence[StoredSuiteResult]) -> None:
    """Refuse two results of one suite with the same options and common seeds."""
    for first, second in combinations(results, 2):
        same = [result.command.replace(result.seeds, "", 1) for result in (first, second)]
        if same[0] == same[1] and not {*first.seed_range}.isdisjoint(second.seed_range):
            what = f"has seeds in common with {second.name}.json; remove one of the files"
            raise ConfigError(what, file=folder / f"{first.name}.json", key="seeds")


def _load(file: Path) -> StoredResult:
    document = load_yaml(file)  # JSON is YAML, and this keeps the line of every key
    data = document.data if isinstance(document.data, dict) else {}
    version = data.get("format")
    if version != FORMAT:
        what = f"expected {FORMAT}, got {version!r}; add the result anew with navfw results add"
        raise ConfigError(what, file=file, line=document.line_of(("format",)), key="format")
    result: StoredResult = (
        validate(document, StoredSuiteResult)
        if data.get("kind") == "suite"
        else validate(document, StoredValues)
    )
    if result.name != file.stem:
        what = f"expected {file.stem!r} as the file is called, got {result.name!r}"
        raise ConfigError(what, file=file, line=document.line_of(("name",)), key="name")
    return result


def save_result(folder: Path, result: StoredResult) -> Path:
    """Write ``FOLDER/NAME.json``, in place of an earlier result of the same command.

    Raises:
        ConfigError: that file holds the result of another command.
        InputError: the file cannot be written.

    """
    file = folder / f"{result.name}.json"
    command = _command_in(file)
    if command not in (None, result.command):
        raise ConfigError(f"holds the result of `{command}`; choose another --name", file=file)
    data = {"format": FORMAT, **result.model_dump(mode="json", exclude_defaults=True)}
    data["kind"] = result.kind
    write_text(file, json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return file


def _command_in(file: Path) -> object:
    """The command of the result in a file of whatever version; None if there is none."""
    try:
        return read_json_object(file).get("command")
    except ConfigError:
        return None


MAX_DEPTH = 3
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
    kept = {key: summary[key] for key in Figures.model_fields if key in summary}
    passed = [summary["by_entry"][entry]["passed"] for entry in wanted]
    return Figures(
        **kept,
        runs=len(rows),
        estimate_error_max_m=max(errors, default=None),
        expect=next(iter(wanted.values())) if len(set(wanted.values())) == 1 else None,
        passed=sum(passed) if len(wanted) == len({row.entry for row in rows}) else None,
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
