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
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from navfw.config.input_file import is_file, read_input_text
from navfw.errors import ConfigError, UnknownNameError
from navfw.process.result_table import markdown_table
from navfw.recording.provenance import DIRTY
from navfw.results.result_file import (
    Figures,
    StoredResult,
    StoredSuiteResult,
    StoredValues,
    load_results,
)
from navfw.suite.suitefile import list_suites

TEMPLATE = "template.md"
"""The template's name, beside the results."""

SENTENCES = "readme.md"
"""The name of the file with the README's sentences, beside the results."""

MAX_PAGE = 2_000_000
"""Largest size of a template or page [byte]."""

_NOT_MEASURED = "not measured"

_HEADER = "<!-- Written by `navfw results write` from {folder}/: change the template there. -->\n\n"
_PLACEHOLDER = re.compile(r"\{\{\s*(.*?)\s*\}\}", re.DOTALL)
_MARKED = re.compile(r"<!-- result: (\S+) -->(.*?)<!-- end -->", re.DOTALL)
_REVISION_DIGITS = 9

_SUITE_COLUMNS = (
    "seeds",
    "reached [95 %]",
    "collisions (by the robot)",
    "SPL",
    "SCT",
    "time",
    "estimate's error",
    "causes of failure",
    "revision",
    "machine",
)
_SIZING_COLUMNS = (
    "suite",
    "runs",
    "runs per core-hour",
    "10,000 runs on a core",
    "memory of a process, largest",
    "on disk, per run",
    "revision",
    "machine",
)
_RUN_COLUMNS = (
    "run",
    "seed",
    "stack",
    "outcome",
    "driven",
    "time",
    "estimate's error: p95, largest",
    "place known after",
    "collisions",
    "revision",
    "machine",
)


def current_pages(folder: Path) -> dict[Path, str]:
    """Each page with the text that it has to have: ``FOLDER.md``, and the README two folders above.

    Raises:
        InputError: the template or a result is missing or wrong.

    """
    template = folder / TEMPLATE
    results = load_results(folder)
    header = _HEADER.format(folder=f"{folder.parent.name}/{folder.name}")
    page = fill(read_input_text(template, MAX_PAGE), results, template)
    pages = {folder.with_suffix(".md"): header + page}
    readme, sentences = folder.parent.parent / "README.md", folder / SENTENCES
    if is_file(sentences):
        text = read_input_text(sentences, MAX_PAGE)
        filled = dict(_MARKED.findall(fill(text, results, sentences)))

        def renewed(match: re.Match[str]) -> str:
            text = filled.get(match[1], _NOT_MEASURED)
            text = _NOT_MEASURED if _NOT_MEASURED in text else text
            return f"<!-- result: {match[1]} -->{text}<!-- end -->"

        pages[readme] = _MARKED.sub(renewed, read_input_text(readme, MAX_PAGE))
    return pages


def fill(template: str, results: Sequence[StoredResult], file: Path, lines_before: int = 0) -> str:
    """``template`` with every placeholder replaced.

    ``lines_before`` is the number of lines of ``file`` before the template begins.

    Raises:
        ConfigError: a placeholder cannot be read; the message names ``file`` and line.
        UnknownNameError: a placeholder, suite or key does not exist.

    """
    writer = _Writer(results)

    def replaced(match: re.Match[str]) -> str:
        line = template.count("\n", 0, match.start()) + 1
        try:
            verb, *words = shlex.split(match[1]) or [""]
            return writer.write(verb, words).rstrip("\n") or _NOT_MEASURED
        except UnknownNameError as error:
            names = error.what, error.name, error.known
            raise UnknownNameError(*names, file=file, line=line) from None
        except (TypeError, ValueError) as error:
            raise ConfigError(f"{match[0]}: {error}", file=file, line=line) from None

    return _PLACEHOLDER.sub(replaced, template)


