from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import invoke

from navfw.bench import (
    TARGETS,
    Target,
    TruePair,
    TrueSet,
    flow_accuracy,
    flow_comparison,
    perception_accuracy,
    perception_benchmark,
    recorded_approach,
    true_pairs,
)
from navfw.flow import Farneback
from navfw.interfaces import FlowProcessor
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame, FramePair

HEADLINES = (
    "offis_ms",
    "offis_skfuzzy_ratio",
    "offis_max_abs_diff",
    "block_matching_ratio",
    "nearest_quadrant_accuracy",
    "distance_accuracy",
    "situation_contains_truth",
    "situation_top1",
    "ttc_median_rel_error",
)
SCORES = {
    "nearest_quadrant_accuracy": 0.97,
    "distance_accuracy": 0.88,
    "far_for_near": 0.0,
    "situation_contains_truth": 0.96,
    "situation_top1": float("nan"),
    "confusion": {"distance": {"near": {"near": 7, "middle": 1}, "far": {"far": 3}}},
}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Every part replaced by a stub; the arguments each was called with."""
    arguments: dict[str, Any] = {}

    def run_speed(comparisons: int, repeats: int, workers: int) -> dict[str, Any]:
        arguments["speed"] = comparisons, workers
        return {
            "offis_ms": 0.3,
            "offis_skfuzzy_ratio": 900.0,
            "offis_max_abs_diff": 1e-15,
            "comparisons": comparisons,
        }

    def run_flow(places: int, seed: int, report: object) -> dict[str, Any]:
        arguments["flow"] = places, seed
        worlds, motions = ("empty",), {"2 cm": true_pairs.MOTIONS["2 cm"]}
        monkeypatch.setattr(flow_accuracy, "MOTIONS", motions)
        errors = flow_accuracy.statistics(np.ones((4, 2)), np.full(4, 2.0), 8)
        part = {**errors, "ms": 1.0, "by_motion": {"2 cm": errors}, "calibration": []}
        return {
            "pairs": 1,
            "worlds": list(worlds),
            "motions": list(motions),
            "trusted_from": 0.3,
            "processors": {"dis": part},
            "block_matching_ratio": 2.6,
        }

    def run_accuracy(poses: int, seed: int, workers: int, progress: object) -> dict[str, Any]:
        arguments["accuracy"] = poses, seed, workers
        return {"poses": poses, "seed": seed, **SCORES, "ideal": dict(SCORES)}

    def run_approach(folder: Path) -> dict[str, Any]:
        arguments["approach"] = folder
        row = {"from_s": 0.0, "to_s": 5.0, "n": 9, "median_rel_error": 0.02, "raw_median": 0.1}
        return {"ttc_median_rel_error": 0.02, "by_time": [row]}

    monkeypatch.setattr(perception_benchmark, "time_perception", run_speed)
    monkeypatch.setattr(flow_accuracy, "bench_flow", run_flow)
    monkeypatch.setattr(perception_accuracy, "run", run_accuracy)
    monkeypatch.setattr(recorded_approach, "bench_approach", run_approach)
    return arguments


def bench(*arguments: str) -> Any:
    return invoke("bench", "perception", *arguments)


def test_json_has_the_headlines_first(measured: dict[str, Any]) -> None:
    done = bench("--poses", "20", "--comparisons", "30", "--places", "2", "--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert tuple(key for key in result if key in HEADLINES) == HEADLINES
    assert result["offis_ms"] == 0.3
    assert result["block_matching_ratio"] == 2.6
    assert result["ttc_median_rel_error"] is None
    assert result["situation_top1"] is None  # not a number
    assert result["ideal"]["distance_accuracy"] == 0.88
    held_out = perception_accuracy.HELD_OUT_SEED
    assert measured["accuracy"][:2] == (20, held_out)
    assert measured["flow"] == (2, held_out)
    assert measured["speed"][0] == 30


def test_tables_show_which_targets_are_reached(measured: dict[str, Any]) -> None:
    done = bench("--workers", "1")
    assert done.exit_code == 0, done.output
    lines = {" ".join(line.split()) for line in done.stdout.splitlines()}
    assert "nearest quadrant correct 0.97 0.97 at least 0.95 yes" in lines
    assert "distance term correct 0.88 0.88 at least 0.9 no" in lines
    assert "most probable situation correct - - at least 0.85 not measured" in lines
    assert "near 1 7" in lines  # confusion: columns far, middle, near
    assert measured["speed"] == (10_000, 1)


def test_data_and_page(measured: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "data" / "approach").mkdir(parents=True)
    out = tmp_path / "page"
    done = bench("--data", str(tmp_path / "data"), "--out", str(out), "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["ttc_median_rel_error"] == 0.02
    assert measured["approach"] == tmp_path / "data" / "approach"
    assert {path.name for path in out.iterdir()} == {"index.md", "result.json", "flow.png"}
    page = (out / "index.md").read_text()
    assert "| 0 to 5 | 9 | 2.0 % | 10.0 % |" in page
    assert "| nearest quadrant correct | 0.97 | 0.97 | at least 0.95 | yes |" in page
    assert "![error and time of the processors](flow.png)" in page


def test_the_page_compares_flow_on_the_recorded_office(
    measured: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def one_processor(robot: RobotModel) -> dict[str, FlowProcessor]:
        return {"farneback": Farneback(robot)}

    def one_pair(folder: Path, only: str) -> list[TrueSet]:
        assert (folder, only) == (tmp_path, "tum_fr1")
        wall = np.full((120, 160), 2.0, np.float32)
        grey = np.random.default_rng(0).integers(0, 255, wall.shape, np.uint8)
        still = CameraMotion(np.eye(3), np.zeros(3), 0.1)
        pair = FramePair(Frame(0.0, grey), Frame(0.1, grey), still)
        return [TrueSet("tum_fr1", RobotModel(), [TruePair("tum", "", pair, still, wall, wall)])]

    monkeypatch.setattr(flow_comparison, "_every_processor", one_processor)
    monkeypatch.setattr(flow_comparison, "recorded_sets", one_pair)
    (tmp_path / "tum_fr1").mkdir()
    done = bench("--data", str(tmp_path), "--out", str(tmp_path / "page"))
    assert done.exit_code == 0, done.output
    page = (tmp_path / "page" / "index.md").read_text()
    assert "## tum_fr1: 1 pairs of 160 x 120 px" in page
    assert re.search(r"\| farneback \| [\d.]+ \| \d+ % \| 0.000 \|", page)


def test_bad_input(tmp_path: Path) -> None:
    done = bench("--data", str(tmp_path))
    assert done.exit_code == 2
    assert "--data: holds neither approach nor tum_fr1" in done.stderr
    (tmp_path / "thesis.txt").write_text("work")
    done = bench("--out", str(tmp_path))
    assert done.exit_code == 2
    assert "contains 'thesis.txt'" in done.stderr


def test_every_reach_is_a_key_of_the_result() -> None:
    assert {reach.key for reach in TARGETS} == {*HEADLINES, "far_for_near"}
    assert Target("a", 0.5, True, "").met(0.5) is True
    assert Target("a", 0.5, False, "").met(0.6) is False
    assert Target("a", 0.5, False, "").met(None) is None


@pytest.mark.slow
def test_the_whole_benchmark(tmp_path: Path) -> None:
    done = bench("--poses", "12", "--comparisons", "10", "--places", "1", "--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["offis_max_abs_diff"] <= 1e-6
    assert result["nearest_quadrant_accuracy"] >= 0.5
