"""What a route is made of: the costs of passages, by a rule base, and its waypoints."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import goal, joined

from navfw.fuzzy import CompiledFis, load_rule_base
from navfw.papfis import Route
from navfw.papfis.edge_costs import RULE_BASE, CostParams, EdgeCosts, inputs_of
from navfw.papfis.routes import Endpoint
from navfw.papfis.waypoints import (
    PassingTolerances,
    distance_to_leg,
    has_passed,
    waypoints_of,
)
from navfw.robot import RobotModel
from navfw.signals import Pose, Waypoint
from navfw.topomap import Passage, Place, PlaceKind, TopoMap

AT_PLACE = 0.05

ROBOT = RobotModel()
FIS = CompiledFis(load_rule_base(RULE_BASE))
shares = st.floats(0.0, 1.0)
SHARES = ("danger", "doorness", "uncertainty")
qualities = st.fixed_dictionaries({"width": st.floats(0.37, 5.0), **dict.fromkeys(SHARES, shares)})


def costs_of(*qualities: dict[str, float], params: CostParams | None = None) -> EdgeCosts:
    """Passages of 2 m that differ in ``qualities`` only."""
    places = [Place(f"p{i}", 2.0 * i, 0.0) for i in range(len(qualities) + 1)]
    passages = [Passage(f"p{i}", f"p{i + 1}", 2.0, **each) for i, each in enumerate(qualities)]
    return EdgeCosts(TopoMap("m", places, passages), ROBOT, params)


def penalty_by_hand(quality: dict[str, float]) -> float:
    """Zero-order Sugeno written out: the peaks of the terms, bilinear between the inputs' corners.

    The rule table as nested lists over danger none/some/high, clearance narrow/fair/wide, doorness
    open/door, uncertainty low/high.
    """
    none = [[[0.5, 0.75]] * 2, [[0.25, 0.5]] * 2, [[0.0, 0.25], [0.25, 0.5]]]
    some = [[[0.75, 0.75]] * 2, [[0.5, 0.75]] * 2, [[0.5, 0.75]] * 2]
    table = np.array([none, some, np.ones((3, 2, 2))])
    clearance = 0.5 * quality["width"] - ROBOT.radius
    danger = memberships(quality["danger"], [0.1, 0.5, 0.8])
    free = memberships(clearance, [0.08, 0.3, 0.6])
    door = memberships(quality["doorness"], [0.0, 1.0])
    doubt = memberships(quality["uncertainty"], [0.2, 0.8])
    return float(np.einsum("abcd,a,b,c,d->", table, danger, free, door, doubt))


def memberships(x: float, peaks: list[float]) -> np.ndarray:
    return np.array([np.interp(x, peaks, row) for row in np.eye(len(peaks))])


@given(qualities)
def test_the_penalty_is_the_sugeno_mean_of_the_rules(quality: dict[str, float]) -> None:
    costs = costs_of(quality, params=CostParams(aversion=4.0, avoidance=0.0))
    expected = 2.0 * (1.0 + 4.0 * penalty_by_hand(quality))
    assert costs.values[0] == pytest.approx(expected, abs=1e-9)


@given(qualities, st.sampled_from(["width", *SHARES]), st.floats(0, 5))
def test_costs_are_monotone_in_inputs(quality: dict[str, float], which: str, value: float) -> None:
    other = quality | {which: max(value, 0.37) if which == "width" else min(value, 1.0)}
    first, second = costs_of(quality, other).values
    worse = other[which] < quality[which] if which == "width" else other[which] > quality[which]
    assert second >= first - 1e-9 if worse else second <= first + 1e-9


@given(qualities, st.floats(0.0, 50.0))
def test_no_passage_costs_less_than_its_length(quality: dict[str, float], aversion: float) -> None:
    assert costs_of(quality, params=CostParams(aversion)).values[0] >= 2.0


@given(qualities)
def test_firing_strengths_sum_to_one(quality: dict[str, float]) -> None:
    """The property that keeps the mean monotone: see the comment in the rule base."""
    inputs = inputs_of([Passage("a", "b", 2.0, **quality)], ROBOT)
    firing = FIS.evaluate(inputs).firing
    assert firing.sum() == pytest.approx(1.0, abs=1e-9)


def test_the_best_passage_costs_its_length_and_the_worst_is_avoided() -> None:
    good, bad = {"width": 3.0}, {"width": 3.0, "danger": 1.0}
    costs = costs_of(good, bad, params=CostParams(aversion=4.0, avoidance=1000.0))
    assert costs.values == pytest.approx([2.0, 2.0 * (1.0 + 4.0 + 1000.0)])


def test_a_passage_too_narrow_for_the_robot_is_impassable_and_one_of_unknown_width_wide() -> None:
    body = 2.0 * ROBOT.radius
    costs = costs_of({"width": body}, {"width": body + 0.01}, {"width": math.inf}).values
    assert math.isinf(costs[0])
    assert math.isfinite(costs[1])
    assert costs[2] == pytest.approx(2.0)


def test_explanations_name_the_rules_and_add_up() -> None:
    places = [Place("a", 0, 0), Place("b", 2, 0), Place("c", 4, 0)]
    passage = Passage("a", "b", 2.0, width=0.95, danger=0.3, doorness=1.0, uncertainty=0.1)
    narrow = Passage("b", "c", 2.0, width=0.3)
    costs = EdgeCosts(TopoMap("m", places, [passage, narrow]), ROBOT)
    explained = costs.explain(passage)
    assert (explained["from"], explained["to"], explained["length"]) == ("a", "b", 2.0)
    assert explained["cost"] == pytest.approx(costs.of(passage))
    assert explained["cost"] == pytest.approx(2.0 * (1.0 + 4.0 * explained["penalty"]))
    assert explained["inputs"]["clearance"] == pytest.approx(0.295)
    sentences = {rule.sentence for rule in load_rule_base(RULE_BASE).rules}
    strengths = [rule["strength"] for rule in explained["rules"]]
    assert strengths == sorted(strengths, reverse=True)
    assert len(strengths) >= 2
    assert all(rule["rule"] in sentences for rule in explained["rules"])
    impassable = costs.explain(narrow)
    assert (impassable["cost"], impassable["passable"]) == (None, False), "without infinities"


# --- waypoints: which places become one, and its tolerance, width and passage ---------------------

Point = tuple[float, float]
KINDS: tuple[PlaceKind, ...] = get_args(PlaceKind)
PASSING = PassingTolerances(open=0.7, door=0.2, beside_door=0.4)


def waypoints(
    kinds: Sequence[PlaceKind],
    widths: tuple[float, ...] = (),
    *,
    start: float = -3.0,
    end: Waypoint,
) -> list[Waypoint]:
    """The waypoints of a route by way of places a, b, c, ... at x = 0, 3, 6, ... m.

    They are of these ``kinds``, joined by passages of these ``widths`` [m] (1.2 m); the route
    begins at x = ``start`` [m], off the passages, and ends at the goal ``end``, off them too.
    """
    places = [Place("abcdef"[k], 3.0 * k, 0.0, kind) for k, kind in enumerate(kinds)]
    widths = widths or (1.2,) * (len(kinds) - 1)
    passages = tuple(
        joined(a, b, width=width) for (a, b), width in zip(pairwise(places), widths, strict=True)
    )
    names = tuple(place.name for place in places)
    ends = Endpoint(start, 0.0), Endpoint(end.x, end.y)
    route = Route(*ends, names, passages, (None, *passages, None), 1.0, 1.0, 0.0, 0.0)
    return waypoints_of(route, end, TopoMap("row", places, passages), PASSING)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("beyond", "within"), [(0.1, True), (0.29, True), (0.31, False)])
def test_a_last_place_at_the_goal_is_left_out(kind: PlaceKind, beyond: float, within: bool) -> None:
    way = waypoints(("room", "room", kind), end=goal(6.0 + beyond, 0.0, tolerance=0.3))
    left_out = within and kind != "door"
    assert [w.place for w in way] == ["a", "b", *([] if left_out else ["c"]), "goal"]
    # the passage that led to the place left out leads to the goal now
    assert way[-1].passage == (("b", "c") if left_out else None)
    assert [w.final for w in way] == [False] * (len(way) - 1) + [True]
    assert (way[-1].kind, way[-1].tolerance, way[-1].x) == ("goal", 0.3, 6.0 + beyond)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("away", "left_out"), [(0.9, True), (1.1, False)])
def test_a_place_at_the_start_is_left_out(kind: PlaceKind, away: float, left_out: bool) -> None:
    way = waypoints((kind, "room", "room"), start=-away * AT_PLACE, end=goal(9.0, 0.0))
    assert [w.place for w in way] == [*([] if left_out else ["a"]), "b", "c", "goal"]
    # each waypoint has the passage that leads there
    assert [w.passage for w in way][-3:] == [("a", "b"), ("b", "c"), None]
    assert [(w.x, w.y, w.kind) for w in way][-3:-1] == [(3.0, 0.0, "room"), (6.0, 0.0, "room")]


def test_one_place_at_start_and_goal_is_left_out_once() -> None:
    (way,) = waypoints(("room",), start=-0.05, end=goal(0.1, 0.0))
    assert (way.place, way.final, way.passage) == ("goal", True, None)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("widths", [(1.4, 0.9), (0.9, 1.4)])
def test_doors_have_the_narrower_width_of_two(kind: PlaceKind, widths: tuple[float, float]) -> None:
    at_a, at_b, at_c, end = waypoints(("room", kind, "room"), widths, end=goal(9.0, 0.0))
    assert at_b.width == (min(widths) if kind == "door" else widths[0])
    assert (at_a.width, at_c.width, end.width) == (math.inf, widths[1], math.inf)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("at", [0, 1, 3, 5])
def test_tolerances_are_smaller_at_and_beside_doors_alone(kind: PlaceKind, at: int) -> None:
    kinds: list[PlaceKind] = ["room"] * 6
    kinds[at] = kind
    way = waypoints(kinds, end=goal(21.0, 0.0))
    away = {0: 0.2, 1: 0.4} if kind == "door" else {}
    assert [w.tolerance for w in way[:-1]] == [away.get(abs(k - at), 0.7) for k in range(6)]


def test_a_goal_on_a_passage_has_the_width_of_that_passage() -> None:
    a, b = Place("a", 0.0, 0.0), Place("b", 6.0, 0.0)
    passage, end = joined(a, b, width=0.8), goal(3.0, 0.0)
    ends = Endpoint(-3.0, 0.0), Endpoint(end.x, end.y)
    route = Route(*ends, ("a",), (), (None, passage), 1.0, 6.0, 0.0, 0.0)
    *_, last = waypoints_of(route, end, TopoMap("row", [a, b], [passage]), PASSING)
    assert (last.width, last.passage) == (0.8, ("a", "b"))


@pytest.mark.parametrize(
    ("body", "width", "beside"),
    [(0.18, 0.95, 0.4), (0.34, 0.95, 0.2), (0.46, 0.95, 0.12), (0.6, 0.95, 0.4), (0.34, 1.4, 0.4)],
)
def test_wide_robots_pass_closely_beside_doors(body: float, width: float, beside: float) -> None:
    """But for one that cannot turn there, and could not comply."""
    kinds = ["room", "room", "door", "room", "room"]
    tolerances = replace(PASSING, body=body).tolerances(kinds, [3.0, 3.0, width, 3.0, 3.0])
    assert tolerances == pytest.approx([0.7, beside, 0.2, beside, 0.7], abs=0.001)


# --- passing them --------------------------------------------------------------------------------

HERE, NEXT = (0.0, 0.0), (2.0, 0.0)


def waypoint(kind: str, width: float) -> Waypoint:
    return Waypoint(*NEXT, 0.3, "p", kind, final=False, width=width)


@pytest.mark.parametrize(
    ("at", "kind", "after", "passed"),
    [
        ((1.8, 0.1), "corridor", (4, 0), True),  # near
        ((1.6, 0.0), "corridor", (4, 0), False),  # not yet
        ((2.1, 0.8), "corridor", (4, 0), True),  # beyond, within reach
        ((2.1, 1.2), "corridor", (4, 0), False),  # beyond, too far aside
        ((1.9, 0.8), "corridor", (4, 0), False),  # aside, but not beyond
        ((1.7, 0.5), "corridor", (2, 4), True),  # cutting the corner
        ((1.3, 0.5), "corridor", (2, 4), False),
        ((2.1, 0.4), "door", (4, 0), True),  # through the gap
        ((2.1, 0.5), "door", (4, 0), False),  # beside the gap
        ((1.2, 0.4), "corridor", (0, 0.1), False),  # a turn back: only the distance counts
    ],
)
def test_when_a_waypoint_is_passed(at: Point, kind: str, after: Point, passed: bool) -> None:
    following = Waypoint(*after, 0.3, "q", "room", final=False)
    assert has_passed(at, HERE, waypoint(kind, 0.9), following, PassingTolerances()) is passed
    # wherever the map's origin is, and however its axes are turned
    for frame in (Pose(3.0, -2.0, 0.0), Pose(-1.0, 5.0, 2.0), Pose(0.5, 0.7, -1.2)):
        (x, y), (next_x, next_y) = frame.to_parent(*NEXT), frame.to_parent(*after)
        moved = replace(waypoint(kind, 0.9), x=x, y=y)
        beyond = replace(following, x=next_x, y=next_y)
        now, start = frame.to_parent(*at), frame.to_parent(*HERE)
        assert has_passed(now, start, moved, beyond, PassingTolerances()) is passed


def test_a_final_waypoint_must_be_reached() -> None:
    final = goal(*NEXT)
    assert not has_passed((2.4, 0.0), HERE, final, None, PassingTolerances())
    assert has_passed((2.2, 0.0), HERE, final, None, PassingTolerances())


def test_distance_to_a_leg() -> None:
    assert distance_to_leg((1.0, 0.5), HERE, NEXT) == pytest.approx(0.5)
    assert distance_to_leg((5.0, 4.0), HERE, NEXT) == pytest.approx(5.0)
    assert distance_to_leg((3.0, 4.0), HERE, HERE) == pytest.approx(5.0)


@pytest.mark.parametrize(("turn", "passed"), [(119.7, True), (120.3, False)])
def test_after_the_sharpest_turn_only_the_distance_counts(turn: float, passed: bool) -> None:
    beyond = math.radians(0.5 * turn)
    at = (NEXT[0] + 0.5 * math.cos(beyond), NEXT[1] + 0.5 * math.sin(beyond))
    after = (NEXT[0] + math.cos(2.0 * beyond), NEXT[1] + math.sin(2.0 * beyond))
    following = Waypoint(*after, 0.3, "q", "room", final=False)
    assert has_passed(at, HERE, waypoint("room", 0.9), following, PassingTolerances()) is passed
