"""``navfw run WORLD MISSION``: drive a mission, show its progress, and write a run folder."""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer

from navfw.cli import options
from navfw.cli.options import option
from navfw.cli.output import NOT_SAVED, echo, print_assumed, quiet_stdout, show_result
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.cli.recordings import VIDEO, write_video
from navfw.cli.supervisor import PATIENCE, announce
from navfw.cli.warm import compile_with_progress
from navfw.config.lookup import list_missions
from navfw.errors import InputError
from navfw.process.interruption import check_interrupted, deferred, interruptible
from navfw.process.last_trace import ended_after
from navfw.recording.run_folder import RunFolder, plain_json

if TYPE_CHECKING:
    from navfw.missions.missionfile import Destination
    from navfw.missions.pilot import TickView
    from navfw.missions.session import MissionResult, Session
    from navfw.recording.channel_list import SeenRun
    from navfw.recording.live_server import LiveServer
    from navfw.signals import Waypoint


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Arguments and options of ``navfw run``."""

    world: options.World
    mission: options.Mission = ""
    goal: str | None = option(
        None,
        "A place or point [m] to drive to from the start of the first mission, instead of MISSION.",
        metavar="PLACE|X,Y",
    )
    map_: str | None = option(
        None,
        "With --goal: name or file of another map, such as one of --explore [default: that of the"
        " first mission].",
        "--map",
        metavar="NAME",
        kind="map",
    )
    explore: bool = option(
        False,
        "Instead of MISSION: make a map of all that can be reached, from the start of the first"
        " mission.",
        "--explore",
    )
    out_map: str | None = option(
        None, "For an exploration: map to write, as maps/NAME.yaml or a .yaml file.", metavar="NAME"
    )
    keep_map: str | None = option(
        None,
        "Map to write: that of the mission, corrected by what was seen, as maps/NAME.yaml or a"
        " .yaml file.",
        metavar="NAME",
    )
    force: bool = option(False, "Let --out-map and --keep-map replace an earlier map.", "--force")
    seed: int = option(0, "Seed of all noise; the same one gives the same commands.", min=0)
    stack: str | None = option(
        None, "Name or file of a stack [default: that of the mission, or default].", kind="stack"
    )
    robot: options.Robot = None
    xacro_arg: list[str] | None = option(
        None, "For a xacro file as --robot: an argument. Repeatable.", metavar="NAME:=VALUE"
    )
    set_: list[str] | None = option(
        None,
        "Change one value, e.g. avoid.spare=0.1, mission.timeout=60, robot.radius=0.2,"
        " sensors.preset=poor. May be repeated.",
        "--set",
        autocompletion=options.complete_setting,
        metavar="K=V",
    )
    out: Path | None = option(None, "Run folder [default: runs/WORLD-MISSION-SEED].")
    record: bool = option(
        False, "Record the run as MCAP, for replay, explain and viewers.", "--record"
    )
    live: bool = option(False, "Serve the run as a page, only to this machine.", "--live")
    port: options.LivePort = 8765
    origin: list[str] | None = option(
        None,
        "With --live: an origin whose pages may read, such as https://app.foxglove.dev, if they"
        " have the address. May be repeated.",
        metavar="ORIGIN",
    )
    speed: float | None = option(
        None, "With --live: top speed; 1 is real time [default: no limit]."
    )
    wait: bool = option(False, "With --live: begin with the first viewer.", "--wait")
    stay: bool = option(False, "With --live: serve the end until Ctrl-C.", "--stay")
    video: options.Video = None
    limit: float = option(
        math.inf, "Wall-clock limit [s]. Beyond it the run is a fault.", min=1.0, show_default=False
    )
    gui: bool = option(False, "Show a window that follows the robot.", "--gui")
    json: options.Json = False
    quiet: Quiet = False


@options.from_options
def run(options: RunOptions) -> None:
    """Drive a mission. Exit with 0 for success, 1 for failure, 2 for invalid input.

    A plugin that fails often is a failure. 3: a file was not written; the result is printed.
    """
    if not options.live and (options.origin or options.speed or options.wait or options.stay):
        raise InputError("--origin, --speed, --wait and --stay need --live", key="--live")
    _run(options)


def _target(request: RunOptions) -> str | Destination | None:
    """The mission, the destination of ``--goal``, or None to explore; one of them is given."""
    from navfw.missions.missionfile import Destination

    if request.map_ is not None and request.goal is None:
        what = "needs --goal; a mission file names its map itself (--set mission.map=NAME)"
        raise InputError(what, key="--map")
    if request.explore:
        if request.mission or request.goal is not None:
            raise InputError("give a mission or goal, or --explore, not both", key="--explore")
        return None
    if request.mission and request.goal is not None:
        raise InputError("give a mission or a goal, not both", key="--goal")
    if request.goal is not None:
        point = None
        if "," in request.goal and not request.goal[:1].isalpha():
            point = options.numbers_of("--goal", request.goal, ("X", "Y"))
        goal = request.goal if point is None else (point[0], point[1])
        own = options.own_map(request.map_ or "")
        return Destination(goal, str(own) if own.is_file() else request.map_)
    if not request.mission:
        names = ", ".join(item.name for item in list_missions(request.world)) or "it has none"
        what = f"give --goal, or one of the missions of {request.world}: {names}"
        raise InputError(f"{what}; or --explore, to make a map")
    return request.mission


def _run(request: RunOptions) -> NoReturn:
    """Drive and hand over the result. No signal interrupts the printing."""
    with deferred():
        with quiet_stdout():
            result, folder, missing = _drive(request)
            where = None if folder is None else str(folder)
            summary = plain_json({**result.summary(), "run_folder": where})
        show_result(summary, missing, request.json)
        code = NOT_SAVED if missing else result.exit_code
        announce(ended=code)
        raise typer.Exit(code)


def _drive(request: RunOptions) -> tuple[MissionResult, Path | None, tuple[str, ...]]:
    """Run the mission and write its folder, after all input has been checked.

    Returns the result, the folder with it, None if it could not be written, and what is missing.
    """
    from navfw.missions.pilot import watcher_of
    from navfw.missions.run_report import RecordedFolder, default_folder, write_run
    from navfw.recording.video_output import check_video
    from navfw.sim.engine import check_display

    mission = _target(request)
    out_map, kept_map = (
        None if name is None else options.map_file(name, option, request.force)
        for name, option in ((request.out_map, "--out-map"), (request.keep_map, "--keep-map"))
    )
    if request.gui:
        check_display()
    if request.video is not None:
        check_video(request.video, VIDEO)
    with interruptible():  # up to here there is nothing to save
        session = _prepared(request, mission)
        if not request.quiet:
            _print_notes(session)
        compile_with_progress(loaded=True, quiet=request.quiet)
        server = None
        if request.live:
            shown = request.port, tuple(request.origin or ())
            server = live_server(session, *shown, speed=request.speed, wait=request.wait)
    target = RunFolder(request.out or default_folder(session), numbered=request.out is None)
    result = None
    try:
        with target:
            kept = request.record or request.video is not None
            recorded = RecordedFolder(session, target) if kept else None
            _announce(session, target, request)
            bar = ProgressBar(quiet=request.quiet)
            show = partial(show_tick, bar, session.mission.goals[-1], time.monotonic())
            with bar, ended_after(request.limit + PATIENCE):
                result = session.run(
                    *([] if server is None else [watcher_of(server.observe)]),
                    show,
                    gui=request.gui,
                    record=False if recorded is None else recorded.recorder,
                    told=(lambda _: None) if recorded is None else recorded.told,
                    limit=request.limit,
                )
            announce(driven=True)
            missing = write_run(result, target)
            _write_maps(result, out_map, kept_map)
        if server is not None:
            if request.stay:
                echo("live: the run has ended; Ctrl-C ends the server", err=True)
            server.end(f"{result.outcome}: {result.reason}", stay=request.stay)
    except InputError as error:
        if result is None:
            raise
        missing = (str(error),)
    folder = target.path if target.final is None and target.kept else target.final
    return result, folder, (*missing, *_write_video(request, target.final))


def _print_notes(session: Session) -> None:
    """Print what is assumed of robot and map, and notes on the robot."""
    from navfw.robot.urdf_measures import robot_notes

    print_assumed(session.mission.assumed)
    for note in robot_notes(session.mission.spec.robot):
        echo(f"note: {note}", err=True)


def _write_maps(result: MissionResult, out_map: Path | None, kept_map: Path | None) -> None:
    """Write the map of an exploration, and the mission's map as it was corrected."""
    from navfw.topomap.map_formats import save_map

    for file, made in ((out_map, result.explored_map), (kept_map, result.corrected_map)):
        if file is not None:
            save_map(made(file.stem), file)
            echo(f"map: {file}", err=True)


