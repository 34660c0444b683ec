"""The tables that are reproduced, and their summary."""

import re
from typing import Any

import numpy as np
import pytest
from flow_scene import rotational_flow
from navfw_benchmarks.bench.perception_accuracy import front_of
from navfw_benchmarks.reproduce.metric_comparison import (
    _claims,
    _discriminate,
    compare_metrics,
)
from navfw_benchmarks.reproduce.paper_scenes import FAST_TURN, WAYPOINTS, drive
from navfw_benchmarks.reproduce.paper_tables import (
    FAST,
    PaperRow,
    checks,
    table2,
    table3,
    true_flow,
)
from navfw_benchmarks.reproduce.reproduction import (
    draw_map,
    scene_picture,
    summary,
    waypoint_picture,
)

from navfw.config import find
from navfw.missions.run_metrics import path_length
from navfw.robot import RobotModel
from navfw.sim import SceneGeometry, load_world


@pytest.fixture(scope="module")
def waypoints() -> list[PaperRow]:
    return table2(seed=0)


@pytest.fixture(scope="module")
def scenes() -> list[PaperRow]:
    return table3(seed=0)


def test_the_way_is_free_and_smooth() -> None:
    way = drive()
    plan = SceneGeometry.from_world(load_world(find("world", "paper-room")), 0.4)
    assert min(plan.clearance(m.pose.x, m.pose.y) for m in way) > RobotModel().radius + 0.1
    assert 7.0 < path_length(np.array([(m.pose.x, m.pose.y) for m in way])) < 12.0
    turns = [abs(point.twist.w) for point in way]
    assert max(turns) == FAST_TURN


def test_waypoint_3_is_the_fast_left_turn() -> None:
    way = drive()
    times = [time for time, _ in WAYPOINTS]
    assert times == sorted(times)
    twists = [way[round(time * 60)].twist for time in times]
    assert twists.pop(FAST - 1).w == FAST_TURN
    assert max(abs(twist.w) for twist in twists) < 0.02


def test_fast_turn_reads_wrong_without_derotation_and_right_with(
    waypoints: list[PaperRow],
) -> None:
    found = checks(waypoints)
    assert all(found.values()), found
    fast = next(row for row in waypoints if row.number == FAST)
    for kind in ("ideal", "block matching"):
        right = fast.percepts[kind, "removed", "normalised"]
        assert front_of(right) != "unknown"
        assert right.floor_in_front > 0.5
    # the paper's own way to read it: everything near, nothing recognised
    false = fast.percepts["ideal", "left in", "raw means"]
    assert set(false.obstacles["layer1"]) == {"P1", "P2", "P3", "P4"}
    assert set(false.obstacles["layer1"].values()) == {"near"}


def test_ideal_flow_is_translation_and_rotation(waypoints: list[PaperRow]) -> None:
    robot = RobotModel()
    for row in waypoints:
        whole = true_flow(row.view, robot)
        rest = row.flows["ideal", "removed"]
        turned = rotational_flow(whole.points, whole.motion.rotation, robot.camera.focal)
        # exact derotation and the rotational flow differ in second order only
        limit = 0.02 + 0.1 * np.abs(turned).max()
        assert np.abs(whole.vectors - turned - rest.vectors).max() < limit
        assert whole.shape == (12, 16)


def test_the_same_seed_gives_the_same_readings(
    waypoints: list[PaperRow], scenes: list[PaperRow]
) -> None:
    again = [*table2(seed=0), *table3(seed=0)]
    assert [row.as_data() for row in again] == [row.as_data() for row in (*waypoints, *scenes)]
    image = waypoints[0].view.pair.now.image
    assert (table2(seed=1)[0].view.pair.now.image != image).any()


def test_the_three_situations(scenes: list[PaperRow]) -> None:
    assert [row.number for row in scenes] == [1, 2, 3]
    for row in scenes:
        assert row.view.pair.now.image.shape == (100, 135)
        for kind in ("ideal", "block matching"):
            assert row.flows[kind,].shape == (10, 15)
            said = row.percepts[kind, "normalised"].sentence
            assert row.right(kind, "normalised"), (row.about, said)
    corridor, chair, door = (row.percepts["ideal", "normalised"] for row in scenes)
    # as the paper prints them
    assert corridor.obstacles["layer1"] == {"P2": "middle"}
    assert chair.obstacles["layer1"] == {"P3": "near"}
    assert {"P1", "P2"} <= door.obstacles["layer1"].keys()
    assert front_of(door) == "door"
    for percept in (corridor, chair):
        assert "door" in front_of(percept)
        assert "Floor in front" in percept.sentence


def test_every_place_has_a_verdict_and_a_reason_where_table_1_has_nothing(
    waypoints: list[PaperRow], scenes: list[PaperRow]
) -> None:
    table = [row.as_data() for row in waypoints]
    assert [row["waypoint"] for row in table] == list(range(1, 11))
    for row in [*table, *(scene.as_data() for scene in scenes)]:
        truth = row["truth"]
        assert bool(truth["situations"]) != bool(truth["no_situation"])
        for reading in row["readings"]:
            assert reading["statements"].keys() == {"nearest", "distance", "front"}
            right = sum(reading["statements"].values())
            assert reading["verdict"] == ("wrong", "partly", "partly", "right")[right]
    none = [row for row in table if row["truth"]["no_situation"]]
    assert none, "the room has views that Table 1 does not name"
    assert all(re.search(r"\d+ ?%", row["truth"]["no_situation"]) for row in none)


