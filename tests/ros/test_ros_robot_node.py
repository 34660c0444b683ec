"""The simulated robot's side of the graph: silence, nonsense, and who can hear it; without ROS."""

import math
from typing import Any, cast

import numpy as np
import pytest
from ros_graph import Graph, GraphNode

from navfw.missions import Simulator
from navfw.recording import deserialize_cdr, ros_message
from navfw.robot import RobotModel
from navfw.ros import RosNode, RosPilot
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Twist

ROBOT = RobotModel()


class Standing:
    """A simulator at ``time``."""

    time = 0.0

    def true_pose(self) -> Pose:
        return Pose(0.0, 0.0, 0.0)


class Listed(GraphNode):
    """A node that keeps the quality of its topics."""

    def __init__(self) -> None:
        super().__init__(Graph())
        self.qualities: dict[str, str] = {}

    def publisher(self, topic: str, kind: str, quality: str = "reliable") -> Any:
        self.qualities[topic] = quality
        return super().publisher(topic, kind)


def made(pace: float = 100.0) -> tuple[RosPilot, Listed, Standing]:
    node, simulator = Listed(), Standing()
    pilot = RosPilot(cast("RosNode", node), ROBOT, cast("Simulator", simulator), pace)
    return pilot, node, simulator


def reading(time: float, frame: Frame | None = None) -> SensorReading:
    return SensorReading(time, Inertial(time, 0.0, 0.0, 0.0), Encoders(time, 0, 0), frame)


def command(v: float) -> bytes:
    twist = {"header": {"frame_id": "base_link"}, "twist": {"linear": {"x": v}}}
    return ros_message("geometry_msgs/msg/TwistStamped", twist)


def test_a_silent_driver_leaves_the_robot_standing_within_a_quarter_of_a_second() -> None:
    pilot, node, simulator = made()
    node.graph.send("cmd_vel", command(0.4))
    speeds = []
    for tick in range(30):
        simulator.time = tick / 60.0
        speeds.append(pilot.step(reading(simulator.time)).v)
    moving = [tick / 60.0 for tick, v in enumerate(speeds) if v > 0.0]
    assert speeds[0] == 0.4
    assert moving[-1] <= 0.25
    assert speeds[-1] == 0.0


@pytest.mark.parametrize("v", [math.nan, math.inf])
def test_commands_that_are_no_numbers_are_left_out(v: float) -> None:
    pilot, node, _ = made()
    node.graph.send("cmd_vel", command(v))
    assert pilot.step(reading(0.0)) == Twist(0.0, 0.0)
    assert "a command is left out" in node.notes[0]


def test_listeners_that_want_reliable_transforms_and_wheels_get_them() -> None:
    qualities = made(1.0)[1].qualities
    assert {qualities[t] for t in ("/tf", "odom", "joint_states", "/clock")} == {"reliable"}
    assert {qualities[t] for t in ("image", "camera_info", "imu")} == {"sensor"}


def test_each_image_has_its_camera_info() -> None:
    pilot, node, _ = made()
    image = np.zeros((ROBOT.camera.height, ROBOT.camera.width), np.uint8)
    for tick in range(1, 5):
        pilot.step(reading(tick / 60.0, Frame(tick / 60.0 - 0.01, image)))
        stamps = [
            deserialize_cdr(node.graph.sent[topic], f"sensor_msgs/msg/{kind}").header.stamp
            for topic, kind in (("image", "Image"), ("camera_info", "CameraInfo"))
        ]
        assert stamps[0] == stamps[1]
