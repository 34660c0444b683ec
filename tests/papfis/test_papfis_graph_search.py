from __future__ import annotations

import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import joined, random_maps

from navfw.numerics import Array
from navfw.papfis import CostGraph, EdgeCosts
from navfw.robot import RobotModel
from navfw.topomap import Place, TopoMap


def reference(topo_map: TopoMap, costs: Array, start: str, end: str) -> float:
    """By networkx; inf where there is no path."""
    graph = nx.Graph()
    graph.add_nodes_from(topo_map.places)
    for passage, cost in zip(topo_map.passages, costs, strict=True):
        if math.isfinite(cost):
            graph.add_edge(passage.a, passage.b, weight=cost)
    try:
        return float(nx.dijkstra_path_length(graph, start, end))
    except nx.NetworkXNoPath:
        return math.inf


def found_cost(topo_map: TopoMap, costs: Array, start: str, end: str) -> float:
    at = topo_map.place(end)
    found = CostGraph(topo_map, costs).cheapest_path({start: 0.0}, {end: 0.0}, (at.x, at.y))
    if found is None:
        return math.inf
    index = {passage.ends: i for i, passage in enumerate(topo_map.passages)}
    assert (found.places[0], found.places[-1]) == (start, end)
    total = sum(costs[index[frozenset(pair)]] for pair in pairwise(found.places))
    assert found.cost == pytest.approx(total)
    return found.cost


@given(random_maps())
def test_the_cost_is_that_of_dijkstra(topo_map: TopoMap) -> None:
    costs = EdgeCosts(topo_map, RobotModel()).values
    first, *_, last = topo_map.places
    assert found_cost(topo_map, costs, first, last) == pytest.approx(
        reference(topo_map, costs, first, last)
    )


@given(random_maps(), st.data())
def test_another_passage_never_makes_the_path_costlier(
    topo_map: TopoMap, data: st.DataObject
) -> None:
    costs = EdgeCosts(topo_map, RobotModel()).values
    first, *_, last = topo_map.places
    taken = {passage.ends for passage in topo_map.passages}
    places = list(topo_map.places.values())
    free = [(a, b) for a in places for b in places if a.name < b.name]
    free = [(a, b) for a, b in free if frozenset((a.name, b.name)) not in taken]
    if not free:
        return
    extra = joined(*data.draw(st.sampled_from(free)), danger=data.draw(st.floats(0.0, 1.0)))
    richer = TopoMap("richer", places, [*topo_map.passages, extra])
    richer_costs = EdgeCosts(richer, RobotModel()).values
    before = found_cost(topo_map, costs, first, last)
    assert found_cost(richer, richer_costs, first, last) <= before + 1e-9


@given(random_maps(), st.data())
def test_several_entries_and_exits_are_searched_together(
    topo_map: TopoMap, data: st.DataObject
) -> None:
    costs = EdgeCosts(topo_map, RobotModel()).values
    names = st.lists(st.sampled_from(list(topo_map.places)), min_size=1, max_size=3, unique=True)
    aim = (0.0, 0.0)
    entries = {name: data.draw(st.floats(0.0, 9.0)) for name in data.draw(names)}
    exits = {
        name: topo_map.place(name).distance(*aim) * data.draw(st.floats(1.0, 3.0))
        for name in data.draw(names)
    }
    expected = min(
        entries[a] + reference(topo_map, costs, a, b) + exits[b] for a in entries for b in exits
    )
    found = CostGraph(topo_map, costs).cheapest_path(entries, exits, aim)
    assert (math.inf if found is None else found.cost) == pytest.approx(expected)


def test_impassable_passages_are_not_used() -> None:
    a, b, c = Place("a", 0.0, 0.0), Place("b", 2.0, 1.0), Place("c", 4.0, 0.0)
    triangle = TopoMap("triangle", [a, b, c], [joined(a, b), joined(b, c), joined(a, c)])
    open_below = CostGraph(triangle, np.array([5.0, 5.0, math.inf]))
    found = open_below.cheapest_path({"a": 0.0}, {"c": 0.0}, (4.0, 0.0))
    assert found is not None
    assert found.places == ("a", "b", "c")
    closed = CostGraph(triangle, np.array([math.inf, 5.0, math.inf]))
    assert closed.cheapest_path({"a": 0.0}, {"c": 0.0}, (4.0, 0.0)) is None


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, 1.5])
def test_a_detour_beyond_the_goal_is_found_if_it_costs_less(angle: float) -> None:
    c, s = math.cos(angle * math.pi), math.sin(angle * math.pi)
    at = {"start": (0.0, 0.0), "beyond": (10.0, 0.0), "aside": (0.0, 3.0), "end": (4.0, 0.0)}
    start, beyond, aside, end = (
        Place(name, c * x - s * y, s * x + c * y) for name, (x, y) in at.items()
    )
    passages = [
        joined(start, beyond),
        joined(beyond, end),
        joined(start, aside),
        joined(aside, end),
    ]
    topo_map = TopoMap("detour", [start, beyond, aside, end], passages)
    assert found_cost(topo_map, np.array([10.0, 6.0, 9.0, 9.0]), "start", "end") == 16.0
    assert found_cost(topo_map, np.array([10.0, 6.0, 6.0, 9.0]), "start", "end") == 15.0
