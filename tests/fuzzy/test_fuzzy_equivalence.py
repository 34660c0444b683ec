"""The compiled evaluator agrees with scikit-fuzzy."""

from __future__ import annotations

import numpy as np
import pytest
from fuzzy_samples import corner_values, rule_bases, samples, small
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navfw.fuzzy import (
    CompiledFis,
    ReferenceFis,
    RuleBase,
    compare,
    random_inputs,
    rule_base_from_mapping,
)

TOLERANCE = 1e-6
METHODS = ["centroid", "bisector", "mom", "som", "lom"]


def assert_same(rule_base: RuleBase, reference: ReferenceFis, inputs: dict[str, float]) -> None:
    ours = CompiledFis(rule_base).evaluate(inputs)
    theirs = reference.evaluate(inputs)
    np.testing.assert_allclose(ours.firing, theirs.firing, rtol=0, atol=TOLERANCE)
    for name, variable in rule_base.outputs.items():
        for term in variable.terms:
            expected = theirs.degrees[name][term]
            np.testing.assert_allclose(ours.degrees[name][term], expected, atol=TOLERANCE)
        scale = variable.high - variable.low
        crisp, expected = ours.outputs[name][0], theirs.outputs[name][0]
        if rule_base.defuzzify == "bisector" and np.isnan(expected):
            # scikit-fuzzy took the root of a number just below zero; ours must still be sound
            assert variable.low <= crisp <= variable.high
        else:
            assert abs(crisp - expected) <= TOLERANCE * max(1.0, scale), (name, inputs)


@settings(
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(data=st.data())
def test_equals_scikit_fuzzy_on_random_rule_bases(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases())
    reference = ReferenceFis(rule_base)
    for inputs in data.draw(st.lists(samples(rule_base), min_size=1, max_size=4)):
        assert_same(rule_base, reference, inputs)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("conjunction", ["min", "prod"])
def test_equals_scikit_fuzzy_at_the_corners(method: str, conjunction: str) -> None:
    rule_base = rule_base_from_mapping(small(**{"and": conjunction, "defuzzify": method}))
    reference = ReferenceFis(rule_base)
    corners = dict(corner_values(rule_base))
    for distance in corners["distance"][::2]:
        for side in corners["side"][::3]:
            assert_same(rule_base, reference, {"distance": distance, "side": side})


@settings(max_examples=10, derandomize=True, deadline=None)
@given(data=st.data())
def test_scaling_implication_equals_scikit_fuzzys_defuzzification(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases(implication="prod"))
    assert_same(rule_base, ReferenceFis(rule_base), data.draw(samples(rule_base)))


def test_the_reference_is_unchanged_by_resets_of_its_simulation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the simulation keeps all results; it is reset every 500 runs, and results must not change
    rule_base = rule_base_from_mapping(
        {
            "name": "x",
            "inputs": {"a": {"range": [0, 1], "terms": {"t": {"trapezoid": [0, 1, 1, 1]}}}},
            "outputs": {
                "o": {"range": [0, 1], "default": 0, "terms": {"t": {"triangle": [0, 1, 1]}}}
            },
            "rules": ["IF a IS t THEN o IS t"],
        }
    )
    reference, compiled = ReferenceFis(rule_base), CompiledFis(rule_base)
    reset, resets = reference.simulation.reset, []

    def counted() -> None:
        resets.append(value)
        reset()

    monkeypatch.setattr(reference.simulation, "reset", counted)
    values = np.linspace(0.01, 1.0, 510).tolist()
    for value in values:
        expected = reference.evaluate({"a": value}).outputs["o"]
        if value > 0.97:
            assert compiled.evaluate({"a": value}).outputs["o"] == pytest.approx(expected)
    assert expected[0] == pytest.approx(2 / 3)
    assert resets == [values[499]]


def test_a_nan_input_and_no_firing_rule_both_give_the_default() -> None:
    rule_base = rule_base_from_mapping(
        small(
            rules=["IF distance IS near AND side IS very left THEN turn IS right"],
            outputs={"turn": {**small()["outputs"]["turn"], "default": 0.25}},
        )
    )
    reference, compiled = ReferenceFis(rule_base), CompiledFis(rule_base)
    for inputs in ({"distance": 2.0, "side": 0.5}, {"distance": np.nan, "side": -1.0}):
        ours, theirs = compiled.evaluate(inputs), reference.evaluate(inputs)
        assert ours.outputs["turn"][0] == theirs.outputs["turn"][0] == 0.25
        assert not ours.firing.any()
        assert not theirs.firing.any()


def test_compare_measures_both_and_finds_them_equal() -> None:
    rng = np.random.default_rng(5)
    comparison = compare(rule_base_from_mapping(small()), 20, rng)
    assert comparison["max_abs_diff"] <= TOLERANCE
    assert comparison["undecided"] == 0
    assert comparison["reference_ms"] > comparison["compiled_ms"] > 0.0
    with pytest.raises(ValueError, match="at least one sample"):
        compare(rule_base_from_mapping(small()), 0, rng)


def test_random_inputs_stay_in_range_and_visit_corners() -> None:
    rule_base = rule_base_from_mapping(small())
    rows = random_inputs(rule_base, 4000, np.random.default_rng(0))
    assert rows.shape == (2, 4000)
    for row, variable in zip(rows, rule_base.inputs.values(), strict=True):
        assert row.min() >= variable.low
        assert row.max() <= variable.high
        width = variable.high - variable.low
        every = {c for shape in variable.terms.values() for c in shape.corners}
        corners = np.array(sorted(every))
        off = row[:, None] - corners
        off = off[np.arange(row.size), np.abs(off).argmin(axis=1)] / width
        # half at the corners or a millionth of the range beside them, on both sides
        near = np.abs(off) < 2e-6
        assert near.mean() == pytest.approx(0.5, abs=0.05)
        assert set(np.round(off[near] * 1e6).tolist()) == {-1.0, 0.0, 1.0}
        # the others all over the range
        quarter = np.histogram(row[~near], 4, (variable.low, variable.high))[0]
        assert quarter.min() > 0.2 * (~near).sum()
    assert {0.5, 1.0} <= set(rows[0].tolist())