class _Writer:
    """Turns placeholders into text, each by a function of its own."""

    def __init__(self, results: Sequence[StoredResult]) -> None:
        self._results = {result.name: result for result in results}
        self._suites = [r for r in results if isinstance(r, StoredSuiteResult)]
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

    def _of_suites(self, names: Sequence[str]) -> list[StoredSuiteResult]:
        known = {*list_suites(), *(result.suite for result in self._suites)}
        for name in names:
            if name not in known:
                raise UnknownNameError("suite", name, known)
        return [result for name in names for result in self._suites if result.suite == name]

    def _suite_table(self, *names: str) -> str:
        found = [result for result in self._of_suites(names) if not result.variant]
        rows = [[_label(result), *self._figure_cells(result, result.figures)] for result in found]
        return markdown_table(["suite", *_SUITE_COLUMNS], rows) if rows else ""

    def _part_table(self, *names: str) -> str:
        rows = [
            [part, *self._figure_cells(result, figures)]
            for result in self._of_suites(names)
            if not result.variant
            for part, figures in (result.parts or {_label(result): result.figures}).items()
        ]
        return markdown_table(["part", *_SUITE_COLUMNS], rows) if rows else ""

    def _variant_table(self, name: str) -> str:
        found = [result for result in self._of_suites([name]) if result.variant]
        found.sort(key=lambda result: bool(result.against))  # stable: the first variant leads
        entries = list(dict.fromkeys(entry for result in found for entry in result.parts))
        rows = [
            [
                result.variant,
                *self._figure_cells(result, result.figures)[:-2],
                "" if result.p is None else f"{result.p:.2g}",
                *(_reached(result.parts[e]) if e in result.parts else "" for e in entries),
                *self._origin(result),
            ]
            for result in found
        ]
        columns = ["variant", *_SUITE_COLUMNS[:-2], "p", *entries, *_SUITE_COLUMNS[-2:]]
        return markdown_table(columns, rows) if rows else ""

    def _sizing_table(self, *names: str) -> str:
        rows = []
        for result in self._of_suites(names):
            figures = result.figures
            if result.variant or not figures.cpu_time_s:
                continue
            cells = [
                f"{3600.0 / figures.cpu_time_s:.0f}",
                f"{10_000.0 * figures.cpu_time_s / 3600.0:.1f} h",
                f"{_number(figures.memory_mb, 0)} MB",
                f"{_number(result.disk_kb, 1)} kB",
            ]
            rows.append([_label(result), str(figures.runs), *cells, *self._origin(result)])
        return markdown_table(_SIZING_COLUMNS, rows) if rows else ""

    def _run_table(self, *patterns: str) -> str:
        rows = []
        for result in self._results.values():
            if not isinstance(result, StoredValues) or result.kind != "run":
                continue
            if any(fnmatchcase(result.name, pattern) for pattern in patterns):
                rows.append([*_run_cells(result), *self._origin(result)])
        return markdown_table(_RUN_COLUMNS, rows) if rows else ""

    def _value_table(self, name: str, *wanted: str) -> str:
        result = self._results.get(name)
        if not isinstance(result, StoredValues):
            return ""
        rows = []
        for text in wanted:
            label, _, rest = text.rpartition("=")
            key, _, shape = rest.partition(":")
            rows.append([label, _formatted(result, key, shape), *self._origin(result)])
        return markdown_table(["quantity", "value", "revision", "machine"], rows)

    def _called(self, name: str) -> list[StoredResult]:
        """The result of that name; else all of that suite, driven as the suite has it."""
        if name in self._results:
            return [self._results[name]]
        return [r for r in self._suites if r.suite == name == _label(r) and not r.variant]

    def _value(self, name: str, key: str, shape: str = "") -> str:
        values = [_value_at(result, key) for result in self._called(name)]
        if len(values) > 1 and not all(isinstance(value, int) for value in values):
            raise ValueError(f"only counts can be added up, and there are {len(values)} results")
        return format(sum(values) if len(values) > 1 else values[0], shape) if values else ""

    def _machine_table(self) -> str:
        rows = [
            [_letter(number), machine.processor, str(machine.cores), machine.python, machine.system]
            for number, machine in enumerate(self._machines)
        ]
        columns = ("machine", "processor", "cores", "Python", "system")
        return markdown_table(columns, rows) if rows else ""

    def _figure_cells(self, result: StoredSuiteResult, figures: Figures) -> list[str]:
        time = figures.mean_time_s
        return [
            result.seeds,
            _arrivals(figures),
            f"{figures.collisions} ({figures.collisions_by_robot})",
            _number(figures.spl),
            _number(figures.sct),
            "" if time is None else f"{time:.1f} s",
            _number(figures.estimate_error_m) + ", " + _number(figures.estimate_error_max_m) + " m",
            "; ".join(f"{cause} {count}" for cause, count in figures.causes.items()) or "none",
            *self._origin(result),
        ]

    def _origin(self, result: StoredResult) -> list[str]:
        return [_short(result), _letter(self._machines.index(result.machine))]


def _formatted(result: StoredResult, key: str, shape: str) -> str:
    value = _value_at(result, key)
    return " to ".join(format(v, shape) for v in (value if isinstance(value, list) else [value]))


def _value_at(result: StoredResult, key: str) -> Any:
    """The value at a dotted key: of a suite's figures, or of a benchmark's or a run's values."""
    suite = isinstance(result, StoredSuiteResult)
    data: Any = result.model_dump(mode="json")["figures" if suite else "values"]
    for part in key.split("."):
        if not isinstance(data, Mapping) or part not in data:
            raise UnknownNameError("value", key, data if isinstance(data, Mapping) else ())
        data = data[part]
    return data


def _joined(texts: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(texts))


def _label(result: StoredSuiteResult) -> str:
    """The suite's name, and the options that change what it runs."""
    words = shlex.split(result.command)
    options = words[words.index(result.seeds) + 1 :] if result.seeds in words else []
    return f"{result.suite} `{shlex.join(options)}`" if options else result.suite


def _arrivals(figures: Figures) -> str:
    """Arrivals with Wilson's interval; where the suite expects something else, passes."""
    if figures.expect == "stop" or (figures.expect is None and figures.passed is not None):
        return f"passed {figures.passed} of {figures.runs}"
    share = 100.0 * figures.reached / figures.runs
    low, high = 100.0 * figures.success_low, 100.0 * figures.success_high
    return f"{_reached(figures)} ({share:.1f} %, {low:.1f} to {high:.1f})"


def _reached(figures: Figures) -> str:
    return f"{figures.reached} of {figures.runs}"


def _run_cells(result: StoredValues) -> list[str]:
    values: Mapping[str, Any] = result.values
    place = values.get("localized_after_s")
    errors = (_number(values.get(f"estimate_error_{name}_m"), 3) for name in ("p95", "max"))
    return [
        f"{values['world']} `{values['mission']}`",
        result.seeds,
        ", ".join(result.stacks),
        str(values["outcome"]),
        f"{values['path_length_m']:.1f} m",
        f"{values['sim_time_s']:.1f} s",
        ", ".join(f"{error} m" for error in errors if error),
        "" if place is None else f"{place:.1f} s",
        str(values["collisions"]),
    ]


def _short(result: StoredResult) -> str:
    if not result.dirty:
        return result.revision if " " in result.revision else result.revision[:_REVISION_DIGITS]
    return result.revision.removesuffix(DIRTY)[:_REVISION_DIGITS] + DIRTY


def _letter(number: int) -> str:
    return chr(ord("A") + number)


def _number(value: float | None, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f}"
