from __future__ import annotations

import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import joined, line, office, random_maps

from navfw.errors import MapError, UnknownNameError
from navfw.numerics import Array
from navfw.papfis import (
    CostGraph,
    EdgeCosts,
    Endpoint,
    Router,
    parse_endpoint,
    parse_passage,
    plan_route,
)
from navfw.robot import RobotModel
from navfw.topomap import Place, TopoMap

ROBOT = RobotModel()
coordinates = st.floats(-12.0, 12.0)


@given(random_maps(), coordinates, coordinates, coordinates, coordinates)
def test_a_route_is_connected_and_its_costs_add_up(
    topo_map: TopoMap, x: float, y: float, goal_x: float, goal_y: float
) -> None:
    router = Router(topo_map, ROBOT)
    try:
        route = router.route(Endpoint(x, y), Endpoint(goal_x, goal_y))
    except MapError as error:
        assert "connect" in str(error) or "wide enough" in str(error)
        return
    straight = math.hypot(goal_x - x, goal_y - y)
    assert route.cost >= straight - 1e-6
    assert route.length >= straight - 1e-6
    assert len(route.passages) == max(len(route.places) - 1, 0)
    assert len(route.widths) == len(route.places) + 1
    for passage, a, b in zip(route.passages, route.places, route.places[1:], strict=False):
        assert passage.ends == {a, b}
    total = route.entry_cost + sum(map(router.costs.of, route.passages)) + route.exit_cost
    assert route.cost == pytest.approx(total)
    explained = router.explain(route)
    assert [step["cost"] for step in explained] == [router.costs.of(p) for p in route.passages]


def test_some_danger_is_worth_a_small_detour_only() -> None:
    a, b = Place("a", 0, 0), Place("b", 4, 0)
    for aside, way in ((1.0, ("a", "c", "b")), (9.0, ("a", "b"))):
        c = Place("c", 2, aside)
        topo_map = TopoMap("m", [a, b, c], [joined(a, b, danger=0.5), *line(a, c, b)])
        route = Router(topo_map, ROBOT).route(Endpoint(0, 0, "a"), Endpoint(4, 0, "b"))
        assert route.places == way


def test_between_two_points_beside_one_passage_the_route_is_straight() -> None:
    route = Router(office(), ROBOT).route(Endpoint(10.2, 5.1), Endpoint(12.4, 4.9))
    assert route.places == ()
    assert route.widths == (1.5,)
    assert route.length == pytest.approx(math.hypot(2.2, 0.2))


def test_unconnected_parts_are_named() -> None:
    places = [Place("hall", 0, 0), Place("cell", 4, 0), Place("attic", 30, 0), Place("den", 34, 0)]
    apart = [joined(places[0], places[1]), joined(places[2], places[3])]
    router = Router(TopoMap("m", places, apart, file="maps/m.yaml"), ROBOT)
    with pytest.raises(MapError) as caught:
        router.route(Endpoint(1, 0), Endpoint(34, 0, "den"))
    message = str(caught.value)
    assert message.startswith("maps/m.yaml: ")
    assert "start (1.00, 0.00), in the part with cell, hall (2 places)" in message
    assert "goal 'den' (34.00, 0.00), in the part with attic, den (2 places)" in message
    assert "add an edge" in message


def test_passages_that_are_too_narrow_are_named() -> None:
    a, b = Place("a", 0, 0), Place("b", 4, 0)
    router = Router(TopoMap("m", [a, b], [joined(a, b, width=0.3)]), ROBOT)
    with pytest.raises(MapError, match=r"wide enough .*0\.36 m.* too narrow: a - b \(0\.3 m\)"):
        router.route(Endpoint(0, 0, "a"), Endpoint(4, 0, "b"))


# --- a single plan ------------------------------------------------------------------------------


def test_a_plan_explains_each_passage_and_adds_up() -> None:
    explained = plan_route(office(), "lobby", "lab").explain()
    assert (explained["places"][0], explained["places"][-1]) == ("lobby", "lab")
    travelled = [(p["from"], p["to"]) for p in explained["passages"]]
    assert travelled == list(pairwise(explained["places"]))
    assert all(passage["rules"] for passage in explained["passages"])
    between = sum(p["cost"] for p in explained["passages"])
    total = explained["entry_cost"] + between + explained["exit_cost"]
    assert explained["cost"] == pytest.approx(total)
    assert explained["closed"] == []


def test_avoided_passages_are_not_used() -> None:
    short = plan_route(office(), "lobby", "meeting")
    assert "side-door" in short.route.places
    other = plan_route(office(), "lobby", "meeting", avoid=["side-door:lobby-side"])
    assert "side-door" not in other.route.places
    assert other.route.cost > short.route.cost
    assert other.explain()["closed"] == [["lobby-side", "side-door"]]


def test_without_a_route_the_avoided_passages_are_named() -> None:
    with pytest.raises(MapError, match=r"without closed passages: .*lab-entrance - lab\b"):
        around = ["lab-entrance:lab", "lab:lab-west", "lab:lab-north"]
        plan_route(office(), "lobby", "lab", avoid=around)


