"""A suite's summary, and the comparison of two suites, as rows of text for terminal and report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

_COLUMNS = (
    "",
    "runs",
    "success [95 %]",
    "collided",
    "SPL",
    "SCT",
    "BARN",
    "time",
    "clearance",
    "faults",
)


def summary_table(summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Head and rows: each entry, then each stack or variant, then all.

    Without other parts there is one row. ``passes`` is the last column where an entry expects
    something.
    """
    parts = dict(summary["by_entry"])
    for kind in ("stack", "variant"):
        for name, numbers in summary.get(f"by_{kind}", {}).items():
            parts[f"all, {kind} {name}"] = numbers
    if len(parts) > 1:
        parts["all"] = summary
    columns = list(_COLUMNS)
    lines = [_line(name, part) for name, part in parts.items()]
    if any("expect" in part for part in parts.values()):
        columns.append("passes")
        lines = [[*line, _passes(part)] for line, part in zip(lines, parts.values(), strict=True)]
    return columns, lines


def _line(name: str, part: Mapping[str, Any]) -> list[str]:
    interval = f"[{100 * part['success_low']:.1f}, {100 * part['success_high']:.1f}]"
    return [
        name,
        str(part["missions"]),
        f"{_percent(part['success'])} {interval}",
        _percent(part["collision_rate"]),
        _number(part["spl"]),
        _number(part["sct"]),
        _number(part["barn_score"], 3),
        _number(part["mean_time_s"], 1, " s"),
        _number(part["min_clearance_m"], 2, " m"),
        str(part["plugin_faults"]),
    ]


def _passes(part: Mapping[str, Any]) -> str:
    if "expect" not in part:
        return ""
    word = "yes" if part["passes"] else "NO"
    return f"{word}, {part['passed']} of {part['missions']} ({part['expect']})"


def comparison_rows(found: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Name, value of A, value of B, and the difference with its interval, of ``compare_tables``.

    Success and SPL of each variant, or stack, come last.
    """
    rows = _pair_rows(found)
    for name, part in found.get("by_configuration", {}).items():
        rows += [(f"{name}: {what}", a, b, by) for what, a, b, by in _pair_rows(part)[:2]]
    return rows


def _pair_rows(found: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Success, SPL, time where there are some, and collisions of pairs."""
    success = _difference(found["success_difference"], found["success_interval"], 100.0, 1, " %")
    rows = [
        (
            "success",
            _percent(found["success_a"]),
            _percent(found["success_b"]),
            f"{success}; only B {len(found['gained'])}, only A {len(found['lost'])};"
            f" McNemar exact p = {found['p']:.3g}",
        ),
        (
            "SPL",
            f"{found['spl_a']:.3f}",
            f"{found['spl_b']:.3f}",
            f"median {_difference(found['spl_difference'], found['spl_interval'], 1.0, 3)}",
        ),
    ]
    if found["both_reached"]:
        times = _difference(found["time_difference_s"], found["time_interval_s"], 1.0, 1, " s")
        note = f"median {times} in {found['both_reached']} pairs of successes"
        rows.append(("time", f"{found['time_a_s']:.1f} s", f"{found['time_b_s']:.1f} s", note))
    rows.append(("collisions", str(found["collisions_a"]), str(found["collisions_b"]), ""))
    return rows


def _difference(
    value: float, ends: tuple[float, float] | None, factor: float, digits: int, unit: str = ""
) -> str:
    """A difference with its interval, if it has one."""
    text = f"{factor * value:+.{digits}f}{unit}"
    if ends is None:
        return text
    low, high = (f"{factor * end:+.{digits}f}" for end in ends)
    return f"{text} [{low}, {high}]"


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.1f} %"


def _number(value: float | None, digits: int = 2, unit: str = "") -> str:
    return "" if value is None or math.isinf(value) else f"{value:.{digits}f}{unit}"
