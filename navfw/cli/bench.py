"""``navfw bench``: time of the loop and of planning; accuracy and time of perception."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.bench_flow import flow
from navfw.cli.bench_landmarks import landmarks
from navfw.cli.bench_real import real
from navfw.cli.options import Json, NoiseSeed, Robot, Stack, of_robot
from navfw.cli.output import print_json, print_table, print_tables, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet


def add_to(app: typer.Typer) -> None:
    """Add ``bench`` with its commands."""
    group = typer.Typer(help="Measure accuracy and computing time.", no_args_is_help=True)
    group.command()(loop)
    group.command()(perception)
    group.command()(flow)
    group.command()(real)
    group.command()(planning)
    group.command()(landmarks)
    app.add_typer(group, name="bench")


def loop(
    world: Annotated[str, typer.Option(help="Name or file of a world.")] = "office",
    mission: Annotated[str, typer.Option(help="Name of a mission of that world.")] = "lobby-to-lab",
    seed: NoiseSeed = 0,
    stack: Stack = "default",
    robot: Robot = None,
    seconds: Annotated[
        float, typer.Option(min=1.0, max=600.0, help="Simulated time of one lap [s].")
    ] = 20.0,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Number of laps.")] = 3,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Time the whole loop, and rendering with physics alone. Runs on one core."""
    with quiet_stdout():
        from navfw.missions.loop_timing import bench_loop
        from navfw.missions.session import prepare
        from navfw.recording.provenance import provenance

        session = prepare(world, mission, seed=seed, stack=stack, overrides=of_robot(robot))
        with ProgressBar("bench", quiet=quiet) as bar:
            result = bench_loop(session, seconds, repeats, bar.show_part)
        options = {"world": world, "mission": mission, "seed": seed, "stack": stack}
        options |= {} if robot is None else {"robot": robot}
        options |= {"seconds": f"{seconds:g}", "repeats": repeats}
        result["provenance"] = provenance("navfw bench loop", options)
    if json:
        print_json(result)
    else:
        _print(result)


_RandomViews = Annotated[int, typer.Option(min=12, help="Number of random views.")]
_Comparisons = Annotated[
    int, typer.Option(min=10, help="Random inputs for each rule base, also by scikit-fuzzy.")
]
_FlowPoses = Annotated[
    int, typer.Option(min=1, help="Poses in each world at which the flow is measured.")
]
_ViewSeed = Annotated[
    int | None,
    typer.Option(min=0, help="Seed of the random views; by default the held-out one."),
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Processes for the parts not timed; by default one per core."),
]
_RecordedData = Annotated[
    Path | None,
    typer.Option(help="Folder with the data sets approach and tum_fr1.", show_default=False),
]
_PageFolder = Annotated[
    Path | None,
    typer.Option(help="Folder to write a page of tables and plots to.", show_default=False),
]


def perception(
    poses: _RandomViews = 1000,
    comparisons: _Comparisons = 10_000,
    places: _FlowPoses = 20,
    seed: _ViewSeed = None,
    workers: Workers = None,
    data: _RecordedData = None,
    out: _PageFolder = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure accuracy and speed of perception. Covers flow, situations and recorded images."""
    with quiet_stdout():
        from navfw.bench.perception_benchmark import (
            SampleSizes,
            bench_perception,
            find_data,
            page_folder,
            tables,
            write_page,
        )
        from navfw.recording.provenance import provenance, usable_cores
        from navfw.recording.run_folder import plain_json

        recorded = None if data is None else find_data(data)
        folder = None if out is None else page_folder(out)
        sizes = SampleSizes(poses=poses, comparisons=comparisons, places=places)
        processes = workers or usable_cores()
        with ProgressBar("bench", quiet=quiet) as bar:
            result = plain_json(bench_perception(sizes, seed, processes, recorded, bar.show_part))
        options = {"poses": poses, "comparisons": comparisons, "places": places}
        options |= {"seed": result["accuracy"]["seed"]} | ({"data": "DIR"} if data else {})
        result["provenance"] = provenance("navfw bench perception", options)
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
        int, typer.Option(min=100, max=200_000, help="Number of places of the generated map.")
    ] = 10_000,
    repeats: Annotated[int, typer.Option(min=3, max=1000, help="Number of routes to plan.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the map and the routes.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Time planning on a large map. Compares PAPFIS with A* of networkx."""
    with quiet_stdout():
        from navfw.bench.planning_time import bench_planning
        from navfw.recording.provenance import provenance

        with ProgressBar("bench", quiet=quiet) as bar:
            result = bench_planning(places, repeats, seed, bar.show_part)
        options = {"places": places, "repeats": repeats, "seed": seed}
        result["provenance"] = provenance("navfw bench planning", options)
    if json:
        print_json(result)
        return
    typer.echo(f"{result['places']} places, {result['passages']} passages, {repeats} routes [ms]")
    rows = [
        (what, *(f"{result[key][part]:.1f}" for part in ("median", "min", "max")))
        for what, key in (
            ("all costs, when loading", "costs_ms"),
            ("first plan", "first_plan_ms"),
            ("new plan after a closure", "replan_ms"),
            ("networkx.astar_path", "networkx_ms"),
        )
    ]
    print_table(["", "median", "least", "most"], rows, "nothing")
    typer.echo(
        f"time over that of networkx: first plan {result['first_plan_over_networkx']:.2f},"
        f" new plan {result['replan_over_networkx']:.2f}"
    )


def _print(result: dict[str, Any]) -> None:
    typer.echo(
        f"loop {result['loop_wall_s']:.2f} s for {result['sim_time_s']:.1f} s simulated:"
        f" {result['real_time_factor']:.1f} x real time"
    )
    for raster, wall, ratio in (
        ("PyBullet", "render_physics_wall_s", "loop_over_render"),
        ("navfw's raster", "own_render_physics_wall_s", "loop_over_own_render"),
    ):
        low, high = result["spread"][ratio]
        typer.echo(
            f"rendering by {raster} and physics alone {result[wall]:.2f} s:"
            f" the loop takes {result[ratio]:.2f} times that ({low:.2f} to {high:.2f})"
        )
    typer.echo(f"rendering by PyBullet {result['pybullet_render_ms']:.2f} ms per frame")
    typer.echo("computing time per camera frame:")
    for stage, milliseconds in result["stage_ms"].items():
        typer.echo(f"  {stage:<12} {milliseconds:7.2f} ms")
    typer.echo(f"peak memory {result['peak_memory_mb']:.0f} MB")
