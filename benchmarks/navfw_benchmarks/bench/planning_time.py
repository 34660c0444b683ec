"""Computing time of planning on a large map, compared with A* of networkx on the same costs."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from statistics import median
from typing import Any, TypeVar

import networkx as nx
import numpy as np

from navfw.papfis.routes import Endpoint, Route, Router
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import RobotModel
from navfw.topomap import Passage, Place, TopoMap

SPACING = 4.0
"""Distance [m] of neighbouring places before their random displacement."""

MIN_DISTANCE = 0.5
"""Least straight distance from start to goal, as a share of the map's diagonal."""

Result = TypeVar("Result")


def bench_planning(
    places: int = 10_000, repeats: int = 20, seed: int = 0, report: ProgressCallback = silent
) -> dict[str, Any]:
    """Plan ``repeats`` long routes through a generated map, and again with a passage closed.

    The cost of every route is checked against networkx, which looks its weights up as attributes.
    Times [ms] are given as median, least and largest. ``costs_ms``: inference of the costs of all
    passages, once for each map and robot; ``first_plan_ms``: the first route; ``replan_ms``: the
    route from the place before the middle passage after that passage is closed;
    ``networkx_ms``: ``networkx.astar_path``. ``report`` is called with each route.

    Raises:
        AssertionError: a route is more expensive than that of networkx.

    """
    rng = np.random.default_rng(seed)
    topo_map = large_map(places, rng)
    robot = RobotModel()
    Router(large_map(100, np.random.default_rng(seed)), robot)  # compile kernels before timing
    times: dict[str, list[float]] = {
        key: [] for key in ("costs_ms", "first_plan_ms", "replan_ms", "networkx_ms")
    }
    for start, goal in with_progress(_far_pairs(topo_map, repeats, rng), "routes", report):
        spent, router = _timed(lambda: Router(topo_map, robot))
        times["costs_ms"].append(spent)
        graph = _priced(topo_map, router)
        spent, route = _timed(lambda: router.route(start, goal))  # noqa: B023 - called at once
        times["first_plan_ms"].append(spent)
        spent, path = _timed(lambda: _reference(topo_map, graph, start, goal))  # noqa: B023
        times["networkx_ms"].append(spent)
        _check(graph, route, path)
        times["replan_ms"].append(_replan(topo_map, router, route, graph))
    summary = {
        key: {"median": median(spans), "min": min(spans), "max": max(spans)}
        for key, spans in times.items()
    }
    reference = summary["networkx_ms"]["median"]
    return {
        "places": len(topo_map.places),
        "passages": len(topo_map.passages),
        "repeats": repeats,
        "seed": seed,
        **summary,
        "first_plan_over_networkx": summary["first_plan_ms"]["median"] / reference,
        "replan_over_networkx": summary["replan_ms"]["median"] / reference,
    }


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """The times of each step, and the ratio of the medians to that of networkx."""
    steps = {
        "all costs, when loading": "costs",
        "first plan": "first_plan",
        "new plan after a closure": "replan",
        "networkx.astar_path": "networkx",
    }
    times = [
        {"step": step, "ratio": result.get(f"{key}_over_networkx"), **result[f"{key}_ms"]}
        for step, key in steps.items()
    ]
    columns = [
        Column("", "step"),
        Column("median", "median", ".1f"),
        Column("least", "min", ".1f"),
        Column("most", "max", ".1f"),
        Column("over networkx", "ratio", ".2f"),
    ]
    size = f"{result['places']} places, {result['passages']} passages"
    yield ResultTable(f"{size}, {result['repeats']} routes [ms]", columns, times)


