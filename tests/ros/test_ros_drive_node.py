"""A driving node among late, lost, slow and hostile messages; without ROS, in simulated time."""

import json
import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ros_graph import Graph, GraphDrive

from navfw.recording import deserialize_cdr, ros_message

STRAIGHT = "empty", "straight"
POSE = "geometry_msgs/msg/PoseStamped"
GOAL = ros_message(POSE, {"header": {"frame_id": "map"}, "pose": {"position": {"x": 2.0}}})


def between(begin: float, end: float, graph: Graph, topic: str) -> None:
    """Lose all messages on ``topic`` from ``begin`` to ``end`` [s]."""
    graph.spoil = lambda name, data: [] if name == topic and begin < graph.time < end else [data]


def test_messages_that_are_late_and_lost_lead_to_the_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = GraphDrive(Graph(dropped=0.1, jitter=0.05), monkeypatch, *STRAIGHT)
    assert drive.run().outcome == "reached"
    assert drive.driver.outputs.latency()["latency_p99_ms"] < 150.0


def test_images_of_a_large_camera_are_reduced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    large = "robot.camera.width=640", "robot.camera.height=480"
    drive = GraphDrive(Graph(), monkeypatch, *STRAIGHT, settings=large)
    assert drive.run().outcome == "reached"
    assert drive.stack.state.faults == ()


def test_weights_change_while_it_drives_and_others_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = list[str]()

    def each(drive: GraphDrive) -> None:
        if drive.graph.time > 2.0 and not answers:
            mofis = drive.stack.mofis
            answers.append(drive.node.change({"go_to_xy.weight": 0.001, "fuzzy.level": 0.5}))
            assert drive.stack.mofis is not mofis
            answers.append(drive.node.change({"go_to_xy.weight": 0.1, "avoid.weight": -3.0}))
            answers.append(drive.node.change({"wheels": "odom"}))
            answers.append(drive.node.change({"use_sim_time": True}))

    given = {"avoid.weight": 0.7}
    drive = GraphDrive(Graph(), monkeypatch, *STRAIGHT, parameters=given, each=each)
    assert drive.stack.config["behaviors"]["avoid"]["weight"] == 0.7
    drive.run()
    used: Any = drive.stack.mofis.behaviors
    assert (used["go_to_xy"].params.weight, used["avoid"].params.weight) == (0.001, 0.7)
    config = drive.stack.config
    assert config["behaviors"]["go_to_xy"]["weight"] == 0.001
    assert config["fusion"] == {"fuzzy": {"blend": "sum", "level": 0.5}}
    assert answers[0] == answers[3] == ""
    assert "avoid.weight: " in answers[1]
    assert answers[2] == "wheels is read when the node starts: restart it with -p wheels:=VALUE"


@pytest.mark.slow
def test_with_late_and_lost_messages_it_touches_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = Graph(dropped=0.1, jitter=0.05)
    drive = GraphDrive(graph, monkeypatch, "office", "lobby-to-lab", 0)
    assert drive.run().outcome != "collided"


@pytest.mark.parametrize("share", [3, 6])  # 20 Hz, 10 Hz
def test_wheels_may_be_slower_than_the_control_rate(
    monkeypatch: pytest.MonkeyPatch, share: int
) -> None:
    graph, count = Graph(), dict.fromkeys(("joint_states", "cmd_vel"), 0)

    def spoil(topic: str, data: bytes) -> Sequence[bytes]:
        count[topic] = count.get(topic, 0) + 1
        return [] if topic == "joint_states" and count[topic] % share else [data]

    graph.spoil = spoil
    result = GraphDrive(graph, monkeypatch, *STRAIGHT).run()
    assert result.outcome == "reached"
    assert result.sim_time_s < 10.0
    assert count["cmd_vel"] == pytest.approx(count["joint_states"] / share, abs=2)


# silent encoders are probed at 0.05 m/s now and then
@pytest.mark.parametrize(("topic", "most"), [("image", 0.0), ("joint_states", 0.07), ("imu", 0.13)])
def test_a_silent_sensor_is_named_and_slows_or_stops_the_robot(
    monkeypatch: pytest.MonkeyPatch, topic: str, most: float
) -> None:
    graph, speeds, named = Graph(), list[float](), list[float]()
    between(3.0, 6.0, graph, topic)

    def each(drive: GraphDrive) -> None:
        if 5.0 < graph.time < 6.0:
            speeds.append(drive.speed)
        if any(f"nothing comes on {topic}" in note for note in drive.node.notes):
            named.append(graph.time)

    drive = GraphDrive(graph, monkeypatch, *STRAIGHT, each=each)
    assert drive.run().outcome == "reached"
    assert max(speeds) <= most
    assert 3.0 < named[0] < 4.0


def status_of(graph: Graph) -> dict[str, Any]:
    text = deserialize_cdr(graph.sent["navfw/status"], "std_msgs/msg/String").data
    status: dict[str, Any] = json.loads(text)
    return status


def test_a_stop_holds_until_resume_and_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    graph, speeds, said = Graph(), list[float](), list[str]()

    def each(drive: GraphDrive) -> None:
        if not said and graph.time > 3.0:
            said.append(drive.node.services["stop"]())
        if len(said) == 1 and graph.time > 10.0:
            graph.send("goal_pose", GOAL)  # does not set it free
            said.append("")
        if len(said) == 2 and graph.time > 38.0:
            said.append(drive.node.services["resume"]())
        if 3.1 < graph.time < 38.0:
            speeds.append(drive.speed)

    longer = ["mission.timeout=90", "mission.stuck_after=60"]
    drive = GraphDrive(graph, monkeypatch, *STRAIGHT, settings=longer, each=each)
    drive.run()
    assert max(speeds) == 0.0
    assert drive.stack.state.fault is None
    assert drive.stack.state.finished
    assert drive.stack.state.belief is not None
    assert drive.stack.state.belief.pose.x == pytest.approx(2.0, abs=0.4)
    assert status_of(graph)["goal"] == [2.0, 0.0]


