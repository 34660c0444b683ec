"""``navfw report RUN|SUITE...``: one HTML file of a run, which needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.output import quiet_stdout

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(report)


def report(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    out: Annotated[
        Path | None, typer.Option(help="File to write [default: report.html in the folder].")
    ] = None,
) -> None:
    """Write a report of a run as one HTML file: plan, pictures, ratings, rules, timelines."""
    with quiet_stdout():
        from navfw.atomic import output_file, write_text
        from navfw.recording.run_folder import REPORT, read_result
        from navfw.report.run_page import run_report

        read_result(folder)
        target = out or folder / REPORT
        output_file(target, "--out")
        write_text(target, run_report(folder))
    typer.echo(f"report: {target}")
