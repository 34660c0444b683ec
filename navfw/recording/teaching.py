"""Teaching: make a map from recordings of drives that a person steered.

The recorded readings are fed to the perceiving half of the stack; nothing is planned. Where a
recording cannot be one drive (a gap, a jump of the wheels, a dark camera, a robot that was carried)
it is split, and its parts are joined only where they certainly overlap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.config.lookup import find
from navfw.errors import ConfigError, InputError, MapError
from navfw.features.landmark_appearance import landmark_kind
from navfw.localization.place_probabilities import SituationTable, learn_table
from navfw.mapping import made_map, with_place
from navfw.mapping.evidence_grid import KeyPose
from navfw.mapping.joining import JoinedMap, free_names, join_all, key_at
from navfw.mapping.landmark_mapping import LandmarkMapper, with_landmarks
from navfw.plugins import default_registry
from navfw.process.work_progress import ProgressCallback, silent
from navfw.recording.floor_readings import with_floor_motion
from navfw.recording.recorded_mission import recorded_mission
from navfw.recording.run_folder import recording_in
from navfw.recording.run_replay import load_recording
from navfw.robot import RobotModel
from navfw.signals import Pose, SensorReading
from navfw.stack import MappingStack
from navfw.stack.mapping_stack import MappedPart, Sighting
from navfw.topomap import Place, TopoMap

STACK = "explore"
"""The stack whose perceiving half makes the map."""

_FLOOR_SEEN = 0.8
"""Least share of the images that show the floor's motion where it takes the place of a sensor. It
was 0.98 and more in five drives; 0.15 to 0.74 of two real cars whose camera's pose is not known."""

_ORIGIN = Pose(0.0, 0.0, 0.0)

_MIN_DETECTIONS = 3
"""Detections of a marker from which it becomes a landmark of the map."""


@dataclass(frozen=True, slots=True)
class TeachingDrive:
    """A recorded drive of ``robot`` in ``file``; ``readings()`` loads it.

    ``start`` is the pose in ``map`` where it begins.
    """

    file: Path
    robot: RobotModel
    readings: Callable[[], Sequence[SensorReading]]
    start: Pose = _ORIGIN


def recorded_drive(folder: Path) -> TeachingDrive:
    """Return the drive in a run folder, for ``teach``.

    Raises:
        ConfigError: it has no recording, or its result is damaged.

    """
    mission, file = recorded_mission(folder), recording_in(folder)
    start = Pose(*mission.start) if mission.start_known else _ORIGIN
    return TeachingDrive(file, mission.robot, lambda: load_recording(file).readings, start)


@dataclass(frozen=True, slots=True)
class TaughtPart:
    """A part of a recording from ``begin`` to ``end`` [s].

    ``why`` says why it ended there, and is empty at the end of the recording. ``path`` is its
    length [m]; ``in_map`` is the name of the map that contains it, empty if none does.
    """

    file: Path
    begin: float
    end: float
    why: str
    path: float
    in_map: str


@dataclass(frozen=True, slots=True)
class TaughtMap:
    """A map, and how many loops were closed or remained undecided.

    ``situations`` are those that OFFIS inferred at each kind of its places; None if it inferred
    none. ``keys`` are the key poses of the drive.
    """

    topo_map: TopoMap
    loops: int
    undecided: int
    situations: SituationTable | None
    keys: Sequence[KeyPose]


@dataclass(frozen=True, slots=True)
class Taught:
    """The maps, at least one; the parts of the recordings, and notes on replaced sensors."""

    maps: Sequence[TaughtMap]
    parts: Sequence[TaughtPart]
    notes: Sequence[str]


def teach(
    drives: Iterable[TeachingDrive],
    name: str,
    named: Sequence[tuple[float, str]] = (),
    report: ProgressCallback = silent,
    is_taken: Callable[[str], bool] = lambda _: False,
) -> Taught:
    """Make the map ``name`` from recorded ``drives``.

    Parts that do not certainly overlap become maps of their own, called ``name``-2 and so on;
    numbers of maps for which ``is_taken`` are left out. ``named`` are times [s] in the first
    recording, and names of the places where the robot was then.

    Raises:
        InputError: a recording lacks a sensor that nothing else replaces; nothing was seen; a name
            is taken, or its time is not in a map.

    """
    notes: list[str] = []
    pieces = [piece for drive in drives for piece in _pieces(drive, notes, report)]
    named_in = [(_piece_at(pieces, time), time, place) for time, place in named]
    report("overlap")
    all_joined = join_all(part.growing for _, part, _ in pieces)
    if not all_joined:
        raise InputError("the robot has not driven, so there is no map", file=pieces[0][0].file)
    names, maps, in_maps = free_names(name, is_taken), list[TaughtMap](), dict[int, str]()
    report("map")
    next_name = next(names)
    for joined in all_joined:
        with suppress(MapError):  # no ground is free
            maps.append(_made(joined, pieces, named_in, next_name))
            in_maps |= dict.fromkeys(joined.spans, next_name)
            next_name = next(names)
    if not maps:
        raise InputError("no ground was seen free, so there is no map", file=pieces[0][0].file)
    for number, time, place in named_in:
        if number not in in_maps:
            what = f"{place} is not in the map: nor is the part of the drive around {time:g} s"
            raise InputError(what, key="--name")
    told = [
        TaughtPart(drive.file, part.begin, part.end, part.why, path, in_maps.get(number, ""))
        for number, (drive, part, path) in enumerate(pieces)
    ]
    return Taught(maps, told, notes)


_Piece = tuple[TeachingDrive, MappedPart, float]
"""A part of a recording, and its length [m]."""


