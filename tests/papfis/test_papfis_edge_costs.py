"""The costs of passages, by a rule base."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.fuzzy import CompiledFis, load_rule_base
from navfw.papfis import RULE_BASE, CostParams, EdgeCosts, inputs_of
from navfw.robot import RobotModel
from navfw.topomap import Passage, Place, TopoMap

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
def test_costs_are_monotone_in_every_input(
    quality: dict[str, float], which: str, value: float
) -> None:
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
