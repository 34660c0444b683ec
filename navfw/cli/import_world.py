"""``navfw import WORLD.world``: convert a Gazebo world of cylinders and boxes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, quiet_stdout
from navfw.errors import InputError

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command("import")(import_)


def import_(
    world: Annotated[Path, typer.Argument(help="SDF file.")],
    out: Annotated[Path, typer.Option(help="Folder to write.")],
    start: Annotated[
        str | None,
        typer.Option(metavar="X,Y,YAW", help="Start [m, rad]; not needed for a BARN world."),
    ] = None,
    goal: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Goal [m]; not needed for a BARN world.")
    ] = None,
    skip_unsupported: Annotated[
        bool, typer.Option("--skip-unsupported", help="Leave out unsupported elements.")
    ] = False,
    json: Json = False,
) -> None:
    """Convert a Gazebo world. Drive in it with navfw run FOLDER cross."""
    from navfw.worldgen.gazebo_import import import_world
    from navfw.worldgen.generated_world import MISSION

    with quiet_stdout():
        begin = _numbers("--start", start, ("X", "Y", "YAW"))
        end = _numbers("--goal", goal, ("X", "Y"))
        made = import_world(
            world,
            start=None if begin is None else (begin[0], begin[1], begin[2]),
            goal=None if end is None else (end[0], end[1]),
            skip_unsupported=skip_unsupported,
        )
        folder = made.write(out)
    for what in made.skipped:
        typer.echo(f"left out: {what}", err=True)
    if json:
        print_json(
            {
                "folder": str(folder),
                "world": made.world.name,
                "mission": MISSION,
                "barn": made.barn,
                "description": made.world.description,
                "boxes": len(made.world.boxes),
                "cylinders": len(made.world.cylinders),
                "shortest_path_m": made.shortest,
                "skipped": list(made.skipped),
            }
        )
        return
    typer.echo(f"{folder}: {made.world.description}")
    typer.echo(f"{made.shortest:.1f} m from start to goal; navfw run {folder} {MISSION}")


def _numbers(option: str, text: str | None, names: tuple[str, ...]) -> list[float] | None:
    """The numbers of an option such as ``--goal 1.5,-2``; None where it is not given."""
    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != len(names) or not all(math.isfinite(number) for number in numbers):
        raise InputError(f"expected {','.join(names)}, got {text!r}", key=option)
    return numbers
