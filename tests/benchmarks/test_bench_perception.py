"""Accuracy of OFFIS: truth of views, judgement of percepts, random views; times of its parts."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from navfw_benchmarks.bench.perception_accuracy import judge_percept, no_situation, run, score
from navfw_benchmarks.bench.perception_benchmark import (
    MAX_DIFFERENCE,
    compare_rule_bases,
    time_offis,
)
from navfw_benchmarks.bench.perception_samples import random_views, samples_of_world
from navfw_benchmarks.bench.true_pairs import random_world
from navfw_benchmarks.bench.view_truth import (
    HalfPlane,
    ViewTruth,
    WallGeometry,
    true_term,
    truth_of,
)

from navfw.offis.fuzzy_systems import RULES
from navfw.offis.nearness import triangulate
from navfw.robot import RobotModel
from navfw.signals import Percept, Pose
from navfw.sim import Simulation, WorldSpec
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import BoxSpec, OpeningSpec, WallSpec

ROBOT = RobotModel()
SHARES = """
    nearest_quadrant_accuracy nearest_quadrant_exact distance_accuracy far_for_near
    one_term_too_far situation_contains_truth situation_top1
"""
ROOM = WorldSpec(
    name="room",
    x=(0.0, 12.0),
    y=(0.0, 8.0),
    walls=(
        WallSpec(
            name="outer",
            points=((0.05, 0.05), (11.95, 0.05), (11.95, 7.95), (0.05, 7.95), (0.05, 0.05)),
        ),
        WallSpec(
            name="middle",
            points=((0.05, 4.0), (11.95, 4.0)),
            openings=(OpeningSpec(name="door", at=(6.0, 4.0), width=0.95),),
        ),
        WallSpec(name="passage", points=((8.0, 5.6), (11.95, 5.6))),
    ),
    boxes=(BoxSpec(name="box", at=(3.0, 6.0), size=(0.5, 0.5, 0.3)),),
)
UP, RIGHT = 0.5 * math.pi, 0.0


def situations(x: float, y: float, yaw: float) -> set[str]:
    return set(WallGeometry(ROOM).situations(Pose(x, y, yaw), ROBOT.camera))


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        ((2.5, 2.0, UP), {"wall"}),
        ((2.5, 2.0, UP + 0.2), {"wall", "right slope wall"}),
        ((4.5, 3.0, UP + 0.6), {"right slope wall"}),
        ((2.5, 2.6, UP - 0.6), {"left slope wall"}),
        ((6.0, 1.5, UP), {"door", "wall"}),
        ((6.0, 3.1, UP), {"door"}),
        ((8.3, 4.8, RIGHT), {"corridor"}),
    ],
)
def test_situations_follow_from_the_walls(
    pose: tuple[float, float, float], expected: set[str]
) -> None:
    assert situations(*pose) == expected


@pytest.mark.parametrize(
    ("pose", "certain", "possible"),
    [
        ((6.0, 0.4, UP), {"wall"}, {"wall", "door"}),
        ((10.0, 2.0, -0.3), {"mixed"}, {"left slope wall"}),
        ((10.5, 1.5, -0.25 * math.pi), {"corner"}, {"corner"}),
        ((7.0, 2.5, UP), {"mixed"}, {"mixed"}),
    ],
)
def test_a_possible_situation_has_wider_limits(
    pose: tuple[float, float, float], certain: set[str], possible: set[str]
) -> None:
    walls, at = WallGeometry(ROOM), Pose(*pose)
    assert situations(*pose) == certain
    assert set(walls.situations(at, ROBOT.camera, possible=True)) == possible


def test_the_nearest_object_is_found_in_the_true_depth() -> None:
    with Simulation(ROOM, ROBOT, Pose(11.0, 1.0, 0.0), seed=0) as sim:
        _, depth = sim.render_from(Pose(2.0, 5.75, RIGHT))
        truth = truth_of(WallGeometry(ROOM), Pose(2.0, 5.75, RIGHT), 0.3, depth, ROBOT)
    # the box's face is 0.65 m before the camera, low and on the left
    assert truth.certain == {"P3"}
    assert truth.distance == pytest.approx(0.65, abs=0.02)
    assert truth.term == "near"


def test_the_true_term_follows_distance_and_speed() -> None:
    assert [true_term(d, 0.0) for d in (0.5, 1.5, 4.0)] == ["near", "middle", "far"]
    assert true_term(1.5, 0.4 * 2) == "near"


@pytest.mark.parametrize("seed", range(4))
def test_random_worlds_are_sound_and_views_free(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = random_world(rng, "world")
    check_world(world)
    walls = WallGeometry(world)
    views = random_views(rng, world, ROBOT, 6, lambda pose: walls.situations(pose, ROBOT.camera))
    assert len(views) == 6
    for view in views:
        assert 0.1 <= view.twist.v <= 0.4
        assert abs(view.twist.w) <= 0.6


def test_a_view_drove_its_arc() -> None:
    rng = np.random.default_rng(3)
    world = random_world(rng, "world")
    view = random_views(rng, world, ROBOT, 1, lambda _: ("wall",))[0]
    past, half = view.before(1.0), view.before(0.5)
    assert math.hypot(past.x - view.pose.x, past.y - view.pose.y) <= view.twist.v + 1e-9
    forward = past.relative(half)
    again = half.relative(view.pose)
    assert (forward.x, forward.y, forward.yaw) == pytest.approx((again.x, again.y, again.yaw))


def test_ideal_flow_gives_the_true_nearness() -> None:
    samples = list(samples_of_world(11, 0, views=2))
    assert samples
    for sample in samples:
        seen = triangulate(sample.ideal, ROBOT.camera.focal)
        # above the horizon, where no floor is
        nearest = float(seen.nearness[:6].max())
        assert 0.8 < nearest / max(sample.truth.nearness[:2]) < 1.05


def test_a_small_run_has_all_figures_and_repeats() -> None:
    result = run(poses=5, seed=12)
    again = run(poses=5, seed=12)
    assert json.loads(json.dumps(result)) == json.loads(json.dumps(again))
    assert result["poses"] == 5
    for key in SHARES.split():
        assert 0.0 <= result[key] <= 1.0
        assert 0.0 <= result["ideal"][key] <= 1.0
    assert sum(sum(row.values()) for row in result["confusion"]["distance"].values()) == 5
    assert result["nearest_quadrant_accuracy"] >= 0.6


def test_shares_of_nothing_are_not_numbers_but_none() -> None:
    empty = score([], [])
    assert empty["situation_top1"] is None
    assert empty["situations"] == 0


# --- judgement of a percept ----------------------------------------------------------------------

WALL = ViewTruth(
    nearness=(0.5, 0.1, 0.1, 0.1),
    certain=frozenset({"P1"}),
    possible=frozenset({"P1", "P4"}),
    distance=2.0,
    term="middle",
    situations=("wall",),
    possible_situations=("wall",),
    planes=(HalfPlane(0, 0.9, 0.1), HalfPlane(0, 0.9, -0.1)),
    hidden=(0.0, 0.1),
)
NEARLY = replace(
    WALL, situations=("mixed",), planes=(HalfPlane(0, 0.6, 0.0), HalfPlane(0, 0.9, 0.0))
)
NOTHING = replace(NEARLY, possible_situations=("mixed",))
HIDDEN = replace(WALL, situations=("hidden",), hidden=(0.5, 0.1), possible_situations=("corridor",))


def percept(front: str) -> Percept:
    sentence = f"Layer1: nearest object is on upper right in middle distance; Front is a {front}"
    found = SimpleNamespace(sentence=sentence, obstacles={"layer1": {"P1": "middle"}})
    return cast(Percept, found)


@pytest.mark.parametrize(
    ("front", "truth", "right"),
    [
        ("wall", WALL, True),
        ("corner", WALL, False),
        ("unknown", WALL, False),
        ("unknown", NOTHING, True),
        ("left wall or unknown", NOTHING, True),
        ("wall", NOTHING, False),
        ("wall", NEARLY, True),
        ("corner", NEARLY, False),
        ("door or corridor", HIDDEN, True),
        ("door", HIDDEN, False),
    ],
)
def test_the_front_is_judged_at_every_view(front: str, truth: ViewTruth, right: bool) -> None:
    judged = judge_percept(percept(front), truth)
    assert judged.statements == {"nearest": True, "distance": True, "front": right}
    assert judged.verdict == ("right" if right else "partly")


def test_the_reason_names_what_is_missing_with_its_figure() -> None:
    assert no_situation(WALL) is None
    assert no_situation(NEARLY) == (
        "the largest wall fills 60% of the left half, less than 67% (possible: wall)"
    )
    assert no_situation(NOTHING) == "the largest wall fills 60% of the left half, less than 67%"
    assert no_situation(HIDDEN) == (
        "furniture hides 50% of the walls in the left half (possible: corridor)"
    )
    steep = (HalfPlane(0, 0.9, math.radians(70.0)), HalfPlane(1, 0.8, math.radians(-10.0)))
    assert no_situation(replace(NOTHING, planes=steep)) == (
        "the walls are aslant by left 70 deg and right -10 deg, which is no pair of Table 1"
    )


def test_every_rule_base_of_offis_equals_scikit_fuzzy() -> None:
    compared = compare_rule_bases(12)
    assert {result["name"] for result in compared} == {path.stem for path in RULES.glob("*.yaml")}
    for result in compared:
        assert result["max_abs_diff"] <= MAX_DIFFERENCE
        assert result["undecided"] == 0


def test_both_evaluators_answer_the_same_inferences() -> None:
    result = time_offis(repeats=5)
    # 20 pairs and 20 regions of two layers, two borders, two slopes, one table, one front
    assert result["inferences"] == 46
    assert result["offis_skfuzzy_ratio"] == pytest.approx(
        result["skfuzzy_ms"] / result["inference_ms"]
    )
    assert result["inference_ms"] < result["offis_ms"] < result["skfuzzy_ms"]
