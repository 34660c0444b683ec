import json
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from offis_scenes import Scene, Wall, box, corner, corridor, door, ideal_flow, motion, wall_ahead
from pydantic import ValidationError

from navfw.offis import Offis
from navfw.offis.elementary_situations import ELEMENTARY, TABLE
from navfw.robot import RobotModel
from navfw.signals import FlowField, Percept, Twist

ROBOT = RobotModel()
SLOW = Twist(0.3, 0.0)


def perceive(
    walls: Iterable[Wall], twist: Twist = SLOW, params: Offis.Params | None = None, **options: Any
) -> Percept:
    flow, _ = ideal_flow(Scene(tuple(walls)), **options)
    return Offis(ROBOT, params).perceive(flow, twist)


def top(percept: Percept, names: Iterable[str]) -> str:
    return max(names, key=percept.situations.__getitem__)


def term(percept: Percept, quadrant: str) -> str:
    degrees = percept.quadrants[quadrant]
    return max(degrees, key=degrees.__getitem__)


DOOR = {"door or corridor", "door or corner"}
CORNER = {"door or corner", "corner"}
LEFT, RIGHT = "left slope wall", "right slope wall"
SLANT = math.radians(35)
ROOM = {
    "wall": ([wall_ahead(1.5)], {"wall"}, "wall", ("[1 1]", "[1 1]")),
    "far wall": ([wall_ahead(3.5)], {"wall"}, "wall", ("[1 1]", "[1 1]")),
    LEFT: ([wall_ahead(1.5, SLANT)], {f"{LEFT} or unknown"}, LEFT, ("[2 1]", "[2 1]")),
    RIGHT: ([wall_ahead(1.5, -SLANT)], {f"{RIGHT} or unknown"}, RIGHT, ("[1 2]", "[1 2]")),
    "corridor": (corridor(), {"door or corridor"}, "corridor", ("[3 1]", "[1 3]")),
    "off centre": (corridor(shift=0.3), {"door or corridor"}, "corridor", ("[3 1]", "[1 3]")),
    "corner": (corner(1.8), CORNER, "corner", ("[2 1]", "[1 2]")),
    "turned corner": (corner(1.8, math.radians(38)), CORNER, "corner", ("[2 1]", "[1 2]")),
    "door": (door(1.2), DOOR, "door", None),
    "door farther": (door(2.2), DOOR, "door", None),
    "door aslant": (door(1.4, angle=0.2), DOOR, "door", None),
}


@pytest.mark.parametrize("name", ROOM)
@pytest.mark.parametrize("grid", [(12, 16), (10, 15)])
def test_situations_and_slopes(name: str, grid: tuple[int, int]) -> None:
    walls, alternatives, elementary, codes = ROOM[name]
    percept = perceive(walls, rows=grid[0], cols=grid[1])
    assert top(percept, TABLE) in alternatives
    assert top(percept, ELEMENTARY) == elementary
    if codes is not None:
        assert (percept.slopes["left"], percept.slopes["right"]) == codes


@pytest.mark.parametrize("name", ROOM)
def test_situations_survive_noise(name: str) -> None:
    walls, alternatives, _, _ = ROOM[name]
    rng = np.random.default_rng(11)
    answers = [top(perceive(walls, sigma=0.1, noise=rng), TABLE) for _ in range(20)]
    assert sum(answer in alternatives for answer in answers) >= 17


MIRRORED = {"P1": "P2", "P2": "P1", "P3": "P4", "P4": "P3"}


def swap_sides(text: str) -> str:
    return text.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")


def swap_code(code: str) -> str:
    return f"[{code[3]} {code[1]}]" if code != "unknown" else code


