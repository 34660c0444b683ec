"""``navfw ros sense``: one camera as a range sensor for other nodes; ``now`` are stamps [ns]."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from navfw.numerics import Array
from navfw.perceive.perceiver import nearness_ahead
from navfw.recording import odometry_message, plain_json, ros_message
from navfw.recording.ros_messages import transforms_message
from navfw.ros.connection import RosNode
from navfw.ros.drive_outputs import DriveOutputs, diagnostics_message, text_message
from navfw.signals import Frame, Pose
from navfw.stack import Stack, StackState
from navfw.stack.sensing_stack import SensingStack

_SCAN, _CLOUD = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
TOPICS: Mapping[str, tuple[str, str]] = {
    "navfw/scan": (_SCAN, "the view by degrees: obstacles; inf free to the range, NaN unknown"),
    "navfw/free": (_SCAN, "how far the floor is seen free, to clear a costmap"),
    "navfw/obstacles": (_CLOUD, "occupied cells: x, y, z, sigma [m], age [s]"),
    "navfw/odom": ("nav_msgs/msg/Odometry", "by wheels, gyro and floor, with covariance"),
    "navfw/time_to_contact": ("std_msgs/msg/Float32", "with what is ahead [s]"),
    "navfw/percept": ("std_msgs/msg/String", "what OFFIS reads, as JSON"),
    "navfw/sentence": ("std_msgs/msg/String", "the same in words"),
    "/tf": ("tf2_msgs/msg/TFMessage", "odom to base_link, with publish_tf"),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", "state, latency"),
}
"""Topics that are published: type, and meaning."""
MAX_RANGE = 2.5
"""Largest range of the scans [m]: beyond it most obstacles are not seen yet."""
_MIN_RANGE = 0.02
"""Least range of the scans [m]."""
_DEGREE = math.radians(1.0)
"""Angle between two rays [rad]."""
_STANDING = 0.02
"""Speed [m/s] up to which nothing counts as coming nearer."""
_FLOAT = 7
"""Code of a ``PointField`` of four bytes."""
_COLUMNS = ("x", "y", "z", "sigma", "age")


class SenseOutputs(DriveOutputs):
    """Publishes on ``node`` the percepts of each frame of ``stack``, which commands nothing.

    Parameter of the node: ``publish_tf`` (default false; the base publishes ``/tf`` as a rule).
    """

    def __init__(self, node: RosNode, stack: Stack) -> None:
        if not isinstance(stack, SensingStack):
            raise TypeError("expected a SensingStack")
        kinds = {topic: kind for topic, (kind, _) in TOPICS.items()}
        if not node.parameter("publish_tf", False):
            del kinds["/tf"]
        super().__init__(node, stack, kinds)
        self._senses = stack
        half = math.floor(0.5 * stack.robot.camera.hfov / _DEGREE)
        self._bearings: Array = _DEGREE * np.arange(-half, half + 1, dtype=np.float64)

    def tell(self, frame: Frame, base: Pose | None, ended: str, now: int) -> None:
        """Publish percepts and diagnostics at ``now`` [ns].

        If ``ended`` says what holds the node, or nothing was seen yet, only the diagnostics.
        """
        state, send, hits = self._senses.state, self._publish, self._senses.hits
        odometry, belief = state.odometry, state.belief
        if odometry is None or belief is None or ended:
            self._diagnose(ended, now)
            return
        pose = odometry.pose
        scan = hits.scan(pose, self._bearings, MAX_RANGE)
        send["navfw/scan"](scan_message(self._bearings, scan.ranges, scan.sigma, now))
        send["navfw/free"](scan_message(self._bearings, scan.free, None, now))
        send["navfw/obstacles"](cloud_message(hits.obstacles(pose, state.time), now))
        send["navfw/odom"](odometry_message(odometry, now, belief.covariance))
        if "/tf" in send:
            send["/tf"](transforms_message(pose, now, camera=self._senses.robot.camera))
        contact = time_to_contact(state, self._senses)
        send["navfw/time_to_contact"](ros_message("std_msgs/msg/Float32", {"data": contact}))
        if state.percept is not None:
            said = percept_data(state, contact)
            send["navfw/percept"](text_message(json.dumps(plain_json(said))))
            send["navfw/sentence"](text_message(state.percept.sentence))
        self._diagnose(ended, now)

    def _diagnose(self, ended: str, now: int) -> None:
        if not self._turn_of("/diagnostics"):
            return
        state = self._senses.state
        trouble = state.sight.trouble or "; ".join(state.faults)
        values = {**self.latency(), "sight": state.sight.name}
        level = 1 if trouble or ended else 0
        message = diagnostics_message(level, ended or trouble or "sensing", values, now)
        self._publish["/diagnostics"](message)


def time_to_contact(state: StackState, stack: SensingStack) -> float:
    """Return the time [s] to contact with the obstacle straight ahead, at the present speed.

    It is inf while nothing approaches, NaN if the newest frame shows no depth.
    """
    speed = 0.0 if state.odometry is None else state.odometry.twist.v
    if abs(speed) <= _STANDING:
        return math.inf
    if state.percept is None:
        return math.nan
    nearness = nearness_ahead(state.percept, state.flows[-1], stack.robot.camera)
    return 1.0 / (speed * nearness) if speed * nearness > 0.0 else math.inf


def percept_data(state: StackState, contact: float) -> Mapping[str, Any]:
    """Convert OFFIS's percept of the newest frame to JSON data; degrees are in [0, 1]."""
    percept = state.percept
    if percept is None:
        return {}
    return {
        "time": percept.time,
        "sentence": percept.sentence,
        "obstacles": percept.obstacles,
        "distances": percept.quadrants,
        "planes": percept.planes,
        "slopes": percept.slopes,
        "situations": percept.situations,
        "floor_in_front": percept.floor_in_front,
        "ttc_s": contact,
    }


def scan_message(bearings: Array, ranges: Array, sigma: Array | None, now: int) -> bytes:
    """Encode ``LaserScan`` in ``base_link``, stamped ``now`` [ns].

    ``ranges`` (n,) [m] are those at ``bearings`` (n,) [rad]; ``sigma`` (n,) [m] are intensities.
    """
    about = {
        "angle_min": float(bearings[0]),
        "angle_max": float(bearings[-1]),
        "angle_increment": _DEGREE,
        "range_min": _MIN_RANGE,
        "range_max": MAX_RANGE,
        "ranges": ranges.astype(np.float32),
    }
    if sigma is not None:
        about["intensities"] = sigma.astype(np.float32)
    return ros_message(_SCAN, {"header": {"frame_id": "base_link"}, **about}, now)


def cloud_message(points: Array, now: int) -> bytes:
    """Encode ``PointCloud2`` in ``base_link``, stamped ``now`` [ns].

    ``points`` (n, 5) are those of ``HitRecord.obstacles``.
    """
    fields = [
        {"name": name, "offset": 4 * number, "datatype": _FLOAT, "count": 1}
        for number, name in enumerate(_COLUMNS)
    ]
    step = 4 * len(_COLUMNS)
    about = {"height": 1, "width": len(points), "point_step": step, "row_step": step * len(points)}
    data = np.frombuffer(points.astype("<f4").tobytes(), np.uint8)
    made = {"fields": fields, **about, "data": data, "is_dense": False}
    return ros_message(_CLOUD, {"header": {"frame_id": "base_link"}, **made}, now)
