"""``navfw ros``: run the stack as a node of ROS 2, or the simulated robot as one."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand

from navfw.cli import options
from navfw.cli.options import option
from navfw.cli.output import NOT_SAVED, print_result, quiet_stdout
from navfw.cli.warm import compile_with_progress
from navfw.errors import InputError
from navfw.process.interruption import deferred, interruptible
from navfw.recording.run_folder import plain_json

if TYPE_CHECKING:
    from navfw.plugins import Registry
    from navfw.robot import RobotModel
    from navfw.ros import DriveOptions
    from navfw.signals import Waypoint
    from navfw.stack import Stack
    from navfw.topomap import TopoMap

_ROS_ARGS = "--ros-args"
_MAP_OF_NOTHING = "empty"
_EXPLORE, _ORIGIN, _AT_HOME = "explore", "0,0,0", 0.15
"""The stack that explores and maps, its start, and the distance [m] at which it has returned."""
_SENSE = "sense"
"""The stack that only perceives, for other nodes."""
_SHARED = "/tf", "/tf_static", "/clock", "/diagnostics", "/ground_truth/odom"
"""Topics that several robots would share; in a namespace each has its own."""

group = options.command_group("Drive a robot of ROS 2, or be one.")


class _RosCommand(TyperCommand):
    """A command that leaves the words after ``--ros-args`` to ROS: remapping, parameters."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        at = args.index(_ROS_ARGS) if _ROS_ARGS in args else len(args)
        ctx.meta[_ROS_ARGS] = args[at + 1 :]
        return super().parse_args(ctx, args[:at])


_Lockstep = Annotated[bool, option(..., "With a robot in lock step: bit for bit.", "--lockstep")]
_Namespace = Annotated[
    str | None,
    option(..., "Of all topics, /tf and /clock, too: one for each robot.", metavar="NAME"),
]
_Force = Annotated[bool, option(..., "Replace an earlier map of that name.", "--force")]


@group.command(cls=_RosCommand)
def drive(
    ctx: typer.Context,
    robot: options.Robot = None,
    map_: str = option(_MAP_OF_NOTHING, "Name or file of a map.", "--map", kind="map"),
    stack: str | None = option(
        None,
        "Name or file of a stack [default: floor_plan with a floor plan, explore to teach, or"
        " default].",
        kind="stack",
    ),
    start: str | None = option(None, "Pose in the map [m, m, rad], or a place.", metavar="X,Y,YAW"),
    goal: list[str] | None = option(
        None, "Place, or X,Y [m]; repeatable. Ends at the last one.", metavar="PLACE"
    ),
    tolerance: float = option(0.3, "Distance at which a goal is reached [m].", min=0.02, max=5.0),
    teach: str | None = option(
        None,
        "Command nothing, and make the map maps/NAME.yaml, or of a .yaml file, while another node"
        " steers.",
        metavar="NAME",
    ),
    force: _Force = False,
    lockstep: _Lockstep = False,
    namespace: _Namespace = None,
    json: options.Json = False,
) -> None:
    """Drive a robot of ROS 2: images, IMU and wheels in, cmd_vel out.

    Without a goal it runs until Ctrl-C, and drives to goals on goal_pose and goal_place. After
    --ros-args come remappings and parameters. Exit with 0 if the goal was reached.
    """
    with quiet_stdout():
        from navfw.stack import MappingStack, Stack

        parts, file = _parts(robot, map_), None
        _, topo_map, _ = parts
        if teach is None:
            unnamed = "default" if topo_map.floor_plan is None else "floor_plan"
            wanted = _options(topo_map, start, goal or [], tolerance, lockstep=lockstep)
            made = Stack.load(stack or unnamed, *parts)
            about = f"{robot or 'default'} on the map {map_} by {stack or unnamed}"
        elif goal or map_ != _MAP_OF_NOTHING:
            what = "needs no map and drives to no goal: leave out --map and --goal"
            raise InputError(what, key="--teach")
        else:
            file = options.map_file(teach, "--teach", force)
            wanted = _options(topo_map, start or _ORIGIN, [], tolerance, lockstep=lockstep)
            made = MappingStack.load(stack or _EXPLORE, *parts)
            about = f"another node steers {robot or 'default'}; the map is {file}"
    _drive(
        ctx, made, wanted, about, maps=teach is not None, file=file, namespace=namespace, json=json
    )


