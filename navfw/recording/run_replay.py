"""Replay: the stack is run on recorded sensor readings and must give the same commands.

No simulator is involved: equal commands show that the stack has no input besides the recording.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from navfw.config.problems import rewording
from navfw.errors import ConfigError, InputError
from navfw.features.landmark_appearance import check_landmark_kind
from navfw.numerics import Array
from navfw.plugins.fault_injection import Failure, inject_faults
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import recording_in
from navfw.recording.run_folder import RESULT, read_result
from navfw.recording.run_log import hash_commands
from navfw.recording.sensor_recording import SensorRecording, load_recording
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose, SensorReading, Twist, Waypoint

if TYPE_CHECKING:
    from navfw.stack import Stack


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """The result of a replay: hashes of both command streams, and their first difference.

    ``first_difference`` is the first tick with another command, or None. ``complete`` is false if
    the recording ends before its run.
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


class _RecordedGoal(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    place: str
    x: float
    y: float


class _RecordedBehaviorFault(BaseModel):
    model_config = ConfigDict(extra="ignore")
    name: str
    does: Failure


class _RecordedAction(BaseModel):
    model_config = ConfigDict(extra="ignore")
    behavior: _RecordedBehaviorFault | None = None


class _RecordedEvent(BaseModel):
    """An event of the run; a replay uses only faults of behaviours, the others act on sensors."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    event: _RecordedAction
    began_s: float
    ended_s: float | None = None


class _RecordedMission(BaseModel):
    """The part of a recorded mission that a replay uses."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    start: tuple[float, float, float]
    start_known: bool = True
    goals: tuple[_RecordedGoal, ...]
    tolerance: float
    robot: RobotModel


def replay(folder: str | Path) -> ReplayResult:
    """Run the stack on the sensor readings in a run folder.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged.

    """
    stack, recording, start, goals = _load(Path(folder))
    faults = _FaultReplay(Path(folder), stack)
    stack.start(start, goals)
    commands = replay_commands(stack.step, recording, faults.update)
    return compare_commands(recording, commands)


def explain_at(folder: str | Path, time: float) -> dict[str, Any]:
    """Why the command in force at ``time`` [s] of a recorded run was given, as plain data.

    The proposal of each behaviour for it, the rules that fired with their strengths, and the inputs
    and results of OFFIS (``Stack.explain``).

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged; or no command
            was in force at that time.

    """
    stack, recording, start, goals = _load(Path(folder))
    faults = _FaultReplay(Path(folder), stack)
    stack.start(start, goals)
    last = recording.readings[-1].time if len(recording) else 0.0
    for reading in recording.readings:
        if reading.time > time + 1e-9:
            break
        faults.update(reading.time)
        stack.step(reading)
    explanation = stack.explain()
    if time < 0.0 or time > last + 1.0 or not explanation:
        raise InputError(
            f"no command was in force at {time:g} s; expected a time within the run's "
            f"{last:.1f} s, after its first command",
            file=folder,
            key="--at",
        )
    return explanation


def _load(folder: Path) -> tuple[Stack, SensorRecording, Pose | None, list[Waypoint]]:
    """The stack, the readings, the start (None: unknown) and the goals of a recorded run."""
    from navfw.plugins import default_registry
    from navfw.stack import Stack
    from navfw.topomap import load_map

    mission = _mission(read_result(folder), folder)
    file = recording_in(folder)
    recording = load_recording(file)
    _check_images(recording, mission.robot.camera, file)
    stack = Stack.load(
        folder / "stack.yaml",
        mission.robot,
        load_map(folder / "map.yaml", check_landmark_kind),
        default_registry(),
    )
    goals = [
        Waypoint(goal.x, goal.y, mission.tolerance, goal.place, "goal", final=True)
        for goal in mission.goals
    ]
    return stack, recording, Pose(*mission.start) if mission.start_known else None, goals


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


class _FaultReplay:
    """Repeats the faults of behaviours that were injected during the run."""

    def __init__(self, folder: Path, stack: Stack) -> None:
        self._waiting: list[tuple[float, Callable[[Failure], None], Failure]] = []
        for recorded in _recorded_events(folder):
            fault = recorded.event.behavior
            if fault is None or fault.name not in stack.mofis.behaviors:
                continue
            injector = inject_faults(stack.mofis.behaviors, fault.name)
            self._waiting.append((recorded.began_s, injector.begin, fault.does))
            if recorded.ended_s is not None:
                self._waiting.append((recorded.ended_s, injector.end, fault.does))

    def update(self, time: float) -> None:
        """Begin and end the faults due at ``time`` [s]."""
        for due in [waiting for waiting in self._waiting if waiting[0] <= time + 1e-9]:
            due[1](due[2])
            self._waiting.remove(due)


def _recorded_events(folder: Path) -> list[_RecordedEvent]:
    events = read_result(folder).get("events", [])
    if not isinstance(events, list):
        raise ConfigError("expected a list", file=folder / RESULT, key="events")
    with rewording(prefix="events.", file=folder / RESULT):
        return [_RecordedEvent.model_validate(event) for event in events]


def replay_commands(
    step: Callable[[SensorReading], Twist],
    recording: SensorRecording,
    before: Callable[[float], None] = lambda time: None,
) -> Array:
    """(n, 2) the commands v [m/s], w [rad/s] that ``step`` gives for the recorded readings.

    ``before`` is called with the time [s] of each reading before its step.
    """
    twists = []
    for reading in recording.readings:
        before(reading.time)
        twists.append(step(reading))
    return np.array([(twist.v, twist.w) for twist in twists], dtype=np.float64).reshape(-1, 2)


def compare_commands(recording: SensorRecording, commands: Array) -> ReplayResult:
    """Compare ``commands`` (n, 2) with the recorded ones, bit by bit."""
    times, recorded = recording.times[:, None], recording.commands
    differ = np.flatnonzero((commands != recorded).any(axis=1))
    return ReplayResult(
        command_hash=hash_commands(np.hstack([times, commands])),
        recorded_hash=hash_commands(np.hstack([times, recorded])),
        ticks=len(recording),
        first_difference=int(differ[0]) if len(differ) else None,
        complete=recording.complete,
    )


def _mission(result: dict[str, Any], folder: Path) -> _RecordedMission:
    config = result.get("config")
    data = config.get("mission") if isinstance(config, dict) else None
    with rewording(prefix="config.mission.", file=folder / RESULT):
        return _RecordedMission.model_validate(data)
