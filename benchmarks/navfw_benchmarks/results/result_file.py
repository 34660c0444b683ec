"""One measured result as a JSON file: its data model, its checks, reading and writing."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field, JsonValue

from navfw.config.document import load_yaml
from navfw.config.input_file import read_json_object
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError
from navfw.process.atomic import write_text
from navfw.recording.provenance import DIRTY

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
