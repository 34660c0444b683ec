"""One camera as a sensor for others: what is published, and a map that another node makes of it."""

import json
import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import yaml
from ros_graph import Graph, GraphNode

from navfw.missions import prepare
from navfw.numerics import Array
from navfw.plugins import default_registry
from navfw.recording import deserialize_cdr, ros_message
from navfw.ros import DriveNode, DriveOptions, RosNode, RosPilot
from navfw.ros.sense_outputs import MAX_RANGE, TOPICS, SenseOutputs
from navfw.signals import Pose
from navfw.stack.sensing_stack import SensingStack
from navfw.topomap import load_map

CELL = 0.05


class Publishing(GraphNode):
    """A node that keeps the topics that it publishes."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.published: set[str] = set()

    def publisher(self, topic: str, kind: str, quality: str = "") -> Any:
        self.published.add(topic)
        return super().publisher(topic, kind, quality)


class SensedDrive:
    """A mission's robot that its own stack drives, with ``navfw ros sense`` beside it."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        world: str,
        mission: str,
        settings: Sequence[str] = (),
        **graph: Any,
    ) -> None:
        self.graph = Graph(**graph)
        for module in ("drive_node", "drive_outputs", "robot_node"):
            monkeypatch.setattr(f"navfw.ros.{module}.time", self.graph)
        self.session = prepare(world, mission, seed=1, overrides=settings)
        self.node, robot = Publishing(self.graph), self.session.task.robot
        robot = robot.with_camera(robot.camera.model_copy(update={"calibration": None}))
        node = cast("RosNode", self.node)
        self.stack = SensingStack.load("sense", robot, load_map("empty"), default_registry())
        outputs = SenseOutputs(node, self.stack)
        options = DriveOptions(None, (), once=False)
        self.driver = DriveNode(node, self.stack, options, None, outputs)
        self.heard: dict[str, list[Any]] = defaultdict(list)
        for topic, (kind, _) in TOPICS.items():
            self.node.subscribe(topic, kind, self.heard[topic].append)
        self.truth: dict[int, Pose] = {}

    def run(self, seconds: float) -> None:
        task, stack = self.session.task, self.session.stack
        robot_node = GraphNode(self.graph)
        with self.session.simulation() as simulation, stack.guard.watchdog.on_duty():
            pilot = RosPilot(cast("RosNode", robot_node), task.robot, simulation)
            robot_node.meanwhile = lambda: self.driver.advance(0.0)
            stack.start(task.start, task.goals)
            self.driver.begin()
            while simulation.time < seconds and not stack.state.finished:
                reading = simulation.read()
                self.truth[round(1e9 * reading.time)] = simulation.true_pose()
                pilot.step(reading)
                twist = stack.step(reading)
                simulation.drive(*task.robot.wheel_speeds(twist))
                simulation.advance(1.0 / task.robot.control_rate)

    def true_pose(self, message: Any) -> Pose:
        stamp = message.header.stamp
        return self.truth[10**9 * stamp.sec + stamp.nanosec]


def angles(scan: Any) -> Array:
    bearings: Array = np.arange(len(scan.ranges)) * scan.angle_increment + scan.angle_min
    return bearings


def off_the_walls(drive: SensedDrive) -> Array:
    """How far [m] from what is truly there rays of the scans end."""
    off = list[float]()
    for scan in drive.heard["navfw/scan"][20:]:
        pose, ranges = drive.true_pose(scan), np.array(scan.ranges)
        way, ends = angles(scan) + pose.yaw, np.isfinite(ranges)
        there = ranges[:, None] * np.stack([np.cos(way), np.sin(way)], axis=1) + (pose.x, pose.y)
        off.extend(np.abs(drive.session.plan.clearances(there[ends])))
    return np.array(off)


