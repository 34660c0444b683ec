"""``navfw report RUN|SUITE...``: one HTML file of a run, a suite or two, which needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.output import print_status, quiet_stdout
from navfw.errors import InputError

__all__ = ["add_to"]


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
) -> None:
    """Write a report of a run, of a suite, or of two suites side by side, as one HTML file."""
    if len(folder) > 2:
        raise typer.BadParameter("at most two folders", param_hint="RUN|SUITE...")
    with quiet_stdout():
        target, notes = _write(folder, out)
    for what in notes:
        print_status(f"navfw: left out: {what}")
    typer.echo(f"report: {target}")


def _write(folders: list[Path], out: Path | None) -> tuple[Path, list[str]]:
    """Write the report; returns its file, and what is wrong with pictures."""
    from navfw.atomic import output_file, write_text
    from navfw.recording.run_folder import REPORT
    from navfw.suite.suite_folder import COMPARISON, SuiteFolder

    of_run = [_is_run(folder) for folder in folders]
    target = out or folders[-1] / (REPORT if len(folders) == 1 else COMPARISON)
    output_file(target, "--out")
    notes: list[str] = []
    if len(folders) > 1:
        from navfw.report.comparison_page import comparison_report

        if any(of_run):
            what = "is the folder of a run; two suites can be compared"
            raise InputError(what, file=folders[of_run.index(True)])
        first, second = map(SuiteFolder, folders)
        text, notes = comparison_report(first, second, target.parent)
    elif of_run[0]:
        from navfw.report.run_page import run_report

        text = run_report(folders[0])
    else:
        from navfw.report.suite_page import suite_report

        text, notes = suite_report(SuiteFolder(folders[0]), target.parent)
    write_text(target, text)
    return target, notes


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
