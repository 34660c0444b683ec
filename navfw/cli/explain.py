"""``navfw explain RUN_FOLDER --at T``: the rules and behaviours behind a command."""

from __future__ import annotations

from typing import Annotated

import typer

from navfw.cli.options import Json, Recorded
from navfw.cli.output import print_json, quiet_stdout


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(explain)


def explain(
    folder: Recorded,
    at: Annotated[float, typer.Option("--at", help="Time since the start of the run [s].")],
    json: Json = False,
) -> None:
    """Explain the command at one moment. Lists the behaviours, and the rules that fired."""
    with quiet_stdout():
        from navfw.recording.run_replay import explain_at

        explanation = explain_at(folder, at)
    if json:
        print_json(explanation)
    else:
        from navfw.mofis.explanation import explanation_lines

        typer.echo("\n".join(explanation_lines(explanation)))
