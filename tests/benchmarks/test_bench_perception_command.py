from pathlib import Path
from typing import Any
from unittest.mock import create_autospec

import pytest
from cli_calls import answer, output
from navfw_benchmarks.bench import perception_accuracy, perception_benchmark
from navfw_benchmarks.bench.perception_benchmark import TARGETS, Target

BENCH = ("bench", "perception")
HEADLINES = (
    "offis_ms",
    "offis_skfuzzy_ratio",
    "offis_max_abs_diff",
    "block_matching_ratio",
    "nearest_quadrant_accuracy",
    "distance_accuracy",
    "situation_contains_truth",
    "situation_top1",
)
SCORES: dict[str, Any] = {
    "nearest_quadrant_accuracy": 0.97,
    "distance_accuracy": 0.88,
    "far_for_near": 0.0,
    "situation_contains_truth": 0.96,
    "situation_top1": float("nan"),
    "confusion": {"distance": {"near": {"near": 7, "middle": 1}, "far": {"far": 3}}},
}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Stubs in place of every part."""
    speed = {"offis_ms": 0.3, "offis_skfuzzy_ratio": 900.0, "offis_max_abs_diff": 1e-15}
    speed["block_matching_ratio"] = 2.6

    def stub(module: Any, name: str, **result: Any) -> Any:
        made = create_autospec(getattr(module, name), return_value=result)
        monkeypatch.setattr(module, name, made)
        return made

    return {
        "speed": stub(perception_benchmark, "time_perception", **speed, comparisons=30),
        "accuracy": stub(perception_accuracy, "run", poses=20, seed=1, **SCORES, ideal={**SCORES}),
    }


def test_json_has_the_headlines_first(measured: dict[str, Any]) -> None:
    result = answer(*BENCH, "--poses", 20, "--comparisons", 30)
    assert tuple(key for key in result if key in HEADLINES) == HEADLINES
    assert result["offis_ms"] == 0.3
    assert result["block_matching_ratio"] == 2.6
    assert result["situation_top1"] is None  # not a number
    assert result["ideal"]["distance_accuracy"] == 0.88
    held_out = perception_accuracy.HELD_OUT_SEED
    assert measured["accuracy"].call_args.args[:2] == (20, held_out)
    assert measured["speed"].call_args.args[0] == 30


def test_tables_show_which_targets_are_reached(measured: dict[str, Any]) -> None:
    lines = {" ".join(line.split()) for line in output(*BENCH, "--workers", 1).splitlines()}
    assert "nearest quadrant correct 0.97 0.97 at least 0.95 yes" in lines
    assert "distance term correct 0.88 0.88 at least 0.9 no" in lines
    assert "most probable situation correct - - at least 0.85 not measured" in lines
    assert "near 1 7" in lines  # confusion: columns far, middle, near
    assert measured["speed"].call_args.args == (10_000, 1)


def test_every_reach_is_a_key_of_the_result() -> None:
    assert {reach.key for reach in TARGETS} == {*HEADLINES, "far_for_near"}
    assert Target("a", 0.5, True, "").met(0.5) is True
    assert Target("a", 0.5, False, "").met(0.6) is False
    assert Target("a", 0.5, False, "").met(None) is None


@pytest.mark.slow
def test_the_whole_benchmark(tmp_path: Path) -> None:
    result = answer(*BENCH, "--poses", 12, "--comparisons", 10)
    assert result["offis_max_abs_diff"] <= 1e-6
    assert result["nearest_quadrant_accuracy"] >= 0.5
