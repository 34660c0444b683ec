"""Tables 2 and 3: what the paper reports must come out again, its false conclusion included."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from navfw.bench import front_of
from navfw.camera_geometry import rotational_flow
from navfw.config import find
from navfw.reproduce import (
    FAST,
    FAST_TURN,
    SCENES,
    WAYPOINTS,
    SceneRow,
    WaypointRow,
    as_data,
    checks,
    draw_map,
    drive,
    hand_held,
    length,
    scene_picture,
    table2,
    table3,
    true_flow,
    waypoint_picture,
)
from navfw.robot import RobotModel
from navfw.sim import SceneGeometry, load_world


@pytest.fixture(scope="module")
def waypoints() -> list[WaypointRow]:
    return table2(seed=0)


@pytest.fixture(scope="module")
def scenes() -> list[SceneRow]:
    return table3(seed=0)


def test_the_way_is_free_and_smooth() -> None:
    way = drive()
    plan = SceneGeometry.from_world(load_world(find("world", "paper-room")), 0.4)
    assert min(plan.clearance(m.pose.x, m.pose.y) for m in way) > RobotModel().radius + 0.1
    assert 7.0 < length(way) < 12.0
    turns = [abs(point.twist.w) for point in way]
    assert max(turns) == FAST_TURN


def test_waypoint_3_is_the_fast_left_turn() -> None:
    way = drive()
    twists = {w.number: way[round(w.time * 60)].twist for w in WAYPOINTS}
    assert [w.number for w in WAYPOINTS] == list(range(1, 11))
    assert [w.time for w in WAYPOINTS] == sorted(w.time for w in WAYPOINTS)
    assert twists.pop(FAST).w == FAST_TURN
    assert max(abs(twist.w) for twist in twists.values()) < 0.02


def test_before_is_where_the_robot_came_from() -> None:
    way = drive()
    for index in (200, 670, 700, 1000):
        past, now = way[index - 3], way[index]
        before = now.before(0.05)
        # the twist hardly changes within 50 ms
        assert math.dist((before.x, before.y), (past.pose.x, past.pose.y)) < 0.003


def test_fast_turn_reads_wrong_without_derotation_and_right_with(
    waypoints: list[WaypointRow],
) -> None:
    found = checks(waypoints)
    assert all(found.values()), found
    fast = next(row for row in waypoints if row.waypoint.number == FAST)
    for kind in ("ideal", "block matching"):
        right = fast.percepts[kind, "removed", "normalised"]
        assert front_of(right.percept) != "unknown"
        assert right.percept.floor_in_front > 0.5
    # the paper's own way to read it: everything near, nothing recognised
    false = fast.percepts["ideal", "left in", "raw means"].percept
    assert set(false.obstacles["layer1"]) == {"P1", "P2", "P3", "P4"}
    assert set(false.obstacles["layer1"].values()) == {"near"}


def test_ideal_flow_is_translation_and_rotation(waypoints: list[WaypointRow]) -> None:
    robot = RobotModel()
    for row in waypoints:
        whole = true_flow(row.view, robot)
        rest = row.percepts["ideal", "removed", "normalised"].flow
        turned = rotational_flow(whole.points, whole.motion.rotation, robot.camera.focal)
        # exact derotation and the rotational flow differ in second order only
        limit = 0.02 + 0.1 * np.abs(turned).max()
        assert np.abs(whole.vectors - turned - rest.vectors).max() < limit
        assert whole.shape == (12, 16)


def test_the_same_seed_gives_the_same_readings(
    waypoints: list[WaypointRow], scenes: list[SceneRow]
) -> None:
    again = as_data(table2(seed=0), table3(seed=0))
    assert again == as_data(waypoints, scenes)
    image = waypoints[0].view.pair.now.image
    assert (table2(seed=1)[0].view.pair.now.image != image).any()


def test_the_three_situations(scenes: list[SceneRow]) -> None:
    assert [row.scene.number for row in scenes] == [1, 2, 3]
    for row in scenes:
        assert row.view.pair.now.image.shape == (100, 135)
        for kind in ("ideal", "block matching"):
            checked = row.percepts[kind, "normalised"]
            assert checked.flow.shape == (10, 15)
            assert checked.right, (row.scene.title, checked.percept.sentence)
    corridor, chair, door = (row.percepts["ideal", "normalised"].percept for row in scenes)
    # as the paper prints them
    assert corridor.obstacles["layer1"] == {"P2": "middle"}
    assert chair.obstacles["layer1"] == {"P3": "near"}
    assert {"P1", "P2"} <= door.obstacles["layer1"].keys()
    assert front_of(door) == "door"
    for percept in (corridor, chair):
        assert "door" in front_of(percept)
        assert "Floor in front" in percept.sentence


def test_scenes_have_the_paper_s_camera() -> None:
    camera = hand_held().camera
    whole = 2.0 * math.degrees(math.atan(72.0 / camera.focal))
    assert whole == pytest.approx(65.0)
    assert len(SCENES) == 3


def test_every_place_has_a_verdict_and_a_reason_where_table_1_has_nothing(
    waypoints: list[WaypointRow], scenes: list[SceneRow]
) -> None:
    found = as_data(waypoints, scenes)
    assert [row["waypoint"] for row in found["table2"]] == list(range(1, 11))
    for row in [*found["table2"], *found["table3"]]:
        truth = row["truth"]
        assert bool(truth["situations"]) != bool(truth["no_situation"])
        for reading in row["readings"]:
            assert reading["statements"].keys() == {"nearest", "distance", "front"}
            right = sum(reading["statements"].values())
            assert reading["verdict"] == ("wrong", "partly", "partly", "right")[right]
    none = [row for row in found["table2"] if row["truth"]["no_situation"]]
    assert none, "the room has views that Table 1 does not name"
    assert all(re.search(r"\d+ ?%", row["truth"]["no_situation"]) for row in none)


def test_pictures(waypoints: list[WaypointRow], scenes: list[SceneRow]) -> None:
    picture = waypoint_picture(waypoints[0])
    assert picture.shape == (2 * (480 + 30), 2 * 640 + 8, 3)
    assert scene_picture(scenes[0]).shape == (430, 2 * 540 + 8, 3)
    # arrows are drawn: the panels with flow are not the plain image
    assert (picture[40:500, 660:1280] > 200).any()
    world = load_world(find("world", "paper-room"))
    plan = draw_map(world, drive(), waypoints).astype(int)
    red, blue = plan[..., 2] - plan[..., 0], plan[..., 0] - plan[..., 2]
    assert (red > 150).sum() > 500, "waypoints"
    assert (blue > 100).sum() > 500, "the way"