def occupancy(drive: SensedDrive, size: float = 12.0) -> tuple[Array, Array]:
    """What a small mapper makes of the scans and odometry: counts of hits and of passing rays."""
    n = round(size / CELL)
    hits, passed = np.zeros((2, n, n))
    for scan, odometry in zip(drive.heard["navfw/scan"], drive.heard["navfw/odom"], strict=True):
        place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        heading = angles(scan) + 2.0 * math.atan2(turn.z, turn.w)
        for bearing, distance in zip(heading, scan.ranges, strict=True):
            if math.isnan(distance):
                continue
            ahead = np.arange(0.0, min(distance, MAX_RANGE), 0.5 * CELL)
            rows, columns = (
                ((at + 0.5 * size + ahead * way) / CELL).astype(int)
                for at, way in ((place.y, math.sin(bearing)), (place.x, math.cos(bearing)))
            )
            passed[rows, columns] += 1
            if math.isfinite(distance):
                end = distance
                row = int((place.y + 0.5 * size + end * math.sin(bearing)) / CELL)
                hits[row, int((place.x + 0.5 * size + end * math.cos(bearing)) / CELL)] += 1
    return hits, passed


def test_what_is_published_and_a_map_made_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = SensedDrive(monkeypatch, "paper-room", "around-objects")
    drive.run(14.0)
    heard = drive.heard
    scans, odometry = heard["navfw/scan"], heard["navfw/odom"]
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in scans]
    assert np.diff(stamps) == pytest.approx(0.1, abs=0.02)
    assert stamps[-1] > 5.0
    for topic in ("navfw/free", "navfw/obstacles", "navfw/time_to_contact"):
        assert len(heard[topic]) == len(scans)
    assert {message.header.frame_id for message in scans} == {"base_link"}
    assert drive.node.published == set(TOPICS) - {"/tf"}  # and so no command

    # rays end at what is truly there, within what their intensities say
    off, known = list[float](), 0
    for scan in scans[20:]:
        pose, ranges = drive.true_pose(scan), np.array(scan.ranges)
        ends = np.isfinite(ranges)
        known += int((~np.isnan(ranges)).sum())
        way = angles(scan)[ends] + pose.yaw
        points = np.array((pose.x, pose.y)) + ranges[ends, None] * np.stack(
            [np.cos(way), np.sin(way)], axis=1
        )
        distance = drive.session.plan.clearances(points)
        off.extend(np.abs(distance) / np.array(scan.intensities)[ends])
        assert np.isnan(np.array(scan.intensities)[~ends]).all()
    assert known > 0.3 * len(scans[20:]) * len(scans[0].ranges)
    assert np.quantile(off, 0.68) < 1.2
    free = np.array([message.ranges for message in heard["navfw/free"]])
    assert np.nanmax(free) <= MAX_RANGE + 1e-6

    # the odometry's covariance grows, and the pose is within it
    start, last = drive.session.task.start, odometry[-1]
    true = start.relative(drive.true_pose(last))
    spread = np.reshape(last.pose.covariance, (6, 6))
    error = math.hypot(last.pose.pose.position.x - true.x, last.pose.pose.position.y - true.y)
    assert 0.0 < spread[0, 0] < 0.1
    assert error < 3.0 * math.sqrt(spread[0, 0] + spread[1, 1]) + 0.02

    cloud = heard["navfw/obstacles"][-1]
    points = np.frombuffer(bytes(cloud.data), "<f4").reshape(-1, 5)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "sigma", "age"]
    assert len(points) == cloud.width > 20
    ages = points[np.isfinite(points[:, 4]), 4]
    assert ages.min() >= 0.0
    assert ages.max() > 1.0  # what is behind the robot was seen a while ago
    said = json.loads(heard["navfw/percept"][-1].data)
    assert said["sentence"] == heard["navfw/sentence"][-1].data
    assert {"situations", "obstacles", "floor_in_front", "ttc_s"} <= set(said)
    contacts = [message.data for message in heard["navfw/time_to_contact"]]
    assert any(0.5 < contact < 60.0 for contact in contacts)

    # another node's map: its walls are the true ones
    hits, passed = occupancy(drive)
    rows, columns = np.nonzero((hits >= 3) & (hits > 0.3 * passed))
    local = np.stack([columns, rows], axis=1, dtype=np.float64) * CELL + 0.5 * CELL - 6.0
    walls = drive.session.plan.clearances(start.points_to_parent(local))
    assert len(walls) > 60
    assert np.quantile(np.abs(walls), 0.95) < 0.15


