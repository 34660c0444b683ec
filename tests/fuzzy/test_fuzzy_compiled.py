"""Properties of the compiled evaluator, and the check that rules cover all inputs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fuzzy_samples import (
    BOUNDED,
    corner_values,
    rule_base_of,
    rule_bases,
    samples,
    small,
    with_default,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.errors import RuleBaseError, UnknownNameError
from navfw.fuzzy import CompiledFis
from navfw.fuzzy.coverage import uncovered_region

FIRING_FLOOR = 1e-09

FIS = CompiledFis(rule_base_of(small()))


@BOUNDED
@given(data=st.data())
def test_outputs_stay_in_range_and_degrees_are_maxima_of_rules(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases())
    result = CompiledFis(rule_base).evaluate(data.draw(samples(rule_base)))
    assert result.firing.min() >= 0.0
    assert result.firing.max() <= 1.0 + 1e-12
    for name, variable in rule_base.outputs.items():
        assert variable.low <= result.outputs[name][0] <= variable.high
        for term in variable.terms:
            strengths = [
                result.firing[0, k]
                for k, rule in enumerate(rule_base.rules)
                if (name, term) in rule.conclusions
            ]
            assert result.degrees[name][term][0] == max(strengths, default=0.0)


@BOUNDED
@given(data=st.data())
def test_the_order_of_rules_does_not_matter(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases())
    inputs = data.draw(samples(rule_base))
    order = data.draw(st.permutations(range(len(rule_base.rules))))
    shuffled = replace(rule_base, rules=tuple(rule_base.rules[k] for k in order))
    one, other = (CompiledFis(base).evaluate(inputs) for base in (rule_base, shuffled))
    np.testing.assert_array_equal(one.firing[:, order], other.firing)
    for name in rule_base.outputs:
        np.testing.assert_array_equal(one.outputs[name], other.outputs[name])


@BOUNDED
@given(data=st.data())
def test_a_sample_does_not_depend_on_others_and_is_the_same_alone(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases())
    rows = data.draw(st.lists(samples(rule_base), min_size=2, max_size=5))
    fis = CompiledFis(rule_base)
    together = fis.evaluate({name: np.array([row[name] for row in rows]) for name in rows[0]})
    assert len(together) == len(rows)
    for k, row in enumerate(rows):
        for alone in (fis.evaluate(row), fis.evaluate_one(row)):
            np.testing.assert_array_equal(together.firing[k], alone.firing[0])
            for name, terms in together.degrees.items():
                assert together.outputs[name][k] == alone.outputs[name][0]
                assert alone.activations(name) == [degree[k] for degree in terms.values()]


@settings(max_examples=50)
@given(st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.floats(-1.0, 1.0))
def test_firing_is_monotone_in_an_input_whose_term_is(near: float, far: float, side: float) -> None:
    near, far = min(near, far), max(near, far)
    firing = FIS.evaluate({"distance": [near, far], "side": side}).firing
    assert (firing[0, :2] >= firing[1, :2]).all()
    assert firing[0, 2] <= firing[1, 2]


def test_worked_example_by_hand() -> None:
    result = FIS.evaluate({"distance": 0.75, "side": -0.5})
    np.testing.assert_allclose(result.firing, [[0.5, 0.5, 0.5]])
    degrees = {term: degree[0] for term, degree in result.degrees["turn"].items()}
    assert degrees == pytest.approx({"right": 0.5, "none": 0.5, "left": 0.5})
    assert result.outputs["turn"][0] == pytest.approx(0.0, abs=1e-12)
    steep = FIS.evaluate({"distance": 0.0, "side": -1.0})
    assert steep.outputs["turn"][0] == pytest.approx(-2 / 3)


@pytest.mark.parametrize(("hedge", "expected"), [("very", 0.25), ("somewhat", 0.5**0.5)])
def test_hedges_and_weights(hedge: str, expected: float) -> None:
    rules = [
        f"IF distance IS {hedge} near THEN turn IS right WITH 0.8 weight",
        "IF distance IS NOT near AND side IS left THEN turn IS left",
    ]
    fis = CompiledFis(rule_base_of(with_default(0, rules)))
    firing = fis.evaluate({"distance": 0.75, "side": -1.0}).firing[0]
    np.testing.assert_allclose(firing, [0.8 * expected, 0.5], atol=1e-3)


def test_inputs_are_clipped_to_their_ranges() -> None:
    outside = FIS.evaluate({"distance": [-5.0, np.inf], "side": [-9.0, 9.0]})
    inside = FIS.evaluate({"distance": [0.0, 2.0], "side": [-1.0, 1.0]})
    np.testing.assert_array_equal(outside.firing, inside.firing)


def test_scalars_apply_to_all_samples_there_may_be_none_and_nan_spoils_its_own() -> None:
    result = FIS.evaluate({"distance": 0.2, "side": np.array([-1.0, 0.0, 1.0])})
    assert result.outputs["turn"].shape == (3,)
    assert result.firing.shape == (3, 3)
    empty = FIS.evaluate({"distance": 0.2, "side": np.array([])})
    assert empty.outputs["turn"].shape == (0,)
    turn = FIS.evaluate({"distance": [0.2, np.nan], "side": 0.5}).outputs["turn"]
    assert np.isnan(turn).tolist() == [False, True]
    assert np.isfinite(turn[0])


def test_wrong_inputs_raise() -> None:
    for evaluate in (FIS.evaluate, FIS.evaluate_one):
        with pytest.raises(UnknownNameError, match="did you mean 'side'"):
            evaluate({"distance": 1.0, "sid": 0.0})
        with pytest.raises(RuleBaseError, match="missing 'side'"):
            evaluate({"distance": 1.0})
    with pytest.raises(ValueError, match=r"input '(side|distance)'.*like the others"):
        FIS.evaluate({"distance": [1.0, 2.0], "side": [0.0, 1.0, 2.0]})
    with pytest.raises(ValueError, match=r"shape \(2, N\)"):
        FIS.evaluate_rows(np.zeros((3, 4)))


def test_rows_are_the_inputs_in_order_whatever_their_memory_layout() -> None:
    rows = np.array([[0.2, 0.9], [0.5, -0.5]])
    named = FIS.evaluate(dict(zip(FIS.input_names, rows, strict=True)))
    others: list[Any] = [rows, np.asfortranarray(rows), rows.astype(np.float32)]
    for same in others:
        turn = FIS.evaluate_rows(same).outputs["turn"]
        np.testing.assert_allclose(turn, named.outputs["turn"], atol=1e-6)


def test_explanation_names_sentences_strongest_first() -> None:
    result = FIS.evaluate({"distance": [2.0, 0.6], "side": [0.0, -0.75]})
    fired = FIS.explain(result, index=1)
    assert [entry["rule"] for entry in fired] == small()["rules"]
    assert [entry["strength"] for entry in fired] == pytest.approx([0.75, 0.25, 0.2])
    assert [e["rule"] for e in FIS.explain(result, index=1, minimum=0.5)] == small()["rules"][:1]
    assert [e["rule"] for e in FIS.explain(result, index=0, minimum=0.0)] == small()["rules"][2:]


def error_of(**changes: Any) -> str:
    with pytest.raises(RuleBaseError) as caught:
        rule_base_of(small(**changes), "turn.yaml")
    assert caught.value.key == "outputs.turn"
    return str(caught.value)


def with_terms(**shapes: dict[str, list[float]]) -> dict[str, Any]:
    """The inputs of the valid rule base, with other terms of the distance."""
    distance = small()["inputs"]["distance"]
    terms = {**distance["terms"], **shapes}
    return {**small()["inputs"], "distance": {**distance, "terms": terms}}


def test_a_missing_rule_leaves_the_region_of_its_terms() -> None:
    message = error_of(rules=[small()["rules"][0], small()["rules"][2]])
    assert message.startswith("turn.yaml:1: outputs.turn: no rule concludes about 'turn' where ")
    assert "distance is in [0, 0.5] m (near) and side is in [0, 1] (middle or right)" in message
    assert "'default: <value>'" in message


@pytest.mark.parametrize(
    ("near", "more", "where"),
    [
        ({"trapezoid": [0, 0, 0.2, 0.4]}, {}, "in [0.4, 0.5] m"),
        ({"trapezoid": [0, 0, 0.2, 0.5]}, {}, "exactly 0.5 m"),
        ({"triangle": [0, 0.5, 1]}, {}, "exactly 0 m"),
        ({"triangle": [0.3, 0.5, 1]}, {"far": {"triangle": [0.5, 1, 1.5]}}, "in [0, 0.3] m"),
        ({"trapezoid": [0, 0, 0.2, 0.6]}, {"far": {"triangle": [0.5, 1, 1.5]}}, "in [1.5, 2] m"),
    ],
    ids=[
        "a gap",
        "terms that touch",
        "the end, to which inputs are clipped",
        "one of two ends",
        "up",
    ],
)
def test_gaps_between_terms_are_named_in_numbers(
    near: dict[str, list[float]], more: dict[str, Any], where: str
) -> None:
    message = error_of(inputs=with_terms(near=near, **more))
    assert f"where distance is {where} (none of its terms)\n" in message


def test_a_negated_term_does_not_fire_where_the_term_is_one() -> None:
    rules = ["IF NOT distance IS near THEN turn IS none"]
    rules += ["IF side IS middle AND distance IS near THEN turn IS left"]
    inputs = small()["inputs"]
    side = {**inputs["side"], "terms": {"middle": {"triangle": [-0.5, 0, 0.5]}}}
    message = error_of(rules=rules, inputs={**inputs, "side": side})
    assert "distance is in [0, 0.5] m (near) and side is in " in message


def test_an_output_with_a_default_is_not_checked() -> None:
    rule_base = rule_base_of(with_default(0.5, small()["rules"][:2]))
    assert rule_base.outputs["turn"].default == 0.5
    result = CompiledFis(rule_base).evaluate({"distance": 2.0, "side": 0.0})
    assert result.outputs["turn"][0] == 0.5


def test_every_output_is_checked() -> None:
    outputs = {**small()["outputs"], "speed": small()["outputs"]["turn"]}
    rules = [*small()["rules"][:2], "IF distance IS far THEN turn IS none, speed IS none"]
    with pytest.raises(RuleBaseError, match="concludes about 'speed' where distance is in "):
        rule_base_of(small(rules=rules, outputs=outputs))


@settings(BOUNDED, max_examples=30)
@given(data=st.data())
def test_the_result_agrees_with_the_firing_strengths(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases())
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    fis = CompiledFis(rule_base)
    rows = np.array(
        [
            np.concatenate([rng.uniform(v.low, v.high, 300), rng.choice(corners, 300)])
            for v, (_, corners) in zip(
                rule_base.inputs.values(), corner_values(rule_base), strict=True
            )
        ]
    )
    for output in rule_base.outputs:
        region = uncovered_region(rule_base, output)
        concludes = [
            k
            for k, rule in enumerate(rule_base.rules)
            if any(name == output for name, _ in rule.conclusions)
        ]
        if region is None:
            assert (fis.evaluate_rows(rows).firing[:, concludes].max(axis=1) > 0.0).all()
            continue
        bounds = {interval.variable.name: interval for interval in region}
        inside = np.array(
            [
                rng.uniform(bounds[name].low, bounds[name].high, 200)
                if name in bounds
                else row[:200]
                for name, row in zip(rule_base.inputs, rows, strict=True)
            ]
        )
        firing = fis.evaluate_rows(inside).firing[:, concludes]
        assert firing.max() <= 1e3 * FIRING_FLOOR


def test_many_inputs_are_searched_up_to_a_limit() -> None:
    def wide(inputs: int, terms: int) -> dict[str, Any]:
        step = 1.0 / (terms - 1)
        shapes = {
            f"t{k}": {"triangle": [(k - 1) * step, k * step, (k + 1) * step]} for k in range(terms)
        }
        names = [f"i{k}" for k in range(inputs)]
        rules = [f"IF {n} IS t{k} THEN o IS a" for n in names for k in range(terms) if k != 1]
        return {
            "name": "wide",
            "inputs": {name: {"range": [0, 1], "terms": shapes} for name in names},
            "outputs": {"o": {"range": [0, 1], "terms": {"a": {"triangle": [0, 0.5, 1]}}}},
            "rules": [*rules, "IF " + " AND ".join(f"{n} IS t0" for n in names) + " THEN o IS a"],
        }

    with pytest.raises(RuleBaseError, match=r"i0 is exactly 0.25 .*i5 is exactly 0.25"):
        rule_base_of(wide(6, 5))
    everything = wide(12, 5)
    everything["rules"] += [
        f"IF i{k} IS t{a} AND i{(k + 1) % 12} IS t1 THEN o IS a"
        for k in range(12)
        for a in range(5)
    ]
    with pytest.raises(RuleBaseError, match="too many inputs and terms"):
        rule_base_of(everything)