@given(
    kind=st.sampled_from(["wall", "corridor", "corner", "door", "boxes"]),
    distance=st.floats(0.9, 2.5),
    angle=st.floats(-0.7, 0.7),
    side=st.floats(-0.6, 0.6),
)
@settings(max_examples=40, deadline=None)
def test_mirrored_scenes_give_mirrored_answers(
    kind: str, distance: float, angle: float, side: float
) -> None:
    scenes: dict[str, Callable[[], tuple[Wall, ...]]] = {
        "wall": lambda: (wall_ahead(distance, angle),),
        "corridor": lambda: corridor(1.0, 2.0 + distance, side),
        "corner": lambda: corner(distance, math.pi / 4 + 0.5 * angle),
        "door": lambda: door(distance, angle=0.4 * angle),
        "boxes": lambda: (*box(distance, side, 0.3, 0.5), wall_ahead(distance + 1.0, angle)),
    }
    scene = Scene(scenes[kind]())
    here = Offis(ROBOT).perceive(ideal_flow(scene)[0], SLOW)
    there = Offis(ROBOT).perceive(ideal_flow(scene.mirrored())[0], SLOW)
    for name, degree in here.situations.items():
        assert there.situations[swap_sides(name)] == pytest.approx(degree, abs=1e-3)
    for quadrant, degrees in here.quadrants.items():
        assert there.quadrants[MIRRORED[quadrant]] == pytest.approx(degrees, abs=1e-3)
    assert there.slopes == {
        "left": swap_code(here.slopes["right"]),
        "right": swap_code(here.slopes["left"]),
    }
    assert there.floor_in_front == pytest.approx(here.floor_in_front, abs=1e-3)
    assert set(there.obstacles["layer1"]) == {MIRRORED[q] for q in here.obstacles["layer1"]}


@pytest.mark.parametrize("layers", [1, 2, 3])
@pytest.mark.parametrize(("y", "low", "high"), [(0.45, "P3", "P2"), (-0.45, "P4", "P1")])
def test_the_nearest_quadrant_holds_the_box(layers: int, y: float, low: str, high: str) -> None:
    params = Offis.Params(layers=layers)
    chair = perceive([*box(1.0, y, 0.4, 0.34), wall_ahead(4.0)], params=params)
    assert set(chair.obstacles["layer1"]) == {low}
    cupboard = perceive([*box(1.0, y, 0.4, 2.0), wall_ahead(4.0)], params=params)
    assert {low, high} == set(cupboard.obstacles["layer1"])
    assert list(cupboard.obstacles) == [f"layer{i + 1}" for i in range(layers)]
    for layer, regions in list(cupboard.obstacles.items())[1:]:
        assert regions, layer
        assert {"P" + name[2] for name in regions} == {low, high}


def test_distance_terms_follow_distance_and_speed() -> None:
    terms = {0.6: "near", 1.5: "middle", 1.6: "middle", 3.5: "far", 4.0: "far"}
    for speed in (0.0, math.nan, -0.1, -0.2):  # without a forward speed distance alone decides
        for distance, expected in terms.items():
            percept = perceive([wall_ahead(distance)], Twist(speed, 0.0))
            assert term(percept, "P2") == expected
            assert set(percept.obstacles["layer1"].values()) == {expected}
    # faster: the same places are reached sooner
    assert term(perceive([wall_ahead(1.6)], Twist(0.8, 0.0)), "P2") == "near"
    assert term(perceive([wall_ahead(3.0)], Twist(0.5, 0.0)), "P2") == "middle"


@given(st.floats(0.5, 5.0), st.floats(1.02, 1.5), st.floats(0.0, 0.5))
@settings(max_examples=40, deadline=None)
def test_nearer_is_never_less_near(distance: float, factor: float, speed: float) -> None:
    near = perceive([wall_ahead(distance)], Twist(speed, 0.0)).quadrants["P1"]
    farther = perceive([wall_ahead(distance * factor)], Twist(speed, 0.0)).quadrants["P1"]
    assert near["near"] >= farther["near"] - 1e-6
    assert near["far"] <= farther["far"] + 1e-6


