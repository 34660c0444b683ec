"""``navfw map``: show, check, build, convert and learn topological maps; export floor plans."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.map_learn import learn
from navfw.cli.options import Json, Map, World
from navfw.cli.output import print_json, print_table, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet

_OverWorld = Annotated[
    str | None,
    typer.Option(help="Name or file of a world [default: the world with the map's name]."),
]


def add_to(app: typer.Typer) -> None:
    """Add ``map`` with its commands."""
    group = typer.Typer(
        help="Show, check, build, convert and learn maps; export floor plans.",
        no_args_is_help=True,
    )
    for command in (show, check, build, convert, learn, export):
        group.command()(command)
    app.add_typer(group, name="map")


def show(
    map_: Map,
    world: _OverWorld = None,
    out: Annotated[Path | None, typer.Option(help="PNG file to write [default: MAP.png].")] = None,
    json: Json = False,
) -> None:
    """Draw a map over its world's floor plan."""
    from navfw.cli.map_inputs import find_map, outline_for
    from navfw.recording.map_picture import draw_map
    from navfw.topomap.map_formats import SUFFIXES

    with quiet_stdout():
        topo_map = find_map(map_)
        outline = outline_for(topo_map, world)
        given = Path(map_)
        stem = given.stem if given.suffix.lower() in SUFFIXES else given.name
        path = out or Path(f"{stem}.png")
        draw_map(path, topo_map, outline)
    kinds: dict[str, int] = {}
    for place in topo_map.places.values():
        kinds[place.kind] = kinds.get(place.kind, 0) + 1
    summary = {
        "map": topo_map.name,
        "places": len(topo_map.places),
        "edges": len(topo_map.passages),
        "landmarks": len(topo_map.landmarks),
        "kinds": kinds,
        "parts": len(topo_map.parts),
        "length_m": sum(passage.length for passage in topo_map.passages),
        "over_world": outline is not None,
        "picture": str(path),
    }
    if json:
        print_json(summary)
        return
    counted = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    typer.echo(f"{topo_map.name}: {summary['places']} places ({counted}), {summary['edges']} edges")
    typer.echo(f"picture {path}" + ("" if outline is not None else ", without a floor plan"))


def check(map_: Map, world: _OverWorld = None, json: Json = False) -> None:
    """Check a map and its world. Exit with 1 if there are problems."""
    from navfw.cli.map_inputs import find_map, floor_plan
    from navfw.topomap.map_check import check_map

    with quiet_stdout():
        topo_map = find_map(map_)
        plan = floor_plan(topo_map, world)
        problems = check_map(topo_map, None if plan is None else plan.clearances)
    rows = [problem.as_data() for problem in problems]
    if json:
        print_json(
            {
                "map": topo_map.name,
                "in_world": plan is not None,
                "ok": not problems,
                "problems": rows,
            }
        )
    else:
        if plan is None:
            typer.echo("No world has the map's name: walls are not checked.", err=True)
        cells = [(row["kind"], row["where"], row["message"]) for row in rows]
        print_table(["problem", "where", ""], cells, f"{topo_map.name}: no problems")
    if problems:
        raise typer.Exit(1)


def build(
    world: World,
    out: Annotated[Path, typer.Option(help="Map file to write.")],
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Build a draft of a map from a world."""
    from navfw.config.lookup import find
    from navfw.sim.floorplan import FloorPlan
    from navfw.sim.worldfile import load_world
    from navfw.topomap.clearance_grid import ClearanceGrid
    from navfw.topomap.map_builder import build_map
    from navfw.topomap.map_formats import save_map

    with quiet_stdout():
        spec = load_world(find("world", world))
        plan = FloorPlan.from_world(spec)
        rooms = {room.name: (*room.x, *room.y) for room in spec.rooms}
        with ProgressBar("map build", quiet=quiet) as bar:
            bar.show_part("clearances")
            grid = ClearanceGrid.of(plan.bounds, plan.near_clearances)
            topo_map = build_map(spec.name, grid, rooms=rooms, report=bar.show_part)
        save_map(topo_map, out)
    if json:
        print_json(
            {
                "map": topo_map.name,
                "places": len(topo_map.places),
                "edges": len(topo_map.passages),
                "file": str(out),
            }
        )
        return
    typer.echo(f"{out}: {len(topo_map.places)} places, {len(topo_map.passages)} edges")
    typer.echo(f"view it with navfw map show {out} --world {world}, then name its places")


def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="Name or file of a map.")],
    out: Annotated[Path, typer.Argument(help="File to write: .yaml, .graphml or .geojson.")],
    both_ways: Annotated[
        bool, typer.Option("--both-ways", help="Make one-way edges two-way.")
    ] = False,
    json: Json = False,
) -> None:
    """Convert a map to another format. Formats: YAML, GraphML, GeoJSON of Nav2's route server."""
    from navfw.cli.map_inputs import find_map
    from navfw.topomap.map_formats import save_map

    with quiet_stdout():
        topo_map = find_map(source, both_ways)
        save_map(topo_map, out)
    places, edges = len(topo_map.places), len(topo_map.passages)
    if json:
        print_json({"map": topo_map.name, "places": places, "edges": edges, "file": str(out)})
    else:
        typer.echo(f"{out}: {places} places, {edges} edges")


def export(
    world: World,
    out: Annotated[Path, typer.Option(help="Yaml file to write; its image is beside it.")],
    resolution: Annotated[float, typer.Option(help="Edge of a cell [m].")] = 0.05,
    walls_only: Annotated[
        bool, typer.Option("--walls-only", help="Leave out furniture, drops and closed doors.")
    ] = False,
    image: Annotated[str, typer.Option(help="Format of the image: pgm, png or bmp.")] = "pgm",
    json: Json = False,
) -> None:
    """Export a world's floor plan for ROS' map_server, as Nav2 uses it."""
    from navfw.config.lookup import find
    from navfw.sim.worldfile import load_world
    from navfw.topomap.ros_map import save_ros_map
    from navfw.worldgen.plan_export import exported_plan

    with quiet_stdout():
        plan = exported_plan(load_world(find("world", world)), resolution, walls_only=walls_only)
        picture = save_ros_map(plan, out, f".{image.removeprefix('.').lower()}")
    rows, columns = plan.cells.shape
    if json:
        summary = {"file": str(out), "image": str(picture), "cells": [columns, rows]}
        print_json({**summary, "resolution_m": resolution, "occupied": int(plan.occupied.sum())})
        return
    typer.echo(f"{out}, {picture}: {columns} x {rows} cells of {resolution:g} m")
