"""``navfw plan MAP START GOAL``: the way through a map, and why it is the cheapest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import Json, Map
from navfw.cli.output import print_json, print_table, quiet_stdout

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(plan)


def plan(
    map_: Map,
    start: Annotated[str, typer.Argument(help="A place, or x,y in metres.")],
    goal: Annotated[str, typer.Argument(help="A place, or x,y in metres.")],
    avoid: Annotated[
        list[str] | None,
        typer.Option(help="A passage not to take, PLACE:PLACE; may be repeated."),
    ] = None,
    world: Annotated[
        str | None, typer.Option(help="The world under the plot [default: of the map's name].")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the way over the map: a PNG file.", show_default=False)
    ] = None,
    json: Json = False,
) -> None:
    """Plan a way without driving it; tell what each passage costs, rule by rule."""
    from navfw.cli.map_inputs import find_map, outline_for
    from navfw.papfis.route_plan import plan_route

    with quiet_stdout():
        topo_map = find_map(map_)
        made = plan_route(topo_map, start, goal, avoid=avoid or [])
        told: dict[str, Any] = {"map": topo_map.name, **made.explain()}
        if plot is not None:
            from navfw.recording.map_picture import draw_map

            draw_map(plot, topo_map, outline_for(topo_map, world), made.route, avoid=told["closed"])
            told["plot"] = str(plot)
    if json:
        print_json(told)
    else:
        _print(told, start, goal)


def _print(told: dict[str, Any], start: str, goal: str) -> None:
    typer.echo(
        f"{start} to {goal}: {told['length']:.1f} m, cost {told['cost']:.1f},"
        f" {len(told['places'])} places"
    )
    names = told["places"]
    rows = [
        (
            names[i + 1],
            f"{passage['length']:.2f}",
            f"{passage['cost']:.2f}",
            f"{passage['penalty']:.2f}" + (", avoided" if passage["avoided"] else ""),
            "; ".join(f"{rule['strength']:.2f} {rule['rule']}" for rule in passage["rules"][:2]),
        )
        for i, passage in enumerate(told["passages"])
    ]
    if names:
        typer.echo(f"first {names[0]}, then")
    print_table(["to", "m", "cost", "penalty", "because"], rows, "straight on")
    if "plot" in told:
        typer.echo(f"plot {told['plot']}")