def _pieces(drive: TeachingDrive, notes: list[str], report: ProgressCallback) -> Sequence[_Piece]:
    """Return the parts of a recording with the maps that grow from them."""
    readings = _complete(drive, notes, report)
    empty = TopoMap("none", [Place("start", 0.0, 0.0)], [])
    stack = MappingStack.load(find("stack", STACK), drive.robot, empty, default_registry())
    stack.start(drive.start, [])
    first, last = readings[0].time, readings[-1].time
    for reading in readings:
        if reading.frame is not None:
            report(f"{drive.file}", round(reading.time - first), max(round(last - first), 1))
        stack.step(reading)
    stack.growing.finish()
    return [(drive, part, part.path) for part in stack.parts]


def _piece_at(pieces: Sequence[_Piece], time: float) -> int:
    """Return the index of the part of the first recording at ``time`` [s]."""
    own = [part for drive, part, _ in pieces if drive is pieces[0][0]]
    for number, part in enumerate(own):
        if (part.begin if number else 0.0) <= time <= part.end + 1.0:
            return number
    what = f"expected a time within the drive's {own[-1].end:.0f} s"
    raise InputError(f"{what}, and in none of its gaps, got {time:g}", key="--name")


def _made(
    joined: JoinedMap,
    pieces: Sequence[_Piece],
    named: Sequence[tuple[int, float, str]],
    name: str,
) -> TaughtMap:
    """Make the map ``name`` of parts that were joined, with the places ``named`` in these."""
    growing, radius = joined.growing, joined.growing.robot.radius
    topo_map = made_map(name, growing.grid, radius, growing.drops)
    for number, time, place in named:
        if number in joined.spans:
            pose = key_at(joined.keys(number), time).pose
            topo_map = with_place(topo_map, place, pose, radius)
    seen_from = [
        (keys[min(one.key, len(keys) - 1)].correction.compose(one.pose), one)
        for number in sorted(joined.spans)
        for keys in (joined.keys(number),)
        for one in pieces[number][1].sightings
    ]
    topo_map = _with_markers(topo_map, seen_from)
    loops = growing.loops
    situations = _situations(topo_map, seen_from)
    return TaughtMap(topo_map, loops.closed, loops.undecided, situations, growing.keys)


def _with_markers(topo_map: TopoMap, sightings: Sequence[tuple[Pose, Sighting]]) -> TopoMap:
    """Return the map with the markers that were seen often enough, from poses in ``map``."""
    mapper = LandmarkMapper(_ORIGIN)
    for pose, sighting in sightings:
        if sighting.markers:
            mapper.integrate(pose, sighting.markers)
    estimates = mapper.estimate(_MIN_DETECTIONS)
    return with_landmarks(topo_map, estimates, lambda kind: landmark_kind(kind).default_size)


def _situations(
    topo_map: TopoMap, sightings: Sequence[tuple[Pose, Sighting]]
) -> SituationTable | None:
    """Learn the situations that OFFIS inferred by the kind of the nearest place; None if none."""
    kinds = [place.kind for place in topo_map.places.values()]
    try:
        return learn_table(
            (kinds[int(topo_map.place_distances(pose.x, pose.y).argmin())], one.situations)
            for pose, one in sightings
            if one.situations is not None
        )
    except ValueError:
        return None


def _complete(
    drive: TeachingDrive, notes: list[str], report: ProgressCallback
) -> Sequence[SensorReading]:
    """Return the readings of a recording; the floor's motion replaces missing wheels or gyro.

    Raises:
        ConfigError: a sensor is missing that the floor's motion does not replace.

    """
    readings = drive.readings()
    missing = _missing(readings)
    if not missing:
        return readings
    what = "a map needs " + "; and ".join(missing.values())
    if "camera" in missing:
        raise ConfigError(what, file=drive.file)
    report(f"{drive.file}: floor")
    complete, seen = with_floor_motion(readings, drive.robot, missing)
    if seen < _FLOOR_SEEN or not complete:
        floor = f"found in {seen:.0%} of the images, not in {_FLOOR_SEEN:.0%}"
        hint = "record what is missing, or correct the camera's height and pitch in --robot"
        what += f". The floor's motion would do, but was {floor}: {hint}"
        raise ConfigError(what, file=drive.file)
    height = f"the camera's height of {drive.robot.camera.mount_height:g} m"
    by = {"wheels": f"the scale is by {height}", "gyro": "turns are by the floor"}
    said = "; ".join(f"no {role}: {by[role]}" for role in by if role in missing)
    notes.append(f"{drive.file}: {said}; the floor was seen in {seen:.0%} of the images")
    return complete


def _missing(readings: Sequence[SensorReading]) -> dict[str, str]:
    """Return what ``readings`` lack of "camera", "gyro" and "wheels"; {} if nothing."""
    rates = np.array([reading.inertial.yaw_rate for reading in readings])
    ticks = np.array([(reading.encoders.left, reading.encoders.right) for reading in readings])
    missing = {}
    if not any(reading.frame is not None for reading in readings):
        missing["camera"] = "a camera: there are no images"
    if not np.isfinite(rates).any():
        where = "sensor_msgs/Imu in a bag, gyro.csv (time [s], yaw_rate [rad/s]) in a folder"
        missing["gyro"] = f"a gyro: there are no yaw rates ({where})"
    if len(ticks) == 0 or not np.ptp(ticks, axis=0).any():
        where = "sensor_msgs/JointState or nav_msgs/Odometry in a bag"
        where += ", wheels.csv (time [s], left, right: angles [rad]) in a folder"
        missing["wheels"] = f"wheels: they never turn ({where})"
    return missing
