"""``navfw map``: show, check, build, convert and teach topological maps, and plan on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from navfw.cli.options import (
    Json,
    Map,
    Mission,
    NoiseSeed,
    Stack,
    World,
    argument,
    command_group,
    option,
)
from navfw.cli.output import (
    echo,
    print_assumed,
    print_json,
    print_result,
    print_table,
    print_tables,
    quiet_stdout,
)
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.cli.teach import name, teach
from navfw.config.input_file import is_file
from navfw.config.lookup import find, list_files
from navfw.process.atomic import output_file, write_text
from navfw.process.result_table import Column, ResultTable
from navfw.recording.run_folder import plain_json

if TYPE_CHECKING:
    from navfw.recording.top_view import WorldOutline
    from navfw.sim.scene_geometry import SceneGeometry
    from navfw.topomap import TopoMap

_OverWorld = Annotated[
    str | None, option(..., "Name or file of a world [default: the world with the map's name].")
]


def show(
    map_: Map,
    world: _OverWorld = None,
    out: Path | None = option(None, "PNG file to write [default: MAP.png]."),
    json: Json = False,
) -> None:
    """Draw a map over its world's floor plan."""
    from navfw.recording.plan_picture import draw_map
    from navfw.topomap.map_formats import SUFFIXES

    with quiet_stdout():
        topo_map = _find_map(map_)
        outline = _outline_for(topo_map, world)
        named = Path(map_)
        stem = named.stem if named.suffix.lower() in SUFFIXES else named.name
        path = out or Path(f"{stem}.png")
        draw_map(path, topo_map, outline)
    kinds = Counter(place.kind for place in topo_map.places.values())
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
    counted = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    lines = (
        f"{topo_map.name}: {summary['places']} places ({counted}), {summary['edges']} edges",
        f"picture {path}" + ("" if outline is not None else ", without a floor plan"),
    )
    print_result(summary, lines, json=json, assumed=topo_map.all_assumed)


def check(
    map_: Map,
    world: _OverWorld = None,
    robot: str = option(
        "default", "Name or file of the robot that is to fit through the passages."
    ),
    json: Json = False,
) -> None:
    """Check a map and its world. Exit with 1 if there are problems."""
    from navfw.robot.robotfile import load_robot
    from navfw.topomap.map_check import check_map

    with quiet_stdout():
        topo_map = _find_map(map_)
        plan = _floor_plan(topo_map, world)
        clearances = None if plan is None else plan.clearances
        problems = check_map(topo_map, clearances, load_robot(robot).radius)
    rows = [problem.as_data() for problem in problems]
    print_assumed(topo_map.all_assumed)
    if json:
        summary = {"map": topo_map.name, "in_world": plan is not None}
        assumed = [one.as_data() for one in topo_map.all_assumed]
        print_json({**summary, "ok": not problems, "problems": rows, "assumed": assumed})
    else:
        if plan is None:
            echo("No world has the map's name: walls are not checked.", err=True)
        cells = [(row["kind"], row["where"], row["message"]) for row in rows]
        print_table(["problem", "where", ""], cells, f"{topo_map.name}: no problems")
    if problems:
        raise typer.Exit(1)


def diff(
    before: str = argument(..., "Name or file of a map.", metavar="A"),
    after: str = argument(..., "Name or file of a later map.", metavar="B"),
    world: _OverWorld = None,
    out: Path | None = option(None, "PNG file to draw the changes to."),
    json: Json = False,
) -> None:
    """List what has changed from one map to another: doors, passages, furniture that is gone."""
    from navfw.mapping import changes_between

    with quiet_stdout():
        old, new = _find_map(before), _find_map(after)
        changes = changes_between(old, new)
        if out is not None:
            from navfw.recording.plan_picture import draw_map

            draw_map(out, old, _outline_for(old, world), changes=changes)
    picture = None if out is None else str(out)
    data = {"a": old.name, "b": new.name, "picture": picture}
    lines = [str(change) for change in changes] or ["no changes"]
    lines += [] if out is None else [f"picture {out}"]
    rows = [asdict(change) for change in changes]
    assumed = (*old.all_assumed, *new.all_assumed)
    print_result(plain_json({**data, "changes": rows}), lines, json=json, assumed=assumed)


