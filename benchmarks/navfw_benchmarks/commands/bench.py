"""Measure accuracy and computing time."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

from navfw.cli.options import Json, NoiseSeed, Robot, Stack, command_group, of_robot
from navfw.cli.output import print_json, print_tables, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError

if TYPE_CHECKING:
    from navfw.plugins import Registry
    from navfw.process.result_table import ResultTable
    from navfw.process.work_progress import ProgressCallback

_SPLITS = ("tuning", "test", "all")


def _bench(
    command: str,
    options: Mapping[str, object],
    measure: Callable[[ProgressCallback], dict[str, Any]],
    tables: Callable[[dict[str, Any]], Iterable[ResultTable]],
    *,
    json: bool,
    quiet: bool,
) -> None:
    """Measure with a progress bar, add the provenance, and print the result as JSON or ``tables``.

    ``options`` are those that repeat the measurement.
    """
    with quiet_stdout():
        from navfw.recording import code_revision, machine_kind

        with ProgressBar("bench", quiet=quiet) as bar:
            result = measure(bar.show_part)
        items = {name: v if isinstance(v, list) else [v] for name, v in options.items()}
        words = (w for name in items for item in items[name] for w in (f"--{name}", str(item)))
        result["provenance"] = {
            "command": f"navfw bench {command} {shlex.join(words)}".rstrip(),
            "seeds": str(options.get("seed", "")),
            "revision": code_revision(),
            "machine": machine_kind(),
        }
    if json:
        print_json(result)
    else:
        print_tables(tables(result))


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
    """Time the whole loop, and rendering with physics only. Runs on one core."""
    with quiet_stdout():
        from navfw.missions.session_setup import prepare
        from navfw_benchmarks.bench.loop_timing import bench_loop, tables

        session = prepare(world, mission, seed=seed, stack=stack, overrides=of_robot(robot))
    options = {"world": world, "mission": mission, "seed": seed, "stack": stack}
    options |= {} if robot is None else {"robot": robot}
    options |= {"seconds": f"{seconds:g}", "repeats": repeats}
    measure = partial(bench_loop, session, seconds, repeats)
    _bench("loop", options, measure, tables, json=json, quiet=quiet)


def gym(
    family: Annotated[str, typer.Option(help="Family of the world.")] = "rooms",
    steps: Annotated[int, typer.Option(min=1, max=10_000, help="Steps of one run.")] = 200,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Number of runs.")] = 5,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Time steps and resets of Gymnasium environments. Needs the extra gym."""
    with quiet_stdout():
        from navfw_benchmarks.bench.step_timing import bench_gym, tables

    options = {"family": family, "steps": steps, "repeats": repeats}
    measure = partial(bench_gym, family, steps, repeats)
    _bench("gym", options, measure, tables, json=json, quiet=quiet)


_RandomViews = Annotated[int, typer.Option(min=12, help="Number of random views.")]
_Comparisons = Annotated[
    int, typer.Option(min=10, help="Random inputs for each rule base, also by scikit-fuzzy.")
]
_ViewSeed = Annotated[
    int | None, typer.Option(min=0, help="Seed of the random views; by default the held-out one.")
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Processes for the parts not timed; by default one per core."),
]


