"""The report of two suites side by side: what got better and worse, with the pictures of both."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from navfw.errors import locating
from navfw.report.report_page import render_page
from navfw.report.run_lines import RunLine, RunLines, relative_link
from navfw.report.suite_page import finished_rows
from navfw.suite.paired_comparison import (
    PairedChanges,
    RunPair,
    compare_tables,
    comparison_rows,
    of_variant,
    pair_up,
)
from navfw.suite.suite_folder import SuiteFolder


def comparison_report(
    first: SuiteFolder,
    second: SuiteFolder,
    page: Path,
    variants: tuple[str | None, str | None] = (None, None),
) -> tuple[str, list[str]]:
    """The report of two suites over the same runs, and what is wrong with pictures.

    Of each suite one of the ``variants`` is compared, or all by name. Links to pictures are
    relative to ``page``, the folder that the file will be in.

    Raises:
        ConfigError: journal or table of one of them are empty or damaged.
        InputError: they have no run in common, or no such variant.

    """
    suites = (first, second)
    finished = [finished_rows(suite) for suite in suites]
    with locating(file=f"{first.path}, {second.path}"):
        rows = [of_variant(*chosen) for chosen in zip(finished, variants, strict=True)]
        found = compare_tables(*rows)
    pairs = pair_up(*rows)
    changes = PairedChanges.of(pairs)
    neither = [pair for pair in pairs if not pair.a.succeeded and not pair.b.succeeded]
    lines = tuple(RunLines(suite, page) for suite in suites)
    names = [
        f"{suite.path}, {variant}" if variant else str(suite.path)
        for suite, variant in zip(suites, variants, strict=True)
    ]
    content = render_page(
        "comparison_page.html",
        title=" and ".join(names),
        suites=[
            (letter, name, relative_link(suite.report, page))
            for letter, name, suite in zip("AB", names, suites, strict=True)
        ],
        several="by_configuration" in found,
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