@group.command(cls=_RosCommand)
def explore(
    ctx: typer.Context,
    robot: options.Robot = None,
    stack: options.Stack = _EXPLORE,
    start: str = option(_ORIGIN, "Pose in the map [m, m, rad].", metavar="X,Y,YAW"),
    out_map: str | None = option(
        None, "Map to write, as maps/NAME.yaml or a .yaml file.", metavar="NAME"
    ),
    force: _Force = False,
    limit: float | None = option(None, "Time to be back at the start [s] [default: 600].", min=1.0),
    lockstep: _Lockstep = False,
    namespace: _Namespace = None,
    json: options.Json = False,
) -> None:
    """Explore a building without a map with a robot of ROS 2, return, and save the map.

    Ctrl-C ends it as well. Exit with 0 if the robot has returned; 3: the map was not saved.
    """
    with quiet_stdout():
        from navfw.stack import Stack

        file = None if out_map is None else options.map_file(out_map, "--out-map", force)
        parts = _parts(robot)
        home = ",".join(start.split(",")[:2])
        wanted = _options(parts[1], start, [home], _AT_HOME, lockstep=lockstep)
        limits = [] if limit is None else [f"explorer.limit={limit!r}"]
        made = Stack.load(stack, *parts, limits)
        about = f"{robot or 'default'} explores"
    _drive(ctx, made, wanted, about, maps=True, file=file, namespace=namespace, json=json)


@group.command(cls=_RosCommand)
def sense(
    ctx: typer.Context,
    robot: options.Robot = None,
    stack: options.Stack = _SENSE,
    namespace: _Namespace = None,
    json: options.Json = False,
) -> None:
    """Be a sensor for other nodes: a scan, obstacles and odometry from one camera, IMU and wheels.

    It commands nothing, and runs until Ctrl-C. Topics are in docs/ros2.md; after --ros-args come
    remappings and parameters.
    """
    with quiet_stdout():
        from navfw.stack.sensing_stack import SensingStack

        parts = _parts(robot)
        wanted = _options(parts[1], None, [], _AT_HOME, lockstep=False)
        made = SensingStack.load(stack, *parts)
    about = f"senses for other nodes with {robot or 'default'}: see navfw/scan, navfw/obstacles"
    _drive(ctx, made, wanted, about, senses=True, namespace=namespace, json=json)


def _parts(
    robot: str | None, map_name: str = _MAP_OF_NOTHING
) -> tuple[RobotModel, TopoMap, Registry]:
    """Load what each stack is made of."""
    from navfw.plugins import default_registry
    from navfw.robot.robotfile import load_robot
    from navfw.topomap import load_map

    return load_robot(robot or "default"), load_map(map_name), default_registry()


def _drive(
    ctx: typer.Context,
    stack: Stack,
    wanted: DriveOptions,
    about: str,
    *,
    maps: bool = False,
    senses: bool = False,
    file: Path | None = None,
    namespace: str | None,
    json: bool,
) -> NoReturn:
    """Drive by ``stack``, and report how it ended; if it ``maps``, save the map in ``file``.

    A stack that ``senses`` is a ``SensingStack``, which publishes its percepts.
    """
    from navfw.ros import DriveNode, RosNode
    from navfw.ros.map_keeper import MapKeeper
    from navfw.ros.sense_outputs import SenseOutputs

    with quiet_stdout():
        _load_kernels(quiet=json)
        name = "navfw_sense" if senses else "navfw"
        node, ended, said = RosNode(name, _arguments(ctx, namespace)), "ended by a signal", {}
        try:
            keeper = MapKeeper(node, stack, file) if maps else None
            outputs = SenseOutputs(node, stack) if senses else None
            driver = DriveNode(node, stack, wanted, keeper, outputs)
            with suppress(KeyboardInterrupt):
                ended = driver.run(about)
            code = int(wanted.once and ended != "reached")
            if keeper is not None:
                try:
                    with deferred():
                        said = {**keeper.finish(), "left": stack.state.notes}
                except InputError as error:
                    node.note(f"the map is not saved: {error}")
                    code = NOT_SAVED
        finally:
            node.close()
    report = {**said, **driver.outputs.latency()}
    lines = [ended, *(f"  {name} {value}" for name, value in report.items() if value)]
    lines += [f"  {note}" for note in node.notes]
    print_result({"ended": ended, "notes": node.notes, **report}, lines, json=json)
    raise typer.Exit(code)