def test_the_floor_is_no_obstacle() -> None:
    percept = perceive([wall_ahead(5.0)])
    assert percept.floor_in_front == pytest.approx(1.0)
    for quadrant in ("P3", "P4"):
        assert term(percept, quadrant) == "far"
    blocked = perceive([*box(0.9, 0.0, 0.7, 0.5), wall_ahead(5.0)])
    assert blocked.floor_in_front < 0.5
    assert "near" in (term(blocked, "P3"), term(blocked, "P4"))


def test_planes_join_what_belongs_together() -> None:
    percept = perceive([wall_ahead(1.2)])
    assert set(percept.planes) == {"P1-P2", "P2-P3", "P3-P4", "P4-P1"}
    assert min(percept.planes.values()) > 0.9
    apart = perceive([Wall((1.0, 3.0), (1.0, 0.15)), wall_ahead(4.0)])
    assert apart.planes["P2-P3"] > 0.9
    assert apart.planes["P1-P2"] < 0.1


def test_sentences_are_the_papers() -> None:
    # Table 3, situation 2: a chair on the left of a corridor
    chair = perceive([*box(0.8, 0.4, 0.35, 0.3), *corridor(1.6)])
    assert chair.sentence == (
        "Layer1: nearest object is on lower left in near distance; "
        "Layer2: nearest object is on lower left in near distance; "
        "Front is a door or corridor; Floor in front"
    )
    # situation 1, along a corridor, nearer to its left wall
    along = perceive(corridor(1.6, 8.0, 0.5), Twist(0.2, 0.0))
    assert along.sentence == (
        "Layer1: nearest object is on upper left and on lower left in middle distance; "
        "Layer2: nearest object is on upper left in middle distance and on lower left in middle "
        "distance; Front is a door or corridor; Floor in front"
    )
    assert perceive([wall_ahead(1.3)], params=Offis.Params(layers=1)).sentence == (
        "Layer1: nearest object is on upper right and on upper left and on lower left and on "
        "lower right in middle distance; Front is a wall; Floor in front"
    )
    assert "Front is a door; Floor in front" in perceive(door(1.4)).sentence


@given(st.integers(0, 2**31), st.sampled_from(["nearness", "paper"]))
@settings(max_examples=25, deadline=None)
def test_pure_noise_shows_no_floor_nor_fails(seed: int, mode: Literal["nearness", "paper"]) -> None:
    rng = np.random.default_rng(seed)
    flow, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    vectors = rng.normal(0.0, 3.0, flow.vectors.shape)
    vectors[rng.random((12, 16)) < 0.1] = np.nan
    wild = replace(flow, vectors=vectors, confidence=rng.random((12, 16)), sigma=flow.sigma * 4.0)
    percept = Offis(ROBOT, Offis.Params(mode=mode)).perceive(wild, SLOW)
    assert percept.floor_in_front < 0.5
    assert all(0.0 <= d <= 1.0 for d in percept.situations.values())
    for values in (percept.nearness, percept.sigma, percept.confidence, percept.height):
        assert np.isfinite(values).all()


@pytest.mark.parametrize("twist", [Twist(0.0, 0.0), Twist(0.0, 1.0), Twist(-0.1, 0.0)])
def test_standing_still_gives_unknown(twist: Twist) -> None:
    percept = perceive([wall_ahead(1.0)], twist, moved=motion(0.0))
    assert percept.situations["unknown"] == pytest.approx(1.0)


def test_without_derotation_a_fast_left_turn_reads_wrong() -> None:
    # METHOD R16, waypoint 3 of Table 2: rotation left in the flow against the same flow without it
    flow, _ = ideal_flow(Scene(tuple(corridor())), sigma=0.1)
    x, y, f = flow.points[..., 0], flow.points[..., 1], ROBOT.camera.focal
    turn = 0.05 * np.stack([f + x * x / f, x * y / f], -1)
    turned = replace(flow, vectors=flow.vectors + turn)
    for mode in ("nearness", "paper"):
        offis = Offis(ROBOT, Offis.Params(mode=mode))
        assert top(offis.perceive(flow, SLOW), TABLE) == "door or corridor"
        assert top(offis.perceive(turned, SLOW), TABLE) != "door or corridor"


