"""Teaching: a map out of recordings of drives that somebody steered.

The recorded readings are fed to the perceiving half of the stack; nothing is planned. Where a
recording cannot be one drive (a gap, a jump of the wheels, a dark camera, a robot that was carried)
it is split, and its parts are joined only where they certainly overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from navfw.config.lookup import find
from navfw.config.yamlfile import rewording
from navfw.errors import ConfigError, InputError
from navfw.features.landmark_appearance import landmark_kind
from navfw.localization.place_probabilities import SituationTable, learn_table
from navfw.mapping import GrowingMap, join, made_map, with_place
from navfw.mapping.evidence_grid import KeyPose
from navfw.plugins import default_registry
from navfw.process.work_progress import ProgressCallback, silent
from navfw.recording.run_folder import RESULT, read_result, recording_in
from navfw.recording.run_replay import RecordedMission, load_recording
from navfw.robot import RobotModel
from navfw.signals import Pose, SensorReading
from navfw.stack import MappingStack
from navfw.stack.mapping_stack import Sighting
from navfw.topomap import Place, TopoMap
from navfw.topomap.landmark_mapping import LandmarkMapper, with_landmarks

STACK = "explore"
"""The stack whose perceiving half makes the map."""

_GAP, _BLIND = 0.5, 3.0
"""Time [s] without any reading, and without an image that shows something, at which a recording is
split."""

_DARK, _FLAT = 8.0, 2.5
"""Mean grey level, and standard deviation, up to which an image shows nothing."""

_TOO_FAST = 3.0
"""Speed of a wheel's rim, over the robot's top speed, that is a jump of its count."""

_CARRIED = 0.3
"""Turn [rad] with both wheels at rest from which the robot was carried."""

_SHORT = 1.5
"""Length [m] of the shortest part of a recording that is used."""

_ORIGIN = Pose(0.0, 0.0, 0.0)

_MIN_DETECTIONS = 3
"""Detections of a marker from which it is a landmark of the map."""


@dataclass(frozen=True, slots=True)
class TeachingDrive:
    """A recorded drive of ``robot`` in ``file``; ``readings`` loads it.

    ``start`` is where it begins in ``map``. ``lacking`` says which sensors the recording has not.
    """

    file: Path
    robot: RobotModel
    readings: Callable[[], Sequence[SensorReading]]
    start: Pose = _ORIGIN
    lacking: Sequence[str] = ()


def recorded_drive(folder: Path) -> TeachingDrive:
    """The drive in a run folder.

    Raises:
        ConfigError: it has no recording, or its result is damaged.

    """
    config = read_result(folder).get("config")
    with rewording(prefix="config.mission.", file=folder / RESULT):
        data = config.get("mission") if isinstance(config, dict) else None
        mission = RecordedMission.model_validate(data)
    file = recording_in(folder)
    start = Pose(*mission.start) if mission.start_known else _ORIGIN
    return TeachingDrive(file, mission.robot, lambda: load_recording(file).readings, start)


@dataclass(frozen=True, slots=True)
class TaughtPart:
    """A part of a recording from ``begin`` to ``end`` [s].

    ``why`` says why it ended there, and is empty at the end of the recording. ``path`` is its
    length [m]; ``used`` says whether it is in the map.
    """

    file: Path
    begin: float
    end: float
    why: str
    path: float
    used: bool


@dataclass(frozen=True, slots=True)
class TaughtMap:
    """The map, its parts, and how many loops were closed or remained undecided.

    ``situations`` is what OFFIS inferred at each kind of its places; None if nothing. ``keys`` are
    the key poses of the drive.
    """

    topo_map: TopoMap
    parts: tuple[TaughtPart, ...]
    loops: int
    undecided: int
    situations: SituationTable | None
    keys: Sequence[KeyPose]


def teach(
    drives: Iterable[TeachingDrive],
    name: str,
    named: Sequence[tuple[float, str]] = (),
    report: ProgressCallback = silent,
) -> TaughtMap:
    """Make the map ``name`` of recorded ``drives``, all in one building.

    ``named`` are times [s] in the first recording, and names of the places where the robot was.

    Raises:
        InputError: a recording has no wheels or gyro; nothing was seen; the recordings do not
            certainly overlap; a name is taken, or its time is not in the map.

    """
    parts: list[TaughtPart] = []
    sightings: list[Sighting] = []
    whole: GrowingMap | None = None
    first: TeachingDrive | None = None
    for drive in drives:
        joined = False
        for growing, seen, part in _grown(drive, report):
            if part.path < _SHORT or not growing.keys:
                parts.append(part)
                continue
            before = 0
            if whole is None:
                whole, used = growing, True
            else:
                report(f"{drive.file}: overlap")
                before, used = len(whole.keys), join(whole, growing)
            joined = joined or used
            sightings += [replace(one, key=one.key + before) for one in seen if used]
            parts.append(replace(part, used=used))
        if first is not None and not joined:
            raise InputError(
                f"does not certainly overlap with {first.file}, so both cannot become one map; "
                "record a drive that passes through places of the other, or teach two maps",
                file=drive.file,
            )
        first = first or drive
    if whole is None or first is None:
        raise InputError("the robot has not driven, so there is no map", file=parts[0].file)
    report("map")
    topo_map = made_map(name, whole.grid, first.robot.radius, whole.drops)
    for time, place in named:
        topo_map = with_place(topo_map, place, _pose_at(whole, time), first.robot.radius)
    seen_from = [
        (whole.keys[min(one.key, len(whole.keys) - 1)].correction.compose(one.pose), one)
        for one in sightings
    ]
    topo_map = _with_markers(topo_map, seen_from)
    situations, loops = _situations(topo_map, seen_from), whole.loops
    return TaughtMap(topo_map, tuple(parts), loops.closed, loops.undecided, situations, whole.keys)


def _with_markers(topo_map: TopoMap, sightings: Sequence[tuple[Pose, Sighting]]) -> TopoMap:
    """The map with the markers that were seen often enough, by sightings from poses in ``map``."""
    mapper = LandmarkMapper(_ORIGIN)
    for pose, sighting in sightings:
        if sighting.markers:
            mapper.integrate(pose, sighting.markers)
    estimates = mapper.estimate(_MIN_DETECTIONS)
    return with_landmarks(topo_map, estimates, lambda kind: landmark_kind(kind).default_size)


def _situations(
    topo_map: TopoMap, sightings: Sequence[tuple[Pose, Sighting]]
) -> SituationTable | None:
    """What OFFIS inferred, by the kind of the place that was nearest."""
    kinds = [place.kind for place in topo_map.places.values()]
    try:
        return learn_table(
            (kinds[int(topo_map.place_distances(pose.x, pose.y).argmin())], one.situations)
            for pose, one in sightings
            if one.situations is not None
        )
    except ValueError:
        return None


def _grown(
    drive: TeachingDrive, report: ProgressCallback
) -> Iterator[tuple[GrowingMap, Sequence[Sighting], TaughtPart]]:
    """The maps that grow from the parts of a recording, and what was seen in each."""
    if drive.lacking:
        raise ConfigError("a map needs " + "; and ".join(drive.lacking), file=drive.file)
    readings = drive.readings()
    _check_sensors(readings, drive.file)
    empty = TopoMap("none", [Place("start", 0.0, 0.0)], [])
    for first, last, why in _parts(readings, drive.robot):
        report(f"{drive.file}: {readings[first].time:.0f} to {readings[last].time:.0f} s")
        stack = MappingStack.load(find("stack", STACK), drive.robot, empty, default_registry())
        stack.start(drive.start if first == 0 else _ORIGIN, [])
        for reading in readings[first : last + 1]:
            stack.step(reading)
        growing = stack.growing
        growing.finish()
        path = growing.keys[-1].path if growing.keys else 0.0
        begin, end = readings[first].time, readings[last].time
        yield growing, stack.sightings, TaughtPart(drive.file, begin, end, why, path, used=False)


def _check_sensors(readings: Sequence[SensorReading], file: Path) -> None:
    """Refuse a recording without wheels, gyro or camera: all three are needed."""
    rates = np.array([reading.inertial.yaw_rate for reading in readings])
    ticks = np.array([(reading.encoders.left, reading.encoders.right) for reading in readings])
    missing = []
    if not np.isfinite(rates).any():
        missing.append("a gyro: no yaw rate is a number")
    if len(ticks) == 0 or not np.ptp(ticks, axis=0).any():
        missing.append("wheels: their counts never change")
    if not any(reading.frame is not None for reading in readings):
        missing.append("a camera: there are no images")
    if missing:
        raise ConfigError("a map needs " + "; and ".join(missing), file=file)


def _parts(readings: Sequence[SensorReading], robot: RobotModel) -> Iterator[tuple[int, int, str]]:
    """First and last reading of each drive in a recording, and why it ended."""
    first = 0
    watch = _Continuity(robot)
    for index, reading in enumerate(readings):
        why = watch.update(reading)
        if why:
            if index > first:
                yield first, index - 1, why
            first = index
            watch = _Continuity(robot)
            watch.update(reading)
    if readings:
        yield first, len(readings) - 1, ""


class _Continuity:
    """Says when a reading cannot belong to the same drive as those before."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._way_per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
        self._last: SensorReading | None = None
        self._seen: float | None = None
        self._driven = self._turned = 0.0
        self._rates: list[float] = []
        self._bias = 0.0

    def update(self, reading: SensorReading) -> str:
        """Return why the drive has ended before this reading; empty if it goes on."""
        last, self._last = self._last, reading
        if last is None:
            self._seen = reading.time
            return ""
        dt = reading.time - last.time
        if dt > _GAP or dt < 0.0:
            return f"a gap of {dt:.1f} s"
        ticks = max(
            abs(reading.encoders.left - last.encoders.left),
            abs(reading.encoders.right - last.encoders.right),
        )
        rolled = self._way_per_tick * ticks
        if rolled > _TOO_FAST * self._robot.max_v * max(dt, 0.02) + 2.0 * self._way_per_tick:
            return f"the wheels jump by {rolled:.2f} m"
        self._driven += rolled
        if reading.frame is not None and _shows(reading.frame.image):
            self._seen, self._driven = reading.time, 0.0
        if self._seen is not None and reading.time - self._seen > _BLIND and self._driven > 0.3:
            return f"no image shows anything for {reading.time - self._seen:.0f} s"
        return self._watch_turn(reading, rolled, dt)

    def _watch_turn(self, reading: SensorReading, rolled: float, dt: float) -> str:
        """Integrate the turn while the wheels rest: nothing else than being carried turns it."""
        rate = reading.inertial.yaw_rate
        if rolled > 0.0 or not math.isfinite(rate):
            self._turned, self._rates = 0.0, []
            return ""
        self._turned += (rate - self._bias) * dt
        self._rates.append(rate)
        if len(self._rates) > 30 and abs(self._turned) < 0.02:
            self._bias = float(np.mean(self._rates[-600:]))
        return "the robot was carried" if abs(self._turned) > _CARRIED else ""


def _shows(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> bool:
    """Whether an image shows anything."""
    some = image[::4, ::4]
    return float(some.mean()) > _DARK and float(some.std()) > _FLAT


def _pose_at(growing: GrowingMap, time: float) -> Pose:
    """Where the robot was in ``map`` at ``time`` [s], by the nearest key pose."""
    last = max(key.submap.time for key in growing.keys)
    if not 0.0 <= time <= last + 1.0:
        raise InputError(
            f"expected a time within the drive's {last:.0f} s, got {time:g}", key="--name"
        )
    return growing.key_at(time).pose