def _arguments(ctx: typer.Context, namespace: str | None) -> list[str]:
    """Return the words after ``--ros-args``, and those that put all topics into ``namespace``."""
    shared = [f"{topic}:={topic[1:]}" for topic in _SHARED]
    rules = [] if namespace is None else [f"__ns:=/{namespace.strip('/')}", *shared]
    return [*ctx.meta[_ROS_ARGS], *(word for rule in rules for word in ("-r", rule))]


def _load_kernels(*, quiet: bool) -> None:
    """Compile and load the kernels: the first call of each would otherwise stop the robot."""
    from navfw.process import listed_kernels

    compile_with_progress(loaded=True, quiet=quiet)
    for kernel in listed_kernels(loaded=True):
        kernel.compile()


def _options(
    topo_map: TopoMap, start: str | None, goals: list[str], tolerance: float, *, lockstep: bool
) -> DriveOptions:
    from navfw.ros import DriveOptions
    from navfw.signals import Pose

    pose: Pose | None = None
    if start is not None and start in topo_map.places:
        pose = Pose(topo_map.places[start].x, topo_map.places[start].y, 0.0)
    elif (at := options.numbers_of("--start", start, ("X", "Y", "YAW"))) is not None:
        pose = Pose(*at)
    points = tuple(_goal(topo_map, text, tolerance) for text in goals)
    return DriveOptions(pose, points, once=bool(goals), lockstep=lockstep)


def _goal(topo_map: TopoMap, text: str, tolerance: float) -> Waypoint:
    from navfw.ros import goal_at
    from navfw.signals import Waypoint

    if "," not in text:
        return goal_at(topo_map, text, tolerance)
    x, y = options.numbers_of("--goal", text, ("X", "Y")) or (0.0, 0.0)
    return Waypoint.goal(x, y, tolerance)


@group.command(cls=_RosCommand)
def sim(
    ctx: typer.Context,
    world: options.World,
    mission: options.Mission = "",
    explore: bool = option(False, "Instead of MISSION: the mission to explore.", "--explore"),
    start: str | None = option(
        None,
        "Start without MISSION [m, m, rad] [default: that of the first one].",
        metavar="X,Y,YAW",
    ),
    seed: options.NoiseSeed = 0,
    robot: options.Robot = None,
    pace: float = option(1.0, "Simulated over real time; 0: in lock step.", min=0.0, max=100.0),
    settings: list[str] | None = option(
        None, "Change one value of the mission, e.g. timeout.", "--set", metavar="K=V"
    ),
    gui: bool = option(False, "Show a window.", "--gui"),
    namespace: _Namespace = None,
    json: options.Json = False,
) -> None:
    """Be a robot of ROS 2, for nodes that drive it; the stack is theirs.

    It stops by itself when cmd_vel is silent for 0.25 s. Without MISSION it runs until Ctrl-C, and
    has the services reset, pause and resume. With one it exits with 0 if it stopped at the goal.
    """
    with quiet_stdout():
        from navfw.missions import MissionLoop, MissionResult, prepare
        from navfw.ros import RosNode, RosPilot

        overrides = (*options.of_robot(robot), *(settings or ()))
        if mission and explore:
            raise InputError("give a mission or --explore, not both", key="--explore")
        free = not (mission or explore)
        if start is not None and not free:
            raise InputError("is for a robot without a mission: leave out MISSION", key="--start")
        if (at := options.numbers_of("--start", start, ("X", "Y", "YAW"))) is not None:
            overrides += (f"mission.start={list(at)}",)
        loaded = prepare(world, mission or None, seed=seed, overrides=overrides)
        compile_with_progress(loaded=True, quiet=json)
        node = RosNode("navfw_sim", _arguments(ctx, namespace))
        simulation = loaded.simulation(gui)
        try:
            pilot = RosPilot(node, loaded.task.robot, simulation, pace, free=free)
            what = "without a mission" if free else loaded.mission_name
            node.say(f"{loaded.world_name}, {what}: waiting for commands")
            if free:
                first = [simulation]
                with suppress(KeyboardInterrupt), interruptible():
                    pilot.roam(lambda: first.pop() if first else loaded.simulation(gui))
                raise typer.Exit(0)
            drive = MissionLoop(loaded.task, pilot, simulation).run()
            summary = MissionResult.of(loaded, drive, simulation).summary()
        finally:
            simulation.close()
            node.close()
    line = f"{summary['outcome']} after {summary['sim_time_s']:.1f} s: {summary['reason']}"
    print_result(plain_json(summary), [line], json=json)
    if summary["outcome"] != "reached":
        raise typer.Exit(1)
