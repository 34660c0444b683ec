"""The result of ``navfw run`` on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from navfw.cli.output import console, print_json

NOT_SAVED = 3
"""Exit code of a finished drive whose run folder could not be written completely."""


def show_result(summary: Mapping[str, Any], missing: Sequence[str], as_json: bool) -> None:
    """Print the result of a run on stdout, and on stderr what its folder lacks.

    The result of a run that was ended from outside has the first few keys only.
    """
    if as_json:
        print_json(summary)
    elif "command_hash" in summary:
        _print_result(summary)
    else:
        typer.echo(f"{summary['outcome']}: {summary['reason']}")
    if missing:
        _report_missing(missing, summary["run_folder"])


def _report_missing(missing: Sequence[str], folder: str | None) -> None:
    """Print on stderr what was not written, and what was."""
    for what in missing:
        typer.echo(f"navfw: {what}", err=True)
    names = [] if folder is None else sorted(file.name for file in Path(folder).iterdir())
    saved = f"{', '.join(names)} in {folder}" if names else "nothing; the result is on stdout"
    typer.echo(f"navfw: saved: {saved}", err=True)


def _print_result(summary: Mapping[str, Any]) -> None:
    objections = summary["objections"]
    good = summary["outcome"] == "reached" and not objections
    leader = f" (leading behaviour {summary['behavior']})" if summary["behavior"] else ""
    screen = console()
    screen.print(
        f"[bold {'green' if good else 'red'}]{summary['outcome']}[/] after"
        f" {summary['sim_time_s']:.1f} s",
        end=", but " if objections else ": ",
    )
    if objections:
        screen.print("; ".join(objections), markup=False, soft_wrap=True, end=": ")
    screen.print(f"{summary['reason']}{leader}", markup=False)
    count = summary["collisions"]
    collisions = f"{count or 'no'} collision{'' if count == 1 else 's'}"
    nearest = summary["min_clearance_m"]
    clearance = "no obstacle near" if nearest is None else f"at least {nearest:.2f} m"
    rows = {
        "path": f"{summary['path_length_m']:.2f} m, shortest {summary['shortest_path_m']:.2f} m"
        f" (SPL {summary['spl']:.2f})",
        "clearance": f"{clearance}, {collisions}",
        "goal": f"{summary['distance_to_goal_m']:.2f} m away, error of the estimated position"
        f" {summary['estimate_error_m']:.2f} m",
        "speed": f"{summary['real_time_factor']:.1f} x real time ({summary['wall_time_s']:.1f} s)",
        "commands": summary["command_hash"][:16],
        "run folder": summary["run_folder"] or "none, the result could not be written",
    }
    for name, text in rows.items():
        screen.print(f"  {name:<11} {text}", markup=False, soft_wrap=True)
    for fault in summary["faults"]:
        screen.print(f"  fault       {fault}", markup=False, soft_wrap=True)