def large_map(places: int, rng: np.random.Generator) -> TopoMap:
    """A connected map of about ``places`` places: a distorted grid without some of its passages.

    Widths, danger, doors and uncertainty of the passages are random.
    """
    side = max(round(math.sqrt(places)), 2)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    points = SPACING * grid + rng.uniform(-1.5, 1.5, (side * side, 2))
    doors = rng.random(side * side) < 0.15
    every = [
        Place(f"p{i}", float(x), float(y), "door" if doors[i] else "room")
        for i, (x, y) in enumerate(points)
    ]
    index = np.arange(side * side).reshape(side, side)
    pairs = [
        *zip(index[:, :-1].ravel().tolist(), index[:, 1:].ravel().tolist(), strict=True),
        *zip(index[:-1].ravel().tolist(), index[1:].ravel().tolist(), strict=True),
    ]
    passages = [
        Passage(
            f"p{i}",
            f"p{j}",
            length=every[i].distance(every[j].x, every[j].y) * float(rng.uniform(1.001, 1.3)),
            width=float(rng.uniform(0.5, 3.0)),
            danger=float(rng.random() < 0.03),
            doorness=float(doors[i] or doors[j]),
            uncertainty=float(rng.uniform(0.0, 0.5)),
        )
        for i, j in pairs
        if rng.random() < 0.85
    ]
    whole = TopoMap("generated", every, passages)
    kept = whole.parts[0]
    return TopoMap(
        "generated",
        [place for place in every if place.name in kept],
        [passage for passage in passages if passage.a in kept],
    )


def _far_pairs(
    topo_map: TopoMap, count: int, rng: np.random.Generator
) -> Sequence[tuple[Endpoint, Endpoint]]:
    every = list(topo_map.places.values())
    xs, ys = [place.x for place in every], [place.y for place in every]
    least = MIN_DISTANCE * math.hypot(max(xs) - min(xs), max(ys) - min(ys))
    pairs: list[tuple[Endpoint, Endpoint]] = []
    while len(pairs) < count:
        a, b = (every[int(i)] for i in rng.integers(len(every), size=2))
        if a.distance(b.x, b.y) >= least:
            pairs.append((Endpoint(a.x, a.y, a.name), Endpoint(b.x, b.y, b.name)))
    return pairs


def _priced(topo_map: TopoMap, router: Router) -> nx.Graph:
    graph = nx.Graph()
    graph.add_nodes_from(topo_map.graph)
    for passage in topo_map.passages:
        if math.isfinite(cost := router.costs.of(passage)):
            graph.add_edge(passage.a, passage.b, cost=cost)
    return graph


def _reference(topo_map: TopoMap, graph: nx.Graph, start: Endpoint, goal: Endpoint) -> list[str]:
    places = topo_map.places

    def straight(a: str, b: str) -> float:
        return math.hypot(places[a].x - places[b].x, places[a].y - places[b].y)

    path: list[str] = nx.astar_path(graph, start.place, goal.place, straight, weight="cost")
    return path


def _replan(topo_map: TopoMap, router: Router, route: Route, graph: nx.Graph) -> float:
    """Time [ms] to close the middle passage of the route and to plan another route."""
    middle = len(route.passages) // 2
    closed, place = route.passages[middle], topo_map.places[route.places[middle]]
    now = Endpoint(place.x, place.y, place.name)

    def plan() -> Route:
        router.close(closed)
        return router.route(now, route.goal)

    spent, other = _timed(plan)
    graph.remove_edge(closed.a, closed.b)
    _check(graph, other, _reference(topo_map, graph, now, route.goal))
    return spent


def _check(graph: nx.Graph, route: Route, path: Sequence[str]) -> None:
    ours, theirs = (
        sum(graph.edges[pair]["cost"] for pair in pairwise(names)) for names in (route.places, path)
    )
    if not math.isclose(ours, theirs, rel_tol=1e-9):
        raise AssertionError(f"the route costs {ours}, that of networkx {theirs}")


def _timed(call: Callable[[], Result]) -> tuple[float, Result]:
    begin = time.perf_counter()
    result = call()
    return 1e3 * (time.perf_counter() - begin), result
