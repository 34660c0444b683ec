"""``navfw plan MAP START GOAL``: the cheapest route through a map, with its costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import Json, Map
from navfw.cli.output import print_json, print_table, quiet_stdout


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(plan)


def plan(
    map_: Map,
    start: Annotated[str, typer.Argument(help="Name of a place, or x,y [m].")],
    goal: Annotated[str, typer.Argument(help="Name of a place, or x,y [m].")],
    avoid: Annotated[
        list[str] | None,
        typer.Option(help="Close the passage PLACE:PLACE. May be repeated."),
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(help="World to draw in the plot [default: the world with the map's name]."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="PNG file to draw the route to.", show_default=False)
    ] = None,
    json: Json = False,
) -> None:
    """Plan a route without driving it. Lists the cost of each passage and the rules behind it."""
    from navfw.cli.map_inputs import find_map, outline_for
    from navfw.papfis.route_plan import plan_route

    with quiet_stdout():
        topo_map = find_map(map_)
        made = plan_route(topo_map, start, goal, avoid=avoid or [])
        route: dict[str, Any] = {"map": topo_map.name, **made.explain()}
        if plot is not None:
            from navfw.recording.map_picture import draw_map

            draw_map(
                plot, topo_map, outline_for(topo_map, world), made.route, avoid=route["closed"]
            )
            route["plot"] = str(plot)
    if json:
        print_json(route)
    else:
        _print(route, start, goal)


def _print(route: dict[str, Any], start: str, goal: str) -> None:
    typer.echo(
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
        typer.echo(f"first {names[0]}, then")
    print_table(["to", "m", "cost", "penalty", "because"], rows, "no passages")
    if "plot" in route:
        typer.echo(f"plot {route['plot']}")
