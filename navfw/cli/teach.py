"""``navfw map teach`` makes a map from recorded drives; ``navfw map name`` names its places."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.assumption import Assumption
from navfw.cli.options import ImuAxes, Json, Map, Topic, argument, map_file, numbers_of, option
from navfw.cli.output import print_result, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.config.input_file import is_file, is_folder
from navfw.config.lookup import find
from navfw.errors import InputError
from navfw.process.atomic import write_text
from navfw.recording.run_folder import RESULT, is_bag

if TYPE_CHECKING:
    from navfw.recording.teaching import Taught, TeachingDrive

_NAME = re.compile(r"(?P<time>[0-9]+(\.[0-9]+)?)=(?P<place>[A-Za-z0-9][A-Za-z0-9_.-]*)")


_APART = (
    "what they show does not certainly overlap. If it is one building, record a drive through"
    " places of both, and teach it with them"
)


def teach(
    recordings: list[Path] = argument(
        ...,
        "Run folders of run --record, bags of ROS, or folders of images with gyro.csv and"
        " wheels.csv.",
        metavar="RECORDING...",
    ),
    out: str = option(..., "Map to write: a name in maps/, or a .yaml file.", metavar="NAME"),
    name: list[str] | None = option(
        None, "Name the place at T [s] of the first one. May be repeated.", metavar="T=PLACE"
    ),
    robot: str | None = option(
        None, "For bags and folders: name or file of the robot.", metavar="ROBOT"
    ),
    topic: Topic = None,
    imu_axes: ImuAxes = None,
    situations: Path | None = option(
        None, "Write the table of what OFFIS saw at each kind of place.", metavar="FILE"
    ),
    force: bool = option(False, "Replace an earlier map of that name.", "--force"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make a map of recorded drives; drives that do not overlap become NAME-2 and so on."""
    from navfw.recording.teaching import teach as taught
    from navfw.topomap.map_formats import save_map

    with quiet_stdout():
        file, notes = map_file(out, "--out", force), list[str]()
        assumed = list[Assumption]()
        named = [_named(text) for text in name or ()]
        drives = _drives(recordings, robot, (topic, imu_axes), notes, assumed)
        with ProgressBar("map teach", quiet=quiet) as bar:
            is_taken = partial(_is_taken, file, force)
            made = taught(drives, file.stem, named, bar.show_part, is_taken)
        files = [file.with_stem(one.topo_map.name) for one in made.maps]
        for one, target in zip(made.maps, files, strict=True):
            save_map(one.topo_map, target)
        if situations is not None:
            if made.maps[0].situations is None:
                raise InputError("OFFIS saw no situation", key="--situations")
            origin = f"navfw map teach --out {out}: {len(recordings)} recordings"
            write_text(situations, made.maps[0].situations.text(origin), parents=True)
    data, lines = _summary(made, files, notes)
    print_result(data, lines, json=json, assumed=assumed)


def _summary(made: Taught, files: list[Path], notes: list[str]) -> tuple[dict[str, Any], list[str]]:
    """What was made, as data, and as lines for people."""
    maps, lines = list[dict[str, Any]](), list[str]()
    for one, file in zip(made.maps, files, strict=True):
        places, edges = len(one.topo_map.places), len(one.topo_map.passages)
        about = {"map": one.topo_map.name, "file": str(file), "places": places, "edges": edges}
        marks = len(one.topo_map.landmarks)
        maps.append(about | {"landmarks": marks, "loops": one.loops, "undecided": one.undecided})
        lines.append(f"{file}: {places} places, {edges} edges, {marks} landmarks")
        lines += [f"{one.loops} loops closed"] if one.loops else []
        if one.undecided:
            lines.append(f"{one.undecided} loops remained undecided, and are not closed")
    if len(maps) > 1:
        names = " and ".join(one["map"] for one in maps)
        lines.append(f"{len(maps)} maps, {names}: {_APART}")
    parts = [
        {
            "recording": str(part.file),
            "begin_s": round(part.begin, 2),
            "end_s": round(part.end, 2),
            "path_m": round(part.path, 2),
            "map": part.in_map,
            "ended_by": part.why,
        }
        for part in made.parts
    ]
    notes = [*made.notes, *notes]
    lines += [f"note: {note}" for note in notes]
    for part in made.parts:
        span = f"{part.begin:.1f} to {part.end:.1f} s, {part.path:.1f} m"
        split = f", split there: {part.why}" if part.why else ""
        where = f"in {part.in_map}" if part.in_map else "in no map, as too short a drive"
        if len(made.parts) > 1 or not part.in_map:
            lines.append(f"{part.file}: {span}: {where}{split}")
    return {**maps[0], "more_maps": maps[1:], "parts": parts, "notes": notes}, lines


