"""The page of results: a template of prose whose placeholders become tables and numbers.

| placeholder | becomes |
|---|---|
| ``{{suites NAME...}}`` | a table with a row for each result of these suites |
| ``{{parts NAME...}}`` | the same with a row for each entry or mission of a suite |
| ``{{variants NAME}}`` | a table of a suite's variants, compared with the first |
| ``{{sizing NAME...}}`` | a table of what the runs of these suites cost, and ten thousand of them |
| ``{{runs PATTERN...}}`` | a table with a row for each single run whose name matches |
| ``{{values NAME "LABEL"=KEY:FORMAT...}}`` | a table with a row for each value of a benchmark |
| ``{{value NAME KEY FORMAT}}`` | a number of a result, or the sum over the results of a suite |
| ``{{seeds NAME}}``, ``{{revision NAME}}`` | of a result, or of a suite's results |
| ``{{machines}}`` | a table of the kinds of machines, by the letter that the rows have |

A result that has not been measured leaves ``not measured``. ``readme.md`` beside the template has
sentences with placeholders, each between ``<!-- result: NAME -->`` and ``<!-- end -->``; they go to
the places of the same names in the README.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from navfw.config.input_file import is_file, read_input_text
from navfw.config.lookup import list_files
from navfw.errors import ConfigError, UnknownNameError, locating
from navfw.process.result_table import Column, ResultTable, markdown_table, shown
from navfw.recording.provenance import DIRTY
from navfw_benchmarks.results import result_file

TEMPLATE = "template.md"
"""The template's name, beside the results."""

SENTENCES = "readme.md"
"""The name of the file with the README's sentences, beside the results."""

_NOT_MEASURED = "not measured"

_HEADER = "<!-- Written by `navfw results write` from {folder}/: change the template there. -->\n\n"
_PLACEHOLDER = re.compile(r"\{\{\s*(.*?)\s*\}\}", re.DOTALL)
_MARKED = re.compile(r"<!-- result: (\S+) -->(.*?)<!-- end -->", re.DOTALL)
_REVISION_DIGITS = 9


@dataclass(frozen=True, slots=True)
class _FigureRow:
    """A row of a table: its label, the result, and the figures of a suite that it shows."""

    label: str
    result: result_file.StoredSuiteResult
    figures: result_file.Figures


_SUITE_COLUMNS = (
    Column("seeds", lambda line: line.result.seeds),
    Column("reached [95 %]", lambda line: _arrivals(line.figures)),
    Column(
        "collisions (by the robot)",
        lambda line: f"{line.figures.collisions} ({line.figures.collisions_by_robot})",
    ),
    Column("SPL", lambda line: line.figures.spl, ".2f", missing=""),
    Column("SCT", lambda line: line.figures.sct, ".2f", missing=""),
    Column("time", lambda line: line.figures.mean_time_s, ".1f", "s", missing=""),
    Column("estimate's error", lambda line: _estimate_error(line.figures)),
    Column("causes of failure", lambda line: _causes(line.figures)),
)
_SIZING_COLUMNS = (
    Column("suite", lambda line: line.label),
    Column("runs", lambda line: line.figures.runs),
    Column("runs per core-hour", lambda line: 3600.0 / line.figures.cpu_time_s, ".0f"),
    Column(
        "10,000 runs on a core", lambda line: 10_000.0 * line.figures.cpu_time_s / 3600, ".1f", "h"
    ),
    Column(
        "memory of a process, largest", lambda line: line.figures.memory_mb, ".0f", "MB", missing=""
    ),
    Column("on disk, per run", lambda line: line.result.disk_kb, ".1f", "kB", missing=""),
)
_RUN_COLUMNS = (
    Column("run", lambda run: f"{run.values['world']} `{run.values['mission']}`"),
    Column("seed", lambda run: run.seeds),
    Column("stack", lambda run: ", ".join(run.stacks)),
    Column("outcome", lambda run: run.values["outcome"]),
    Column("driven", lambda run: run.values["path_length_m"], ".1f", "m"),
    Column("time", lambda run: run.values["sim_time_s"], ".1f", "s"),
    Column("estimate's error: p95, largest", lambda run: _estimate_errors(run.values)),
    Column(
        "place known after", lambda run: run.values.get("localized_after_s"), ".1f", "s", missing=""
    ),
    Column("collisions", lambda run: run.values["collisions"]),
)


