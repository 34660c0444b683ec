"""A node that maps: what it publishes and keeps while it explores, or while another one steers."""

import json
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import refusal
from map_server import served_map
from ros_graph import Graph, GraphDrive

from navfw.mapping import GrowingMap
from navfw.recording import deserialize_cdr, ros_message
from navfw.signals import Pose
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import load_map

MARKERS = "visualization_msgs/msg/MarkerArray"
LIMIT = "mission.explore.limit=35"


class Kept(Graph):
    """A graph that keeps all messages of some topics, and when they were sent [s]."""

    def __init__(self, *topics: str) -> None:
        super().__init__()
        self.kept: dict[str, list[tuple[float, bytes]]] = {topic: [] for topic in topics}
        self.counts: dict[str, int] = {}

    def send(self, topic: str, data: bytes) -> None:
        self.counts[topic] = self.counts.get(topic, 0) + 1
        if topic in self.kept:
            self.kept[topic].append((self.time, data))
        super().send(topic, data)


def cells_of(grid: Any) -> np.ndarray:
    return np.asarray(grid.data, np.int8).reshape(grid.info.height, grid.info.width)


def named(markers: Any) -> set[str]:
    return {marker.text for marker in markers.markers if marker.text}


def points(markers: Any, kind: int) -> Sequence[Any]:
    return [point for marker in markers.markers if marker.type == kind for point in marker.points]


