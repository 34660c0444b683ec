"""The stack alone, fed with recorded sensor readings: the same commands must come out.

Nothing here knows a simulator. That the commands agree shows that the stack has seen nothing but
what the recording holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from navfw.errors import ConfigError, InputError
from navfw.fault_injection import Failure, inject_faults
from navfw.recording.run_folder import RESULT, read_result
from navfw.recording.run_log import hash_commands
from navfw.recording.sensor_recording import SensorRecording, load_recording
from navfw.robot import RobotModel
from navfw.signals import Array, Pose, SensorReading, Twist, Waypoint

if TYPE_CHECKING:
    from navfw.stack import Stack

__all__ = ["ReplayResult", "explain_at", "replay", "replay_commands"]


class Driver(Protocol):
    """What can be replayed: a stack."""

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Begin at ``pose`` (None: unknown), to visit ``goals`` in order."""
        ...

    def step(self, reading: SensorReading) -> Twist:
        """What to drive until the next control tick."""
        ...


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """What a replay gave: both command streams' hashes, and where they part.

    ``first_difference`` is the first tick with another command, or None; ``complete`` is false when
    the recording ends before its run did.
    """

    command_hash: str
    recorded_hash: str
    ticks: int
    first_difference: int | None
    complete: bool

    @property
    def same(self) -> bool:
        """Whether the stack gave the very same commands again."""
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
    """An event of the run. Of all kinds, only those that befell the stack itself play a part."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    event: _RecordedAction
    began_s: float
    ended_s: float | None = None


class _RecordedMission(BaseModel):
    """What a replay needs of a mission; the rest of the record is for people."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    start: tuple[float, float, float]
    start_known: bool = True
    goals: tuple[_RecordedGoal, ...]
    tolerance: float
    robot: RobotModel


def replay(folder: str | Path) -> ReplayResult:
    """Run the stack again on what was recorded in a run folder.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged.

    """
    stack, recording, start, goals = _load(Path(folder))
    failures = _FaultReplay(Path(folder), stack)
    return compare_commands(recording, replay_commands(stack, recording, start, goals, failures.at))


def explain_at(folder: str | Path, time: float) -> dict[str, Any]:
    """Why the command in force at ``time`` [s] of a recorded run was given, as plain data.

    What each behaviour said of it, the rules that fired with their strengths, and what OFFIS
    inferred from which numbers (``Stack.explain``).

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged; or it has no
            command at that time.

    """
    stack, recording, start, goals = _load(Path(folder))
    failures = _FaultReplay(Path(folder), stack)
    stack.start(start, goals)
    last = float(recording.sensors[-1, 0]) if len(recording) else 0.0
    for reading in recording.readings():
        if reading.time > time + 1e-9:
            break
        failures.at(reading.time)
        stack.step(reading)
    explanation = stack.explain()
    if time < 0.0 or time > last + 1.0 or not explanation:
        raise InputError(
            f"no command was in force at {time:g} s; expected a time within the run's "
            f"{last:.1f} s, after it has begun to move",
            file=folder,
            key="--at",
        )
    return explanation


def _load(folder: Path) -> tuple[Stack, SensorRecording, Pose | None, list[Waypoint]]:
    """The stack, the readings, the start (None: not told) and the goals of a recorded run."""
    from navfw.plugins import default_registry
    from navfw.stack import Stack
    from navfw.topomap import load_map

    mission = _mission(read_result(folder), folder)
    if not (folder / "recording.npz").is_file():
        raise ConfigError("holds no sensor readings; run again with --record", file=folder)
    recording = load_recording(folder / "recording.npz")
    stack = Stack.load(
        folder / "stack.yaml", mission.robot, load_map(folder / "map.yaml"), default_registry()
    )
    goals = [
        Waypoint(goal.x, goal.y, mission.tolerance, goal.place, "goal", final=True)
        for goal in mission.goals
    ]
    return stack, recording, Pose(*mission.start) if mission.start_known else None, goals


class _FaultReplay:
    """Lets the stack's behaviours fail again when they were made to fail in the run."""

    def __init__(self, folder: Path, stack: Stack) -> None:
        self._waiting: list[tuple[float, Callable[[Failure], None], Failure]] = []
        for happened in _happened(folder):
            failure = happened.event.behavior
            if failure is None or failure.name not in stack.mofis.behaviors:
                continue
            saboteur = inject_faults(stack.mofis.behaviors, failure.name)
            self._waiting.append((happened.began_s, saboteur.begin, failure.does))
            if happened.ended_s is not None:
                self._waiting.append((happened.ended_s, saboteur.end, failure.does))

    def at(self, time: float) -> None:
        """What begins or ends at ``time`` [s] does so."""
        for due in [waiting for waiting in self._waiting if waiting[0] <= time + 1e-9]:
            due[1](due[2])
            self._waiting.remove(due)


def _happened(folder: Path) -> list[_RecordedEvent]:
    events = read_result(folder).get("events", [])
    if not isinstance(events, list):
        raise ConfigError("expected a list", file=folder / RESULT, key="events")
    try:
        return [_RecordedEvent.model_validate(event) for event in events]
    except ValidationError as error:
        where = ".".join(["events", *map(str, error.errors()[0]["loc"])])
        raise ConfigError(error.errors()[0]["msg"], file=folder / RESULT, key=where) from None


def replay_commands(
    driver: Driver,
    recording: SensorRecording,
    start: Pose | None,
    goals: Sequence[Waypoint],
    before: Callable[[float], None] | None = None,
) -> Array:
    """(n, 2) the commands v [m/s], w [rad/s] that ``driver`` gives to the recorded readings.

    ``before`` is called with the time [s] of each reading before it is given.
    """
    driver.start(start, goals)
    twists = []
    for reading in recording.readings():
        if before is not None:
            before(reading.time)
        twists.append(driver.step(reading))
    return np.array([(twist.v, twist.w) for twist in twists], dtype=np.float64).reshape(-1, 2)


def compare_commands(recording: SensorRecording, commands: Array) -> ReplayResult:
    """How ``commands`` (n, 2) agree with the recorded ones, to the last bit."""
    times = recording.sensors[:, :1]
    differ = np.flatnonzero((commands != recording.commands).any(axis=1))
    return ReplayResult(
        command_hash=hash_commands(np.hstack([times, commands])),
        recorded_hash=hash_commands(np.hstack([times, recording.commands])),
        ticks=len(recording),
        first_difference=int(differ[0]) if len(differ) else None,
        complete=recording.complete,
    )


def _mission(result: dict[str, Any], folder: Path) -> _RecordedMission:
    config = result.get("config")
    data = config.get("mission") if isinstance(config, dict) else None
    try:
        return _RecordedMission.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(["config", "mission", *map(str, first["loc"])])
        raise ConfigError(first["msg"], file=folder / RESULT, key=where) from None