def current_pages(folder: Path) -> dict[Path, str]:
    """Each page with the text that it has to have: ``FOLDER.md``, and the README two folders above.

    Raises:
        InputError: the template or a result is missing or wrong.

    """
    template = folder / TEMPLATE
    results = result_file.load_results(folder)
    header = _HEADER.format(folder=f"{folder.parent.name}/{folder.name}")
    page = fill(read_input_text(template), results, template)
    pages = {folder.with_suffix(".md"): header + page}
    readme, sentences = folder.parent.parent / "README.md", folder / SENTENCES
    if is_file(sentences):
        text = read_input_text(sentences)
        filled = dict(_MARKED.findall(fill(text, results, sentences)))

        def renewed(match: re.Match[str]) -> str:
            text = filled.get(match[1], _NOT_MEASURED)
            text = _NOT_MEASURED if _NOT_MEASURED in text else text
            return f"<!-- result: {match[1]} -->{text}<!-- end -->"

        pages[readme] = _MARKED.sub(renewed, read_input_text(readme))
    return pages


def fill(template: str, results: Sequence[result_file.StoredResult], file: Path) -> str:
    """``template``, the text of ``file``, with every placeholder replaced.

    Raises:
        ConfigError: a placeholder cannot be read; the message names ``file`` and line.
        UnknownNameError: a placeholder, suite or key does not exist.

    """
    writer = _Writer(results)

    def replaced(match: re.Match[str]) -> str:
        line = template.count("\n", 0, match.start()) + 1
        with locating(file=file, line=line):
            try:
                verb, *words = shlex.split(match[1]) or [""]
                return writer.write(verb, words).rstrip("\n") or _NOT_MEASURED
            except (TypeError, ValueError) as error:
                raise ConfigError(f"{match[0]}: {error}") from None

    return _PLACEHOLDER.sub(replaced, template)


class _Writer:
    """Turns placeholders into text, each by a function of its own."""

    def __init__(self, results: Sequence[result_file.StoredResult]) -> None:
        self._results = {result.name: result for result in results}
        self._suites = [r for r in results if isinstance(r, result_file.StoredSuiteResult)]
        self._machines = list(dict.fromkeys(result.machine for result in results))
        self._verbs: dict[str, Callable[..., str]] = {
            "suites": self._suite_table,
            "parts": self._part_table,
            "variants": self._variant_table,
            "sizing": self._sizing_table,
            "runs": self._run_table,
            "values": self._value_table,
            "value": self._value,
            "seeds": lambda name: _joined(r.seeds for r in self._called(name)),
            "revision": lambda name: _joined(_short(r) for r in self._called(name)),
            "machines": self._machine_table,
        }

    def write(self, verb: str, words: Sequence[str]) -> str:
        """The text of a placeholder; empty if nothing of it has been measured."""
        if verb not in self._verbs:
            raise UnknownNameError("placeholder", verb, self._verbs)
        return self._verbs[verb](*words)

    def _of_suites(self, names: Sequence[str]) -> list[result_file.StoredSuiteResult]:
        shipped = {file.name for file in list_files("suite")}
        suites = shipped | {result.suite for result in self._suites}
        for name in names:
            if name not in suites:
                raise UnknownNameError("suite", name, suites)
        return [result for name in names for result in self._suites if result.suite == name]

    def _whole_suites(self, names: Sequence[str]) -> list[_FigureRow]:
        results = [result for result in self._of_suites(names) if not result.variant]
        return [_FigureRow(_label(result), result, result.figures) for result in results]

    def _table(self, columns: Iterable[Column], records: Sequence[Any]) -> str:
        """A table with its origin, in the last columns where rows differ; empty without rows."""
        if not records:
            return ""
        origin = Column("revision", _short), Column("machine", self._letter_of)
        several = [c for c in origin if len({c.cell(record) for record in records}) > 1]
        common = [f"{c.title} {c.cell(records[0])}" for c in origin if c not in several]
        table = ResultTable("", [*columns, *several], records).markdown()
        return f"{table}\nAll rows: {', '.join(common)}." if common else table

    def _letter_of(self, record: _FigureRow | result_file.StoredResult) -> str:
        return _letter(self._machines.index(_result_of(record).machine))

    def _suite_table(self, *names: str) -> str:
        lines = self._whole_suites(names)
        return self._table([Column("suite", lambda line: line.label), *_SUITE_COLUMNS], lines)

    def _part_table(self, *names: str) -> str:
        lines = [
            _FigureRow(part, line.result, figures)
            for line in self._whole_suites(names)
            for part, figures in (line.result.parts or {line.label: line.figures}).items()
        ]
        return self._table([Column("part", lambda line: line.label), *_SUITE_COLUMNS], lines)

    def _variant_table(self, name: str) -> str:
        variants = [result for result in self._of_suites([name]) if result.variant]
        variants.sort(key=lambda result: bool(result.against))  # stable: the first variant leads
        entries = dict.fromkeys(entry for result in variants for entry in result.parts)
        columns = [
            Column("variant", lambda line: line.label),
            *_SUITE_COLUMNS,
            Column("p", lambda line: line.result.p, ".2g", missing=""),
            *(Column(entry, partial(_reached_in, entry), missing="") for entry in entries),
        ]
        lines = [_FigureRow(result.variant, result, result.figures) for result in variants]
        return self._table(columns, lines)

    def _sizing_table(self, *names: str) -> str:
        lines = [line for line in self._whole_suites(names) if line.figures.cpu_time_s]
        return self._table(_SIZING_COLUMNS, lines)

    def _run_table(self, *patterns: str) -> str:
        runs = [
            result
            for result in self._results.values()
            if isinstance(result, result_file.StoredValues) and result.kind == "run"
            if any(fnmatchcase(result.name, pattern) for pattern in patterns)
        ]
        return self._table(_RUN_COLUMNS, runs)

    def _value_table(self, name: str, *wanted: str) -> str:
        result = self._results.get(name)
        if not isinstance(result, result_file.StoredValues):
            return ""
        values = []
        for text in wanted:
            label, _, rest = text.rpartition("=")
            key, _, form = rest.partition(":")
            value = _value_at(result, key)
            numbers = value if isinstance(value, list) else [value]
            values.append((label, " to ".join(format(number, form) for number in numbers)))
        table = markdown_table(["quantity", "value"], values)
        return f"{table}\nRevision {_short(result)}, machine {self._letter_of(result)}."

    def _called(self, name: str) -> list[result_file.StoredResult]:
        """The result of that name; else all of that suite, driven as the suite has it."""
        if name in self._results:
            return [self._results[name]]
        return [r for r in self._suites if r.suite == name == _label(r) and not r.variant]

    def _value(self, name: str, key: str, form: str = "") -> str:
        values = [_value_at(result, key) for result in self._called(name)]
        if len(values) > 1 and not all(isinstance(value, int) for value in values):
            raise ValueError(f"only counts can be added up, and there are {len(values)} results")
        return format(sum(values) if len(values) > 1 else values[0], form) if values else ""

    def _machine_table(self) -> str:
        columns = [
            Column("machine", lambda machine: _letter(self._machines.index(machine))),
            *(
                Column(title, attrgetter(title.lower()))
                for title in ("processor", "cores", "Python", "system")
            ),
        ]
        return ResultTable("", columns, self._machines).markdown() if self._machines else ""


