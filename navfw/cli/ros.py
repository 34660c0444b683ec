"""``navfw ros``: the stack as a node of ROS 2, and the simulated robot as one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from navfw.cli import options
from navfw.cli.options import completer_of
from navfw.cli.output import print_result, quiet_stdout
from navfw.cli.warm import compile_with_progress
from navfw.recording.run_folder import plain_json

if TYPE_CHECKING:
    from navfw.ros import DriveOptions
    from navfw.signals import Pose, Waypoint
    from navfw.topomap import TopoMap

_ROS_ARGS = "--ros-args"
_MAP_OF_NOTHING = "empty"

group = options.command_group("Drive a robot of ROS 2, or be one.")


def add_to(app: typer.Typer) -> None:
    """Add the commands ``navfw ros ...`` to the command line."""
    app.add_typer(group, name="ros")


class _RosCommand(TyperCommand):
    """Leaves what follows ``--ros-args`` to ROS: remapping, parameters."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        at = args.index(_ROS_ARGS) if _ROS_ARGS in args else len(args)
        ctx.meta[_ROS_ARGS] = args[at + 1 :]
        return super().parse_args(ctx, args[:at])


@group.command(cls=_RosCommand)
def drive(
    ctx: typer.Context,
    robot: options.Robot = None,
    map_: Annotated[
        str,
        typer.Option("--map", help="Name or file of a map.", autocompletion=completer_of("map")),
    ] = _MAP_OF_NOTHING,
    stack: Annotated[
        str | None,
        typer.Option(
            help="Name or file of a stack [default: floor_plan with a floor plan, or default].",
            autocompletion=completer_of("stack"),
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(metavar="X,Y,YAW", help="Pose in the map [m, m, rad], or a place."),
    ] = None,
    goal: Annotated[
        list[str] | None,
        typer.Option(metavar="PLACE", help="Place, or X,Y [m]; repeatable. Ends at the last one."),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(min=0.02, max=5.0, help="Distance at which a goal is reached [m].")
    ] = 0.3,
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="With a robot in lock step: bit for bit.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Drive a robot of ROS 2: images, IMU and wheels in, cmd_vel out.

    Without a goal it runs until Ctrl-C, and drives to goals on goal_pose and goal_place. After
    --ros-args come remappings and parameters. Exit with 0 if the goal was reached.
    """
    with quiet_stdout():
        from navfw.plugins import default_registry
        from navfw.robot.robotfile import load_robot
        from navfw.ros import DriveNode, RosNode
        from navfw.stack import Stack
        from navfw.topomap import load_map

        topo_map = load_map(map_)
        unnamed = "default" if topo_map.floor_plan is None else "floor_plan"
        wanted = _options(topo_map, start, goal or [], tolerance, lockstep=lockstep)
        model = load_robot(robot or "default")
        made = Stack.load(stack or unnamed, model, topo_map, default_registry())
        _load_kernels(quiet=json)
        node, driver = RosNode("navfw", ctx.meta[_ROS_ARGS]), None
        try:
            driver = DriveNode(node, made, wanted)
            ended = driver.run(f"{robot or 'default'} on the map {map_} by {stack or unnamed}")
        except KeyboardInterrupt:
            ended = "ended by a signal"
        finally:
            node.close()
    latency = driver.outputs.latency() if driver else {}
    _print_end(ended, {"notes": node.notes, **latency}, json=json)
    if wanted.once and ended != "reached":
        raise typer.Exit(1)


def _load_kernels(*, quiet: bool) -> None:
    """Compile and load what drives: the first call of each kernel would stop the robot."""
    from navfw.process import listed_kernels

    compile_with_progress(loaded=True, quiet=quiet)
    for kernel in listed_kernels(loaded=True):
        kernel.compile()


def _print_end(ended: str, about: dict[str, Any], *, json: bool) -> None:
    lines = [ended, *(f"  {name} {value}" for name, value in about.items() if value)]
    print_result({"ended": ended, **about}, lines, json=json)


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
    seed: Annotated[int, typer.Option(min=0, help="Seed of all noise.")] = 0,
    robot: options.Robot = None,
    pace: Annotated[
        float,
        typer.Option(min=0.0, max=100.0, help="Simulated over real time; 0: in lock step."),
    ] = 1.0,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="K=V", help="Change one value of the mission, e.g. timeout."),
    ] = None,
    gui: Annotated[bool, typer.Option("--gui", help="Show a window.")] = False,
    json: options.Json = False,
) -> None:
    """Be the robot of a mission in ROS 2, for nodes that drive it; the stack is theirs.

    It stops by itself when cmd_vel is silent for 0.25 s. Exit with 0 if it stopped at the goal.
    """
    with quiet_stdout():
        from navfw.missions import MissionLoop, MissionResult, prepare
        from navfw.ros import RosNode, RosPilot

        overrides = (*options.of_robot(robot), *(settings or ()))
        loaded = prepare(world, mission, seed=seed, overrides=overrides)
        compile_with_progress(loaded=True, quiet=json)
        node = RosNode("navfw_sim", ctx.meta[_ROS_ARGS])
        simulation = loaded.simulation(gui)
        try:
            pilot = RosPilot(node, loaded.task.robot, simulation, pace)
            node.say(f"{loaded.world_name}, {loaded.mission_name}: waiting for commands")
            drive = MissionLoop(loaded.task, pilot, simulation).run()
            summary = MissionResult.of(loaded, drive, simulation).summary()
        finally:
            simulation.close()
            node.close()
    line = f"{summary['outcome']} after {summary['sim_time_s']:.1f} s: {summary['reason']}"
    print_result(plain_json(summary), [line], json=json)
    if summary["outcome"] != "reached":
        raise typer.Exit(1)
