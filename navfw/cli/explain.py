"""``navfw explain RUN_FOLDER --at T``: the rules and behaviours behind a command."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from navfw.cli.options import Json, Recorded
from navfw.cli.output import print_json, quiet_stdout

__all__ = ["add_to"]


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
        typer.echo("\n".join(_lines(explanation)))


def _lines(explanation: dict[str, Any]) -> list[str]:
    """The explanation as lines of text."""
    perceived = explanation.get("perception", {}).get("sentence", "")
    lines = [
        f"at {explanation['time']:.1f} s: v {explanation['v']:+.2f} m/s, "
        f"w {explanation['w']:+.2f} rad/s, led by {explanation['leader']}",
        f"  perceived  {perceived or 'nothing yet'}",
    ]
    composite = explanation.get("composite", {"rules": ()})
    if composite["rules"]:
        given = ", ".join(f"{name} {weight:.2f}" for name, weight in composite["weights"].items())
        lines.append(f"  {composite['name']} weights {given}")
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in composite["rules"]]
    ordered = sorted(explanation["behaviors"].items(), key=lambda item: -item[1]["weight"])
    for name, part in ordered:
        lines.append(
            f"  {name}: weight {part['weight']:.2f}, desirability {part['desirability']:.2f}, "
            f"prohibition {part['prohibition']:.2f} - {part['reason']}"
        )
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in part["rules"]]
    return lines
