"""The report of a suite: one HTML file with its summary and its runs, failures first, by cause."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from navfw.config.image_file import read_image
from navfw.config.input_file import is_file
from navfw.errors import ConfigError, locating
from navfw.recording.run_folder import RECORDING, REPORT
from navfw.report.report_page import reduced_source, render_page
from navfw.suite import paired_comparison
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_summary import equal_configurations, summarize, summary_table

_MAX_PICTURES = 400
"""Largest number of embedded pictures of a suite, about 10 MB; other runs have links to theirs."""

_WIDTH, _QUALITY = 640, 60
"""Width [px] and quality (WebP, of 100) of an embedded picture: its labels are legible."""


class RunLines:
    """Makes the lines of a page, in the folder ``page``, on the runs of the suite in ``folder``.

    ``damaged`` has a message for each picture that cannot be read; its run has only the link.
    """

    def __init__(self, folder: SuiteFolder, page: Path) -> None:
        self._folder = folder
        self._page = page
        self._left = _MAX_PICTURES
        self.damaged: list[str] = []

    def line(self, row: RunRow) -> dict[str, Any]:
        """Make the line of one run from its ``row``; ``name`` is entry, world, mission, each once.

        ``image`` is a data URL, ``link`` the relative URL of the picture's file, and ``report``
        that of the report of a recorded run; each is "" if there is none.
        """
        recording = self._folder.recording(row)
        recorded = is_file(recording / RECORDING) or is_file(recording / REPORT)
        report = relative_link(recording / REPORT, self._page) if recorded else ""
        name = " / ".join(dict.fromkeys((row.entry, row.world, row.mission)))
        line = {"row": row, "name": name, "image": "", "link": "", "report": report}
        file = self._folder.pictures / Path(row.picture).name
        if row.picture and is_file(file):
            line |= {"image": self._image(file), "link": relative_link(file, self._page)}
        return line

    def _image(self, file: Path) -> str:
        """Return the picture as a data URL; "" where there are too many, or it cannot be read."""
        if not self._left:
            return ""
        try:
            image = np.asarray(read_image(file), dtype=np.uint8)
        except ConfigError as error:
            self.damaged.append(str(error))
            return ""
        self._left -= 1
        return reduced_source(image, _WIDTH, quality=_QUALITY)


def relative_link(file: Path, folder: Path) -> str:
    """Return the URL of ``file``, relative to a page in ``folder``."""
    return quote(os.path.relpath(file.absolute(), folder.absolute()))


_MAX_REACHED = 2000
"""Largest number of successful runs on a page; ``table.csv`` has all of them."""


def suite_report(folder: SuiteFolder, page: Path) -> tuple[str, list[str]]:
    """Render the report of the suite in ``folder`` as HTML; also messages on damaged pictures.

    Links to pictures are relative to ``page``, the folder that the file will be in.

    Raises:
        ConfigError: no run has ended yet, or journal, table or summary are damaged.

    """
    rows = finished_rows(folder)
    last = folder.summary()
    expected = {
        name: entry["expect"]
        for name, entry in last.get("by_entry", {}).items()
        if "expect" in entry
    }
    summary = summarize(rows, expected)
    table = summary_table(summary)
    lines = RunLines(folder, page)
    failed = [row for row in rows if not row.succeeded]
    groups = [  # the most frequent first
        (cause, [lines.line(row) for row in failed if row.failure == cause])
        for cause in summary["causes"]
    ]
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
        equal=equal_configurations(rows),
        groups=groups,
        reached=[lines.line(row) for row in reached[:_MAX_REACHED]],
        more=max(0, len(reached) - _MAX_REACHED),
        several_stacks=len({row.configuration for row in rows}) > 1,
    )
    return content, lines.damaged


def finished_rows(folder: SuiteFolder) -> list[RunRow]:
    """Return the rows of the runs that have ended, at least one.

    Raises:
        ConfigError: no run has ended yet, or journal or table are damaged.

    """
    rows = folder.rows()
    if not rows:
        raise ConfigError("no run of the suite has ended yet", file=folder.path)
    return rows


def comparison_report(
    first: SuiteFolder,
    second: SuiteFolder,
    page: Path,
    variants: tuple[str | None, str | None] = (None, None),
) -> tuple[str, list[str]]:
    """Render the report that compares two suites run by run; also messages on damaged pictures.

    ``variants`` selects one variant of each suite; None: all, paired by name. Links to pictures are
    relative to ``page``, the folder that the file will be in.

    Raises:
        ConfigError: journal or table of one of them are empty or damaged.
        InputError: they have no run in common, or no such variant.

    """
    suites = (first, second)
    finished = [finished_rows(suite) for suite in suites]
    with locating(file=f"{first.path}, {second.path}"):
        rows = [
            paired_comparison.of_variant(*chosen) for chosen in zip(finished, variants, strict=True)
        ]
        comparison = paired_comparison.compare_tables(*rows)
    pairs = paired_comparison.pair_up(*rows)
    changes = paired_comparison.paired_changes(pairs)
    neither = [pair for pair in pairs if not pair.a.succeeded and not pair.b.succeeded]
    of_a, of_b = (RunLines(suite, page) for suite in suites)
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
        several="by_configuration" in comparison,
        unpaired=comparison["unpaired"],
        numbers=paired_comparison.comparison_rows(comparison),
        pairs=pairs,
        groups=[
            (name, note, [(of_a.line(pair.a), of_b.line(pair.b)) for pair in changed_pairs])
            for name, note, changed_pairs in (
                ("Lost", "only A reached its goals", changes["lost"]),
                ("Worse", "both reached their goals, the SPL of B is lower", changes["worse"]),
                ("Gained", "only B reached its goals", changes["gained"]),
                ("Better", "both reached their goals, the SPL of B is higher", changes["better"]),
                ("Failed in both", "neither reached its goals", neither),
            )
        ],
    )
    return content, [*of_a.damaged, *of_b.damaged]