@pytest.mark.thorough
def test_an_exploration_publishes_and_keeps_its_map(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    graph, file = Kept("navfw/map", "navfw/frontiers", "/tf"), tmp_path / "maps" / "made.yaml"
    graph.topics["navfw/frontiers"].append(lambda _: None)
    kept_at = list[float]()

    def each(_: GraphDrive) -> None:
        if not kept_at and file.exists():
            kept_at.append(graph.time)
            assert load_map(file).floor_plan is not None

    settings = [LIMIT]
    drive = GraphDrive(graph, monkeypatch, "paper-room", None, 1, settings, each=each, keep=file)
    assert drive.run().outcome == "reached"
    assert drive.ended == "reached"
    assert kept_at[0] < 0.7 * graph.time
    # the goals of others, and another start, are none of an exploration
    assert not {"goal_pose", "goal_place", "initialpose"} & set(graph.topics)
    assert drive.keeper is not None
    said = drive.keeper.finish()
    topo_map = load_map(file)
    assert said == {
        "map": str(file),
        "places": len(topo_map.places),
        "edges": len(topo_map.passages),
        "more_maps": [],
    }

    times = [time for time, _ in graph.kept["navfw/map"]][:-1]  # without that of the end
    assert len(times) > 5
    assert np.diff(times).min() >= 1.0 - 1e-6
    grids = [
        deserialize_cdr(data, "nav_msgs/msg/OccupancyGrid") for _, data in graph.kept["navfw/map"]
    ]
    for before, after in pairwise(grids):
        moved = before.info.origin.position.x != after.info.origin.position.x
        assert moved or not np.array_equal(before.data, after.data)
    assert grids[-1].header.frame_id == "map"
    # the frame is that of the world, where the mission starts: walls are where they truly are
    plan = SceneGeometry.from_world(load_world(Path("worlds/paper-room/world.yaml")))
    info, cells = grids[-1].info, cells_of(grids[-1])
    rows, columns = np.nonzero(cells == 100)
    corner = np.array([info.origin.position.x, info.origin.position.y])
    centres = corner + (np.column_stack([columns, rows]) + 0.5) * info.resolution
    assert np.percentile(np.abs(plan.clearances(centres)), 80) < 0.15
    saved = served_map(file.parent / "plans" / "made.yaml")
    assert saved.origin[:2] == pytest.approx(tuple(corner), abs=1e-5)
    assert saved.data.shape == cells.shape
    assert (cells[saved.data == 100] == 100).mean() > 0.9  # thinner walls in the same places
    assert (saved.data[cells == 0] == 0).mean() > 0.95

    graph_markers = deserialize_cdr(graph.sent["navfw/graph"], MARKERS)
    assert named(graph_markers) == set(topo_map.places)
    assert len(points(graph_markers, 5)) == 2 * len(topo_map.passages)
    frontiers = [deserialize_cdr(data, MARKERS) for _, data in graph.kept["navfw/frontiers"]]
    assert max(len(points(markers, 7)) for markers in frontiers) > 1
    assert {marker.header.frame_id for marker in frontiers[-1].markers} == {"map"}
    sent = [deserialize_cdr(data, "tf2_msgs/msg/TFMessage") for _, data in graph.kept["/tf"][-9:]]
    links = {(link.header.frame_id, link.child_frame_id) for tf in sent for link in tf.transforms}
    assert {("map", "odom"), ("odom", "base_link")} <= links


def steer(graph: Graph, circle: bool = False) -> None:
    """Command what a person may: ahead, and a turn to the left; or a circle of 0.4 m."""
    turns = graph.time % 6.0 > 3.0
    twist = {"linear": {"x": 0.1 if turns else 0.3}, "angular": {"z": 0.4 if turns else 0.0}}
    if circle:
        twist = {"linear": {"x": 0.2}, "angular": {"z": 0.5}}
    kind = "geometry_msgs/msg/TwistStamped"
    graph.send("cmd_vel", ros_message(kind, {"header": {"frame_id": "base_link"}, "twist": twist}))


@pytest.mark.thorough
def test_a_drive_that_another_node_steers_becomes_a_map_with_named_places(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    graph, file = Kept("navfw/map", "navfw/pose"), tmp_path / "taught.yaml"
    steered, at = [0], list[tuple[float, float]]()

    def name(text: str) -> None:
        graph.send("name_place", ros_message("std_msgs/msg/String", {"data": text}))

    def each(drive: GraphDrive) -> None:
        if graph.time > 1.2 and graph.time - 0.1 * steered[0] > 1.2:
            steer(graph)
            steered[0] += 1
        if not at and graph.time > 9.0:
            at.append((drive.truth.x, drive.truth.y))
            name("dock")
            name("a place/")

    settings = ["mission.explore.limit=12", "mission.timeout=12"]
    drive = GraphDrive(
        graph, monkeypatch, "paper-room", None, 1, settings, each=each, keep=file, watches=True
    )
    drive.run()
    assert graph.counts["cmd_vel"] == steered[0] > 50  # all of them are the other node's
    assert "stop" not in drive.node.services
    assert drive.keeper is not None
    drive.keeper.finish()
    topo_map = load_map(file)
    dock = topo_map.places["dock"]
    assert math.dist((dock.x, dock.y), at[0]) < 0.1
    assert any("dock" in passage.ends for passage in topo_map.passages)
    assert any("'a place/' on name_place is left out" in note for note in drive.node.notes)
    status = json.loads(deserialize_cdr(graph.sent["navfw/status"], "std_msgs/msg/String").data)
    assert math.dist(status["pose"][:2], (drive.truth.x, drive.truth.y)) < 0.1
    assert status["finished"] is False


@pytest.mark.slow
def test_a_drive_with_a_gap_is_split_and_joined_where_its_parts_overlap(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    graph, file, steered = Graph(), tmp_path / "taught.yaml", [0]
    other = tmp_path / "taught-2.yaml"
    other.write_text("name: of somebody else\n")
    kept = set[str]()

    def spoil(topic: str, data: bytes) -> list[bytes]:
        lost = 26.0 < graph.time < 27.0 and topic in {"image", "imu", "joint_states"}
        return [] if lost else [data]

    def each(_: GraphDrive) -> None:
        kept.update(path.name for path in tmp_path.glob("*.yaml"))
        if graph.time > 1.2 and graph.time - 0.1 * steered[0] > 1.2:
            steer(graph, circle=True)
            steered[0] += 1
            if steered[0] == 400:
                graph.send("name_place", ros_message("std_msgs/msg/String", {"data": "desk"}))

    graph.spoil = spoil
    settings = ["mission.explore.limit=60", "mission.timeout=60"]
    drive = GraphDrive(
        graph, monkeypatch, "paper-room", None, 1, settings, each=each, keep=file, watches=True
    )
    drive.run()
    said = "the drive is split: a gap of 1.0 s; from here on the map is taught-3"
    assert said in drive.node.notes
    assert kept == {"taught.yaml", "taught-2.yaml", "taught-3.yaml"}
    assert drive.keeper is not None
    apart = drive.keeper.finish()
    third = tmp_path / "taught-3.yaml"
    assert [one["map"] for one in apart["more_maps"]] == [str(third)]
    assert "desk" in load_map(third).places
    assert "desk" not in load_map(file).places

    def overlap(first: GrowingMap, second: GrowingMap) -> bool:
        first.join(second, Pose(0.0, 0.0, 0.0), [])
        return True

    monkeypatch.setattr("navfw.mapping.joining.join", overlap)
    assert drive.keeper.finish()["more_maps"] == []
    assert "desk" in load_map(file).places
    assert not third.exists()
    assert not (tmp_path / "plans" / "taught-3.yaml").exists()
    assert other.read_text() == "name: of somebody else\n"


@pytest.mark.parametrize("words", [("explore", "--out-map"), ("drive", "--teach")])
def test_an_earlier_map_is_replaced_by_force_alone(words: tuple[str, ...], tmp_path: Path) -> None:
    there = tmp_path / "there.yaml"
    there.write_text("name: there\n")
    assert "there.yaml: exists; choose another" in refusal("ros", *words, there)
    assert there.read_text() == "name: there\n"


def test_wrong_words() -> None:
    said = refusal("ros", "drive", "--teach", "new", "--goal", "lab")
    assert "--teach: needs no map and drives to no goal" in said
    said = refusal("ros", "sim", "paper-room", "around-objects", "--explore")
    assert "--explore: give a mission or --explore, not both" in said
