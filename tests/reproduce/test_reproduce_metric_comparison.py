from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from navfw.reproduce import compare_metrics
from navfw.reproduce.metric_comparison import _claims, _discriminate, _features
from navfw.robot import RobotModel
from navfw.testing.behavior_scenes import wall_flow


def test_discriminant_separates_separable_classes_only() -> None:
    rng = np.random.default_rng(0)
    labels = ["left", "right"] * 100
    shift = np.array([[-1.0, 0.0], [1.0, 0.0]] * 100)
    table = shift + 0.3 * rng.standard_normal((200, 2))
    answers = _discriminate(table[:150], labels[:150], table[150:])
    assert np.mean([a == b for a, b in zip(answers, labels[150:], strict=True)]) > 0.97
    blind = _discriminate(rng.standard_normal((150, 2)), labels[:150], table[150:])
    assert set(blind) <= {"left", "right"}


def test_features_are_the_regions_metrics() -> None:
    flow = wall_flow(RobotModel(), 0.0, ahead=1.0, left=20.0, right=20.0)
    assert _features(flow, 2, False).shape == (32,)
    assert _features(flow, 1, True).shape == (16,)
    means = np.exp(_features(flow, 1, False)) - 0.05
    part = np.abs(flow.vectors[:6, 8:, 0])  # P1: upper right
    assert np.isclose(means[0], part.mean())


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return compare_metrics(14, seed=3)


def test_comparison_on_a_few_views(result: dict[str, Any]) -> None:
    assert result["views"] == 14
    for found in result["offis"].values():
        for shares in found.values():
            assert all(share is None or 0.0 <= share <= 1.0 for share in shares.values())
    normalised = result["offis"]["normalised, L=2, nearest eighth"]["ideal"]
    assert normalised["quadrant"] > 0.8
    assert set(result["numbers"]) == {"L=2, means", "L=1, means and variances", "L=1, means"}


def test_the_claim_is_judged_on_the_same_views(result: dict[str, Any]) -> None:
    assert len(result["claims"]) == 16
    for claim in result["claims"]:
        two, one = claim["two_layers_right"], claim["one_layer_right"]
        assert claim["confirmed"] == (two >= one)
        assert abs(two - one) <= claim["differ"] <= claim["views"] <= 14
        if claim["by"] == "the metrics alone":
            found = result["numbers"]["L=2, means"][claim["flow"]][claim["what"]]
        elif claim["by"] == "OFFIS, raw means":
            found = result["offis"]["L=2, means"][claim["flow"]][claim["what"]]
        else:
            found = result["offis"]["normalised, L=2, means"][claim["flow"]][claim["what"]]
        assert found == two / claim["views"]


def test_a_claim_counts_views_on_which_the_answers_differ() -> None:
    two = {"ideal": {"quadrant": [True, True, False, None, False]}}
    one = {"ideal": {"quadrant": [False, True, True, None, True]}}
    (claim,) = _claims("OFFIS", two, one)
    assert (claim["views"], claim["two_layers_right"], claim["one_layer_right"]) == (4, 2, 3)
    assert claim["differ"] == 3
    assert not claim["confirmed"]
    assert claim["p"] == 1.0
    (turned,) = _claims("OFFIS", one, two)
    assert turned["confirmed"]
