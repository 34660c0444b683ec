from __future__ import annotations

import numpy as np

from navfw.bench import bench_planning, large_map


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
