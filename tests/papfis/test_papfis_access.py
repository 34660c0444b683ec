from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import joined, line, office, random_maps

from navfw.papfis import Endpoint, Router
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.topomap import Passage, Place, TopoMap

ROBOT = RobotModel()
OFFICE = Router(office(), ROBOT)
coordinates = st.floats(-12.0, 12.0)


def leads_to(router: Router, x: float, y: float, place: str | None = None) -> set[str]:
    return set(router.access(Endpoint(x, y, place)).costs)


@given(random_maps(), coordinates, coordinates)
def test_access_never_costs_less_than_the_straight_distance(
    topo_map: TopoMap, x: float, y: float
) -> None:
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
    hall, door, cell = Place("hall", 0, 0), Place("door", 2, 0, "door"), Place("cell", 4, 0)
    router = Router(TopoMap("m", [hall, door, cell], line(hall, door, cell, width=0.9)), ROBOT)
    assert leads_to(router, 1.7, 1.2) == {"hall"}
    assert leads_to(router, 2.3, 1.2) == {"cell"}
    assert leads_to(router, 1.7, 0.4) == {"hall", "door"}


def test_a_known_place_restricts_the_choice() -> None:
    assert leads_to(OFFICE, 14.2, 7.8, "lab") == {"lab"}
    assert leads_to(OFFICE, 14.4, 8.4, "lab") <= {"lab", "lab-north", "lab-west", "lab-entrance"}


def test_a_place_without_passages_is_reached_straight() -> None:
    router = Router(TopoMap("m", [Place("only", 1, 1)], []), ROBOT)
    access = router.access(Endpoint(4, 5))
    assert list(access.costs) == ["only"]
    assert access.distance == pytest.approx(5.0)


def test_in_a_closed_passage_only_the_nearer_end_is_reachable() -> None:
    a, b = Place("a", 0, 0), Place("b", 4, 0)
    router = Router(TopoMap("m", [a, b], [joined(a, b, width=0.3)]), ROBOT)
    assert leads_to(router, 1.0, 0.0) == {"a"}
    assert leads_to(router, 3.0, 0.0) == {"b"}


def test_a_given_part_excludes_the_others() -> None:
    a, b, c, d = (Place(n, x, 0) for n, x in zip("abcd", (0, 2, 2.2, 4.2), strict=True))
    router = Router(TopoMap("m", [a, b, c, d], [joined(a, b), joined(c, d)]), ROBOT)
    near = Endpoint(2.2, 0.1)
    assert set(router.access(near).costs) == {"c", "d"}
    assert set(router.access(near, frozenset("ab")).costs) == {"a", "b"}


def test_an_infinite_width_hides_nothing() -> None:
    a, b = Place("a", 0, 0), Place("b", 4, 0)
    access = Router(TopoMap("m", [a, b], [Passage("a", "b", 4.0)]), ROBOT).access(Endpoint(1, 3))
    assert set(access.costs) == {"a", "b"}
    passage = access.passage_to("a")
    assert passage is not None
    assert passage.width == math.inf
