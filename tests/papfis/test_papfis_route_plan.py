from __future__ import annotations

from itertools import pairwise

import pytest
from papfis_maps import joined, office

from navfw.errors import MapError, UnknownNameError
from navfw.papfis import Endpoint, parse_endpoint, parse_passage, plan_route
from navfw.topomap import Place, TopoMap


def test_a_plan_explains_each_passage_and_adds_up() -> None:
    explained = plan_route(office(), "lobby", "lab").explain()
    assert (explained["places"][0], explained["places"][-1]) == ("lobby", "lab")
    travelled = [(p["from"], p["to"]) for p in explained["passages"]]
    assert travelled == list(pairwise(explained["places"]))
    assert all(passage["rules"] for passage in explained["passages"])
    parts = (
        explained["entry_cost"]
        + sum(p["cost"] for p in explained["passages"])
        + explained["exit_cost"]
    )
    assert explained["cost"] == pytest.approx(parts)
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
        plan_route(
            office(), "lobby", "lab", avoid=["lab-entrance:lab", "lab:lab-west", "lab:lab-north"]
        )


def test_stairs_are_avoided_unless_there_is_no_other_route() -> None:
    a, b = Place("a", 0, 0), Place("b", 10, 0)
    stairs, round_ = Place("stairs", 5, 0, "danger"), Place("round", 5, 20)
    near = [joined(a, stairs, danger=1.0), joined(stairs, b, danger=1.0)]
    far = [joined(a, round_), joined(round_, b)]
    both = TopoMap("both", [a, b, stairs, round_], near + far)
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
