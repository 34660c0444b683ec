"""The summary of a table of runs, and its tables for terminal, report and Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from statistics import fmean, median
from typing import Any

from navfw.missions.outcome import Cause, Outcome
from navfw.process.result_table import Column, ResultTable, named, shown
from navfw.suite.paired_comparison import MIN_RUNS, mcnemar_exact, wilson
from navfw.suite.run_row import RunRow
from navfw.suite.suitefile import Expect

ENOUGH = 0.9
"""Smallest share of successful runs with which an entry with ``expect: arrival`` passes."""

_P_SHOWN = 1e-4
"""Values of p below this are shown as "< 0.0001"."""


def summarize(rows: Sequence[RunRow], expect: Mapping[str, Expect] | None = None) -> dict[str, Any]:
    """Summarize all runs, and those of each entry under ``by_entry``, as plain data.

    ``success`` is a proportion with its Wilson interval (95 %). SPL, SCT and the BARN score are
    means over all runs, 0 for failures; the BARN score is None if no mission has a reference path.
    ``collisions`` is the number of collisions, ``collision_rate`` the share of runs with one,
    ``collisions_by_robot`` the number of runs in which the robot moved into the object, ``died``
    the number of runs whose process ended without a result, ``plugin_faults`` the number of
    objections to the runs. ``mean_time_s`` is over the successful runs, ``cpu_time_s`` a mean,
    ``memory_mb`` the largest.
    Figures that no run has are None. With more than one stack, ``by_stack`` has the summary of
    each; ``by_hazard`` has that of the runs in worlds with each hazard. Entries in ``expect`` have
    ``expect``, the number of runs that ``passed``, and whether the entry ``passes``. With variants,
    ``by_variant`` replaces ``by_stack``; it has the summary of each variant and of its entries, and
    ``p`` of McNemar's exact test on success against the first variant.
    """
    summary = _numbers(rows)
    by_entry = _split(rows, lambda row: row.entry)
    for name, wanted in (expect or {}).items():
        of_entry = [row for row in rows if row.entry == name]
        passed = sum(_passed(row, wanted) for row in of_entry)
        enough = ENOUGH if wanted == "arrival" else 1.0
        by_entry.setdefault(name, _numbers([]))
        by_entry[name] |= {
            "expect": wanted,
            "passed": passed,
            "passes": bool(of_entry) and passed >= enough * len(of_entry),
        }
    summary["by_entry"] = by_entry
    if any(row.variant for row in rows):
        summary["by_variant"] = _by_variant(rows)
    elif len({row.stack for row in rows}) > 1:
        summary["by_stack"] = _split(rows, lambda row: row.stack)
    hazards = sorted({name for row in rows for name in _hazards(row)})
    if hazards:
        summary["by_hazard"] = {
            name: _numbers([row for row in rows if name in _hazards(row)]) for name in hazards
        }
    return summary


def _hazards(row: RunRow) -> list[str]:
    """Return the hazards of the run's world."""
    return row.hazards.split(", ") if row.hazards else []


def _by_variant(rows: Sequence[RunRow]) -> dict[str, Any]:
    """Return the summary of each variant, in the order of the table."""
    by_variant: dict[str, list[RunRow]] = {}
    for row in rows:
        by_variant.setdefault(row.variant, []).append(row)
    first = {_run(row): row.succeeded for row in next(iter(by_variant.values()))}
    numbers = {}
    for name, of_variant in by_variant.items():
        both = [(first[_run(row)], row.succeeded) for row in of_variant if _run(row) in first]
        numbers[name] = {
            **_numbers(of_variant),
            "p": mcnemar_exact(both.count((True, False)), both.count((False, True))),
            "by_entry": _split(of_variant, lambda row: row.entry),
        }
    return numbers


def _run(row: RunRow) -> tuple[str, str, str, int]:
    """Return the columns that identify a run across variants."""
    return row.entry, row.world, row.mission, row.seed


def _passed(row: RunRow, wanted: Expect) -> bool:
    """Whether the run passes; a stop passes without a collision and with a known reason."""
    if wanted == "arrival":
        return row.succeeded
    ended = {Outcome.REACHED, Outcome.STUCK, Outcome.TIMEOUT, Outcome.LOST, Outcome.UNSURE}
    with_reason = {Cause.SENSOR_FAILED, Cause.NOTHING_SEEN, Cause.PLUGIN_FAILED}
    stopped = row.outcome == Outcome.FAULT and row.cause in with_reason
    return not row.collisions and (row.outcome in ended or stopped)


