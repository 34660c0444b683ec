"""``navfw bench``: what the loop and planning cost, how right perception is and what it costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.bench_landmarks import landmarks
from navfw.cli.options import Json, NoiseSeed, Stack
from navfw.cli.output import print_json, print_table, print_tables, quiet_stdout, say

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add ``bench`` with its commands."""
    group = typer.Typer(
        help="Measure how good things are, and what they cost.", no_args_is_help=True
    )
    group.command()(loop)
    group.command()(perception)
    group.command()(planning)
    group.command()(landmarks)
    app.add_typer(group, name="bench")


def loop(
    world: Annotated[str, typer.Option(help="A world's name or file.")] = "office",
    mission: Annotated[str, typer.Option(help="A mission of that world.")] = "lobby-to-lab",
    seed: NoiseSeed = 0,
    stack: Stack = "default",
    seconds: Annotated[
        float, typer.Option(min=1.0, max=600.0, help="Simulated time of a lap.")
    ] = 20.0,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="How many laps.")] = 3,
    json: Json = False,
) -> None:
    """Time the whole loop, and PyBullet's rendering with physics alone, on one core."""
    with quiet_stdout():
        from navfw.missions.loop_timing import bench_loop
        from navfw.missions.session import prepare

        session = prepare(world, mission, seed=seed, stack=stack)
        result = bench_loop(session, seconds, repeats, say)
    if json:
        print_json(result)
    else:
        _print(result)


def perception(
    poses: Annotated[int, typer.Option(min=12, help="Random views.")] = 1000,
    comparisons: Annotated[
        int, typer.Option(min=10, help="Random inputs of each rule base, by scikit-fuzzy, too.")
    ] = 10_000,
    places: Annotated[
        int, typer.Option(min=1, help="Poses in each world for the flow's errors.")
    ] = 20,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Of the random views; by default the held-out one."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Processes, for what is not timed; by default one a core."),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            help="A folder with the recorded data: approach, tum_fr1.", show_default=False
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write a page with all tables and plots to this folder.", show_default=False
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Measure perception: accuracy against geometry, flow, speed, recorded images."""
    with quiet_stdout():
        from navfw.bench.perception import (
            Extent,
            bench_perception,
            cores,
            find_data,
            page_folder,
            tables,
            write_page,
        )
        from navfw.recording.run_folder import plain_json

        recorded = None if data is None else find_data(data)
        folder = None if out is None else page_folder(out)
        result = plain_json(
            bench_perception(
                Extent(poses=poses, comparisons=comparisons, places=places),
                seed,
                workers or cores(),
                recorded,
                say,
            )
        )
        if folder is not None:
            with folder:
                write_page(result, folder.path)
    if json:
        print_json(result)
        return
    print_tables(tables(result))
    if out is not None:
        typer.echo(f"page {out / 'index.md'}")


def planning(
    places: Annotated[
        int, typer.Option(min=100, max=200_000, help="Of the generated map.")
    ] = 10_000,
    repeats: Annotated[int, typer.Option(min=3, max=1000, help="Ways to plan.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the map and the ways.")] = 0,
    json: Json = False,
) -> None:
    """Time PAPFIS on a large map, beside A* of networkx on the same costs."""
    with quiet_stdout():
        from navfw.bench.planning import bench_planning

        result = bench_planning(places, repeats, seed)
    if json:
        print_json(result)
        return
    typer.echo(f"{result['places']} places, {result['passages']} passages, {repeats} ways [ms]")
    rows = [
        (what, *(f"{result[key][part]:.1f}" for part in ("median", "min", "max")))
        for what, key in (
            ("all costs, at load", "costs_ms"),
            ("first plan", "first_plan_ms"),
            ("new plan after closing", "replan_ms"),
            ("networkx.astar_path", "networkx_ms"),
        )
    ]
    print_table(["", "median", "least", "most"], rows, "nothing")
    typer.echo(
        f"first plan {result['first_plan_over_networkx']:.2f} times networkx,"
        f" new plan {result['replan_over_networkx']:.2f} times"
    )


def _print(result: dict[str, Any]) -> None:
    typer.echo(
        f"loop {result['loop_wall_s']:.2f} s for {result['sim_time_s']:.1f} simulated:"
        f" {result['real_time_factor']:.1f} x real time"
    )
    for whose, wall, ratio in (
        ("PyBullet's", "render_physics_wall_s", "loop_over_render"),
        ("our own", "own_render_physics_wall_s", "loop_over_own_render"),
    ):
        low, high = result["spread"][ratio]
        typer.echo(
            f"{whose} rendering and physics alone {result[wall]:.2f} s:"
            f" the loop takes {result[ratio]:.2f} times that ({low:.2f} to {high:.2f})"
        )
    typer.echo(f"a frame takes PyBullet {result['pybullet_render_ms']:.2f} ms")
    typer.echo("per camera frame:")
    for stage, milliseconds in result["stage_ms"].items():
        typer.echo(f"  {stage:<12} {milliseconds:7.2f} ms")
    if result["peak_memory_mb"] is not None:
        typer.echo(f"peak memory {result['peak_memory_mb']:.0f} MB")