def test_a_robot_that_has_not_moved_claims_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = SensedDrive(monkeypatch, "empty", "straight")
    drive.run(0.5)
    assert drive.heard["navfw/scan"]
    for scan in drive.heard["navfw/scan"]:
        assert np.isnan(scan.ranges).all()
    assert drive.heard["navfw/time_to_contact"][-1].data == math.inf


def test_wheels_of_another_robot_between_its_own_are_said_and_end_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kind, random = "sensor_msgs/msg/JointState", np.random.default_rng(3)

    def spoil(topic: str, data: bytes) -> list[bytes]:
        if topic != "joint_states" or random.random() < 0.8:
            return [data]
        other, turned = deserialize_cdr(data, kind), random.normal(size=2) * 10.0**8
        stamp = 10**9 * other.header.stamp.sec + other.header.stamp.nanosec + 10**6
        names = {"name": list(other.name), "position": turned}
        return [data, ros_message(kind, {"header": {"frame_id": ""}, **names}, stamp)]

    drive = SensedDrive(monkeypatch, "paper-room", "around-objects", spoil=spoil)
    monkeypatch.setattr(drive.node, "publishers", lambda topic: 1 + (topic == "joint_states"))
    drive.run(4.0)
    assert len(drive.heard["navfw/scan"]) > 30
    last = drive.heard["navfw/odom"][-1]
    true, at = drive.session.task.start.relative(drive.true_pose(last)), last.pose.pose.position
    assert math.hypot(at.x - true.x, at.y - true.y) < 0.1
    for said in ("which they cannot: they are left out", "2 nodes publish joint_states"):
        assert any(said in note for note in drive.node.notes), drive.node.notes


def test_a_lens_with_distortion_is_that_of_camera_info(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lens = tmp_path / "lens.yaml"
    lens.write_text(
        "{image_width: 640, image_height: 480, distortion_model: plumb_bob,"
        " camera_matrix: [420.0, 0.0, 310.0, 0.0, 415.0, 248.0, 0.0, 0.0, 1.0],"
        " distortion_coefficients: [-0.28, 0.07, 0.001, -0.002, 0.01]}"
    )
    camera = f"robot.camera.calibration={lens}", "robot.camera.width=320", "robot.camera.height=240"
    held = list[bytes]()

    def spoil(topic: str, data: bytes) -> list[bytes]:
        if topic != "camera_info":
            return [data]
        held.append(data)  # comes after the next image
        return held[-2:-1]

    drive = SensedDrive(monkeypatch, "paper-room", "around-objects", camera, spoil=spoil)
    drive.run(8.0)
    assert any("removed by camera_info" in note for note in drive.node.notes), drive.node.notes
    assert np.median(off_the_walls(drive)) < 0.05


def test_the_examples_name_topics_that_there_are() -> None:
    folder = Path(__file__).parents[2] / "examples" / "ros"
    text = (folder / "README.md").read_text(encoding="utf-8")
    rows = [
        f"| `{name}` | `{kind.split('/')[-1]}` | {what} |" for name, (kind, what) in TOPICS.items()
    ]
    assert "\n".join(rows) in text
    package = (folder / "package.xml").read_text(encoding="utf-8")
    assert [f"<name>{marker.name}</name>" in package for marker in folder.glob("resource/*")] == [
        True
    ]
    costmap = yaml.safe_load((folder / "nav2_costmap.yaml").read_text(encoding="utf-8"))
    layer = costmap["local_costmap"]["local_costmap"]["ros__parameters"]["obstacle_layer"]
    slam = yaml.safe_load((folder / "slam_toolbox.yaml").read_text(encoding="utf-8"))
    scan = slam["slam_toolbox"]["ros__parameters"]
    assert scan["max_laser_range"] == layer["free"]["raytrace_max_range"] == MAX_RANGE
    sources = [layer[name] for name in layer["observation_sources"].split()]
    for source in sources:
        kind = TOPICS[source["topic"].lstrip("/")][0]
        assert kind.endswith(source["data_type"])
        assert source["marking"] != source["clearing"]
    assert TOPICS[scan["scan_topic"].lstrip("/")][0].endswith("LaserScan")