def name(
    map_: Map,
    place: str = argument(
        ..., "A place of the map, or a new one's point [m].", metavar="PLACE|X,Y"
    ),
    new: str = argument(..., "Its name from now on.", metavar="NAME"),
    json: Json = False,
) -> None:
    """Name a place of a map, or a point of its floor plan, which gets edges to the nearest."""
    import numpy as np

    from navfw.features.landmark_appearance import check_landmark_kind
    from navfw.mapping import with_place
    from navfw.robot import RobotModel
    from navfw.signals import Pose
    from navfw.topomap import load_map
    from navfw.topomap.map_formats import save_map
    from navfw.topomap.occupancy_map import FREE

    with quiet_stdout():
        file = find("map", map_)
        topo_map = load_map(file, check_landmark_kind)
        point = numbers_of("PLACE", place, ("X", "Y")) if "," in place else None
        if point is None:
            if new in topo_map.places:
                raise InputError(f"the map has a place {new!r} already; choose another name")
            changed = topo_map.renamed({topo_map.place(place).name: new})
        else:
            at, plan = Pose(point[0], point[1], 0.0), topo_map.floor_plan
            if plan is not None and plan.state(np.array([point])) != FREE:
                raise InputError("is not on free ground of the floor plan", key=place)
            changed = with_place(topo_map, new, at, RobotModel().radius)
        save_map(changed, file)
    what = f"{file}: {place} is now {new}"
    print_result({"map": changed.name, "file": str(file), "place": new}, (what,), json=json)


def _drives(
    recordings: list[Path],
    robot: str | None,
    of_bags: tuple[str | None, str | None],
    notes: list[str],
    assumed: list[Assumption],
) -> Iterator[TeachingDrive]:
    """Each recording as a drive; remarks on it are added to ``notes``, choices to ``assumed``.

    ``of_bags`` are the topic of images and the axes of the gyro, if given.
    """
    from navfw.perceive import camera_contradiction
    from navfw.perceive.folder_drive import FolderDrive
    from navfw.recording import Bag
    from navfw.recording.teaching import TeachingDrive, recorded_drive
    from navfw.robot.robotfile import load_robot
    from navfw.ros import BagReadings

    for path in recordings:
        bag: Bag | FolderDrive
        if is_bag(path):
            bag = Bag(path, *of_bags)
            contradiction = camera_contradiction(bag)
        elif is_folder(path) and not is_file(path / RESULT):
            bag, contradiction = FolderDrive(path), ""
        else:
            yield recorded_drive(path)
            continue
        model = load_robot(robot or "default")
        notes += [f"{path}: {contradiction}"] if contradiction else []
        readings = partial(tuple, BagReadings(bag, model, only_gyro=True))
        yield TeachingDrive(path, model, readings)
        notes += [f"{path}: {note}" for note in dict.fromkeys(bag.notes)]
        assumed += bag.assumed


def _is_taken(first: Path, force: bool, name: str) -> bool:
    """Whether there is a map ``name`` beside the ``first`` one that is not to be replaced."""
    return first.with_stem(name).exists() and not force


def _named(text: str) -> tuple[float, str]:
    """Return the time [s] and the name of ``T=PLACE``."""
    match = _NAME.fullmatch(text)
    if match is None:
        raise InputError(f"expected T=PLACE, as in 12.5=dock, got {text!r}", key="--name")
    return float(match["time"]), match["place"]
