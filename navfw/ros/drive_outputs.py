"""What a driving node tells: where the robot is and goes, what it sees, and why; serialised."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from navfw.localmap import OccupancyGrid
from navfw.numerics import Image
from navfw.perceive import draw_flow
from navfw.recording import plain_json, ros_message
from navfw.signals import Belief, Frame, Waypoint
from navfw.stack import StackState

_ENLARGED = 3
_LINE, _LETTERS, _MARGIN = 18, 0.45, 6
"""Height of a line of text [px], size of its letters, and margin [px]."""


def pose_message(belief: Belief, now: int) -> bytes:
    """``PoseWithCovarianceStamped`` of ``base_link`` in ``map``."""
    covariance = np.zeros((6, 6))
    covariance[np.ix_([0, 1, 5], [0, 1, 5])] = belief.covariance
    pose = {"pose": _pose(belief.pose.x, belief.pose.y, belief.pose.yaw)}
    fields = {"pose": {**pose, "covariance": covariance.ravel()}}
    return _in("map", "geometry_msgs/msg/PoseWithCovarianceStamped", fields, now)


def path_message(belief: Belief, path: Sequence[Waypoint], now: int) -> bytes:
    """``Path`` in ``map`` from the robot through the waypoints."""
    points = [(belief.pose.x, belief.pose.y), *((point.x, point.y) for point in path)]
    poses = [{"header": {"frame_id": "map"}, "pose": _pose(x, y, 0.0)} for x, y in points]
    return _in("map", "nav_msgs/msg/Path", {"poses": poses}, now)


def grid_message(grid: OccupancyGrid, now: int) -> bytes:
    """``OccupancyGrid`` of the local map in ``odom``: percent, -1 where nothing is known."""
    cell, (x, y) = grid.params.cell, grid.origin
    percent = np.rint(100.0 / (1.0 + np.exp(-grid.log_odds)))
    percent[np.abs(grid.log_odds) < 1e-3] = -1
    rows, columns = percent.shape
    origin = _pose(x - 0.5 * cell, y - 0.5 * cell, 0.0)
    about = {"resolution": cell, "width": columns, "height": rows, "origin": origin}
    fields = {"info": about, "data": percent.astype(np.int8).ravel()}
    return _in("odom", "nav_msgs/msg/OccupancyGrid", fields, now)


def explanation_message(explanation: Mapping[str, Any]) -> bytes:
    """``String`` with the explanation of the last command as JSON."""
    return text_message(json.dumps(plain_json(explanation)))


def text_message(text: str) -> bytes:
    """``String``."""
    return ros_message("std_msgs/msg/String", {"data": text})


def overlay_message(frame: Frame, state: StackState, flow_width: int, now: int) -> bytes:
    """``CompressedImage`` of the camera's image with the flow and what OFFIS makes of it.

    ``flow_width`` [px] is that of the images of the stack, to which the flow refers.
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
    """``DiagnosticArray`` of one status: ``level`` 0 is good, 1 a warning, 2 an error."""
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    status = {"level": level, "name": "navfw", "message": summary, "values": pairs}
    return _in("", "diagnostic_msgs/msg/DiagnosticArray", {"status": [status]}, now)


def _in(frame: str, kind: str, fields: Mapping[str, Any], now: int) -> bytes:
    return ros_message(kind, {"header": {"frame_id": frame}, **fields}, now)


def _pose(x: float, y: float, yaw: float) -> Mapping[str, Any]:
    turn = {"z": math.sin(0.5 * yaw), "w": math.cos(0.5 * yaw)}
    return {"position": {"x": x, "y": y}, "orientation": turn}
