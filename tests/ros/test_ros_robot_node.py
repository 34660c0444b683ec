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


FINISHED = '{"stamp": 0, "finished": true, "still": true}'


class Listed(GraphNode):
    """A node that keeps the quality of its topics; Ctrl-C comes while time stands."""

    def __init__(self) -> None:
        super().__init__(Graph())
        self.spins = 0
        self.qualities: dict[str, str] = {}

    def spin(self, seconds: float) -> None:
        super().spin(seconds)
        if seconds > 0.0 and self.spins:
            raise KeyboardInterrupt

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


def test_listeners_that_want_reliable_messages_get_them() -> None:
    # listeners by best effort get them as well
    assert set(made(1.0)[1].qualities.values()) == {"reliable"}


class Simulated(Standing):
    """A simulator of which there may be several: each begins at time 0."""

    contacts: tuple[str, ...] = ()

    def __enter__(self) -> "Simulated":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def read(self) -> SensorReading:
        return reading(self.time)

    def drive(self, left: float, right: float) -> None:
        self.wheels = left, right

    def advance(self, dt: float) -> None:
        self.time += dt


def test_without_a_mission_it_begins_anew_pauses_and_does_not_end_at_a_goal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    node, begun, done = Listed(), list[Simulated](), False
    monkeypatch.setattr("navfw.ros.robot_node.time", node.graph)
    pilot = RosPilot(cast("RosNode", node), ROBOT, cast("Simulator", Simulated()), 1.0, free=True)

    def begin() -> Any:
        begun.append(Simulated())
        return begun[-1]

    def meanwhile() -> None:
        nonlocal done
        time = begun[-1].time
        node.graph.send("navfw/status", ros_message("std_msgs/msg/String", {"data": FINISHED}))
        node.graph.send("cmd_vel", command(0.4))
        node.graph.deliver()
        if time > 1.0 and len(begun) == 1:
            node.services["reset"]()
        if 0.5 < time < 0.6 and len(begun) == 2 and not done:
            node.services["pause"]()
            done = True
        assert time < 0.6 or len(begun) == 1
        node.spins = int(done)

    node.meanwhile = meanwhile
    with pytest.raises(KeyboardInterrupt):
        pilot.roam(begin)
    assert [round(simulated.time, 1) for simulated in begun] == [1.0, 0.5]
    assert begun[1].wheels[0] > 0.0


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
