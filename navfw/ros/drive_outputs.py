"""Publish the state of a driving node: pose, path, local map, image; ``now`` are stamps [ns]."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from navfw.localmap import OccupancyGrid
from navfw.numerics import Array, Image
from navfw.perceive import draw_flow
from navfw.recording import odometry_message, plain_json, ros_message
from navfw.recording.ros_messages import in_space, pose_fields, transforms_message
from navfw.ros.connection import RosNode
from navfw.signals import Belief, Frame, Pose, Waypoint
from navfw.stack import Stack, StackState
from navfw.topomap.occupancy_map import Cells

_GRID = "nav_msgs/msg/OccupancyGrid"
TOPICS = {
    "navfw/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "navfw/path": "nav_msgs/msg/Path",
    "navfw/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "navfw/local_map": _GRID,
    "navfw/explanation": "std_msgs/msg/String",
    "navfw/image/compressed": "sensor_msgs/msg/CompressedImage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""Topics that are published, and their types."""
_RATES = {
    "navfw/explanation": 2.0,
    "navfw/local_map": 2.0,
    "navfw/image/compressed": 5.0,
    "/diagnostics": 1.0,
}
"""Largest rate of each output [Hz]."""
_LATENCIES = 10_000
"""Number of latencies kept for the median."""
_ENLARGED = 3
_LINE, _LETTERS, _MARGIN = 18, 0.45, 6
"""Height of a line of text [px], size of its letters, and margin [px]."""


class DriveOutputs:
    """Publishes the decisions of ``stack`` on ``node``, each topic at its rate.

    ``topics`` are those that are published, with their types; ``latencies`` [s] are the newest
    times from an image's stamp to the command.
    """

    def __init__(self, node: RosNode, stack: Stack, topics: Mapping[str, str] = TOPICS) -> None:
        self._node, self._stack = node, stack
        self._told: dict[str, float] = {}
        self.latencies: deque[float] = deque(maxlen=_LATENCIES)
        self._publish = {
            topic: node.publisher(topic, kind, "latched" if kind == _GRID else "reliable")
            for topic, kind in topics.items()
        }

    def tell(self, frame: Frame, base: Pose | None, ended: str, now: int) -> None:
        """Publish the state after the last decision, made on ``frame``, at ``now`` [ns].

        ``base`` is the robot's own odometry, if it publishes the transform to ``base_link``.
        ``ended`` is why the robot does not drive, or "".
        """
        stack, state, send = self._stack, self._stack.state, self._publish
        camera, grid = stack.robot.camera, stack.local_map.occupancy
        if state.belief is not None and state.odometry is not None:
            send["navfw/pose"](pose_message(state.belief, now))
            send["navfw/path"](path_message(state.belief, state.path, now))
            send["navfw/odom"](odometry_message(state.odometry, now))
            at, own = (state.odometry.pose, camera) if base is None else (base, None)
            send["/tf"](transforms_message(at, now, state.belief, own))
        if self._turn_of("navfw/explanation"):
            send["navfw/explanation"](text_message(json.dumps(plain_json(stack.explain()))))
        if self._turn_of("navfw/local_map") and grid.located:
            send["navfw/local_map"](local_map_message(grid, now))
        if self._turn_of("navfw/image/compressed"):
            send["navfw/image/compressed"](overlay_message(frame, state, camera.width, now))
        if self._turn_of("/diagnostics"):
            level = 2 if state.fault else 1 if state.stuck or state.veto or state.faults else 0
            faults = {"sight": state.sight.name, "faults": "; ".join(state.faults)}
            summary, values = ended or state.veto or "driving", {**self.latency(), **faults}
            send["/diagnostics"](diagnostics_message(level, summary, values, now))

    def _turn_of(self, topic: str) -> bool:
        """Return whether the output is due, and has a subscriber."""
        now = time.monotonic()
        if now < self._told.get(topic, 0.0) or not self._node.wanted(topic):
            return False
        self._told[topic] = now + 1.0 / _RATES[topic]
        return True

    def latency(self) -> Mapping[str, float]:
        """Return the latency from an image's stamp to the command [ms]: median, 99th percentile."""
        if not self.latencies:
            return {}
        p50, p99 = np.percentile(1e3 * np.array(self.latencies), [50, 99]).round(1).tolist()
        return {"latency_p50_ms": p50, "latency_p99_ms": p99}


