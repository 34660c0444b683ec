"""Run the stack on a bag: compare its commands with those that moved the robot."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from itertools import pairwise
from typing import Any

import numpy as np

from navfw import recording
from navfw.errors import InputError, locating
from navfw.numerics import Array
from navfw.perceive import camera_contradiction
from navfw.perceive.folder_drive import FolderDrive
from navfw.plugins import default_registry
from navfw.process.interruption import check_interrupted, interruptible
from navfw.recording.channel_list import SeenRun
from navfw.robot import RobotModel
from navfw.ros.camera_images import CameraImages, grey_image
from navfw.ros.sensor_inputs import TOLERANCE, goal_at
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Twist
from navfw.stack import ShadowStack
from navfw.topomap import Passage, Place, TopoMap

_GAP = 0.5
"""Time [s] without a reading of the wheels from which they count as silent; between two readings
that are nearer, counts are interpolated: a drive has them one interval later."""
_SLACK = 1e-6
"""Rounding of times [s]."""
_DELAY = 1.0
"""Largest time [s] from an image's stamp to its reception; a command of the bag holds so long."""
_LEG = 2.0
"""Distance [m] between the places along a path that was driven."""


def _gyro(bag: recording.Bag | FolderDrive) -> Array:
    """Return the rates (n, 4) by the gyro, or else by the wheels, only about the vertical."""
    if len(bag.gyro) or len(bag.odometry) < 2:
        return bag.gyro
    bag.notes.append("there is no gyro: turns are those of the wheels")
    rates = np.diff(bag.odometry[:, 3]) / np.diff(bag.odometry[:, 0])
    nothing = np.full(len(rates), math.nan)
    return np.column_stack([bag.odometry[1:, 0], nothing, nothing, rates])


class BagReadings:
    """The readings of ``robot`` in ``bag`` at its control rate; to be iterated once.

    With ``only_gyro`` the rates of a bag without a gyro are unknown, not those of the wheels.
    """

    def __init__(
        self, bag: recording.Bag | FolderDrive, robot: RobotModel, only_gyro: bool = False
    ) -> None:
        self._bag, self._robot, self._gyro = bag, robot, bag.gyro if only_gyro else _gyro(bag)
        known = bag if isinstance(bag, recording.Bag) and bag.info is not None else None
        self._camera = CameraImages(
            robot.camera, "" if known is None else known.image_topic, bag.notes.append
        )
        if known is not None:
            self._camera.describe(known.info_topic, known.info)
        turned = 0.5 * robot.track * bag.odometry[:, 3]
        way = recording.driven_way(bag.odometry)
        rolled = np.column_stack([bag.odometry[:, 0], way - turned, way + turned])
        if len(bag.joints):
            rolled = bag.joints * [1.0, robot.wheel_radius, robot.wheel_radius]
        per_way = robot.ticks_per_turn / (2.0 * math.pi * robot.wheel_radius)
        self._ticks = rolled * [1.0, per_way, per_way]
        self._begin = float(rolled[0, 0]) if len(rolled) else 0.0
        end = float(rolled[-1, 0]) if len(rolled) else 0.0
        if (len(rolled) or not only_gyro) and bag.duration - end > _GAP:
            bag.notes.append(f"the wheels are silent for the last {bag.duration - end:.1f} s")

    def __len__(self) -> int:
        return max(int((self._bag.duration - self._begin) * self._robot.control_rate) + 1, 1)

    def __iter__(self) -> Iterator[SensorReading]:
        last = -math.inf
        with closing(self._bag.each_image()) as images:
            ahead = next(images, None)
            for tick in range(len(self)):
                now, newest = self._begin + tick / self._robot.control_rate, None
                while ahead is not None and _due(ahead) <= now + _SLACK:
                    newest, ahead = ahead, next(images, None)
                frame = None if newest is None else self._frame(newest)
                yield SensorReading(now, self._inertial(last, now), self._encoders(now), frame)
                last = now

    def _inertial(self, last: float, now: float) -> Inertial:
        """Return the mean rates since ``last`` [s], or the last ones before."""
        times = self._gyro[:, 0]
        begin, end = np.searchsorted(times, [last + _SLACK, now + _SLACK]).tolist()
        if end == 0:
            return Inertial(self._begin, math.nan, math.nan, math.nan)
        rates = self._gyro[min(begin, end - 1) : end, 1:].mean(axis=0)
        return Inertial(float(times[end - 1]), *rates.tolist())

    def _encoders(self, now: float) -> Encoders:
        after = int(np.searchsorted(self._ticks[:, 0], now + _SLACK))
        if after == 0:
            return Encoders(self._begin, 0, 0)
        taken, *ticks = self._ticks[after - 1].tolist()
        if after < len(self._ticks) and self._ticks[after, 0] - taken <= _GAP:
            times, taken = self._ticks[after - 1 : after + 1, 0], now
            ticks = [np.interp(now, times, self._ticks[after - 1 : after + 1, k]) for k in (1, 2)]
        return Encoders(min(taken, now), round(float(ticks[0])), round(float(ticks[1])))

    def _frame(self, item: recording.BagImage) -> Frame | None:
        """Return the image in the camera's size; None, and a note, if it is damaged."""
        try:
            grey = grey_image(item.message, item.name)
        except InputError as error:
            self._bag.notes.append(f"an image is left out: {error}")
            return None
        with locating(file=self._bag.file, key="--robot"):
            return Frame(item.time, self._camera.taken(grey))


