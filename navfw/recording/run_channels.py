"""The channels of a run: for its file, and for its live server."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from foxglove import Channel, Context, Schema
from foxglove import messages as typed
from foxglove.messages import Timestamp

from navfw.config.input_file import read_json_object
from navfw.guard import PluginGuard
from navfw.mofis.mofis import explain_command
from navfw.numerics import Image
from navfw.recording import channel_list as topics
from navfw.recording import ros_messages as ros
from navfw.recording import viewer_messages as messages
from navfw.recording.channel_list import SeenRun
from navfw.recording.run_folder import plain_json
from navfw.robot import RobotModel
from navfw.signals import Percept, Pose, SensorReading, Twist
from navfw.stack import Stack
from navfw.stack.stack_state import StackState

_IMAGE_FORMAT = "png"
"""Format of the images. It loses nothing; WebP and JPEG 2000 are a tenth smaller and take five to
ten times as long, an eighth of the run."""

OpenChannel = Callable[[topics.ChannelInfo], Any]
"""Opens a channel: it has ``has_sinks()``, and ``log(data, log_time=...)`` with a time [ns]."""


class SensorChannels:
    """Logs sensor readings, each with its images before it.

    Images are compressed in a thread of their own, and whatever comes later waits for them; the
    thread sees nothing but the images, which are not changed.
    """

    def __init__(self, open_channel: OpenChannel) -> None:
        channels = {info.topic: open_channel(info) for info in topics.SENSOR_CHANNELS}
        self._reading = channels.pop(topics.READING)
        self._images = channels
        self._packer = ThreadPoolExecutor(max_workers=1)
        self._waiting: deque[tuple[str, int, Future[bytes] | bytes]] = deque()

    def log(self, reading: SensorReading, twist: Twist) -> None:
        """Log one control tick: the reading, and the stack's command for it."""
        now = topics.nanoseconds(reading.time)
        frame, landmarks = reading.frame, reading.landmark_frame
        if frame is not None:
            self._pack(topics.CAMERA_IMAGE, frame.image, now)
            for topic, side in zip(topics.SIDE_IMAGES, frame.sides, strict=False):
                self._pack(topic, side, now)
        if landmarks is not None:
            self._pack(topics.LANDMARK_IMAGE, landmarks.image, now)
        self._waiting.append((topics.READING, now, ros.reading_message(reading, twist)))
        self.send(wait=False)

    def close(self) -> None:
        """Log what still waits; nothing can be logged afterwards."""
        self.send(wait=True)
        self._packer.shutdown()

    def _pack(self, topic: str, image: Image, now: int) -> None:
        if self._images[topic].has_sinks():
            self._waiting.append((topic, now, self._packer.submit(_packed, image)))

    def send(self, *, wait: bool) -> None:
        """Log what is ready, in order; with ``wait`` all of it."""
        while self._waiting:
            topic, now, data = self._waiting[0]
            if isinstance(data, Future):
                if not (wait or data.done()):
                    return
                data = data.result()
            self._waiting.popleft()
            if topic == topics.READING:
                self._reading.log(data, log_time=now)
            else:
                self._log_image(topic, data, now)

    def _log_image(self, topic: str, data: bytes, now: int) -> None:
        frame = topic.removeprefix("/").removesuffix("/image")
        content = {"format": _IMAGE_FORMAT, "data": np.frombuffer(data, dtype=np.uint8)}
        fields = {"header": {"frame_id": frame}, **content}
        message = ros.ros_message(topics.IMAGE_SCHEMA, fields, now)
        self._images[topic].log(message, log_time=now)


def _packed(image: Image) -> bytes:
    """An image in ``_IMAGE_FORMAT``; OpenCV lets other threads run meanwhile."""
    return cv2.imencode(f".{_IMAGE_FORMAT}", image)[1].tobytes()


_VISION_PERIOD = 0.2
"""Interval between two flows, percepts and ratings of all commands [s]: what costs most."""
_MAP_PERIOD = 0.5
"""Interval between two local maps, and between two lists of fired rules [s]."""
_LOG_PERIOD = 1.0
"""Interval between two lines of the log [s]."""
_MAX_TICKS = 60
"""Ticks of which messages are made at once, at the latest at a frame: each alone costs three times
as much, with cold caches."""
_WORLD_PERIOD = 5.0
"""Interval at which the world is sent again, for viewers that join [s]."""


