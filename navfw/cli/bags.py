"""``navfw export``, and the replay of bags: recordings in the formats of ROS."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from navfw.cli.options import Json, Recorded, numbers_of
from navfw.cli.output import print_result, quiet_stdout
from navfw.cli.progress_bar import ProgressBar
from navfw.errors import InputError


class _Storage(StrEnum):
    MCAP = "mcap"
    SQLITE3 = "sqlite3"


def export(
    folder: Recorded,
    to: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the bag to write.", show_default=False)
    ],
    storage: Annotated[_Storage, typer.Option(help="Kind of the bag's file.")] = _Storage.MCAP,
    json: Json = False,
) -> None:
    """Write a recorded run as a bag of ROS 2."""
    with quiet_stdout():
        from navfw.recording.bag_export import export_bag

        counts = export_bag(folder, to, storage)
    lines = [*(f"  {count:6d}  {topic}" for topic, count in counts.items()), f"bag: {to}"]
    print_result({"bag": str(to), "messages": counts}, lines, json=json)


class MapChoice(NamedTuple):
    """The options of a bag's map: its name, the goals on it, and the start."""

    name: str | None
    goals: list[str]
    start: str | None


def replay_bag(
    path: Path,
    robot: str | None,
    choice: MapChoice,
    stack: str,
    topic: str | None,
    out: Path | None,
    *,
    json: bool,
    quiet: bool,
) -> Path:
    """Replay a bag and print the result; the run folder."""
    with ProgressBar("replay", "ticks", quiet=quiet) as bar, quiet_stdout():
        from navfw.recording import Bag, BagContents, RunFolder
        from navfw.robot.robotfile import load_robot
        from navfw.ros import BagReplay, driven_map
        from navfw.signals import Pose
        from navfw.topomap import load_map

        target = RunFolder(out or Path("runs") / f"{path.stem}-replay", numbered=out is None)
        contents = BagContents(Bag(path), topic)
        at = numbers_of("--start", choice.start, ("X", "Y", "YAW"))
        begin = None if at is None else Pose(*at)
        if choice.name is None:
            topo_map, begin = driven_map(contents.odometry), Pose(0.0, 0.0, 0.0)
            goals = list(topo_map.places)[1:]
        else:
            topo_map, goals = load_map(choice.name), choice.goals
            if not goals:
                what = f"needs a place of the map to drive to: {', '.join(topo_map.places)}"
                raise InputError(what, key="--goal")
        with target:
            model = load_robot(robot or "default")
            drive = BagReplay(contents, model, topo_map, begin, goals, stack)
            result = drive.run(bar.update)
            drive.write(target, result)
    lines = [f"replayed {result['sim_time_s']:.1f} s at {result['real_time_factor']:.1f} x"]
    lines += [*(f"  {note}" for note in result["notes"]), f"  run folder  {target.final}"]
    shown = {key: result[key] for key in result if key not in {"config", "machine"}}
    print_result({**shown, "run_folder": str(target.final)}, lines, json=json)
    return target.final or target.target
