"""``navfw import``: a world from a Gazebo file, or from a floor plan as of ROS' map_server."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, quiet_stdout
from navfw.errors import InputError

__all__ = ["add_to"]

IMAGE_SUFFIXES = (".pgm", ".png", ".bmp")
"""Files that are imported as the image of a floor plan."""


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command("import")(import_)


def import_(
    source: Annotated[
        Path, typer.Argument(help="SDF file, map_server yaml, or image of a floor plan.")
    ],
    out: Annotated[Path, typer.Option(help="Folder to write.")],
    start: Annotated[
        str | None,
        typer.Option(metavar="X,Y,YAW", help="SDF: start [m, rad]; not needed for a BARN world."),
    ] = None,
    goal: Annotated[
        str | None, typer.Option(metavar="X,Y", help="SDF: goal [m]; not needed for a BARN world.")
    ] = None,
    skip_unsupported: Annotated[
        bool, typer.Option("--skip-unsupported", help="SDF: leave out unsupported elements.")
    ] = False,
    models: Annotated[
        Path | None, typer.Option(help="SDF: folder of models, for meshes not beside the world.")
    ] = None,
    resolution: Annotated[
        float | None, typer.Option(help="Image: edge of a pixel [m]; a yaml file has its own.")
    ] = None,
    speckle: Annotated[
        float | None, typer.Option(help="Plan: spots up to this size vanish [m] [default: 0.12].")
    ] = None,
    gap: Annotated[
        float | None, typer.Option(help="Plan: narrower openings are closed [m] [default: 0.15].")
    ] = None,
    json: Json = False,
) -> None:
    """Make a world of a Gazebo world, or of a floor plan: with a map, and missions between places.

    Drive in it with navfw run FOLDER MISSION.
    """
    kind = source.suffix.lower()
    plan = kind in {".yaml", ".yml", *IMAGE_SUFFIXES}
    for option, value, fits in (
        ("--start", start, not plan),
        ("--goal", goal, not plan),
        ("--skip-unsupported", skip_unsupported or None, not plan),
        ("--models", models, not plan),
        ("--resolution", resolution, kind in IMAGE_SUFFIXES),
        ("--speckle", speckle, plan),
        ("--gap", gap, plan),
    ):
        if value is not None and not fits:
            raise InputError(f"is not for {kind or 'such'} files; leave it out", key=option)
    if plan:
        _import_plan(source, out, resolution, {"speckle": speckle, "gap": gap}, json)
    else:
        _import_gazebo(source, out, start, goal, skip_unsupported, models, json)


def _import_plan(
    source: Path,
    out: Path,
    resolution: float | None,
    cleaning: dict[str, float | None],
    json: bool,
) -> None:
    from navfw.worldgen.plan_import import import_plan, read_cleaning, read_plan

    with quiet_stdout():
        steps = read_cleaning(cleaning)
        made = import_plan(read_plan(source, resolution), source.stem, steps)
        folder = made.write(out)
    kinds = {place.kind for place in made.topo_map.places.values()}
    doors = sum(place.kind == "door" for place in made.topo_map.places.values())
    if json:
        print_json(
            {
                "folder": str(folder),
                "world": made.world.name,
                "walls": len(made.world.walls),
                "size_m": list(made.size),
                "free_m2": made.free_area,
                "places": len(made.topo_map.places),
                "doors": doors,
                "kinds": sorted(kinds),
                "edges": len(made.topo_map.passages),
                "missions": {name: made.lengths[name] for name in made.missions},
            }
        )
        return
    typer.echo(f"{folder}: {made.world.description}")
    typer.echo(
        f"{made.free_area:.0f} m2 free; {len(made.topo_map.places)} places, {doors} doors, "
        f"{len(made.topo_map.passages)} edges"
    )
    for name in made.missions:
        typer.echo(f"  navfw run {folder} {name}  ({made.lengths[name]:.1f} m)")


def _import_gazebo(
    source: Path,
    out: Path,
    start: str | None,
    goal: str | None,
    skip_unsupported: bool,
    models: Path | None,
    json: bool,
) -> None:
    from navfw.worldgen.gazebo_import import import_world
    from navfw.worldgen.generated_world import MISSION

    with quiet_stdout():
        begin = _numbers("--start", start, ("X", "Y", "YAW"))
        end = _numbers("--goal", goal, ("X", "Y"))
        made = import_world(
            source,
            start=None if begin is None else (begin[0], begin[1], begin[2]),
            goal=None if end is None else (end[0], end[1]),
            skip_unsupported=skip_unsupported,
            models=models,
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
                "meshes": made.meshes,
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
