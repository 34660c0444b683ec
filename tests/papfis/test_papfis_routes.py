"""Routes: the places that lead on from a point, a single plan, and the search for the cheapest."""

import math
from dataclasses import replace
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import joined, line, office, random_maps, row

from navfw.errors import MapError, UnknownNameError
from navfw.numerics import Array
from navfw.papfis.edge_costs import EdgeCosts
from navfw.papfis.route_plan import parse_endpoint, parse_passage, plan_route
from navfw.papfis.routes import CostGraph, Endpoint, Router
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.topomap import Place, TopoMap

ROBOT = RobotModel()
coordinates = st.floats(-12.0, 12.0)


def narrow_pair() -> Router:
    """Two places whose passage is too narrow for the robot."""
    return Router(row(Place("a", 0, 0), Place("b", 4, 0), width=0.3), ROBOT)


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


def test_of_a_large_part_five_places_are_named() -> None:
    near = [Place(f"p{k}", 2.0 * k, 0) for k in range(7)]
    far = Place("x", 90, 0), Place("y", 94, 0)
    router = Router(TopoMap("m", [*near, *far], [*line(*near), joined(*far)]), ROBOT)
    with pytest.raises(MapError, match=r"the part with p0, p1, p2, p3, p4, \S+ \(7 places\)"):
        router.route(Endpoint(0, 0, "p0"), Endpoint(90, 0, "x"))


@pytest.mark.parametrize("aside", [0.5, 3.0])
def test_a_metre_off_the_passages_costs_two(aside: float) -> None:
    a, b = Place("a", 0, 0), Place("b", 8, 0)
    router = Router(TopoMap("m", [a, b], [joined(a, b)]), ROBOT)
    on, off = (router.route(Endpoint(4, y), Endpoint(8, 0, "b")).cost for y in (0.0, aside))
    assert off - on == pytest.approx(2.0 * aside)


def test_passages_that_are_too_narrow_are_named() -> None:
    with pytest.raises(MapError, match=r"wide enough .*0\.36 m.* too narrow: a - b \(0\.3 m\)"):
        narrow_pair().route(Endpoint(0, 0, "a"), Endpoint(4, 0, "b"))


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
def test_another_passage_makes_no_path_costlier(topo_map: TopoMap, data: st.DataObject) -> None:
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
def test_entries_and_exits_are_searched_together(topo_map: TopoMap, data: st.DataObject) -> None:
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


# --- the places that lead on from a point ---------------------------------------------------------

OFFICE = Router(office(), ROBOT)


def leads_to(router: Router, x: float, y: float, place: str | None = None) -> set[str]:
    return set(router.access(Endpoint(x, y, place)).costs)


@given(random_maps(), coordinates, coordinates)
def test_access_costs_the_straight_distance_at_least(topo_map: TopoMap, x: float, y: float) -> None:
    access = Router(topo_map, ROBOT).access(Endpoint(x, y))
    assert access.costs
    for place, cost in access.costs.items():
        assert cost >= topo_map.place(place).distance(x, y) - 1e-9


@pytest.mark.parametrize(
    ("x", "y", "rooms"),
    [
        (7.6, 6.3, "office-b"),  # the corridor is nearer, behind the wall
        (13.7, 6.3, "lab"),  # beside the lab's door, inside
        (3.9, 3.8, "lobby"),
        (12.5, 8.9, "lab"),  # beside the door to the kitchen
        (4.4, 5.4, "corridor"),
        (4.6, 1.3, "lobby"),  # the side door leads on from here: within its passage
    ],
)
def test_a_point_has_access_within_its_room_only(x: float, y: float, rooms: str) -> None:
    places = leads_to(OFFICE, x, y) - {"side-door"}
    assert places
    assert all(place.startswith(rooms) for place in places), places