def build(
    world: World,
    out: Path = option(..., "Map file to write."),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Build a draft of a map from a world."""
    from navfw.sim.scene_geometry import SceneGeometry
    from navfw.sim.worldfile import load_world
    from navfw.topomap.clearance_grid import ClearanceGrid
    from navfw.topomap.map_builder import build_map
    from navfw.topomap.map_formats import save_map

    with quiet_stdout():
        spec = load_world(find("world", world))
        plan = SceneGeometry.from_world(spec)
        rooms = {room.name: (*room.x, *room.y) for room in spec.rooms}
        with ProgressBar("map build", quiet=quiet) as bar:
            bar.show_part("clearances")
            grid = ClearanceGrid.of(plan.bounds, plan.near_clearances)
            topo_map = build_map(spec.name, grid, rooms=rooms, report=bar.show_part)
        save_map(topo_map, out)
    next_step = f"view it with navfw map show {out} --world {world}, then name its places"
    _print_written(topo_map, out, next_step, json=json)


def convert(
    source: str = argument(..., "Name or file of a map.", metavar="IN"),
    out: Path = argument(..., "File to write: .yaml, .graphml or .geojson."),
    both_ways: bool = option(False, "Make one-way edges two-way.", "--both-ways"),
    json: Json = False,
) -> None:
    """Convert a map to another format. Formats: YAML, GraphML, GeoJSON of Nav2's route server."""
    from navfw.topomap.map_formats import save_map

    with quiet_stdout():
        topo_map = _find_map(source, both_ways)
        save_map(topo_map, out)
    _print_written(topo_map, out, json=json)


def _print_written(topo_map: TopoMap, file: Path, *more: str, json: bool) -> None:
    places, edges = len(topo_map.places), len(topo_map.passages)
    data = {"map": topo_map.name, "places": places, "edges": edges, "file": str(file)}
    lines = (f"{file}: {places} places, {edges} edges", *more)
    print_result(data, lines, json=json, assumed=topo_map.all_assumed)


def export(
    world: World,
    out: Path = option(..., "Yaml file to write; its image is beside it."),
    resolution: float = option(0.05, "Edge of a cell [m]."),
    walls_only: bool = option(
        False, "Leave out furniture, drops and closed doors.", "--walls-only"
    ),
    image: str = option("pgm", "Format of the image: pgm, png or bmp."),
    json: Json = False,
) -> None:
    """Export a world's floor plan for ROS' map_server, as Nav2 uses it."""
    from navfw.sim.worldfile import load_world
    from navfw.topomap.occupancy_map import save_ros_map
    from navfw.worldgen.plan_exchange import exported_plan

    with quiet_stdout():
        plan = exported_plan(load_world(find("world", world)), resolution, walls_only=walls_only)
        picture = save_ros_map(plan, out, f".{image.removeprefix('.').lower()}")
    rows, columns = plan.cells.shape
    summary = {
        "file": str(out),
        "image": str(picture),
        "cells": [columns, rows],
        "resolution_m": resolution,
        "occupied": int(plan.occupied.sum()),
    }
    line = f"{out}, {picture}: {columns} x {rows} cells of {resolution:g} m"
    print_result(summary, (line,), json=json)


def plan(
    map_: Map,
    start: str = argument(..., "Name of a place, or x,y [m]."),
    goal: str = argument(..., "Name of a place, or x,y [m]."),
    avoid: list[str] | None = option(None, "Close the passage PLACE:PLACE. May be repeated."),
    world: str | None = option(
        None, "World to draw in the plot [default: the world with the map's name]."
    ),
    plot: Path | None = option(None, "PNG file to draw the route to."),
    json: Json = False,
) -> None:
    """Plan a route without driving it. Lists the cost of each passage and the rules behind it."""
    from navfw.papfis.route_plan import plan_route

    with quiet_stdout():
        topo_map = _find_map(map_)
        made = plan_route(topo_map, start, goal, avoid=avoid or [])
        route: dict[str, Any] = {"map": topo_map.name, **made.explain()}
        if plot is not None:
            from navfw.recording.plan_picture import draw_map

            draw_map(
                plot, topo_map, _outline_for(topo_map, world), made.route, avoid=route["closed"]
            )
            route["plot"] = str(plot)
    if json:
        print_json(route)
    else:
        _print_route(route, start, goal)


def _print_route(route: dict[str, Any], start: str, goal: str) -> None:
    echo(
        f"{start} to {goal}: {route['length']:.1f} m, cost {route['cost']:.1f},"
        f" {len(route['places'])} places"
    )
    names = route["places"]
    rows = [
        (
            names[i + 1],
            f"{passage['length']:.2f}",
            f"{passage['cost']:.2f}",
            f"{passage['penalty']:.2f}" + (", avoided" if passage["avoided"] else ""),
            "; ".join(f"{rule['strength']:.2f} {rule['rule']}" for rule in passage["rules"][:2]),
        )
        for i, passage in enumerate(route["passages"])
    ]
    if names:
        echo(f"first {names[0]}, then")
    print_table(["to", "m", "cost", "penalty", "because"], rows, "no passages")
    if "plot" in route:
        echo(f"plot {route['plot']}")


def learn_landmarks(
    world: World,
    mission: Mission,
    stack: Stack = "default",
    out: Path | None = option(None, "Map file to write [default: MAP-learnt.yaml]."),
    seed: NoiseSeed = 0,
    least: int = option(3, "Least number of observations of a landmark.", min=1, max=1000),
    json: Json = False,
) -> None:
    """Add detected landmarks to a map. Drives a mission, and writes its map with them."""
    with quiet_stdout():
        from navfw.missions.session_setup import prepare
        from navfw.suite.learning_drives import learn_landmarks as learn
        from navfw.topomap.map_formats import save_map

        session = prepare(world, mission, seed=seed, stack=stack)
        name = Path(session.stack.topo_map.name).name
        path = out or Path(f"{name}-learnt.yaml")
        output_file(path, "--out")
        topo_map, data = learn(session, least=least)
        save_map(topo_map, path)
        result = plain_json({**data, "file": str(path)})
    if json:
        print_json(result)
        return
    columns = (
        Column("landmark", "identity"),
        Column("x", "x", ".2f"),
        Column("y", "y", ".2f"),
        Column("observations", "observations"),
        Column("sigma [m]", "sigma_m", ".2f"),
        Column("error [m]", "error_m", ".2f", missing=""),
    )
    table = ResultTable("", columns, result["landmarks"])
    print_table(table.head, table.rows, "no landmarks")
    echo(f"{result['reason']}; {path}: {result['learnt']} landmarks learnt")


def learn_situations(
    suite: str = argument("situations", "Name or file of a suite.", metavar="SUITE"),
    seeds: str = option("7000:7005", "Seeds from A to B - 1.", metavar="A:B"),
    out: Path = option(Path("situations.yaml"), "File to write."),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Learn a table of how often OFFIS infers each situation at each kind of place."""
    with quiet_stdout():
        from navfw.plugins import default_registry
        from navfw.suite.learning_drives import learn_situations, tables
        from navfw.suite.suite_plan import plan_runs
        from navfw.suite.suitefile import load_suite, parse_seeds

        output_file(out, "--out")
        registry = default_registry()
        plan = plan_runs(load_suite(suite), parse_seeds(seeds), registry)
        with ProgressBar("learn", quiet=quiet) as bar:
            table, data = learn_situations(plan, registry, bar.show_part)
        provenance = f"navfw map learn-situations {suite} --seeds {seeds}: {data['drives']} drives"
        write_text(out, table.text(provenance), parents=True)
    if json:
        print_json({"file": str(out), **data})
    else:
        print_tables(tables(data))
        echo(f"table: {out}; use it with --set topological.discrete.situations={out}")


def _find_map(name: str, both_ways: bool = False) -> TopoMap:
    """Return the map called ``name``, or in the file ``name`` of any supported format."""
    from navfw.features.landmark_appearance import check_landmark_kind
    from navfw.topomap.map_formats import SUFFIXES, load_any_map

    path = Path(name)
    suffix = path.suffix.lower()
    foreign = suffix not in {".yaml", ".yml"} and (suffix in SUFFIXES or is_file(path))
    return load_any_map(path if foreign else find("map", name), both_ways, check_landmark_kind)


def _floor_plan(topo_map: TopoMap, world: str | None) -> SceneGeometry | None:
    """Return the floor plan of ``world``, or of the world with the map's name; None without one."""
    from navfw.sim.scene_geometry import SceneGeometry
    from navfw.sim.worldfile import load_world

    if world is None:
        worlds = {world_file.name: world_file.path for world_file in list_files("world")}
        file = worlds.get(topo_map.name)
    else:
        file = find("world", world)
    return None if file is None else SceneGeometry.from_world(load_world(file))


def _outline_for(topo_map: TopoMap, world: str | None) -> WorldOutline | None:
    from navfw.missions.run_drawing import outline_of

    plan = _floor_plan(topo_map, world)
    return None if plan is None else outline_of(plan)


group = command_group("Show, check, compare, build, teach and convert maps; plan on them.")
_COMMANDS: tuple[Callable[..., None], ...] = (
    *(show, check, diff, build, teach, name, plan, learn_landmarks, learn_situations),
    *(convert, export),
)
for _command in _COMMANDS:
    group.command()(_command)