@pytest.mark.parametrize("name", ["wall", "corridor", "corner", "door", LEFT])
def test_paper_mode_finds_the_situations_of_the_paper(name: str) -> None:
    walls, alternatives, _, _ = ROOM[name]
    percept = perceive(walls, params=Offis.Params(mode="paper"))
    assert top(percept, TABLE) in alternatives - {"corner"}


def test_the_explanation_is_plain_data_with_rules_and_numbers() -> None:
    percept = perceive(corridor())
    explained = json.loads(json.dumps(dict(percept.explanation)))
    keys = "mode report regions plane distance border walls slope situation front"
    assert " ".join(explained) == " ".join(percept.explanation) == keys
    assert len(percept.explanation) == 10
    assert percept.explain() == {"sentence": percept.sentence, **dict(percept.explanation)}
    assert explained["report"]["front"] == "door or corridor"
    strongest = explained["situation"]["rules"][0]
    assert strongest["rule"] == (
        "IF left IS very_slope AND right IS very_slope THEN situation IS door_or_corridor"
    )
    assert strongest["strength"] == pytest.approx(percept.situations["door or corridor"])
    assert explained["slope"]["left"]["code"] == "[3 1]"
    assert explained["regions"]["P2"]["nearest"] > 1.0
    assert explained["distance"]["P2"]["rules"][0]["rule"].endswith("range IS near")
    assert "P1-P2" in explained["plane"]
    with pytest.raises(KeyError):
        percept.explanation["nothing"]


def test_only_what_all_alternatives_show_is_named_as_nearest() -> None:
    offis = Offis(ROBOT)
    one, other = box(1.2, 0.5, 0.4, 2.0), box(1.2, -0.5, 0.4, 2.0)
    both, left, right, none = (
        ideal_flow(Scene((*walls, wall_ahead(11.0))))[0]
        for walls in ((*one, *other), one, other, ())
    )
    unknown = replace(both, confidence=np.zeros(both.shape))

    def nearest(flow: FlowField, *others: FlowField) -> str:
        percept = offis.perceive(flow, SLOW, others)
        assert percept.explanation["report"]["nearest"] == percept.obstacles
        return percept.sentence.split("; ")[0].removeprefix("Layer1: ")

    named = "nearest object is on upper left and on lower left in middle distance"
    assert nearest(left) == nearest(left, both) == nearest(both, both, left) == named
    assert nearest(left, right) == nearest(both, left, right) == "nearest object is unknown"
    assert nearest(left, unknown) == nearest(left, none) == "nearest object is unknown"
    assert nearest(none) == nearest(none, none) == "no object in sight"
    assert nearest(none, left) == nearest(none, unknown) == "nearest object is unknown"


def test_a_new_grid_is_taken_up() -> None:
    offis = Offis(ROBOT)
    for rows, cols in ((12, 16), (10, 15), (12, 16)):
        flow, _ = ideal_flow(Scene((wall_ahead(1.5),)), rows=rows, cols=cols)
        assert offis.perceive(flow, SLOW).label.shape == (rows, cols)


def test_metrics_agree_on_a_plain_wall_and_contradicting_parameters_are_refused() -> None:
    for metric in ("nearest", "mean", "mean_variance"):
        percept = perceive([wall_ahead(1.5)], params=Offis.Params(metric=metric))
        assert term(percept, "P1") == "middle"
        assert len(percept.obstacles["layer1"]) == 4
    with pytest.raises(ValidationError, match="mode nearness"):
        Offis.Params(mode="paper", metric="nearest")
    with pytest.raises(ValidationError):
        Offis.Params(layers=4)