def _split(rows: Sequence[RunRow], key: Callable[[RunRow], str]) -> dict[str, Any]:
    names = dict.fromkeys(key(row) for row in rows)
    return {name: _numbers([row for row in rows if key(row) == name]) for name in names}


def _numbers(rows: Sequence[RunRow]) -> dict[str, Any]:
    count = len(rows)
    arrived = [row for row in rows if row.succeeded]
    hit = [row for row in rows if row.collisions]
    low, high = wilson(len(arrived), count)
    scored = any(row.barn_score is not None for row in rows)  # the benchmark has a reference path
    return {
        "missions": count,
        "reached": len(arrived),
        "success": len(arrived) / count if count else None,
        "success_low": low,
        "success_high": high,
        "collisions": sum(row.collisions or 0 for row in rows),
        "collision_rate": len(hit) / count if count else None,
        "collisions_by_robot": sum(row.collision_cause == "robot" for row in hit),
        "died": sum(row.died for row in rows),
        "plugin_faults": sum(row.plugin_faults or 0 for row in rows),
        "spl": _reduced(row.spl or 0.0 for row in rows),
        "sct": _reduced(row.sct or 0.0 for row in rows),
        "mean_time_s": _reduced(row.sim_time_s for row in arrived),
        "min_clearance_m": _reduced((row.min_clearance_m for row in rows), min),
        "estimate_error_m": _reduced((row.estimate_error_m for row in rows), median),
        "localized_after_m": _reduced((row.localized_after_m for row in rows), median),
        "lost_s": _reduced(row.lost_s for row in rows),
        "confidently_wrong_s": _reduced(row.confidently_wrong_s for row in rows),
        "route_changes": _reduced(row.route_changes for row in rows),
        "observed_share": _reduced(row.observed_share for row in rows),
        "least_observed": _reduced((row.observed_share for row in rows), min),
        "path_over_tour": _reduced(row.path_over_tour for row in rows),
        "barn_score": _reduced((row.barn_score or 0.0 for row in rows) if scored else ()),
        "cpu_time_s": _reduced(row.cpu_time_s for row in rows),
        "memory_mb": _reduced((row.memory_mb for row in rows), max),
        "real_time_factor": _reduced((row.real_time_factor for row in rows), median),
        "outcomes": _counts(row.outcome for row in rows),
        "causes": _counts(row.failure for row in rows if not row.succeeded),
    }


def equal_configurations(rows: Sequence[RunRow]) -> list[list[str]]:
    """Return groups of two or more variants, or stacks, that drove equal commands in all runs."""
    driven: dict[str, dict[tuple[str, str, str, int], str]] = {}
    for row in rows:
        driven.setdefault(row.configuration, {})[_run(row)] = row.command_hash
    equal: dict[frozenset[Any], list[str]] = {}
    for name, commands in driven.items():
        if all(commands.values()):
            equal.setdefault(frozenset(commands.items()), []).append(name)
    return [names for names in equal.values() if len(names) > 1]


def _counts(words: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(words).items(), key=lambda item: (-item[1], item[0])))


def _reduced(
    values: Iterable[float | None], by: Callable[[list[float]], float] = fmean
) -> float | None:
    """Return the mean, or what else ``by`` gives, of those that are not None."""
    numbers = [value for value in values if value is not None]
    return by(numbers) if numbers else None


# --- tables ---------------------------------------------------------------------------------------