def test_a_cancelled_drive_has_not_reached_its_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = Graph()

    def each(drive: GraphDrive) -> None:
        if 3.0 < graph.time < 3.1:
            drive.node.services["cancel"]()

    drive = GraphDrive(graph, monkeypatch, *STRAIGHT, each=each)
    drive.run()
    assert drive.ended == "no goal"
    assert drive.speed == 0.0
    assert status_of(graph)["goal"] is None


@pytest.mark.parametrize("cancelled", [False, True])
def test_a_goal_of_an_action_ends_with_it(
    monkeypatch: pytest.MonkeyPatch, *, cancelled: bool
) -> None:
    graph, taken = Graph(), list[bool]()

    def each(drive: GraphDrive) -> None:
        if not taken and graph.time > 1.0:
            for frame in ("moon", "map"):
                place = {"header": {"frame_id": frame}, "pose": {"position": {"x": 2.0}}}
                pose = deserialize_cdr(ros_message(POSE, place), POSE)
                taken.append(drive.node.begin(SimpleNamespace(pose=pose)))
            drive.node.action_ends.clear()  # of the goal before
        if cancelled and 2.0 < graph.time < 2.1:
            drive.node.cancel()

    drive = GraphDrive(graph, monkeypatch, *STRAIGHT, each=each, settings=["mission.timeout=12"])
    drive.run()
    assert taken == [False, True]
    assert drive.node.action_ends[0] is not cancelled
    assert drive.speed < 0.02


def test_a_goal_after_another_ends_when_it_is_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    graph, places, ended_at = Graph(), [0.4, 2.0], list[float]()
    between(0.0, math.inf, graph, "navfw/status")  # the robot is not told when to end

    def each(drive: GraphDrive) -> None:
        ended_at.extend([drive.truth.x] if True in drive.node.action_ends else [])
        drive.node.action_ends.clear()
        between_images = 0.02 < graph.time - drive.stack.state.time < 0.04
        if places and between_images and graph.time > 1.0 and len(ended_at) == 2 - len(places):
            place = {"header": {"frame_id": "map"}, "pose": {"position": {"x": places.pop(0)}}}
            pose = deserialize_cdr(ros_message(POSE, place), POSE)
            assert drive.node.begin(SimpleNamespace(pose=pose))

    GraphDrive(graph, monkeypatch, *STRAIGHT, each=each, settings=["mission.timeout=14"]).run()
    assert ended_at == pytest.approx([0.4, 2.0], abs=0.35)


def test_a_corrected_pose_keeps_the_goals(monkeypatch: pytest.MonkeyPatch) -> None:
    graph, sent = Graph(), list[float]()

    def each(drive: GraphDrive) -> None:
        belief = drive.stack.state.belief
        if not sent and graph.time > 3.0 and belief is not None:
            sent.append(belief.pose.x)
            at = {"pose": {"pose": {"position": {"x": belief.pose.x, "y": belief.pose.y}}}}
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            at["pose"]["pose"]["orientation"] = {"w": 1.0}
            graph.send("initialpose", ros_message(kind, at))

    assert GraphDrive(graph, monkeypatch, *STRAIGHT, each=each).run().outcome == "reached"
    assert 0.0 < sent[0] < 2.5


def spoiler(graph: Graph, change: Callable[[np.ndarray, np.random.Generator], None]) -> None:
    """Spoil every fifth message of a sensor between 2 and 6 s, and send it besides the good one."""
    random = np.random.default_rng(1)

    def spoil(topic: str, data: bytes) -> Sequence[bytes]:
        spoilt = topic in {"image", "imu", "joint_states"} and 2.0 < graph.time < 6.0
        if not spoilt or random.random() > 0.2:
            return [data]
        content = np.frombuffer(data, np.uint8).copy()
        change(content, random)
        return [content.tobytes(), data]

    graph.spoil = spoil


def flip_bytes(content: np.ndarray, random: np.random.Generator) -> None:
    content[random.integers(4, min(len(content), 120), 6)] = random.integers(0, 256, 6)


def not_a_number(content: np.ndarray, random: np.random.Generator) -> None:
    at = 8 * int(random.integers(3, max(len(content) // 8 - 1, 4))) + 4
    content[at : at + 8] = np.frombuffer(np.float64(math.nan).tobytes(), np.uint8)


def back_in_time(content: np.ndarray, random: np.random.Generator) -> None:
    content[4:8] = np.frombuffer(np.int32(random.integers(-9, 9)).tobytes(), np.uint8)


@pytest.mark.parametrize("change", [flip_bytes, not_a_number, back_in_time])
def test_hostile_messages_among_good_ones_are_survived(
    monkeypatch: pytest.MonkeyPatch, change: Callable[[np.ndarray, np.random.Generator], None]
) -> None:
    graph = Graph()
    spoiler(graph, change)
    drive = GraphDrive(graph, monkeypatch, *STRAIGHT)
    assert drive.run().outcome in {"reached", "fault", "stuck", "lost", "timeout"}
    assert drive.node.notes