def test_stairs_are_avoided_unless_there_is_no_other_route() -> None:
    a, b = Place("a", 0, 0), Place("b", 10, 0)
    stairs, round_ = Place("stairs", 5, 0, "danger"), Place("round", 5, 20)
    near = line(a, stairs, b, danger=1.0)
    both = TopoMap("both", [a, b, stairs, round_], [*near, *line(a, round_, b)])
    assert plan_route(both, "a", "b").route.places == ("a", "round", "b")
    only = TopoMap("only", [a, b, stairs], near)
    plan = plan_route(only, "a", "b")
    assert plan.route.places == ("a", "stairs", "b")
    assert all(passage["avoided"] for passage in plan.explain()["passages"])


def test_points_can_be_start_and_goal() -> None:
    assert parse_endpoint(office(), " 1.5, -2e0") == Endpoint(1.5, -2.0)
    assert parse_endpoint(office(), "lab").place == "lab"
    with pytest.raises(UnknownNameError, match="did you mean 'lab'"):
        parse_endpoint(office(), "lba")


def test_passages_are_named_by_their_ends() -> None:
    lab = parse_passage(office(), "lab:lab-entrance")
    assert lab == parse_passage(office(), "lab-entrance:lab")
    with pytest.raises(MapError, match="PLACE:PLACE"):
        parse_passage(office(), "lab")
    with pytest.raises(UnknownNameError, match="did you mean 'lab-entrance'"):
        parse_passage(office(), "lab:lab-entranc")
    with pytest.raises(MapError, match="no passage between 'lab' and 'lobby'"):
        parse_passage(office(), "lab:lobby")
    colons = TopoMap("m", [Place("a:1", 0, 0), Place("b", 1, 0)], [])
    with pytest.raises(MapError, match="no passage between 'a:1' and 'b'"):
        parse_passage(colons, "a:1:b")


# --- the search for the cheapest path -----------------------------------------------------------


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


def path_cost(topo_map: TopoMap, costs: Array, start: str, end: str) -> float:
    at = topo_map.place(end)
    path = CostGraph(topo_map, costs).cheapest_path({start: 0.0}, {end: 0.0}, (at.x, at.y))
    if path is None:
        return math.inf
    index = {passage.ends: i for i, passage in enumerate(topo_map.passages)}
    assert (path.places[0], path.places[-1]) == (start, end)
    total = sum(costs[index[frozenset(pair)]] for pair in pairwise(path.places))
    assert path.cost == pytest.approx(total)
    return path.cost


@given(random_maps())
def test_the_cost_is_that_of_dijkstra(topo_map: TopoMap) -> None:
    costs = EdgeCosts(topo_map, ROBOT).values
    first, *_, last = topo_map.places
    assert path_cost(topo_map, costs, first, last) == pytest.approx(
        reference(topo_map, costs, first, last)
    )


@given(random_maps(), st.data())
def test_another_passage_never_makes_the_path_costlier(
    topo_map: TopoMap, data: st.DataObject
) -> None:
    costs = EdgeCosts(topo_map, ROBOT).values
    first, *_, last = topo_map.places
    taken = {passage.ends for passage in topo_map.passages}
    places = list(topo_map.places.values())
    free = [(a, b) for a in places for b in places if a.name < b.name]
    free = [(a, b) for a, b in free if frozenset((a.name, b.name)) not in taken]
    if not free:
        return
    extra = joined(*data.draw(st.sampled_from(free)), danger=data.draw(st.floats(0.0, 1.0)))
    richer = TopoMap("richer", places, [*topo_map.passages, extra])
    richer_costs = EdgeCosts(richer, ROBOT).values
    before = path_cost(topo_map, costs, first, last)
    assert path_cost(richer, richer_costs, first, last) <= before + 1e-9


@given(random_maps(), st.data())
def test_several_entries_and_exits_are_searched_together(
    topo_map: TopoMap, data: st.DataObject
) -> None:
    costs = EdgeCosts(topo_map, ROBOT).values
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
    path = CostGraph(topo_map, costs).cheapest_path(entries, exits, aim)
    assert (math.inf if path is None else path.cost) == pytest.approx(expected)


def test_impassable_passages_are_not_used() -> None:
    a, b, c = Place("a", 0.0, 0.0), Place("b", 2.0, 1.0), Place("c", 4.0, 0.0)
    triangle = TopoMap("triangle", [a, b, c], [*line(a, b, c), joined(a, c)])
    open_below = CostGraph(triangle, np.array([5.0, 5.0, math.inf]))
    path = open_below.cheapest_path({"a": 0.0}, {"c": 0.0}, (4.0, 0.0))
    assert path is not None
    assert path.places == ("a", "b", "c")
    closed = CostGraph(triangle, np.array([math.inf, 5.0, math.inf]))
    assert closed.cheapest_path({"a": 0.0}, {"c": 0.0}, (4.0, 0.0)) is None


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, 1.5])
def test_a_detour_beyond_the_goal_is_found_if_it_costs_less(angle: float) -> None:
    c, s = math.cos(angle * math.pi), math.sin(angle * math.pi)
    at = {"start": (0.0, 0.0), "beyond": (10.0, 0.0), "aside": (0.0, 3.0), "end": (4.0, 0.0)}
    start, beyond, aside, end = (
        Place(name, c * x - s * y, s * x + c * y) for name, (x, y) in at.items()
    )
    passages = [*line(start, beyond, end), *line(start, aside, end)]
    topo_map = TopoMap("detour", [start, beyond, aside, end], passages)
    assert path_cost(topo_map, np.array([10.0, 6.0, 9.0, 9.0]), "start", "end") == 16.0
    assert path_cost(topo_map, np.array([10.0, 6.0, 6.0, 9.0]), "start", "end") == 15.0
