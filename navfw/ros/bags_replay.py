"""The stack on a bag: what it would have commanded, beside what the robot was."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from navfw.numerics import Array
from navfw.perceive import camera_contradiction
from navfw.plugins import default_registry
from navfw.process.interruption import check_interrupted, interruptible
from navfw.recording import RECORDING, RESULT, RunFolder, RunRecorder, WorldOutline, hash_commands
from navfw.recording.bag_contents import BagContents
from navfw.recording.channel_list import SeenRun
from navfw.recording.provenance import code_revision, machine_kind
from navfw.recording.run_folder import plain_json
from navfw.robot import RobotModel
from navfw.ros.bags_readings import BagReadings
from navfw.signals import Pose, Twist, Waypoint
from navfw.stack import ShadowStack
from navfw.topomap import TopoMap

_TOLERANCE = 0.3
"""Distance [m] at which a goal is reached."""
_HELD = 1.0
"""Time [s] for which a command of the bag holds."""
_TURNS = 0.05
"""Least rate [rad/s] that is a turn."""
_REASONS = 3
"""Number of reasons of standstill that are told."""


class BagReplay:
    """The stack called ``stack_name`` on the readings of a bag, for ``robot`` on ``topo_map``.

    It drives from ``start`` (None: unknown) to the places ``goals``, or thinks so: the robot does
    what it did. ``run`` may be called once.

    Raises:
        InputError: the bag is not one of this robot, or a name is unknown.

    """

    def __init__(
        self,
        contents: BagContents,
        robot: RobotModel,
        topo_map: TopoMap,
        start: Pose | None,
        goals: Sequence[str],
        stack_name: str = "default",
    ) -> None:
        self._contents, self._start = contents, start
        places = [topo_map.place(name) for name in goals]
        self._goals = [Waypoint(p.x, p.y, _TOLERANCE, p.name, "goal", final=True) for p in places]
        self._readings = BagReadings(contents, robot)
        self._stack = ShadowStack.load(
            stack_name, self._readings.robot, topo_map, default_registry()
        )
        self._readings.landmarks = self._stack.features.landmark_frames
        config = {"mission": self._mission(), "stack": self._stack.config}
        about = {"world": contents.bag.path.name, "mission": "replay", "seed": "0"}
        self._about = {**about, "config": json.dumps(plain_json(config))}
        self._recorder = RunRecorder(self._about, SeenRun(self._stack, WorldOutline()))
        self._held: Counter[str] = Counter()

    def _mission(self) -> dict[str, Any]:
        start, robot = self._start or Pose(0.0, 0.0, 0.0), self._readings.robot
        return {
            "start": [start.x, start.y, start.yaw],
            "start_known": self._start is not None,
            "shadow": True,
            "goals": [{"place": goal.place, "x": goal.x, "y": goal.y} for goal in self._goals],
            "tolerance": _TOLERANCE,
            "robot": robot.model_dump(mode="json", include=set(RobotModel.model_fields)),
            "map": self._stack.topo_map.name,
        }

    def run(
        self, progress: Callable[[int, int], None] = lambda done, total: None
    ) -> dict[str, Any]:
        """Replay the whole bag; ``progress`` takes ticks done, and all. Returns the result.

        Raises:
            InputError: the stack refuses the mission, or the bag is damaged.

        """
        began = time.perf_counter()
        stack, rows = self._stack, []
        stack.start(self._start, self._goals)
        with stack.guard.on_duty(), interruptible():
            for number, reading in enumerate(self._readings):
                check_interrupted()
                twist = stack.step(reading)
                driven = self._driven(reading.time)
                if driven is not None and reading.frame is not None:
                    self._recorder.log_driven(driven, reading.time)
                self._recorder.observe(reading, twist, None)
                if twist == Twist(0.0, 0.0):
                    self._held[self._reason()] += 1
                was = (math.nan, math.nan) if driven is None else (driven.v, driven.w)
                rows.append((reading.time, twist.v, twist.w, *was))
                progress(number + 1, len(self._readings))
        self._recorder.close()
        return self._result(np.array(rows), time.perf_counter() - began)

    def write(self, target: RunFolder, result: dict[str, Any]) -> None:
        """Write the run folder, into the temporary folder of ``target``."""
        target.write_json(RESULT, result)
        writers = target.input_writers(self._stack.config, self._stack.topo_map)
        writers[RECORDING] = self._recorder.save
        for name, write in writers.items():
            write(target.path / name)

    def _driven(self, now: float) -> Twist | None:
        """What the bag's robot was commanded at ``now`` [s]; None if nothing is known."""
        commands = self._contents.commands
        at = int(np.searchsorted(commands[:, 0], now, side="right")) - 1
        if at < 0 or now - commands[at, 0] > _HELD:
            return None
        return Twist(float(commands[at, 1]), float(commands[at, 2]))

    def _reason(self) -> str:
        """Why the stack stands."""
        state, safety = self._stack.state, self._stack.safety
        if safety.senses.camera_age > safety.params.camera_stop:
            return safety.senses.trouble or "the camera is silent"
        if self._stack.verdict.stopped:
            return self._stack.verdict.reason
        if state.fault is not None:
            return state.fault.reason
        if state.finished:
            return "it is at its goal"
        return "no command" if state.command is None else state.command.reason

    def _result(self, rows: Array, wall: float) -> dict[str, Any]:
        contents, duration = self._contents, float(rows[-1, 0] - rows[0, 0])
        contradiction = camera_contradiction(contents)
        notes = [contradiction] if contradiction else []
        notes += [*dict.fromkeys(contents.notes), *_turned(contents), *self._compared(rows)]
        return {
            "outcome": "replayed",
            "reason": f"{len(rows)} control ticks of {contents.bag.file}, to the end",
            "world": self._about["world"],
            "mission": "replay",
            "seed": 0,
            "sim_time_s": duration,
            "wall_time_s": wall,
            "real_time_factor": duration / max(wall, 1e-9),
            "images": len(contents.image_times) if contents.images else 0,
            "camera_moves_with_robot": not contradiction if contents.images else None,
            "command_hash": hash_commands(rows[:, :3]),
            "complete": self._recorder.complete,
            "notes": notes,
            "faults": list(self._stack.state.faults),
            "events": [],
            "config": json.loads(self._about["config"]),
            "revision": code_revision(),
            "machine": machine_kind(),
        }

    def _compared(self, rows: Array) -> list[str]:
        """The commands of the stack beside the bag's, and why it stood."""
        own, both = rows[:, 1:3], rows[np.isfinite(rows[:, 3])]
        notes = []
        if len(both):
            off = np.sqrt(np.mean((both[:, 1:3] - both[:, 3:]) ** 2, axis=0))
            notes.append(
                f"the robot was commanded {_mean(both[:, 3])} m/s in the mean, the stack would"
                f" have {_mean(both[:, 1])} m/s; they differ by {off[0]:.2f} m/s and"
                f" {off[1]:.2f} rad/s (root mean square)"
            )
            turns = both[(np.abs(both[:, [2, 4]]) > _TURNS).all(axis=1)]
            if len(turns):
                same = float((turns[:, 2] * turns[:, 4] > 0.0).mean())
                notes.append(f"where both turn, {same:.0%} of the time to the same side")
        else:
            notes.append("the bag has no commands to compare with")
        reasons = [f"{n / len(own):.0%} {why}" for why, n in self._held.most_common(_REASONS)]
        stood = sum(self._held.values()) / len(own)
        return [
            *notes,
            f"the stack would have stood for {stood:.0%} of the time: {', '.join(reasons)}",
        ]


def _mean(values: Array) -> str:
    return f"{round(float(values.mean()), 2) + 0.0:.2f}"  # no negative zero


def _turned(contents: BagContents) -> list[str]:
    """How far wheels and gyro have turned in their common time, if there are both."""
    gyro, odometry = contents.gyro, contents.odometry
    if len(gyro) < 2 or len(odometry) < 2 or not np.isfinite(gyro[:, 3]).all():
        return []
    begin, end = max(gyro[0, 0], odometry[0, 0]), min(gyro[-1, 0], odometry[-1, 0])
    middle = 0.5 * (gyro[1:, 3] + gyro[:-1, 3])
    angle = np.concatenate([[0.0], np.cumsum(np.diff(gyro[:, 0]) * middle)])
    turns = [
        math.degrees(float(np.diff(np.interp([begin, end], times, yaw))[0]))
        for times, yaw in ((gyro[:, 0], angle), (odometry[:, 0], odometry[:, 3]))
    ]
    return [f"turned by {turns[1]:.0f} degrees by the wheels, by {turns[0]:.0f} by the gyro"]
