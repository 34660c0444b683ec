"""``navfw report RUN|SUITE...``: one HTML file of a run, a suite or two, which needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfw.cli.options import VariantA, VariantB
from navfw.cli.output import print_status, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError

if TYPE_CHECKING:
    from navfw.suite.suite_folder import SuiteFolder

Variants = tuple[str | None, str | None]
"""The variants of A and B to compare; None for all."""


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(report)


def report(
    folder: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN|SUITE...",
            help="Folder of a run or of a suite; or of two suites, which are compared.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write [default: report.html in the folder; comparison.html in that of"
            " the second suite].",
            show_default=False,
        ),
    ] = None,
    variant_a: VariantA = None,
    variant_b: VariantB = None,
    quiet: Quiet = False,
) -> None:
    """Write a report of a run, of a suite, or of two suites side by side, as one HTML file.

    Recorded runs of a suite get reports of their own, if they have none yet.
    """
    if len(folder) > 2:
        raise typer.BadParameter("at most two folders", param_hint="RUN|SUITE...")
    if len(folder) < 2 and (variant_a or variant_b):
        name = "--variant-a" if variant_a else "--variant-b"
        raise typer.BadParameter("needs two suites to compare", param_hint=name)
    with quiet_stdout(), ProgressBar("report", "recorded runs", quiet=quiet) as bar:
        target, notes = _write(folder, (variant_a, variant_b), out, bar)
    for what in notes:
        print_status(f"navfw: left out: {what}")
    typer.echo(f"report: {target}")


def _write(
    folders: list[Path], variants: Variants, out: Path | None, bar: ProgressBar
) -> tuple[Path, list[str]]:
    """Write the report; returns its file, and what is wrong with pictures and recordings."""
    from navfw.process.atomic import output_file, write_text
    from navfw.recording.run_folder import REPORT
    from navfw.suite.suite_folder import COMPARISON, SuiteFolder

    of_run = [_is_run(folder) for folder in folders]
    target = out or folders[-1] / (REPORT if len(folders) == 1 else COMPARISON)
    output_file(target, "--out")
    suites = [SuiteFolder(folder) for folder in folders]
    notes: list[str] = []
    if of_run == [True]:
        from navfw.report.run_page import run_report

        text = run_report(folders[0])
    elif any(of_run):
        what = "is the folder of a run; two suites can be compared"
        raise InputError(what, file=folders[of_run.index(True)])
    else:
        text, notes = _suite_text(suites, variants, target.parent)
        for suite in suites:
            notes += _write_run_reports(suite, bar)
    write_text(target, text)
    return target, notes


def _suite_text(suites: list[SuiteFolder], variants: Variants, page: Path) -> tuple[str, list[str]]:
    """The page of one suite, or of two; and what is wrong with pictures."""
    if len(suites) == 1:
        from navfw.report.suite_page import suite_report

        return suite_report(suites[0], page)
    from navfw.report.comparison_page import comparison_report

    return comparison_report(suites[0], suites[1], page, variants)


def _write_run_reports(suite: SuiteFolder, bar: ProgressBar) -> list[str]:
    """Write the reports of recorded runs that have none; returns what is wrong with recordings."""
    from navfw.config.input_file import is_file
    from navfw.process.atomic import write_text
    from navfw.recording.run_folder import RECORDING, REPORT
    from navfw.report.run_page import run_report

    folders = [
        folder
        for row in suite.rows()
        if is_file((folder := suite.recording(row)) / RECORDING) and not is_file(folder / REPORT)
    ]
    wrong = []
    for number, folder in enumerate(folders):
        bar.update(number, len(folders), folder.name)
        try:
            write_text(folder / REPORT, run_report(folder))
        except InputError as error:
            wrong.append(str(error))
    return wrong


def _is_run(folder: Path) -> bool:
    """Whether it is the folder of a run; otherwise it is that of a suite.

    Raises:
        InputError: it is neither.

    """
    from navfw.config.input_file import is_file
    from navfw.recording.run_folder import RESULT
    from navfw.suite.suite_folder import SuiteFolder

    if is_file(folder / RESULT):
        return True
    if not SuiteFolder(folder).has_runs:
        what = f"is neither the folder of a run (it has no {RESULT}) nor of a suite (it has no"
        raise InputError(f"{what} journal.sqlite, and no table.csv)", file=folder)
    return False