def test_pictures(waypoints: list[PaperRow], scenes: list[PaperRow]) -> None:
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


# --- the summary ---------------------------------------------------------------------------------


def claim(what: str, two: int, one: int, differ: int, p: float) -> dict[str, Any]:
    views = {"by": "the metrics alone", "flow": "ideal", "what": what, "views": 50}
    right = {"two_layers_right": two, "one_layer_right": one, "confirmed": two >= one}
    return {**views, **right, "differ": differ, "p": p}


def reading(verdict: str, rotation: str) -> dict[str, str]:
    return {"flow": "ideal", "mode": "normalised", "rotation": rotation, "verdict": verdict}


def place(number: int, removed: str, left: str, why: str | None) -> dict[str, Any]:
    readings = [reading(removed, "removed"), reading(left, "left in")]
    return {"waypoint": number, "truth": {"no_situation": why}, "readings": readings}


def summarised(**changed: Any) -> dict[str, list[str]]:
    claims = [
        claim("quadrant", 40, 48, 10, 0.022),
        claim("situation", 30, 29, 9, 1.0),
        claim("distance", 44, 44, 0, 1.0),
        claim("quadrant", 40, 41, 3, 1.0),
    ]
    hidden = "furniture hides 50% of the walls in the left half"
    places = [place(3, "right", "wrong", None), place(2, "partly", "right", hidden)]
    result = {"table2": places, "table3": [], "real": None, "metrics": {"claims": claims}}
    return summary({**result, **changed})


def test_the_claim_of_section_4_3_is_told_with_its_figures() -> None:
    whole, *missed = summarised()["Section 4.3"]
    assert "is confirmed in 2 of 4 comparisons: better by more than chance (p < 0.05) in 0" in whole
    denied = "alike on every view in 1. It is not confirmed in 2: worse by more than chance in 1"
    assert denied in whole
    assert missed == [
        "Not confirmed: nearest quadrant by the metrics alone, ideal flow: 40 against 48 of 50"
        " right (answers that differ: 10, p = 0.022).",
        "Not confirmed: nearest quadrant by the metrics alone, ideal flow: 40 against 41 of 50"
        " right (answers that differ: 3, p = 1).",
    ]


def test_places_are_counted_by_verdict() -> None:
    found = summarised()["Table 2"]
    assert found[0] == "All 2 places are judged."
    assert (
        "Ideal flow, normalised: 1 right, 1 partly with the rotation removed;"
        " 1 right, 1 wrong with the rotation left in." in found
    )
    assert (
        "Waypoint 3, where the paper's conclusion is false, normalised: ideal flow, rotation"
        " removed: right; ideal flow, rotation left in: wrong." in found
    )
    assert "At 1 places (waypoints 2) the geometry forms none" in found[-1]


def test_photographs_are_counted_or_said_to_be_missing() -> None:
    assert "no recordings were given (--data DIR)" in summarised()["Table 3, photographs"][0]
    total = {"right": 3, "partly": 2, "wrong": 1, "silent": 0}
    single = {"single": True, "verdicts": {"right": 0, "silent": 7}}
    real = {"total": total, "recordings": [{"single": False}, {"single": False}, single]}
    assert summarised(real=real)["Table 3, photographs"] == [
        "6 labelled frames of 2 recordings: 3 right, 2 partly, 1 wrong.",
        "7 single photographs, about which nothing should be said: 7 silent.",
    ]


def test_discriminant_separates_separable_classes_only() -> None:
    rng = np.random.default_rng(0)
    labels = ["left", "right"] * 100
    shift = np.array([[-1.0, 0.0], [1.0, 0.0]] * 100)
    table = shift + 0.3 * rng.standard_normal((200, 2))
    answers = _discriminate(table[:150], labels[:150], table[150:])
    assert np.mean([a == b for a, b in zip(answers, labels[150:], strict=True)]) > 0.97
    blind = _discriminate(rng.standard_normal((150, 2)), labels[:150], table[150:])
    assert set(blind) <= {"left", "right"}


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return compare_metrics(14, seed=3)


SOURCES = {
    "the metrics alone": ("numbers", "L=2, means"),
    "OFFIS, raw means": ("offis", "L=2, means"),
}


def test_the_claim_is_judged_on_the_same_views(result: dict[str, Any]) -> None:
    assert result["views"] == 14
    assert result["offis"]["normalised, L=2, nearest eighth"]["ideal"]["quadrant"] > 0.8
    assert len(result["claims"]) == 16
    for claim in result["claims"]:
        two, one = claim["two_layers_right"], claim["one_layer_right"]
        assert claim["confirmed"] == (two >= one)
        assert abs(two - one) <= claim["differ"] <= claim["views"] <= 14
        part, way = SOURCES.get(claim["by"], ("offis", "normalised, L=2, means"))
        share = result[part][way][claim["flow"]][claim["what"]]
        assert share == two / claim["views"]


def test_a_claim_counts_views_on_which_the_answers_differ() -> None:
    two = {"ideal": {"quadrant": [True, True, False, None, False]}}
    one = {"ideal": {"quadrant": [False, True, True, None, True]}}
    (claim,) = _claims("OFFIS", two, one)
    assert (claim["views"], claim["two_layers_right"], claim["one_layer_right"]) == (4, 2, 3)
    assert (claim["differ"], claim["confirmed"], claim["p"]) == (3, False, 1.0)
    (turned,) = _claims("OFFIS", one, two)
    assert turned["confirmed"]
