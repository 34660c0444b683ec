"""The report of two suites side by side: what got better and worse, with the pictures of both."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from navfw.errors import InputError
from navfw.report.report_page import render_page
from navfw.report.run_lines import RunLine, RunLines, relative_link
from navfw.report.suite_page import finished_rows
from navfw.suite.paired_comparison import PairedChanges, RunPair, compare_tables, pair_up
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.summary_table import comparison_rows

__all__ = ["comparison_report"]


def comparison_report(first: SuiteFolder, second: SuiteFolder, page: Path) -> tuple[str, list[str]]:
    """The report of two suites over the same runs, and what is wrong with pictures.

    Links to pictures are relative to ``page``, the folder that the file will be in.

    Raises:
        ConfigError: journal or table of one of them are empty or damaged.
        InputError: they have no run in common.

    """
    suites = (first, second)
    rows = tuple(finished_rows(suite) for suite in suites)
    try:
        found = compare_tables(*rows)
    except InputError as error:
        raise InputError(f"{first.path}, {second.path}: {error}") from None
    pairs = pair_up(*rows)
    changes = PairedChanges.of(pairs)
    neither = [pair for pair in pairs if not pair.a.succeeded and not pair.b.succeeded]
    lines = tuple(RunLines(suite, page) for suite in suites)
    content = render_page(
        "comparison_page.html",
        title=f"{first.path} and {second.path}",
        suites=[
            (name, str(suite.path), relative_link(suite.report, page))
            for name, suite in zip("AB", suites, strict=True)
        ],
        pairs=found["pairs"],
        unpaired=found["unpaired"],
        numbers=comparison_rows(found),
        groups=[
            (name, note, _sides(part, lines))
            for name, note, part in (
                ("Lost", "only A reached its goals", changes.lost),
                ("Worse", "both reached their goals, the SPL of B is lower", changes.worse),
                ("Gained", "only B reached its goals", changes.gained),
                ("Better", "both reached their goals, the SPL of B is higher", changes.better),
                ("Failed in both", "neither reached its goals", neither),
            )
        ],
    )
    return content, [what for side in lines for what in side.damaged]


def _sides(pairs: Iterable[RunPair], lines: tuple[RunLines, ...]) -> list[tuple[RunLine, RunLine]]:
    """The runs of each pair as lines."""
    of_a, of_b = lines
    return [(of_a.line(pair.a), of_b.line(pair.b)) for pair in pairs]
