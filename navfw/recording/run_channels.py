"""Log a run to channels: those of its file, and those of its live server."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from foxglove import Channel, Context, Schema
from foxglove import messages as typed
from foxglove.messages import Timestamp

from navfw.config.input_file import read_json_object
from navfw.guard import PluginGuard
from navfw.numerics import Image
from navfw.recording import channel_list as topics
from navfw.recording import ros_messages as ros
from navfw.recording import viewer_messages as messages
from navfw.recording.channel_list import SeenRun
from navfw.recording.decision_message import encoded_decision
from navfw.recording.recorded_rules import rule_bases
from navfw.recording.run_folder import plain_json
from navfw.recording.top_view import MOVER, Disc
from navfw.signals import Command, Percept, Pose, SensorReading, Twist
from navfw.stack.stack_state import StackState

_IMAGE_FORMAT = "png"
"""Format of images. It is lossless; WebP and JPEG 2000 are a tenth smaller and take five to ten
times as long, an eighth of the run."""

OpenChannel = Callable[[topics.Topic], Any]
"""Opens a channel, which has ``has_sinks()``, and ``log(data, log_time=...)`` with a time [ns]."""


_PERIODS: dict[str, float] = {
    info: 1.0 / rate
    for info in topics.CHANNELS
    if (rate := float(info.rate.partition(" ")[0])) < 10.0
}
"""Intervals [s] of channels that are logged less often than every frame."""


class RunChannels:
    """Logs every control tick of a run to channels that ``open_channel`` opens.

    Without ``seen`` only the sensor readings, each with its images before it. A channel without a
    receiver costs nothing. The stack is only read: its plugins explain themselves outside its
    guard, so that a fault in an explanation is not counted as one of the run.
    """

    def __init__(self, open_channel: OpenChannel, seen: SeenRun | None = None) -> None:
        self._open_channel = open_channel
        self._seen = seen
        self._guard = PluginGuard()
        opened = topics.SENSOR_CHANNELS if seen is None else topics.CHANNELS
        self._channels: dict[str, Any] = {info: open_channel(info) for info in opened}
        self.restart()

    def restart(self) -> None:
        """Log the less frequent channels at the next frame, for a viewer that joins."""
        self._next: dict[str, float] = {}

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose | None) -> None:
        """Log one control tick: the reading, the stack's command, the true pose if it is known."""
        now = topics.nanoseconds(reading.time)
        frame, landmarks = reading.frame, reading.landmark_frame
        images: dict[str, Image] = {}
        if landmarks is not None:
            images[topics.LANDMARK_IMAGE] = landmarks.image
        if frame is not None:
            images[topics.CAMERA_IMAGE] = frame.image
            images |= zip(topics.SIDE_IMAGES, frame.sides, strict=False)
        for topic, image in images.items():
            self._log(topic, now, partial(image_message, topic, image, now))
        self._log(topics.READING, now, partial(ros.reading_message, reading, twist))
        if self._seen is None:
            return
        robot = self._seen.stack.robot
        self._log(topics.IMU, now, partial(ros.imu_message, robot, reading, now))
        self._log(topics.JOINTS, now, partial(ros.joints_message, robot, reading, now))
        self._log(topics.TWIST, now, partial(ros.command_message, twist, now))
        if frame is not None:
            size = frame.image.shape
            self._log(topics.CAMERA_INFO, now, partial(ros.camera_message, robot.camera, size, now))
            for topic, make in _views(self._seen, reading.time, pose, self._guard):
                if reading.time >= self._next.get(topic, 0.0):
                    self._next[topic] = reading.time + _PERIODS.get(topic, 0.0) - 1e-9
                    self._log(topic, now, make)

    def log_driven(self, twist: Twist, time: float) -> None:
        """Log the command that moved the robot at ``time`` [s] while the stack did not."""
        if topics.DRIVEN not in self._channels:
            self._channels[topics.DRIVEN] = self._open_channel(topics.DRIVEN)
        now = topics.nanoseconds(time)
        self._log(topics.DRIVEN, now, partial(ros.command_message, twist, now))

    def _log(self, topic: str, log_time: int, make: Callable[[], Any]) -> None:
        """Log the message that ``make`` gives, if anybody receives it."""
        channel = self._channels[topic]
        if channel.has_sinks():
            made = make()
            made = _json(made) if isinstance(made, Mapping) else made
            channel.log(made if isinstance(made, bytes) else made.encode(), log_time=log_time)


def _json(content: Mapping[str, Any]) -> str:
    """Convert ``content`` to JSON; most is plain already."""
    try:
        return json.dumps(content, allow_nan=False)
    except (TypeError, ValueError):
        return json.dumps(plain_json(content, topics.DIGITS))


def image_message(topic: str, image: Image, now: int, code: str = _IMAGE_FORMAT) -> bytes:
    """Encode an image, gray or BGR, as ``CompressedImage``, stamped ``now`` [ns].

    ``code`` is the format, as in ``png``; the frame is called after ``topic``, without "/image".
    """
    data = np.asarray(cv2.imencode(f".{code}", image)[1]).ravel()
    frame = {"frame_id": topic.removeprefix("/").removesuffix("/image")}
    fields = {"header": frame, "format": code, "data": data}
    return ros.ros_message(topics.IMAGE_SCHEMA, fields, now)


