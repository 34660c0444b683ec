"""A suite's summary as a Markdown table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_P_SHOWN = 1e-4
"""Values of p below this are shown as "< 0.0001"."""


def markdown_table(summary: Mapping[str, Any]) -> str:
    """One row per variant, with its success in every entry; without variants, one row per entry.

    Success in percent with its Wilson interval (95 %); ``p`` is of McNemar's exact test against the
    first variant. Time is the mean over the runs that reached their goals. ``faults`` counts plugin
    faults.
    """
    if "by_variant" in summary:
        return _variants(summary)
    rows = [[name, *_numbers(part)] for name, part in summary["by_entry"].items()]
    rows += [
        [f"all, {name}", *_numbers(part)] for name, part in summary.get("by_stack", {}).items()
    ]
    if len(rows) > 1:
        rows.append(["all", *_numbers(summary)])
    return pipe_table(["entry", *_COLUMNS], rows)


_COLUMNS = ("runs", "success [95 %]", "collided", "SPL", "time", "faults")


def _variants(summary: Mapping[str, Any]) -> str:
    entries = list(summary["by_entry"])
    rows = []
    for number, (name, part) in enumerate(summary["by_variant"].items()):
        of_entries = [_percent(part["by_entry"].get(e, {}).get("success")) for e in entries]
        rows.append([name, *_numbers(part), _p(part["p"]) if number else "", *of_entries])
    for name, reason in summary.get("skipped", {}).items():
        rows.append([name, "0", f"skipped: {reason}", *[""] * (len(_COLUMNS) - 1 + len(entries))])
    return pipe_table(["variant", *_COLUMNS, "p", *entries], rows)


def _numbers(part: Mapping[str, Any]) -> list[str]:
    interval = f"[{100.0 * part['success_low']:.0f}, {100.0 * part['success_high']:.0f}]"
    time = part["mean_time_s"]
    return [
        str(part["missions"]),
        f"{_percent(part['success'])} {interval}".strip(),
        _percent(part["collision_rate"]),
        "" if part["spl"] is None else f"{part['spl']:.2f}",
        "" if time is None else f"{time:.0f} s",
        str(part["plugin_faults"]),
    ]


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.0f} %"


def _p(value: float) -> str:
    return f"< {_P_SHOWN:g}" if value < _P_SHOWN else f"{value:.2g}"


def pipe_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; all columns but the first are aligned to the right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in lines
    )
