"""``navfw explain RUN_FOLDER --at T``: why a command was given, rule by rule."""

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
    at: Annotated[float, typer.Option("--at", help="Time in the run [s].")],
    json: Json = False,
) -> None:
    """Say why the robot did what it did at one moment: which rules fired, how strongly."""
    with quiet_stdout():
        from navfw.recording.run_replay import explain_at

        explanation = explain_at(folder, at)
    if json:
        print_json(explanation)
    else:
        typer.echo("\n".join(_lines(explanation)))


def _lines(explanation: dict[str, Any]) -> list[str]:
    """The explanation for a person."""
    seen = explanation.get("perception", {}).get("sentence", "")
    lines = [
        f"at {explanation['time']:.1f} s: v {explanation['v']:+.2f} m/s, "
        f"w {explanation['w']:+.2f} rad/s, led by {explanation['leader']}",
        f"  saw  {seen or 'nothing yet'}",
    ]
    composite = explanation.get("composite", {"rules": ()})
    if composite["rules"]:
        given = ", ".join(f"{name} {weight:.2f}" for name, weight in composite["weights"].items())
        lines.append(f"  {composite['name']} gives {given}")
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in composite["rules"]]
    ordered = sorted(explanation["behaviors"].items(), key=lambda item: -item[1]["weight"])
    for name, said in ordered:
        lines.append(
            f"  {name}: weight {said['weight']:.2f}, wants this {said['desirability']:.2f}, "
            f"forbids it {said['prohibition']:.2f} - {said['reason']}"
        )
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in said["rules"]]
    return lines
