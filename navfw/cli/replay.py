"""``navfw replay`` of recorded runs and bags, ``navfw export``; bags are in the formats of ROS."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import typer

from navfw.cli.options import (
    ImuAxes,
    Json,
    Recorded,
    Robot,
    Topic,
    Video,
    argument,
    complete_setting,
    from_options,
    numbers_of,
    option,
)
from navfw.cli.output import print_assumed, print_result, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.cli.recordings import VIDEO, chase_of, write_video
from navfw.errors import InputError
from navfw.process.atomic import write_text
from navfw.recording.run_folder import REPORT, is_bag


def export(
    folder: Recorded,
    to: Path = option(..., "Folder of the bag to write.", metavar="DIR"),
    json: Json = False,
) -> None:
    """Write a recorded run as a bag of ROS 2."""
    with quiet_stdout():
        from navfw.recording.recorded_run import export_bag

        counts = export_bag(folder, to)
    lines = [*(f"  {count:6d}  {topic}" for topic, count in counts.items()), f"bag: {to}"]
    print_result({"bag": str(to), "messages": counts}, lines, json=json)


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """Arguments and options of ``navfw replay``."""

    folder: Path = argument(
        ..., "Folder of navfw run --record, or a bag of ROS.", metavar="RUN_FOLDER|BAG"
    )
    robot: Robot = None
    map_name: str | None = option(
        None, "For a bag: name or file of a map [default: the path driven].", "--map"
    )
    goal: list[str] | None = option(
        None, "For a bag: a place of --map to drive to. May be repeated."
    )
    start: str | None = option(
        None, "For a bag: start on --map [m, rad] [default: unknown].", metavar="X,Y,YAW"
    )
    stack: str | None = option(None, "Another stack, by name or file [default: the run's].")
    overrides: list[str] | None = option(
        None,
        "Change one value, e.g. avoid.spare=0.1. May be repeated.",
        "--set",
        autocompletion=complete_setting,
        metavar="K=V",
    )
    rules: list[Path] | None = option(
        None, "File of rules that replaces the one of its name. May be repeated."
    )
    topic: Topic = None
    imu_axes: ImuAxes = None
    report: bool = option(
        False, "With a changed stack: write its commands into the report.", "--report"
    )
    out: Path | None = option(None, "For a bag: run folder [default: runs/BAG-replay].")
    video: Video = None
    json: Json = False
    quiet: Quiet = False


_OF_BAGS = ("robot", "map_name", "goal", "start", "topic", "imu_axes", "out")
"""The options that are only for bags."""


@from_options
def replay(options: ReplayOptions) -> None:
    """Run the stack on recorded readings. Exit with 1 if the commands differ.

    With --set, --stack or --rules, print what a changed stack would have commanded. For a bag,
    print what the stack would have commanded, and write a run folder.
    """
    if options.video is not None:
        from navfw.recording.video_output import check_video

        check_video(options.video, VIDEO)
    if is_bag(options.folder):
        if options.overrides or options.rules:
            raise typer.BadParameter("is for a run folder", param_hint="--set, --rules")
        target = _replay_bag(options)
        if options.video is not None:
            write_video(target, options.video, quiet=options.json or options.quiet)
        return
    for name in _OF_BAGS:
        if getattr(options, name):
            hint = f"--{name.removesuffix('_name').replace('_', '-')}"
            raise typer.BadParameter("is for a bag", param_hint=hint)
    if options.overrides or options.rules or options.stack is not None:
        _what_if(options)
    elif options.report:
        raise typer.BadParameter("needs --set, --stack or --rules", param_hint="--report")
    else:
        _replay_run(options)


def _replay_bag(options: ReplayOptions) -> Path:
    """Replay a bag, print the result, and return the run folder that was written."""
    path, out, name, goals = options.folder, options.out, options.map_name, options.goal
    with ProgressBar("replay", "ticks", quiet=options.quiet) as bar, quiet_stdout():
        from navfw.recording import Bag, RunFolder
        from navfw.robot.robotfile import load_robot
        from navfw.ros import BagReplay, driven_map
        from navfw.signals import Pose
        from navfw.topomap import load_map

        target = RunFolder(out or Path("runs") / f"{path.stem}-replay", numbered=out is None)
        bag = Bag(path, options.topic, options.imu_axes)
        topo_map = driven_map(bag) if name is None else load_map(name)
        if name is not None and not goals:
            places = ", ".join(topo_map.places)
            raise InputError(f"--map needs a place to drive to: {places}", key="--goal")
        at = numbers_of("--start", options.start if name else "0,0,0", ("X", "Y", "YAW"))
        places_to = (goals if name else None) or list(topo_map.places)[1:]
        begin = None if at is None else Pose(*at)
        model, stack = load_robot(options.robot or "default"), options.stack or "default"
        with target:
            run = BagReplay(bag, model, topo_map, begin, places_to, stack)
            result = run.run(target, bar.update)
    final = target.final or target.target
    lines = [f"replayed {result['sim_time_s']:.1f} s at {result['real_time_factor']:.1f} x"]
    lines += [*(f"  {note}" for note in result["notes"]), f"  run folder  {final}"]
    print_assumed(bag.assumed)
    shown = {key: result[key] for key in result if key not in {"config", "machine"}}
    print_result({**shown, "run_folder": str(final)}, lines, json=options.json)
    return final


def _what_if(options: ReplayOptions) -> None:
    """Print what a changed stack would have commanded; write it into the report as well."""
    folder, stack = options.folder, options.stack
    overrides, rules = options.overrides or [], options.rules or []
    with quiet_stdout():
        from navfw.recording.what_if import what_if, what_if_lines

        changed = what_if(folder, overrides, stack, rules)
        data, lines = changed.as_data(), what_if_lines(changed)
        if options.report:
            from navfw.report.run_page import ChangedRun, run_report

            changes = ", ".join([*overrides, *map(str, rules), *filter(None, [stack])])
            page = run_report(folder, chase_of(folder), ChangedRun(changes, changed))
            write_text(folder / REPORT, page)
            target = str(folder / REPORT)
            data, lines = {**data, "report": target}, [*lines, f"report: {target}"]
    print_result(data, lines, json=options.json)


def _replay_run(options: ReplayOptions) -> None:
    with quiet_stdout():
        from navfw.recording.run_replay import replay as run_again

        result = run_again(options.folder)
        if options.video is not None:
            write_video(options.folder, options.video, quiet=options.json)
    data = {**asdict(result), "same": result.same}
    ending = "" if result.complete else " (the recording ends before its run did)"
    lines = [f"same commands in all {result.ticks} ticks{ending}"]
    if not result.same:
        first = result.first_difference
        lines = [f"different commands from tick {first} of {result.ticks} on{ending}"]
        lines.append(f"  recorded  {result.recorded_hash}")
    print_result(data, [*lines, f"  commands  {result.command_hash}"], json=options.json)
    raise typer.Exit(0 if result.same else 1)