@pytest.mark.parametrize("frame", [Pose(-9.0, 4.0, 0.0), Pose(30.0, -20.0, 2.0)])
def test_access_is_the_same_wherever_the_maps_origin_is(frame: Pose) -> None:
    places = []
    for place in office().places.values():
        x, y = frame.to_parent(place.x, place.y)
        places.append(replace(place, x=x, y=y))
    moved = Router(TopoMap("moved", places, office().passages), ROBOT)
    rng = np.random.default_rng(0)
    for x, y in rng.uniform((0.3, 0.3), (15.7, 9.7), (150, 2)).tolist():
        expected = OFFICE.access(Endpoint(x, y)).costs
        costs = moved.access(Endpoint(*frame.to_parent(x, y))).costs
        assert costs == pytest.approx(expected, abs=1e-6), (x, y)


def test_within_a_passage_both_ends_are_reachable_even_through_a_door() -> None:
    assert leads_to(OFFICE, 3.3, 4.6) == {"corridor-lobby", "lobby-door"}
    assert {"lobby-door", "lobby-entrance"} <= leads_to(OFFICE, 3.2, 4.15)


def test_beside_a_passage_its_door_is_not_reachable() -> None:
    door = Place("door", 2, 0, "door")
    router = Router(row(Place("hall", 0, 0), door, Place("cell", 4, 0), width=0.9), ROBOT)
    assert leads_to(router, 1.7, 1.2) == {"hall"}
    assert leads_to(router, 2.3, 1.2) == {"cell"}
    assert leads_to(router, 1.7, 0.4) == {"hall", "door"}


@pytest.mark.parametrize("frame", [Pose(0.0, 0.0, 0.0), Pose(3.0, -5.0, 2.0)])
@pytest.mark.parametrize("y", [1.0, 3.9, -3.9, 4.2, -4.2])
def test_the_wall_of_a_door_hides_what_is_beyond_it(y: float, frame: Pose) -> None:
    """Up to 3.5 m from the door, which the line from (1.7, 4.03) to the cell crosses."""
    at = [frame.to_parent(x, 0.0) for x in (0.0, 2.0, 4.0)]
    hall, door, cell = Place("hall", *at[0]), Place("door", *at[1], "door"), Place("cell", *at[2])
    passages = line(hall, door, cell, width=0.9) + line(hall, cell, width=0.9)
    router = Router(TopoMap("m", [hall, door, cell], passages), ROBOT)
    assert ("cell" in leads_to(router, *frame.to_parent(1.7, y))) is (abs(y) > 4.03)


def test_a_known_place_restricts_the_choice() -> None:
    assert leads_to(OFFICE, 14.2, 7.8, "lab") == {"lab"}
    assert leads_to(OFFICE, 14.4, 8.4, "lab") <= {"lab", "lab-north", "lab-west", "lab-entrance"}


def test_a_place_without_passages_is_reached_straight() -> None:
    router = Router(TopoMap("m", [Place("only", 1, 1)], []), ROBOT)
    access = router.access(Endpoint(4, 5))
    assert list(access.costs) == ["only"]
    assert access.distance == pytest.approx(5.0)


def test_in_a_closed_passage_only_the_nearer_end_is_reachable() -> None:
    assert leads_to(narrow_pair(), 1.0, 0.0) == {"a"}
    assert leads_to(narrow_pair(), 3.0, 0.0) == {"b"}


def test_a_given_part_excludes_the_others() -> None:
    a, b, c, d = (Place(n, x, 0) for n, x in zip("abcd", (0, 2, 2.2, 4.2), strict=True))
    router = Router(TopoMap("m", [a, b, c, d], [joined(a, b), joined(c, d)]), ROBOT)
    near = Endpoint(2.2, 0.1)
    assert set(router.access(near).costs) == {"c", "d"}
    assert set(router.access(near, frozenset("ab")).costs) == {"a", "b"}


def test_an_infinite_width_hides_nothing() -> None:
    access = Router(row(Place("a", 0, 0), Place("b", 4, 0)), ROBOT).access(Endpoint(1, 3))
    assert set(access.costs) == {"a", "b"}
    passage = access.passage_to("a")
    assert passage is not None
    assert passage.width == math.inf