def _prepared(request: RunOptions, mission: str | Destination | None) -> Session:
    """Return the session of the run, loaded and checked."""
    from navfw.missions.session_setup import prepare

    args = json.dumps(request.xacro_arg)
    xacro = [f"robot.urdf.args={args}"] if request.xacro_arg else []
    session = prepare(
        request.world,
        mission,
        seed=request.seed,
        stack=request.stack,
        overrides=(*options.of_robot(request.robot), *xacro, *(request.set_ or ())),
    )
    check_interrupted()
    if request.out_map is not None and session.mission.spec.explore is None:
        what = "is for explorations: give --explore, or such a mission"
        raise InputError(what, key="--out-map")
    if request.keep_map is not None and session.mission.spec.explore is not None:
        raise InputError("an exploration has no map to correct; give --out-map", key="--keep-map")
    return session


def shown_live(session: Session) -> tuple[SeenRun, str]:
    """Return the content of the live server for a run: what it draws, and its page."""
    from navfw.report import live_page
    from navfw.sim.chase_view import ChaseView

    title = f"{session.world_name} / {session.mission_name}, seed {session.seed}"
    goals = [(goal.x, goal.y) for goal in session.mission.goals]
    chase = ChaseView(session.world, session.mission.spec.robot, (480, 270)).draw
    return replace(session.seen, chase=chase), live_page(title, session.seen, goals)