def _value_at(result: result_file.StoredResult, key: str) -> Any:
    """The value at a dotted key: of a suite's figures, or of a benchmark's or a run's values."""
    suite = isinstance(result, result_file.StoredSuiteResult)
    data: Any = result.model_dump(mode="json")["figures" if suite else "values"]
    for name in key.split("."):
        if not isinstance(data, Mapping) or name not in data:
            raise UnknownNameError("value", key, data if isinstance(data, Mapping) else ())
        data = data[name]
    return data


def _joined(texts: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(texts))


def _label(result: result_file.StoredSuiteResult) -> str:
    """The suite's name, and the options that change what it runs."""
    words = shlex.split(result.command)
    options = words[words.index(result.seeds) + 1 :] if result.seeds in words else []
    return f"{result.suite} `{shlex.join(options)}`" if options else result.suite


def _arrivals(figures: result_file.Figures) -> str:
    """Arrivals with Wilson's interval; where the suite expects something else, passes."""
    if figures.expect == "stop" or (figures.expect is None and figures.passed is not None):
        return f"passed {figures.passed} of {figures.runs}"
    share = 100.0 * figures.reached / figures.runs
    low, high = 100.0 * figures.success_low, 100.0 * figures.success_high
    return f"{_reached(figures)} ({share:.1f} %, {low:.1f} to {high:.1f})"


def _reached(figures: result_file.Figures) -> str:
    return f"{figures.reached} of {figures.runs}"


def _reached_in(entry: str, line: _FigureRow) -> str | None:
    parts = line.result.parts
    return _reached(parts[entry]) if entry in parts else None


def _estimate_error(figures: result_file.Figures) -> str:
    errors = figures.estimate_error_m, figures.estimate_error_max_m
    return ", ".join(shown(error, ".2f", missing="") for error in errors) + " m"


def _estimate_errors(values: Mapping[str, Any]) -> str:
    errors = (values.get(f"estimate_error_{name}_m") for name in ("p95", "max"))
    return ", ".join(shown(error, ".3f", "m") for error in errors if error is not None)


def _causes(figures: result_file.Figures) -> str:
    return "; ".join(f"{cause} {count}" for cause, count in figures.causes.items()) or "none"


def _result_of(record: _FigureRow | result_file.StoredResult) -> result_file.StoredResult:
    return record.result if isinstance(record, _FigureRow) else record


def _short(record: _FigureRow | result_file.StoredResult) -> str:
    """The revision that a record was measured at, shortened."""
    result = _result_of(record)
    if not result.dirty:
        return result.revision if " " in result.revision else result.revision[:_REVISION_DIGITS]
    return result.revision.removesuffix(DIRTY)[:_REVISION_DIGITS] + DIRTY


def _letter(number: int) -> str:
    return chr(ord("A") + number)
