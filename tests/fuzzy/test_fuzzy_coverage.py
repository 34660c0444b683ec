"""The coverage check finds and describes every uncovered region."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fuzzy_samples import corner_values, rule_bases, small
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navfw.errors import RuleBaseError
from navfw.fuzzy import CompiledFis, rule_base_from_mapping, uncovered_region
from navfw.fuzzy.inference_kernels import FIRING_FLOOR


def error_of(**changes: Any) -> str:
    with pytest.raises(RuleBaseError) as caught:
        rule_base_from_mapping(small(**changes), "turn.yaml")
    assert caught.value.key == "outputs.turn"
    return str(caught.value)


def with_near(shape: dict[str, list[float]]) -> dict[str, Any]:
    distance = small()["inputs"]["distance"]
    terms = {**distance["terms"], "near": shape}
    return {**small()["inputs"], "distance": {**distance, "terms": terms}}


def test_a_missing_rule_leaves_the_region_of_its_terms() -> None:
    message = error_of(rules=[small()["rules"][0], small()["rules"][2]])
    assert message.startswith("turn.yaml: outputs.turn: no rule concludes about 'turn' where ")
    assert "distance is in [0, 0.5] m (near) and side is in [0, 1] (middle or right)" in message
    assert "'default: <value>'" in message


def test_a_gap_between_terms_is_named_in_numbers() -> None:
    message = error_of(inputs=with_near({"trapezoid": [0, 0, 0.2, 0.4]}))
    assert "where distance is in [0.4, 0.5] m (none of its terms)\n" in message


def test_terms_that_only_touch_leave_a_point() -> None:
    message = error_of(inputs=with_near({"trapezoid": [0, 0, 0.2, 0.5]}))
    assert "where distance is exactly 0.5 m (none of its terms)\n" in message


def test_the_end_of_a_range_counts_for_inputs_are_clipped_to_it() -> None:
    message = error_of(inputs=with_near({"triangle": [0, 0.5, 1]}))
    assert "where distance is exactly 0 m (none of its terms)\n" in message


def test_a_negated_term_does_not_fire_where_the_term_is_one() -> None:
    rules = ["IF NOT distance IS near THEN turn IS none"]
    rules += ["IF side IS middle AND distance IS near THEN turn IS left"]
    inputs = small()["inputs"]
    side = {**inputs["side"], "terms": {"middle": {"triangle": [-0.5, 0, 0.5]}}}
    message = error_of(rules=rules, inputs={**inputs, "side": side})
    assert "distance is in [0, 0.5] m (near) and side is in " in message


def test_an_output_with_a_default_is_not_checked() -> None:
    outputs = {"turn": {**small()["outputs"]["turn"], "default": 0.5}}
    rule_base = rule_base_from_mapping(small(rules=small()["rules"][:2], outputs=outputs))
    assert rule_base.outputs["turn"].default == 0.5
    result = CompiledFis(rule_base).evaluate({"distance": 2.0, "side": 0.0})
    assert result.outputs["turn"][0] == 0.5


def test_every_output_is_checked() -> None:
    outputs = {**small()["outputs"], "speed": small()["outputs"]["turn"]}
    rules = [*small()["rules"][:2], "IF distance IS far THEN turn IS none, speed IS none"]
    with pytest.raises(RuleBaseError, match="concludes about 'speed' where distance is in "):
        rule_base_from_mapping(small(rules=rules, outputs=outputs))


@settings(
    max_examples=30,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(data=st.data())
def test_the_result_agrees_with_the_firing_strengths(data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases())
    seed = data.draw(st.integers(0, 1000))
    rng = np.random.default_rng(seed)
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
        rule_base_from_mapping(wide(6, 5))
    everything = wide(12, 5)
    everything["rules"] += [
        f"IF i{k} IS t{a} AND i{(k + 1) % 12} IS t1 THEN o IS a"
        for k in range(12)
        for a in range(5)
    ]
    with pytest.raises(RuleBaseError, match="too many inputs and terms"):
        rule_base_from_mapping(everything)
