"""Accuracy of flow on rendered pairs, and times of planning on large maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from navfw.bench import (
    MOTIONS,
    all_processors,
    bench_flow,
    bench_planning,
    large_map,
    load_worlds,
    match_template_ratio,
    plot,
    rendered_pairs,
    statistics,
    tables,
)
from navfw.flow import BlockMatching, Ideal
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FramePair
from navfw.sim import check_world

ROBOT = RobotModel()


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    processors = {"block_matching": BlockMatching(ROBOT), "ideal": Ideal(ROBOT)}
    return bench_flow(2, 5, ROBOT, ("corridor",), processors)


def test_ideal_flow_is_without_error(result: dict[str, Any]) -> None:
    ideal = result["processors"]["ideal"]
    assert ideal["epe_p95"] < 1e-9
    assert ideal["coverage"] > 0.9
    assert ideal["within_2_sigma"] == 1.0


def test_block_matching_is_good_and_knows_how_good(result: dict[str, Any]) -> None:
    measured = result["processors"]["block_matching"]
    assert measured["epe_median"] < 0.15
    assert measured["epe_p95"] < 0.8
    assert measured["coverage"] > 0.7
    assert 0.88 < measured["within_2_sigma"] <= 1.0
    assert sum(row["n"] for row in measured["calibration"]) == measured["n"]
    assert sum(part["n"] for part in measured["by_motion"].values()) == measured["n"]
    assert measured["edges"]["n"] + measured["smooth"]["n"] == measured["n"]


def test_the_result_is_plain_data_with_a_table_and_a_plot(
    result: dict[str, Any], tmp_path: Path
) -> None:
    again = json.loads(json.dumps(result))
    assert again["pairs"] == 2 * len(MOTIONS)
    assert again["block_matching_ratio"] > 0.0
    text = "".join(table.markdown() for table in tables(again))
    assert "| block_matching |" in text
    assert all(f"| {motion} |" in text for motion in MOTIONS)
    plot(again, tmp_path / "flow.png")
    assert (tmp_path / "flow.png").stat().st_size > 10_000


def test_every_processor_that_ships_is_measured() -> None:
    measured = {processor.name for processor in all_processors(ROBOT).values()}
    assert measured == set(default_registry().names("flow"))


def test_pairs_repeat_and_motions_are_what_they_are_called() -> None:
    worlds = load_worlds(["corridor"])
    first, second = (list(rendered_pairs(worlds, ROBOT, 1, seed=3)) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.pair.now.image, b.pair.now.image)
        np.testing.assert_array_equal(a.pair.past.image, b.pair.past.image)
        np.testing.assert_array_equal(a.pair.motion.rotation, b.pair.motion.rotation)
    by_name = {pair.name: pair for pair in first}
    assert by_name["8 cm"].motion.translation[2] == pytest.approx(0.08)
    assert np.trace(by_name["turn 8 deg"].motion.rotation) == pytest.approx(
        1 + 2 * np.cos(np.radians(8))
    )
    # the measured turn differs from the true one
    assert not np.allclose(by_name["8 cm"].pair.motion.rotation, np.eye(3), atol=1e-6)


def test_the_corridor_can_be_and_has_obstacles() -> None:
    world = load_worlds(["corridor"])["corridor"]
    check_world(world)
    assert len(world.boxes) + len(world.cylinders) >= 4


def test_statistics_of_known_errors() -> None:
    off = np.array([[0.3, 0.4], [0.0, 0.1], [0.0, -1.0]])
    found = statistics(off, np.array([0.3, 0.1, 0.1]), 6)
    assert found["n"] == 3
    assert found["coverage"] == 0.5
    assert found["epe_median"] == pytest.approx(0.5)
    assert found["over_half_px"] == pytest.approx(1 / 3)
    assert found["within_2_sigma"] == pytest.approx(5 / 6)
    assert statistics(np.zeros((0, 2)), np.zeros(0), 6)["epe_median"] is None


def test_the_reference_loop_finds_the_same_peaks() -> None:
    drawn = next(iter(rendered_pairs(load_worlds(["corridor"]), ROBOT, 1))).pair
    # the loop foresees no rotation
    pair = FramePair(drawn.past, drawn.now, CameraMotion(np.eye(3), np.zeros(3), 0.2))
    matcher = BlockMatching(ROBOT, BlockMatching.Params(subpixel="peak"))
    peaks, flow = matcher.whole_pixel_loop(pair), matcher.compute(pair)
    sure = flow.confidence > 0.3
    assert np.abs(flow.vectors - peaks)[sure].max() <= 0.5
    keys = "match_template_ms block_matching_ms block_matching_peak_ms block_matching_ratio"
    assert set(match_template_ratio(ROBOT, [pair])) == set(keys.split())


# --- planning ---


def test_the_map_is_as_large_as_asked_for_and_in_one_part() -> None:
    topo_map = large_map(900, np.random.default_rng(3))
    assert 850 <= len(topo_map.places) <= 900
    assert len(topo_map.parts) == 1
    again = large_map(900, np.random.default_rng(3))
    assert (again.places, again.passages) == (topo_map.places, topo_map.passages)


def test_plans_are_timed_and_as_cheap_as_those_of_networkx() -> None:
    result = bench_planning(places=400, repeats=3, seed=1)  # compares every cost
    for key in ("costs_ms", "first_plan_ms", "replan_ms", "networkx_ms"):
        assert 0.0 < result[key]["min"] <= result[key]["median"] <= result[key]["max"]
    ratio = result["first_plan_ms"]["median"] / result["networkx_ms"]["median"]
    assert result["first_plan_over_networkx"] == ratio