def perception(
    poses: _RandomViews = 1000,
    comparisons: _Comparisons = 10_000,
    seed: _ViewSeed = None,
    workers: Workers = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure accuracy and speed of perception."""
    with quiet_stdout():
        from navfw.process.process_resources import usable_cores
        from navfw_benchmarks.bench import perception_benchmark as run
        from navfw_benchmarks.bench.perception_accuracy import HELD_OUT_SEED

        seed = HELD_OUT_SEED if seed is None else seed
    options = {"poses": poses, "comparisons": comparisons, "seed": seed}
    measure = partial(run.bench_perception, poses, comparisons, seed, workers or usable_cores())
    _bench("perception", options, measure, run.tables, json=json, quiet=quiet)


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
        from navfw_benchmarks.bench.planning_time import bench_planning, tables

    options = {"places": places, "repeats": repeats, "seed": seed}
    measure = partial(bench_planning, places, repeats, seed)
    _bench("planning", options, measure, tables, json=json, quiet=quiet)


def flow(
    data: Annotated[
        Path | None, typer.Option(help="Folder with the data sets hololens_office and tum_fr1.")
    ] = None,
    places: Annotated[
        int,
        typer.Option(min=0, max=1000, help="Poses in each rendered world; 0: recorded pairs only."),
    ] = 6,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the rendered pairs.")] = 0,
    part: Annotated[
        str, typer.Option(help="Pairs of each sequence, by their number: all, odd or even.")
    ] = "all",
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure cost, error and sigma of flow. Compares the processors with OpenCV's."""
    with quiet_stdout():
        from navfw_benchmarks.bench import flow_comparison

    parts = flow_comparison.PARTS
    if part not in parts:
        raise InputError(f"must be one of {', '.join(parts)}, got {part!r}", key="--part")
    if data is None and not places:
        raise InputError("must be at least 1 without --data, got 0", key="--places")

    def measure(report: ProgressCallback) -> dict[str, Any]:
        report("reading and rendering pairs")
        sets = [] if data is None else flow_comparison.recorded_sets(data, parts[part])
        sets += [flow_comparison.rendered_set(places, seed, parts[part])] if places else []
        return flow_comparison.bench_flow_sets(sets, report=report)

    options = {"places": places, "seed": seed, "part": part} | ({"data": "DIR"} if data else {})
    _bench("flow", options, measure, flow_comparison.tables, json=json, quiet=quiet)


def landmarks(
    views: Annotated[
        int, typer.Option(min=1, max=1000, help="Views at each distance and angle.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the views and their noise.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure landmark recognition. Varies distance and angle, and measures the time per frame."""
    with quiet_stdout():
        from navfw_benchmarks.bench.landmark_recognition import bench_landmarks, tables

    options = {"views": views, "seed": seed}
    measure = partial(bench_landmarks, views, seed)
    _bench("landmarks", options, measure, tables, json=json, quiet=quiet)


_Split = Annotated[str, typer.Option(help="Labelled frames: tuning, test or all.")]
_Flows = Annotated[
    list[str] | None,
    typer.Option(help="Flow processor, repeatable. Default: perceive's and OpenCV's."),
]


def real(
    data: Annotated[Path, typer.Option(help="Folder of the recordings.")],
    split: _Split = "test",
    flow: _Flows = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge perception on real frames by labels. Counts right, partly right, wrong and silent."""
    with quiet_stdout():
        from navfw_benchmarks.bench import real_benchmark

    options = {"data": "DIR", "split": split, "flow": flow or []}
    _judge("real", options, partial(real_benchmark.bench_real, data), json=json, quiet=quiet)


def scenes(
    count: Annotated[int, typer.Option(min=1, max=1000, help="Sequences of each kind.")] = 8,
    split: _Split = "test",
    flow: _Flows = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge perception on hard scenes, rendered. Gloss, low things, blur and other kinds."""
    with quiet_stdout():
        from navfw_benchmarks.bench import real_benchmark

    options = {"count": count, "split": split, "flow": flow or []}
    _judge("scenes", options, partial(real_benchmark.bench_scenes, count), json=json, quiet=quiet)


def _judge(
    command: str,
    options: Mapping[str, Any],
    measure: Callable[[str, list[str], Registry, ProgressCallback], dict[str, Any]],
    *,
    json: bool,
    quiet: bool,
) -> None:
    """Judge the sentences of a split with each flow processor, by default four."""
    with quiet_stdout():
        from navfw.perceive.perceiver_options import PerceiverOptions
        from navfw.plugins import default_registry
        from navfw_benchmarks.bench.real_benchmark import tables

        registry = default_registry()
    split = options["split"]
    if split not in _SPLITS:
        raise InputError(f"must be one of {', '.join(_SPLITS)}, got {split!r}", key="--split")
    names = options["flow"] or [PerceiverOptions().flow, "dis", "lucas_kanade", "farneback"]
    _bench(
        command, options, partial(measure, split, names, registry), tables, json=json, quiet=quiet
    )


def explain(
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run folders; by default four drives are recorded.")
    ] = None,
    decisions: Annotated[int, typer.Option(min=1, max=10_000, help="Number of decisions.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the drives and decisions.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check explanations of decisions. Applies each change that would have turned one."""
    with quiet_stdout():
        from navfw_benchmarks.bench import explained_decisions

    def measure(report: ProgressCallback) -> dict[str, Any]:
        with TemporaryDirectory() as folder:
            of = runs or explained_decisions.recorded_runs(Path(folder), seed, report)
            return explained_decisions.bench_explain(of, decisions, seed, report)

    options = {"decisions": decisions, "seed": seed}
    _bench("explain", options, measure, explained_decisions.tables, json=json, quiet=quiet)


bench = command_group("Measure accuracy and computing time.")
for _command in (loop, perception, flow, real, scenes, planning, landmarks, gym, explain):
    bench.command()(_command)