class RunChannels:
    """Logs every control tick of a run to channels of ``open_channel``.

    Without ``seen`` the sensor readings and images alone. A channel without a receiver costs
    nothing. The stack is only read: its plugins explain themselves outside its guard, so that a
    fault in an explanation is none of the run.
    """

    def __init__(self, open_channel: OpenChannel, seen: SeenRun | None = None) -> None:
        self._open_channel = open_channel
        self._sensors = SensorChannels(open_channel)
        self._seen = seen
        self._guard = PluginGuard()
        self._ticks: list[tuple[SensorReading, Twist]] = []
        self._channels: dict[str, Any] = {}
        for info in topics.VIEWER_CHANNELS if seen is not None else ():
            self._channels[info.topic] = open_channel(info)
        self.restart()

    def restart(self) -> None:
        """Log at the next frame what is not logged at every one, for who joins."""
        self._next_vision = self._next_map = self._next_world = self._next_log = 0.0

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose | None) -> None:
        """Log one control tick: the reading, the stack's command, the true pose if it is known."""
        self._sensors.log(reading, twist)
        if self._seen is None:
            return
        self._ticks.append((reading, twist))
        if reading.frame is not None or len(self._ticks) >= _MAX_TICKS:
            self._log_ticks(self._seen.stack.robot)
        if reading.frame is not None:
            now, camera = topics.nanoseconds(reading.time), self._seen.stack.robot.camera
            size = reading.frame.image.shape
            self._log(topics.CAMERA_INFO, now, ros.camera_message, camera, size, now)
            self._show(self._seen, reading.time, twist, pose)

    def log_driven(self, twist: Twist, time: float) -> None:
        """Log what the robot was commanded at ``time`` [s] while the stack was not in command."""
        if topics.DRIVEN not in self._channels:
            self._channels[topics.DRIVEN] = self._open_channel(topics.DRIVEN_CHANNEL)
        now = topics.nanoseconds(time)
        self._log(topics.DRIVEN, now, ros.command_message, twist, now)

    def flush(self) -> None:
        """Log what still waits."""
        self._sensors.send(wait=True)

    def close(self) -> None:
        """Log what still waits; nothing can be logged afterwards."""
        if self._seen is not None:
            self._log_ticks(self._seen.stack.robot)
        self._sensors.close()

    def _log_ticks(self, robot: RobotModel) -> None:
        """Log gyro, wheels and command of the ticks that wait."""
        ticks = [(topics.nanoseconds(r.time), r, twist) for r, twist in self._ticks]
        self._ticks.clear()
        for now, reading, _ in ticks:
            self._log(topics.IMU, now, ros.imu_message, robot, reading, now)
        for now, reading, _ in ticks:
            self._log(topics.JOINTS, now, ros.joints_message, robot, reading, now)
        for now, _, twist in ticks:
            self._log(topics.TWIST, now, ros.command_message, twist, now)

    def _show(self, seen: SeenRun, now: float, twist: Twist, pose: Pose | None) -> None:
        """Log what the stack has made of the newest frame."""
        stack, state = seen.stack, seen.stack.state
        log_time = topics.nanoseconds(now)
        stamp = Timestamp(*divmod(log_time, 10**9))
        if pose is not None:
            self._log(topics.TRUE_POSE, log_time, messages.true_pose_message, pose, stamp)
        if now >= self._next_vision:
            self._next_vision = now + _VISION_PERIOD - 1e-9
            self._show_vision(stack, state, stamp, log_time)
        self._show_belief(stack, state, twist, stamp, log_time)
        if state.command is not None:
            self._log_json(topics.COMMAND, log_time, _command, state)
        tracks = stack.tracker.confirmed
        self._log(topics.OBSTACLES, log_time, messages.obstacles_message, tracks, now, stamp)
        if now >= self._next_log:
            self._next_log = now + _LOG_PERIOD - 1e-9
            self._log(topics.LOG, log_time, _line, state, log_time)
        if now >= self._next_world:
            self._next_world = now + _WORLD_PERIOD - 1e-9
            self._log(topics.WORLD, log_time, messages.world_message, seen.outline, stamp)
        if now >= self._next_map:
            self._next_map = now + _MAP_PERIOD - 1e-9
            if stack.local_map.occupancy.located:
                grid = stack.local_map.occupancy
                self._log(topics.LOCAL_MAP, log_time, messages.local_map_message, grid, stamp)
            if state.command is not None:
                self._log_json(topics.RULES, log_time, _rules, stack, state, self._guard)

    def _show_vision(
        self, stack: Stack, state: StackState, stamp: Timestamp, log_time: int
    ) -> None:
        camera = stack.robot.camera
        if state.flows:
            flow = state.flows[-1]
            self._log(topics.FLOW, log_time, messages.flow_message, flow, camera, stamp)
        if state.percept is not None and state.flows:
            percept = state.percept
            self._log(topics.CELLS, log_time, messages.cells_message, percept, camera, stamp)
            self._log_json(topics.PERCEPT, log_time, _percept, percept)
        if state.command is not None and state.proposals:
            grid = stack.mofis.commands
            rated = state.proposals, grid.v, grid.w, stamp
            self._log(topics.PROPOSALS, log_time, messages.proposals_message, *rated)

    def _show_belief(
        self, stack: Stack, state: StackState, twist: Twist, stamp: Timestamp, log_time: int
    ) -> None:
        belief, odometry = state.belief, state.odometry
        if belief is None or odometry is None:
            return
        camera = stack.robot.camera
        placed = odometry.pose, log_time, belief, camera
        self._log(topics.TRANSFORMS, log_time, ros.transforms_message, *placed)
        self._log(topics.ODOMETRY, log_time, ros.odometry_message, odometry, log_time)
        self._log(topics.POSE, log_time, messages.pose_message, belief, odometry.twist, stamp)
        self._log(topics.PATH, log_time, messages.path_message, belief, state.path, stamp)
        context = stack.mofis.context
        if state.command is not None and context is not None and context.local_goal is not None:
            goal = context.local_goal
            self._log(topics.LOCAL_GOAL, log_time, messages.local_goal_message, goal, stamp)

    def _log(self, topic: str, log_time: int, make: Any, *arguments: Any) -> None:
        """Log what ``make`` gives, if anybody receives it."""
        channel = self._channels[topic]
        if channel.has_sinks():
            made = make(*arguments)
            data = made if isinstance(made, bytes) else made.encode()
            channel.log(data, log_time=log_time)

    def _log_json(self, topic: str, log_time: int, make: Any, *arguments: Any) -> None:
        self._log(topic, log_time, lambda: _json(make(*arguments)))


