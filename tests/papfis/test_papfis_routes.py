from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import joined, line, office, random_maps

from navfw.errors import MapError
from navfw.papfis import Endpoint, Router
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


def test_high_danger_is_avoided_unless_there_is_no_other_route() -> None:
    a, b, c = Place("a", 0, 0), Place("b", 4, 0), Place("c", 2, 40)
    stairs = joined(a, b, danger=0.9)
    around = TopoMap("around", [a, b, c], [stairs, joined(a, c), joined(c, b)])
    assert Router(around, ROBOT).route(Endpoint(0, 0, "a"), Endpoint(4, 0, "b")).places == (
        "a",
        "c",
        "b",
    )
    only = TopoMap("only", [a, b], [stairs])
    assert Router(only, ROBOT).route(Endpoint(0, 0, "a"), Endpoint(4, 0, "b")).places == ("a", "b")


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


def test_lobby_to_lab_goes_through_two_doors_and_the_corridor() -> None:
    route = Router(office(), ROBOT).route(Endpoint(1.2, 1.2), Endpoint(14.2, 7.8, "lab"))
    assert [p for p in route.places if p.endswith("-door")] == ["lobby-door", "lab-door"]
    assert route.places[-1] == "lab"
    assert 17.0 < route.length < 21.0


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