def live_server(
    session: Session,
    port: int,
    origins: tuple[str, ...] = (),
    *,
    speed: float | None = None,
    wait: bool = False,
) -> LiveServer:
    """Start the live server of a run, and print its address; arguments as of ``LiveServer``."""
    from navfw.recording.live_server import LiveServer

    seen, page = shown_live(session)
    server = LiveServer(seen, port, page=page, origins=origins, speed=speed, wait=wait)
    # printed with --quiet as well: without its token the address is of no use
    waits = " (the run begins with the first viewer)" if wait else ""
    echo(f"live: {server.url}{waits}", err=True)
    if origins:
        address = server.url.replace("http", "ws", 1)
        echo(f"live: {address} for Foxglove and Lichtblick", err=True)
    return server


def show_tick(bar: ProgressBar, goal: Waypoint, began: float, tick: TickView) -> None:
    """Show the progress of a run that ``began`` [s, monotonic], and its speed, in ``bar``."""
    speed = tick.time / max(time.monotonic() - began, 1e-9)
    bar.show_line(_line(tick, goal, speed, bar.width))


def _announce(session: Session, target: RunFolder, request: RunOptions) -> None:
    """Report to the supervisor what run begins."""
    about = {"world": session.world_name, "mission": session.mission_name, "seed": session.seed}
    folder = str(target.target.absolute())
    announce(run={"summary": about, "folder": folder, "as_json": request.json})


def _write_video(request: RunOptions, folder: Path | None) -> tuple[str, ...]:
    """Write the video of a run, if one was asked for; returns why it is missing, if it is."""
    if request.video is None or folder is None:
        return ()
    try:
        with interruptible():
            write_video(folder, request.video, quiet=request.quiet)
    except KeyboardInterrupt:
        return (f"{request.video} is missing: interrupted",)
    except InputError as error:
        return (f"the video is missing: {error}",)
    return ()


def _line(tick: TickView, goal: Waypoint, speed: float, width: int) -> str:
    """Where the run is; who leads, to where, and what is ahead as far as the ``width`` allows.

    ``speed`` is simulated time per wall-clock time.
    """
    x, y, _ = tick.true_pose
    line = f"{tick.time:5.1f} s, {math.hypot(goal.x - x, goal.y - y):4.1f} m to go"
    place = tick.state.path[0].place if tick.state.path else ""
    towards = place and f" to {place}"
    clauses = [f", {speed:.1f} x real time"] if speed >= 0.1 else []
    clauses += [f": {tick.leader}{towards}"] if tick.leader else []
    # the objects of all layers are longer than a line
    sentence = "" if tick.percept is None else tick.percept.sentence
    seen = (" ".join(clause.split()) for clause in sentence.split(";"))
    clauses += [f"; {clause}" for clause in seen if clause and not clause.startswith("Layer")]
    for clause in clauses:
        if len(line) + len(clause) > width:
            break
        line += clause
    return line
