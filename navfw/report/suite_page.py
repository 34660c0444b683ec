"""The report of a suite: one HTML file with its summary, and its runs, failures first, by cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from navfw.errors import ConfigError
from navfw.report.report_page import render_page
from navfw.report.run_lines import RunLine, RunLines
from navfw.suite.run_table import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_summary import summarize, summary_table

_MAX_REACHED = 2000
"""Largest number of successful runs on a page; the table has all of them."""


def suite_report(folder: SuiteFolder, page: Path) -> tuple[str, list[str]]:
    """The report of the suite in ``folder`` as HTML, and what is wrong with pictures.

    Links to pictures are relative to ``page``, the folder that the file will be in.

    Raises:
        ConfigError: no run has ended yet, or journal, table or summary are damaged.

    """
    rows = finished_rows(folder)
    last = folder.summary()
    expected = {
        name: part["expect"] for name, part in last.get("by_entry", {}).items() if "expect" in part
    }
    summary = summarize(rows, expected)
    table = summary_table(summary)
    lines = RunLines(folder, page)
    groups = _groups(rows, summary["causes"], lines)
    reached = [row for row in rows if row.succeeded]
    content = render_page(
        "suite_page.html",
        title=f"suite {last.get('suite', folder.path.absolute().name)}",
        folder=str(folder.path),
        revisions=[str(revision) for revision in last.get("revisions", [])],
        complete=bool(last.get("complete")) and last.get("missions") == len(rows),
        columns=table.head,
        table=table.rows,
        died=summary["died"],
        groups=groups,
        reached=lines.of(reached[:_MAX_REACHED]),
        more=max(0, len(reached) - _MAX_REACHED),
        several_stacks=len({row.configuration for row in rows}) > 1,
    )
    return content, lines.damaged


def finished_rows(folder: SuiteFolder) -> list[RunRow]:
    """The rows of a suite that has at least one.

    Raises:
        ConfigError: no run has ended yet, or journal or table are damaged.

    """
    rows = folder.rows()
    if not rows:
        raise ConfigError("no run of the suite has ended yet", file=folder.path)
    return rows


def _groups(
    rows: Sequence[RunRow], causes: Mapping[str, int], lines: RunLines
) -> list[tuple[str, list[RunLine]]]:
    """The failed runs by outcome and cause, the most frequent first."""
    return [
        (cause, lines.of(row for row in rows if not row.succeeded and row.failure == cause))
        for cause in causes
    ]