def _columns(digits: int) -> list[Column]:
    """The columns of the figures of runs; shares in percent and times have ``digits`` decimals."""
    share = f".{digits}%"
    return [
        Column("runs", "missions"),
        Column("success [95 %]", lambda figures: _success(figures, digits)),
        Column("collided", "collision_rate", share, missing=""),
        Column("mean SPL", "spl", ".2f", missing=""),
        Column("mean SCT", "sct", ".2f", missing=""),
        Column("BARN", "barn_score", ".3f", missing=""),
        Column("mean time", "mean_time_s", f".{digits}f", "s", missing=""),
        Column("least clearance", "min_clearance_m", ".2f", "m", missing=""),
        Column("observed", "observed_share", ".1%", missing=""),
        Column("least", "least_observed", ".1%", missing=""),
        Column("path / tour", "path_over_tour", ".2f", missing=""),
        Column("reroutes", "route_changes", ".1f", missing=""),
        Column("lost", "lost_s", f".{digits}f", "s", missing=""),
        Column("wrong", "confidently_wrong_s", f".{digits}f", "s", missing=""),
        Column("faults", "plugin_faults", missing=""),
    ]


_BRIEF = {"runs", "success [95 %]", "collided", "mean SPL", "mean time", "faults"}
"""The columns of the table in Markdown."""


def summary_table(summary: Mapping[str, Any]) -> ResultTable:
    """Return the summary to print: a row for each entry, then stack, variant, hazard, then all.

    The row of all is left out if it would be the second. Columns without a value are left out.
    The last column is ``passes`` if an entry has ``expect``.
    """
    rows = dict(summary["by_entry"])
    for kind in ("stack", "variant", "hazard"):
        for name, numbers in summary.get(f"by_{kind}", {}).items():
            rows[f"all, {kind} {name}"] = numbers
    if len(rows) > 1:
        rows["all"] = summary
    columns = [Column("", "name"), *_columns(1)]
    if any("expect" in figures for figures in rows.values()):
        columns.append(Column("passes", _passes))
    records = named(rows)
    told = [one for one in columns if one.title == "" or any(map(one.cell, records))]
    return ResultTable("summary", told, records)


def brief_table(summary: Mapping[str, Any]) -> ResultTable:
    """One row per variant, with its success in every entry; without variants, one row per entry.

    Success is in percent with its Wilson interval (95 %); ``p`` is that of McNemar's exact test
    against the first variant. Time is the mean over the runs that reached their goals. ``faults``
    counts plugin faults.
    """
    columns = [column for column in _columns(0) if column.title in _BRIEF]
    if "by_variant" in summary:
        return _variant_table(summary, columns)
    rows = dict(summary["by_entry"])
    rows |= {f"all, {name}": figures for name, figures in summary.get("by_stack", {}).items()}
    if len(rows) > 1:
        rows["all"] = summary
    return ResultTable("summary", [Column("entry", "name"), *columns], named(rows))


def _variant_table(summary: Mapping[str, Any], columns: Sequence[Column]) -> ResultTable:
    entries = list(summary["by_entry"])
    variants = named(summary["by_variant"])
    variants[0]["p"] = None  # it is compared with itself
    for name, reason in summary.get("skipped", {}).items():
        nothing = dict.fromkeys(variants[0])
        skipped = {"name": name, "missions": 0, "skipped": reason, "by_entry": {}}
        variants.append({**nothing, **skipped})
    of_entries = [Column(entry, partial(_in_entry, entry), ".0%", missing="") for entry in entries]
    head, p = Column("variant", "name"), Column("p", _chance, missing="")
    return ResultTable("variants", [head, *columns, p, *of_entries], variants)


def _success(figures: Mapping[str, Any], digits: int) -> str:
    """Return the share of runs that succeeded, with its interval; of few runs their number."""
    if "skipped" in figures:
        return f"skipped: {figures['skipped']}"
    if figures["missions"] < MIN_RUNS:
        return f"{figures['reached']} of {figures['missions']}"
    low, high = (f"{100.0 * figures[key]:.{digits}f}" for key in ("success_low", "success_high"))
    return f"{shown(figures['success'], f'.{digits}%', missing='')} [{low}, {high}]".strip()


def _in_entry(entry: str, variant: Mapping[str, Any]) -> object:
    return variant["by_entry"].get(entry, {}).get("success")


def _chance(figures: Mapping[str, Any]) -> str | None:
    p = figures["p"]
    if p is None:
        return None
    return f"< {_P_SHOWN:g}" if p < _P_SHOWN else f"{p:.2g}"


def _passes(figures: Mapping[str, Any]) -> str:
    if "expect" not in figures:
        return ""
    word = "yes" if figures["passes"] else "NO"
    return f"{word}, {figures['passed']} of {figures['missions']} ({figures['expect']})"
