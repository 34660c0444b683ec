"""``navfw export`` and ``navfw replay`` for bags: recordings in the formats of ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json, Recorded, numbers_of
from navfw.cli.output import print_assumed, print_result, quiet_stdout
from navfw.cli.progress_bar import ProgressBar
from navfw.errors import InputError


def export(
    folder: Recorded,
    to: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the bag to write.")],
    json: Json = False,
) -> None:
    """Write a recorded run as a bag of ROS 2."""
    with quiet_stdout():
        from navfw.recording.recorded_run import export_bag

        counts = export_bag(folder, to)
    lines = [*(f"  {count:6d}  {topic}" for topic, count in counts.items()), f"bag: {to}"]
    print_result({"bag": str(to), "messages": counts}, lines, json=json)


def replay_bag(
    path: Path,
    of_bag: tuple[str | None, str | None, str | None],
    stack: str | None,
    on_map: tuple[str | None, list[str] | None, str | None],
    out: Path | None,
    *,
    json: bool,
    quiet: bool,
) -> Path:
    """Replay a bag, print the result, and return the run folder that was written.

    ``of_bag`` are the topic of images, the gyro's axes and the robot, ``on_map`` the map's name,
    goals and start; None: the default.
    """
    name, goals, start = on_map
    with ProgressBar("replay", "ticks", quiet=quiet) as bar, quiet_stdout():
        from navfw.recording import Bag, RunFolder
        from navfw.robot.robotfile import load_robot
        from navfw.ros import BagReplay, driven_map
        from navfw.signals import Pose
        from navfw.topomap import load_map

        target = RunFolder(out or Path("runs") / f"{path.stem}-replay", numbered=out is None)
        *about, robot = of_bag
        bag = Bag(path, *about)
        topo_map = driven_map(bag) if name is None else load_map(name)
        if name is not None and not goals:
            places = ", ".join(topo_map.places)
            raise InputError(f"--map needs a place to drive to: {places}", key="--goal")
        at = numbers_of("--start", start if name else "0,0,0", ("X", "Y", "YAW"))
        places_to = (goals if name else None) or list(topo_map.places)[1:]
        begin, model = None if at is None else Pose(*at), load_robot(robot or "default")
        with target:
            replay = BagReplay(bag, model, topo_map, begin, places_to, stack or "default")
            result = replay.run(target, bar.update)
    final = target.final or target.target
    lines = [f"replayed {result['sim_time_s']:.1f} s at {result['real_time_factor']:.1f} x"]
    lines += [*(f"  {note}" for note in result["notes"]), f"  run folder  {final}"]
    print_assumed(bag.assumed)
    shown = {key: result[key] for key in result if key not in {"config", "machine"}}
    print_result({**shown, "run_folder": str(final)}, lines, json=json)
    return final
