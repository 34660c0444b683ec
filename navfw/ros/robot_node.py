"""``navfw ros sim``: publish and drive the simulated robot as a robot of ROS 2."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from navfw.egomotion import Odometer
from navfw.missions import Simulator
from navfw.process.interruption import check_interrupted
from navfw.recording import ros_messages as ros
from navfw.robot import RobotModel
from navfw.ros.connection import RosNode
from navfw.safety import PersistentFailure
from navfw.signals import Belief, Pose, SensorReading, Twist, Waypoint
from navfw.stack import StackState

MAX_COMMAND_AGE = 0.25
"""Age [s] of the last command, by the simulated clock, from which the robot stands."""
_DISCOVERY = 1.0
"""Time [s] given to the other node to discover this one as well."""
_MAX_COMMAND = 100.0
"""Largest speed [m/s] and turning rate [rad/s] that is accepted as a command."""
_STAND = Twist(0.0, 0.0)

TOPICS = {
    "image": ("sensor_msgs/msg/Image", "the camera, mono8"),
    "camera_info": ("sensor_msgs/msg/CameraInfo", "of an undistorted lens"),
    "imu": ("sensor_msgs/msg/Imu", "rates about base_link's axes"),
    "joint_states": ("sensor_msgs/msg/JointState", "angles of the wheels"),
    "odom": ("nav_msgs/msg/Odometry", "by wheels and gyro"),
    "/tf": ("tf2_msgs/msg/TFMessage", "odom to base_link and camera; where tf2_msgs is installed"),
    "/clock": ("rosgraph_msgs/msg/Clock", "simulated time"),
    "/ground_truth/odom": ("nav_msgs/msg/Odometry", "the true pose, only for metrics"),
    "cmd_vel": ("geometry_msgs/msg/TwistStamped", "what to drive; also Twist on cmd_vel_unstamped"),
}
"""Topics of the simulated robot: type, and meaning."""


class RosPilot:
    """A pilot for ``MissionLoop`` whose commands come from another node.

    It publishes every reading, and returns the newest command. ``pace`` is simulated over
    wall-clock time; 0 is lock step: each tick waits for the command that has its stamp, and for the
    driving node's status. In a drive without a mission (``free``) the status is not waited for.
    """

    def __init__(
        self,
        node: RosNode,
        robot: RobotModel,
        simulator: Simulator,
        pace: float = 1.0,
        *,
        free: bool = False,
    ) -> None:
        node.check_parameters()  # it has none
        self.state = StackState(time=0.0)
        self._node, self._robot, self._simulator, self._pace = node, robot, simulator, pace
        self._free = free
        self._odometer = Odometer(robot)
        self._twist, self._commanded, self._stamp = _STAND, -math.inf, -1
        self._status: dict[str, Any] = {}
        self._paused = self._again = False
        self._began: tuple[float, float] | None = None
        # reliably, as best-effort listeners get them then, too
        self._out = {
            topic: node.publisher(topic, kind)
            for topic, (kind, _) in TOPICS.items()
            if topic != "cmd_vel"
        }
        self._landmarks = node.publisher("landmark_image", "sensor_msgs/msg/Image")
        node.subscribe("cmd_vel", TOPICS["cmd_vel"][0], self._take, "reliable")
        node.subscribe("cmd_vel_unstamped", "geometry_msgs/msg/Twist", self._take, "reliable")
        node.subscribe("navfw/status", "std_msgs/msg/String", self._take_status, "reliable")

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """In lock step, wait until the driving node subscribes and publishes."""
        if self._pace > 0.0:
            return
        heard: Sequence[str] = () if self._free else ("imu", "joint_states", "image")
        driven = ("cmd_vel",) if self._free else ("cmd_vel", "navfw/status")
        while not (all(map(self._node.wanted, heard)) and all(map(self._node.publishers, driven))):
            check_interrupted()
            self._node.spin(0.05)
        self._node.spin_for(_DISCOVERY)

    def roam(self, begin: Callable[[], AbstractContextManager[Simulator]]) -> None:
        """Be driven without a mission, whatever it touches or reaches, until a signal.

        ``begin`` makes the simulator at its start: at once, and when ``~/reset`` is called.
        Simulated time stands still from ``~/pause`` to ``~/resume``.
        """
        for name, service in (
            ("reset", self._reset),
            ("pause", self._pause),
            ("resume", self._resume),
        ):
            self._node.serve(name, service)
        self.start(None, ())
        while True:
            with begin() as self._simulator:
                self._odometer.reset()
                self._again, self._began, self._stamp = False, None, -1
                self._twist, self._commanded = _STAND, -math.inf
                while not self._again:
                    self._advance()

    def _advance(self) -> None:
        """Advance by one tick, or wait while paused."""
        check_interrupted()
        if self._paused:
            self._node.spin(0.05)
            self._began = None
            return
        twist = self.step(self._simulator.read())
        self._simulator.drive(*self._robot.wheel_speeds(twist))
        self._simulator.advance(1.0 / self._robot.control_rate)
        for body in self._simulator.contacts:
            pose = self._simulator.true_pose()
            self._node.note(f"touched {body} at ({pose.x:.2f}, {pose.y:.2f})")

    def _reset(self) -> str:
        self._again = True
        return "the robot is at its start, and the clock at 0"

    def _pause(self) -> str:
        self._paused = True
        return "time stands until ~/resume"

    def _resume(self) -> str:
        self._paused = False
        return "time goes on"

    def step(self, reading: SensorReading) -> Twist:
        """Publish ``reading``; return the command that holds now."""
        self._publish(reading)
        if self._pace == 0.0:
            self._wait_for(round(1e9 * reading.time))
        else:
            self._keep_pace(reading.time)
            if reading.time - self._commanded > MAX_COMMAND_AGE:
                self._twist = _STAND
        self.state = self._state(reading.time)
        return self._twist

    def _publish(self, reading: SensorReading) -> None:
        now, robot, out = round(1e9 * reading.time), self._robot, self._out
        out["/clock"](ros.ros_message("rosgraph_msgs/msg/Clock", {"clock": ros.time_fields(now)}))
        images = []
        if reading.frame is not None:
            images.append("image")
            taken, image = round(1e9 * reading.frame.time), reading.frame.image
            out["camera_info"](ros.camera_message(robot.camera, image.shape, taken))
            out["image"](ros.image_message(image, taken))
        if reading.landmark_frame is not None:
            images.append("landmarks")
            taken = round(1e9 * reading.landmark_frame.time)
            self._landmarks(ros.image_message(reading.landmark_frame.image, taken))
        out["imu"](ros.imu_message(robot, reading, round(1e9 * reading.inertial.time)))
        frame = "+".join(["", *images])
        wheels_at = round(1e9 * reading.encoders.time)
        odometry = self._odometer.update(reading.inertial, reading.encoders, self._twist)
        out["odom"](ros.odometry_message(odometry, now))
        out["/tf"](ros.transforms_message(odometry.pose, now, camera=robot.camera))
        self._truth(reading.time, odometry.twist, now)
        out["joint_states"](ros.joints_message(robot, reading, wheels_at, frame))

    def _truth(self, time: float, twist: Twist, now: int) -> None:
        pose = self._simulator.true_pose()
        at = {"pose": ros.pose_fields(pose.x, pose.y, pose.yaw)}
        fields = {"header": {"frame_id": "map"}, "child_frame_id": "base_link", "pose": at}
        self._out["/ground_truth/odom"](ros.ros_message("nav_msgs/msg/Odometry", fields, now))

    def _keep_pace(self, now: float) -> None:
        """Handle commands until the wall clock has come to ``now`` [s] of the simulation."""
        if self._began is None:
            self._began = now, time.monotonic()
        due = self._began[1] + (now - self._began[0]) / self._pace
        left = due - time.monotonic()
        if left < -1.0:  # the simulation is slower than that: time goes on from here
            self._began = now, time.monotonic()
        self._node.spin_for(max(left, 0.0))
        self._node.spin(0.0)

    def _wait_for(self, stamp: int) -> None:
        """Handle messages until command and status with this ``stamp`` [ns] have come."""
        while self._stamp != stamp or not (self._free or self._status.get("stamp") == stamp):
            if self._again:
                return
            check_interrupted()
            self._node.spin(0.05)

    def _take(self, message: Any) -> None:
        twist = message.twist if hasattr(message, "twist") else message
        v, w = twist.linear.x, twist.angular.z
        if not max(abs(v), abs(w)) <= _MAX_COMMAND or math.isnan(w):
            self._node.note(f"a command is left out: v = {v:g}, w = {w:g}")
            return
        if hasattr(message, "header"):
            stamp = message.header.stamp
            self._stamp = 10**9 * stamp.sec + stamp.nanosec
        self._twist, self._commanded = Twist(v, w), self._simulator.time

    def _take_status(self, message: Any) -> None:
        try:
            self._status = json.loads(message.data)
            self._state(0.0)
        except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            self._node.note("a message on navfw/status cannot be read")
            self._status = {}

    def _state(self, now: float) -> StackState:
        """Return the state that the driving node publishes; one without facts if it does not."""
        status = self._status
        if self._pace > 0.0 and 1e-9 * status.get("stamp", -1e9) < now - 2.0:
            status = {}
        fault, at = status.get("fault"), status.get("pose")
        spread = np.zeros((3, 3))
        lost = bool(status.get("lost"))
        return StackState(
            belief=None if at is None else Belief(now, Pose(*map(float, at)), spread, lost=lost),
            time=now,
            finished=bool(status.get("finished")),
            stuck=str(status.get("stuck") or "") or None,
            fault=None if fault is None else PersistentFailure("sensor", str(fault)),
        )