def _views(
    seen: SeenRun, now: float, pose: Pose | None, guard: PluginGuard
) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield topics, and functions that make their messages, of the stack's state at a new frame."""
    stack, state = seen.stack, seen.stack.state
    camera, grid, tracks = stack.robot.camera, stack.local_map.occupancy, stack.tracker.confirmed
    command, belief, odometry = state.command, state.belief, state.odometry
    log_time = topics.nanoseconds(now)
    stamp = Timestamp(*divmod(log_time, 10**9))
    if pose is not None:
        yield topics.TRUE_POSE, partial(messages.pose_in_message, "map", pose, stamp)
    if state.flows:
        yield topics.FLOW, partial(messages.flow_message, state.flows[-1], camera, stamp)
    if state.percept is not None and state.flows:
        yield topics.CELLS, partial(messages.cells_message, state.percept, camera, stamp)
        yield topics.PERCEPT, partial(_percept, state.percept)
    if command is not None and state.proposals:
        rated = state.proposals, stack.mofis.commands.v, stack.mofis.commands.w, stamp
        yield topics.PROPOSALS, partial(messages.proposals_message, *rated)
    if belief is not None and odometry is not None:
        placed = odometry.pose, log_time, belief, camera
        yield topics.TRANSFORMS, partial(ros.transforms_message, *placed)
        yield topics.ODOMETRY, partial(ros.odometry_message, odometry, log_time)
        yield topics.POSE, partial(messages.pose_message, belief, odometry.twist, stamp)
        yield topics.PATH, partial(messages.path_message, belief, state.path, stamp)
        context = stack.mofis.context
        if command is not None and context is not None and context.local_goal is not None:
            goal = Pose(context.local_goal.x, context.local_goal.y, 0.0)
            yield topics.LOCAL_GOAL, partial(messages.pose_in_message, "base_link", goal, stamp)
    yield topics.OBSTACLES, partial(messages.obstacles_message, tracks, now, stamp)
    if movers := seen.movers():
        discs = [Disc(*disc, MOVER) for disc in movers]
        scene = partial(messages.scene_message, discs, "map", "movers", stamp)
        yield topics.TRUE_OBSTACLES, scene
    yield topics.LOG, partial(_line, state, log_time)
    yield topics.RULE_BASES, partial(rule_bases, stack.mofis)
    shapes = seen.outline.shapes()
    yield topics.WORLD, partial(messages.scene_message, shapes, "map", "world", stamp)
    if grid.located:
        yield topics.LOCAL_MAP, partial(messages.local_map_message, grid, stamp)
    if command is not None:
        yield topics.COMMAND, partial(_command, state, command)
        yield topics.RULES, partial(stack.explain, guard, inference=False)
        if stack.mofis.context is not None:
            yield topics.DECISION, partial(encoded_decision, stack.mofis.context, command.twist)


def context_channels(context: Context) -> OpenChannel:
    """Return a function that opens channels whose sinks are those of ``context``."""

    def open_channel(info: topics.Topic) -> Channel:
        encoding, schema = channel_schema(info)
        return Channel(info, schema=schema, message_encoding=encoding, context=context)

    return open_channel


def channel_schema(info: topics.Topic) -> tuple[str, Schema]:
    """Return the encoding and the schema of messages: Foxglove's, of ROS 2, or JSON."""
    namespace, _, name = info.schema.partition(".")
    if namespace == "foxglove":
        return "protobuf", getattr(typed, name).get_schema()
    if "/msg/" in info.schema:
        text, _ = ros.message_types().generate_msgdef(info.schema, ros_version=2)
        text = topics.SCHEMA if info == topics.READING else text
        return "cdr", Schema(name=info.schema, encoding="ros2msg", data=text.encode())
    data = json.dumps(json_schemas()[info.schema]).encode()
    return "json", Schema(name=info.schema, encoding="jsonschema", data=data)


@cache
def json_schemas() -> dict[str, Any]:
    """Return the JSON schemas of the channels in JSON, by their name."""
    return read_json_object(Path(__file__).with_name("json_schemas.json"))


def _line(state: StackState, now: int) -> bytes:
    """Encode a line of the log: why the stack is held (a warning, 30), or what it does (20)."""
    command, held = state.command, state.veto or (state.fault.reason if state.fault else "")
    does = "no command" if command is None else f"{command.leader}: {command.reason}"
    said = {"msg": f"held: {held}" if held else does, "level": 30 if held else 20}
    fields = {"stamp": ros.time_fields(now), "name": "navfw", **said}
    return ros.ros_message("rcl_interfaces/msg/Log", fields)


def _percept(percept: Percept) -> Mapping[str, Any]:
    named = ("obstacles", "quadrants", "planes", "slopes", "situations")
    return {name: getattr(percept, name) for name in ("sentence", "floor_in_front", *named)}


def _command(state: StackState, command: Command) -> Mapping[str, Any]:
    proposals, belief = state.proposals or {}, state.belief
    return {
        "v": command.twist.v,
        "w": command.twist.w,
        "leader": command.leader,
        "reason": command.reason,
        "emergency": command.emergency,
        "held": state.veto or (state.fault.reason if state.fault else ""),
        "slower": state.slower,
        "weights": command.weights,
        "reasons": {name: proposal.reason for name, proposal in proposals.items()},
        "applicability": {name: proposal.applicability for name, proposal in proposals.items()},
        "confidence": None if belief is None else belief.confidence,
        "lost": belief is not None and belief.lost,
        "hypotheses": 0 if belief is None else belief.hypotheses,
    }