def context_channels(context: Context) -> OpenChannel:
    """Channels whose sinks are those of ``context``."""

    def open_channel(info: topics.ChannelInfo) -> Channel:
        encoding, schema = channel_schema(info)
        return Channel(info.topic, schema=schema, message_encoding=encoding, context=context)

    return open_channel


def channel_schema(info: topics.ChannelInfo) -> tuple[str, Schema]:
    """Encoding and schema of messages: Foxglove's, of ROS 2, or JSON by ``json_schemas``."""
    namespace, _, name = info.schema.partition(".")
    if namespace == "foxglove":
        return "protobuf", getattr(typed, name).get_schema()
    if "/msg/" in info.schema:
        text = topics.SCHEMA if info.topic == topics.READING else ros.schema_text(info.schema)
        return "cdr", Schema(name=info.schema, encoding="ros2msg", data=text.encode())
    data = json.dumps(json_schemas()[info.schema]).encode()
    return "json", Schema(name=info.schema, encoding="jsonschema", data=data)


@cache
def json_schemas() -> dict[str, Any]:
    """The JSON schemas of the channels in JSON, by their name."""
    return read_json_object(Path(__file__).with_name("json_schemas.json"))


def _json(value: Mapping[str, Any]) -> str:
    """``value`` as JSON; only values that JSON does not know cost a copy of all."""
    try:
        return json.dumps(value, default=dict, allow_nan=False)
    except (TypeError, ValueError):
        return json.dumps(plain_json(value))


def _line(state: StackState, now: int) -> bytes:
    """A line of the log: why the stack is held (a warning, 30), or what it does (20)."""
    command, held = state.command, state.veto or (state.fault.reason if state.fault else "")
    does = "no command" if command is None else f"{command.leader}: {command.reason}"
    said = {"msg": f"held: {held}" if held else does, "level": 30 if held else 20}
    fields = {"stamp": ros.time_fields(now), "name": "navfw", **said}
    return ros.ros_message("rcl_interfaces/msg/Log", fields)


def _percept(percept: Percept) -> Mapping[str, Any]:
    named = ("obstacles", "quadrants", "planes", "slopes", "situations")
    return {name: getattr(percept, name) for name in ("sentence", "floor_in_front", *named)}


def _command(state: StackState) -> Mapping[str, Any]:
    command, proposals = state.command, state.proposals or {}
    if command is None:
        return {}
    return {
        "v": command.twist.v,
        "w": command.twist.w,
        "leader": command.leader,
        "reason": command.reason,
        "emergency": command.emergency,
        "weights": command.weights,
        "reasons": {name: proposal.reason for name, proposal in proposals.items()},
        "applicability": {name: proposal.applicability for name, proposal in proposals.items()},
        "confidence": None if state.belief is None else state.belief.confidence,
        "lost": state.belief is not None and state.belief.lost,
        "hypotheses": 0 if state.belief is None else state.belief.hypotheses,
    }


def _rules(stack: Stack, state: StackState, guard: PluginGuard) -> Mapping[str, Any]:
    """The rules that fired for the command, as ``navfw explain`` gives them."""
    if state.command is None or state.proposals is None:
        return {}
    fired = explain_command(state.command, state.proposals, stack.mofis, guard)
    sentence = "" if state.percept is None else state.percept.sentence
    return {**fired, "perception": {"sentence": sentence}}
