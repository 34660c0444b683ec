"""``navfw generate FAMILY``: generate a world from a seed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, quiet_stdout


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(generate)


def generate(
    family: Annotated[str, typer.Argument(help="Family: see navfw plugins --kind family.")],
    seed: Annotated[int, typer.Option(help="Seed; the same one gives the same world.")] = 0,
    difficulty: Annotated[float, typer.Option(help="Difficulty from 0 (easy) to 1.")] = 0.5,
    contrast: Annotated[
        float | None,
        typer.Option(help="Contrast of every surface [grey levels] [default: each its own]."),
    ] = None,
    look: Annotated[
        Literal["plain", "photo"] | None,
        typer.Option(help="Surfaces: painted walls with skirting; or like photographs."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write [default: generated/FAMILY-SEED].")
    ] = None,
    json: Json = False,
) -> None:
    """Generate a world from a seed. Drive in it with navfw run FOLDER cross."""
    from navfw.worldgen import generate as make
    from navfw.worldgen.generated_world import MISSION

    with quiet_stdout():
        made = make(family, seed, difficulty, contrast, look)
        folder = made.write(out or Path("generated") / f"{family}-{seed}")
    world = made.world
    if json:
        print_json(
            {
                "folder": str(folder),
                "family": family,
                "seed": seed,
                "difficulty": difficulty,
                "contrast": contrast,
                "look": look,
                "mission": MISSION,
                "map": made.has_map,
                "description": world.description,
                "shortest_path_m": made.shortest,
                "timeout_s": made.mission.timeout,
                "size_m": [world.x[1] - world.x[0], world.y[1] - world.y[0]],
                "boxes": len(world.boxes),
                "cylinders": len(world.cylinders),
                "movers": len(world.movers),
                "attempts": made.attempt + 1,
            }
        )
        return
    typer.echo(f"{folder}: {world.description}")
    typer.echo(f"{made.shortest:.1f} m from start to goal; navfw run {folder} {MISSION}")