def _due(item: recording.BagImage) -> float:
    """Return when [s] an image was delivered: as received, if stamps are on the same clock."""
    return item.received if 0.0 <= item.received - item.time <= _DELAY else item.time


def driven_map(bag: recording.Bag) -> TopoMap:
    """Make a map of the path that the bag's wheels drove, with its start at the origin.

    It has a place every two metres; if the robot did not move it leads two metres ahead.
    """
    points = [(0.0, 0.0)]
    if len(bag.odometry):
        way = np.abs(np.diff(recording.driven_way(bag.odometry), prepend=0.0)).cumsum()
        start = Pose(*bag.odometry[0, 1:].tolist())
        for row in [*np.searchsorted(way, np.arange(_LEG, way[-1], _LEG)).tolist(), -1]:
            point = start.to_local(*bag.odometry[row, 1:3].tolist())
            points += [point] if math.dist(point, points[-1]) > 0.25 * _LEG else []
    points += [(_LEG, 0.0)] if len(points) < 2 else []
    places = [Place(f"driven-{number}", x, y) for number, (x, y) in enumerate(points)]
    passages = [Passage(a.name, b.name, a.distance(b.x, b.y)) for a, b in pairwise(places)]
    return TopoMap("driven", places, passages)


class BagReplay:
    """Runs the stack ``stack_name`` on the readings of ``bag``, for ``robot`` on ``topo_map``.

    From ``start`` (None: unknown) it heads for the places ``goals``; the robot moves as it did.

    Raises:
        UnknownNameError: there is no such stack, or place on the map.

    """

    def __init__(
        self,
        bag: recording.Bag,
        robot: RobotModel,
        topo_map: TopoMap,
        start: Pose | None,
        goals: Sequence[str],
        stack_name: str = "default",
    ) -> None:
        self._bag, self._start, self._robot = bag, start, robot
        self._goals = [goal_at(topo_map, name) for name in goals]
        self._stack = ShadowStack.load(stack_name, robot, topo_map, default_registry())
        self._config = {"mission": self._mission(), "stack": self._stack.config}
        self._held: Counter[str] = Counter()

    def _mission(self) -> dict[str, Any]:
        start, robot = self._start or Pose(0.0, 0.0, 0.0), self._robot
        return {
            "start": [start.x, start.y, start.yaw],
            "start_known": self._start is not None,
            "shadow": True,
            "goals": [{"place": goal.place, "x": goal.x, "y": goal.y} for goal in self._goals],
            "tolerance": TOLERANCE,
            "robot": robot.model_dump(mode="json", include=set(RobotModel.model_fields)),
        }

    def run(
        self, target: recording.RunFolder, progress: Callable[[int, int], None] = lambda *_: None
    ) -> dict[str, Any]:
        """Replay the whole bag into a run folder; ``progress`` takes the ticks done, and all ticks.

        Returns the content of its result.

        Raises:
            InputError: the bag is damaged, or its images are not those of the robot's camera.

        """
        began, rows, stack = time.perf_counter(), [], self._stack
        config = json.dumps(recording.plain_json(self._config))
        recorder = recording.RunRecorder(
            {"world": self._bag.path.name, "config": config},
            SeenRun(stack, recording.WorldOutline()),
            path=target.path / recording.RECORDING,
        )
        contradiction = camera_contradiction(self._bag)
        self._bag.notes[:0] = [contradiction] if contradiction else []
        stack.start(self._start, self._goals)
        readings = BagReadings(self._bag, self._robot)
        with stack.guard.watchdog.on_duty(), interruptible():
            for number, reading in enumerate(readings):
                check_interrupted()
                twist, driven = stack.step(reading), self._driven(reading.time)
                if reading.frame is not None and driven is not None:
                    recorder.log_driven(driven, reading.time)
                recorder.observe(reading, twist, None)
                self._held[self._reason()] += twist == Twist(0.0, 0.0)
                was = (math.nan, math.nan) if driven is None else (driven.v, driven.w)
                rows.append((reading.time, twist.v, twist.w, *was))
                progress(number + 1, len(readings))
        result = self._result(np.array(rows), time.perf_counter() - began)
        target.write_json(recording.RESULT, result)
        target.write_inputs(stack.config, stack.topo_map)
        recorder.save(target.path / recording.RECORDING)
        return result

    def _driven(self, now: float) -> Twist | None:
        """Return the command of the bag's robot at ``now`` [s]; None if unknown."""
        commands = self._bag.commands
        at = int(np.searchsorted(commands[:, 0], now, side="right")) - 1
        known = at >= 0 and now - commands[at, 0] <= _DELAY
        return Twist(*commands[at, 1:].tolist()) if known else None

    def _reason(self) -> str:
        """Return why the stack stands, if it does."""
        state, safety = self._stack.state, self._stack.safety
        if safety.senses.camera_age > safety.params.camera_stop:
            return safety.senses.trouble or "the camera is silent"
        if self._stack.verdict.stopped:
            return self._stack.verdict.reason
        if state.finished:
            return "it is at its goal"
        return "no command" if state.command is None else state.command.reason

    def _result(self, rows: Array, wall: float) -> dict[str, Any]:
        duration = float(rows[-1, 0] - rows[0, 0])
        return {
            "outcome": "replayed",
            "reason": f"{len(rows)} control ticks of {self._bag.file}, to the end",
            "world": self._bag.path.name,
            "mission": "replay",
            "seed": 0,
            "sim_time_s": duration,
            "wall_time_s": wall,
            "real_time_factor": duration / max(wall, 1e-9),
            "command_hash": recording.hash_commands(rows[:, :3]),
            "notes": [*dict.fromkeys(self._bag.notes), *self._compared(rows)],
            "assumed": [one.as_data() for one in self._bag.assumed],
            "faults": list(self._stack.state.faults),
            "events": [],
            "config": self._config,
            "revision": recording.code_revision(),
            "machine": recording.machine_kind(),
        }

    def _compared(self, rows: Array) -> list[str]:
        """Compare the commands of the stack with the bag's, and say why it stood."""
        both = rows[np.isfinite(rows[:, 3])]
        notes = [] if len(both) else ["the bag has no commands to compare with"]
        if len(both):
            v, was = (round(float(column.mean()), 2) + 0.0 for column in both[:, [1, 3]].T)
            off = np.sqrt(np.mean((both[:, 1:3] - both[:, 3:]) ** 2, axis=0))
            what = (
                f"the robot was commanded {was:.2f} m/s in the mean, the stack would have {v:.2f}"
            )
            notes.append(f"{what}; they differ by {off[0]:.2f} m/s, {off[1]:.2f} rad/s (RMS)")
        stood = f"the stack would have stood for {self._held.total() / len(rows):.0%} of the time"
        reasons = [f"{n / len(rows):.0%} {why}" for why, n in self._held.most_common(3) if n]
        return [*notes, f"{stood}: {', '.join(reasons)}" if reasons else stood]