def pose_message(belief: Belief, now: int) -> bytes:
    """Encode ``PoseWithCovarianceStamped`` of ``base_link`` in ``map``, stamped ``now`` [ns]."""
    pose = {"pose": pose_fields(belief.pose.x, belief.pose.y, belief.pose.yaw)}
    fields = {"pose": {**pose, "covariance": in_space(belief.covariance)}}
    return _in("map", "geometry_msgs/msg/PoseWithCovarianceStamped", fields, now)


def path_message(belief: Belief, path: Sequence[Waypoint], now: int) -> bytes:
    """Encode ``Path`` in ``map`` from the robot through the waypoints, stamped ``now`` [ns]."""
    points = [(belief.pose.x, belief.pose.y), *((point.x, point.y) for point in path)]
    poses = [{"header": {"frame_id": "map"}, "pose": pose_fields(x, y, 0.0)} for x, y in points]
    return _in("map", "nav_msgs/msg/Path", {"poses": poses}, now)


def local_map_message(grid: OccupancyGrid, now: int) -> bytes:
    """Encode ``OccupancyGrid`` of the local map in ``odom``, stamped ``now`` [ns].

    Cells are in percent, -1 if unknown.
    """
    cell, (x, y) = grid.params.cell, grid.origin
    percent = np.rint(100.0 / (1.0 + np.exp(-grid.log_odds)))
    percent[np.abs(grid.log_odds) < 1e-3] = -1
    return grid_message("odom", percent, cell, Pose(x - 0.5 * cell, y - 0.5 * cell, 0.0), now)


def grid_message(frame: str, percent: Array | Cells, cell: float, corner: Pose, now: int) -> bytes:
    """Encode ``OccupancyGrid`` of ``percent`` (rows, columns), -1 if unknown, at ``now`` [ns].

    ``cell`` is the edge of a cell [m], ``corner`` the pose of the lower left corner in ``frame``.
    """
    rows, columns = percent.shape
    origin = pose_fields(corner.x, corner.y, corner.yaw)
    about = {"resolution": cell, "width": columns, "height": rows, "origin": origin}
    fields = {"info": about, "data": percent.astype(np.int8).ravel()}
    return _in(frame, _GRID, fields, now)


def text_message(text: str) -> bytes:
    """Encode ``String``."""
    return ros_message("std_msgs/msg/String", {"data": text})


def overlay_message(frame: Frame, state: StackState, flow_width: int, now: int) -> bytes:
    """Encode ``CompressedImage`` of the camera's image with the flow and OFFIS's sentence.

    ``flow_width`` [px] is that of the images to which the flow refers; the stamp is ``now`` [ns].
    """
    height, width = frame.image.shape
    size = _ENLARGED * width, _ENLARGED * height
    grey = cv2.resize(frame.image, size, interpolation=cv2.INTER_CUBIC)
    scene: Image = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    if state.flows:
        draw_flow(scene, state.flows[-1], size[0] / flow_width)
    sentence = "nothing seen yet" if state.percept is None else state.percept.sentence
    leader = "" if state.command is None else f"{state.command.leader}: {state.command.reason}"
    lines = [*sentence.split("; "), *([leader] if leader else [])]
    caption = np.full((_LINE * len(lines) + _MARGIN, size[0], 3), 255, np.uint8)
    for number, line in enumerate(lines, 1):
        at = _MARGIN, number * _LINE
        cv2.putText(
            caption, line, at, cv2.FONT_HERSHEY_SIMPLEX, _LETTERS, (0, 0, 0), 1, cv2.LINE_AA
        )
    _, packed = cv2.imencode(".jpg", np.concatenate([scene, caption]))
    fields = {"format": "jpeg", "data": np.asarray(packed).ravel()}
    return _in("camera", "sensor_msgs/msg/CompressedImage", fields, now)


def diagnostics_message(level: int, summary: str, values: Mapping[str, object], now: int) -> bytes:
    """Encode ``DiagnosticArray`` of one status, stamped ``now`` [ns].

    ``level`` is 0 if all is well, 1 for a warning, 2 for an error; ``values`` become text.
    """
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    status = {"level": level, "name": "navfw", "message": summary, "values": pairs}
    return _in("", "diagnostic_msgs/msg/DiagnosticArray", {"status": [status]}, now)


def _in(frame: str, kind: str, fields: Mapping[str, Any], now: int) -> bytes:
    return ros_message(kind, {"header": {"frame_id": frame}, **fields}, now)
