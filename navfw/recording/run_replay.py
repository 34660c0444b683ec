"""Replay: run the stack on recorded sensor readings, and compare its commands bit by bit.

No simulator is involved: equal commands show that the stack has no input besides the recording, map
and stack file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.errors import ConfigError
from navfw.features.landmark_appearance import check_landmark_kind
from navfw.numerics import Array, Image
from navfw.plugins.fault_injection import inject_faults
from navfw.recording import channel_list as topics
from navfw.recording.recorded_mission import recorded_mission
from navfw.recording.recorded_run import RecordedRun, image_of, located_damage
from navfw.recording.run_folder import RESULT, read_result, recording_in
from navfw.recording.run_observers import hash_commands
from navfw.robot import CameraModel
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Twist, Waypoint

if TYPE_CHECKING:
    from navfw.stack import Stack


@dataclass(frozen=True, slots=True)
class SensorRecording:
    """Sensor ``readings`` and commands of a run (n control ticks).

    ``commands`` (n, 2) are the stack's: v [m/s] and w [rad/s]. ``complete`` is False if the
    recording ends before its run.
    """

    readings: tuple[SensorReading, ...]
    commands: Array
    complete: bool

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def times(self) -> Array:
        """The times (n,) of the ticks [s]."""
        return np.array([reading.time for reading in self.readings])


def load_recording(path: str | Path) -> SensorRecording:
    """Load the sensor readings of a recording, images included.

    If the file is cut off, the readings of its intact part.

    Raises:
        ConfigError: the file does not exist, is too large, or is not a recording (``RecordedRun``).

    """
    run = RecordedRun(path)
    images: dict[str, Image] = {}
    readings: list[SensorReading] = []
    commands: list[tuple[float, float]] = []
    for message in run.messages(topics.READING, *topics.IMAGES):
        row = message.content
        if message.topic == topics.READING:
            readings.append(_reading(row, images, run))
            commands.append((row.v, row.w))
        elif message.topic in images:
            raise run.refused("an image belongs to no reading")
        else:
            images[message.topic] = image_of(message, run.path)
    if not readings and not run.complete:
        raise run.refused("the file is cut off before its first reading")
    table = np.array(commands, dtype=np.float64).reshape(-1, 2)
    return SensorRecording(tuple(readings), table, run.complete)


def _reading(row: Any, images: dict[str, Image], run: RecordedRun) -> SensorReading:
    """Make the reading of ``row``; take its ``images``, which stand before it in the file."""

    def take(topic: str) -> Image:
        if topic not in images:
            raise run.refused(f"images of {topic} are missing")
        return images.pop(topic)

    frame = landmark_frame = None
    if row.pictures & topics.ImageFlags.CAMERA:
        sided = row.pictures & topics.ImageFlags.SIDES
        sides = tuple(map(take, topics.SIDE_IMAGES)) if sided else ()
        frame = Frame(row.frame_time, take(topics.CAMERA_IMAGE), sides)
    if row.pictures & topics.ImageFlags.LANDMARKS:
        landmark_frame = Frame(row.landmark_frame_time, take(topics.LANDMARK_IMAGE))
    if images:
        raise run.refused("an image belongs to no reading")
    return SensorReading(
        time=row.time,
        inertial=Inertial(row.inertial_time, row.roll_rate, row.pitch_rate, row.yaw_rate),
        encoders=Encoders(row.encoders_time, row.left, row.right),
        frame=frame,
        landmark_frame=landmark_frame,
    )


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """The result of a replay: hashes of both series of commands, and their first difference.

    ``first_difference`` is the index of the first tick with another command, None if there is none.
    ``complete`` is False if the recording ends before its run.
    """

    command_hash: str
    recorded_hash: str
    ticks: int
    first_difference: int | None
    complete: bool

    @property
    def same(self) -> bool:
        """Whether the stack gave exactly the recorded commands."""
        return self.command_hash == self.recorded_hash


def replay(folder: str | Path) -> ReplayResult:
    """Run the stack on the sensor readings in a run folder, and compare its commands.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged.

    """
    _, recording, step = recorded_stack(Path(folder))
    return replay_by(step, recording)


def repeat_until(folder: str | Path, time: float) -> tuple[dict[str, Any], float]:
    """Run the stack on the readings up to ``time`` [s]; return the explanation of its last command.

    The explanation is {} before the first command. The second value is the time [s] of the last
    reading of the recording.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged.

    """
    stack, recording, step = recorded_stack(Path(folder))
    for reading in recording.readings:
        if reading.time > time + 1e-9:
            break
        step(reading)
    explanation = stack.explain()
    last = recording.readings[-1].time if len(recording) else 0.0
    if explanation and not recording.complete:
        explanation["complete"] = False
    return explanation, last


Step = Callable[[SensorReading], Twist]
"""Runs a stack on a reading; returns its command."""


def recorded_stack(
    folder: Path, other: str | None = None, overrides: Sequence[str] = ()
) -> tuple[Stack, SensorRecording, Step]:
    """Load the stack of a recorded run, started, the readings, and what steps the stack on them.

    It repeats the faults of behaviours that were injected during the run. ``other`` is the name or
    file of a stack in its place; ``overrides`` change single values.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged; the stack or
            an override is none.

    """
    from navfw.plugins import default_registry
    from navfw.stack import ShadowStack, Stack
    from navfw.topomap import load_map

    mission = recorded_mission(folder)
    file = recording_in(folder)
    recording = load_recording(file)
    _check_images(recording, mission.robot.camera, file)
    stack = (ShadowStack if mission.shadow else Stack).load(
        folder / "stack.yaml" if other is None else other,
        mission.robot,
        load_map(folder / "map.yaml", check_landmark_kind),
        default_registry(),
        overrides,
    )
    waiting = _faults(folder, stack)
    tolerance = mission.tolerance
    goals = [Waypoint.goal(goal.x, goal.y, tolerance, goal.place) for goal in mission.goals]
    stack.start(Pose(*mission.start) if mission.start_known else None, goals)

    def step(reading: SensorReading) -> Twist:
        for due in [fault for fault in waiting if fault[0] <= reading.time + 1e-9]:
            due[1]()
            waiting.remove(due)
        return stack.step(reading)

    return stack, recording, step


def _check_images(recording: SensorRecording, camera: CameraModel, file: Path) -> None:
    for reading in recording.readings:
        frame = reading.frame
        if frame is not None and frame.image.shape != (camera.height, camera.width):
            height, width = frame.image.shape
            raise ConfigError(
                f"an image is {width} x {height}, those of the camera in {RESULT} are"
                f" {camera.width} x {camera.height}",
                file=file,
                key=topics.CAMERA_IMAGE,
            )


def _faults(folder: Path, stack: Stack) -> list[tuple[float, Callable[[], None]]]:
    """Return times [s] at which injected faults of behaviours began and ended, and calls for it."""
    waiting: list[tuple[float, Callable[[], None]]] = []
    with located_damage(folder / RESULT, "its list of events"):
        for event in read_result(folder).get("events", ()):
            fault = event["event"].get("behavior")
            if fault is None or fault["name"] not in stack.mofis.behaviors:
                continue
            injector = inject_faults(stack.mofis.behaviors, fault["name"])
            waiting.append((event["began_s"], partial(injector.begin, fault["does"])))
            if event.get("ended_s") is not None:
                waiting.append((event["ended_s"], partial(injector.end, fault["does"])))
    return waiting


def replay_by(step: Step, recording: SensorRecording) -> ReplayResult:
    """Run ``step`` on the recorded readings, and compare its commands bit by bit."""
    twists = map(step, recording.readings)
    table = np.array([(twist.v, twist.w) for twist in twists], dtype=np.float64)
    commands, times = table.reshape(-1, 2), recording.times[:, None]
    differ = np.flatnonzero((commands != recording.commands).any(axis=1))
    return ReplayResult(
        command_hash=hash_commands(np.hstack([times, commands])),
        recorded_hash=hash_commands(np.hstack([times, recording.commands])),
        ticks=len(recording),
        first_difference=int(differ[0]) if len(differ) else None,
        complete=recording.complete,
    )
