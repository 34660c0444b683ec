from __future__ import annotations

import pytest

from navfw.bench import MAX_DIFFERENCE, compare_rule_bases, time_flow, time_offis
from navfw.offis import RULES


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


def test_block_matching_is_timed_against_the_loop() -> None:
    result = time_flow(2)
    assert result["block_matching_ratio"] == pytest.approx(
        result["match_template_ms"] / result["block_matching_ms"]
    )
