from __future__ import annotations

import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.errors import MapError, UnknownNameError
from navfw.topomap import Passage, Place, TopoMap

coordinates = st.floats(-20.0, 20.0)
points = st.tuples(coordinates, coordinates)


def straight(a: Place, b: Place, **values: float) -> Passage:
    return Passage(a.name, b.name, a.distance(b.x, b.y), **values)


@st.composite
def chains(draw: st.DrawFn) -> TopoMap:
    """A map whose places are distinct and joined one after the other."""
    spots = draw(st.lists(points, min_size=2, max_size=8, unique=True))
    places = [Place(f"p{i}", x, y) for i, (x, y) in enumerate(spots)]
    pairs = [(a, b) for a, b in pairwise(places) if a.distance(b.x, b.y) > 0]
    return TopoMap("chain", places, [straight(a, b) for a, b in pairs])


def closest_by_sampling(topo_map: TopoMap, passage: Passage, x: float, y: float) -> float:
    a, b = topo_map.place(passage.a), topo_map.place(passage.b)
    share = np.linspace(0.0, 1.0, 2001)
    return float(np.min(np.hypot(a.x + share * (b.x - a.x) - x, a.y + share * (b.y - a.y) - y)))


@given(chains(), points)
def test_projections_are_the_nearest_points_of_passages(
    topo_map: TopoMap, point: tuple[float, float]
) -> None:
    footings = topo_map.project_onto_passages(*point, slack=1e9)
    assert len(footings) == len(topo_map.passages)
    assert [f.aside for f in footings] == sorted(f.aside for f in footings)
    for footing in footings:
        sampled = closest_by_sampling(topo_map, footing.passage, *point)
        assert footing.aside <= sampled + 1e-9
        assert sampled - footing.aside <= footing.span / 2000 + 1e-9
        both = footing.to_end(footing.passage.a) + footing.to_end(footing.passage.b)
        assert both == pytest.approx(footing.passage.length)


@given(chains(), points, st.floats(0.0, 5.0))
def test_projections_are_within_the_slack_and_the_choice(
    topo_map: TopoMap, point: tuple[float, float], slack: float
) -> None:
    everything = topo_map.project_onto_passages(*point, slack=1e9)
    near = topo_map.project_onto_passages(*point, slack=slack)
    assert near == [f for f in everything if f.aside <= everything[0].aside + slack]
    assert topo_map.nearest_passage(*point) == near[0]
    last = everything[-1].passage
    for among in ([last], []):
        near = topo_map.project_onto_passages(*point, slack=0.0, among=among)
        assert [projection.passage for projection in near] == among


@given(chains(), points)
def test_nearest_place_is_no_farther_than_any(
    topo_map: TopoMap, point: tuple[float, float]
) -> None:
    distances = [place.distance(*point) for place in topo_map.places.values()]
    assert topo_map.nearest_place(*point).distance(*point) == pytest.approx(min(distances))
    assert np.allclose(topo_map.place_distances(*point), distances)


HALL, DOOR, CELL = Place("hall", 0, 0), Place("door", 3, 0, "door"), Place("cell", 9, 9)


def test_accessors_return_the_elements_of_the_graph() -> None:
    passage = straight(HALL, DOOR, width=0.9)
    topo_map = TopoMap("m", [HALL, DOOR, CELL], [passage])
    assert isinstance(topo_map.graph, nx.Graph)
    assert topo_map.graph.nodes["door"]["place"] is DOOR
    assert topo_map.passage("door", "hall") is passage
    assert topo_map.passages_at("hall") == (passage,)
    assert passage.other("hall") == "door"
    assert topo_map.parts == (frozenset({"hall", "door"}), frozenset({"cell"}))
    assert topo_map.part_of("cell") == {"cell"}
    assert topo_map.isolated == {"cell"}
    assert TopoMap("m", [CELL], []).nearest_passage(0.0, 0.0) is None


def test_unknown_names_come_with_the_nearest() -> None:
    topo_map = TopoMap("m", [HALL, DOOR, CELL], [straight(HALL, DOOR)])
    with pytest.raises(UnknownNameError, match="unknown place 'hal': did you mean 'hall'"):
        topo_map.place("hal")
    with pytest.raises(MapError, match=r"no passage between 'hall' and 'cell'.*lead to: door"):
        topo_map.passage("hall", "cell")


@pytest.mark.parametrize(
    ("passage", "message"),
    [
        (Passage("hall", "dor", 3.0), r"0\.to: there is no place 'dor'; did you mean 'door'"),
        (Passage("hall", "hall", 1.0), "connects 'hall' to itself"),
        (Passage("hall", "door", 0.0), r"edges\.0\.length: expected more than 0 m, got 0"),
        (Passage("hall", "door", -2.0), "expected more than 0 m, got -2"),
        (Passage("hall", "door", math.nan), "expected more than 0 m, got nan"),
        (Passage("hall", "door", 2.9), r"2\.9 m is shorter than the straight line .*3\.00 m"),
        (Passage("hall", "door", 3.0, width=0.0), r"edges\.0\.width: expected more than 0 m"),
        (Passage("hall", "door", 3.0, danger=1.5), r"edges\.0\.danger: expected 0 to 1, got 1\.5"),
    ],
)
def test_violations_are_refused(passage: Passage, message: str) -> None:
    with pytest.raises(MapError, match=message):
        TopoMap("m", [HALL, DOOR], [passage])


def test_duplicates_are_refused() -> None:
    with pytest.raises(MapError, match="a second place 'hall'"):
        TopoMap("m", [HALL, Place("hall", 1, 1)], [])
    with pytest.raises(MapError, match=r"door - hall is the same passage as edges\.0"):
        TopoMap("m", [HALL, DOOR], [straight(HALL, DOOR), straight(DOOR, HALL)])
    with pytest.raises(MapError, match="at least one place"):
        TopoMap("m", [], [])
    # but a length rounded to centimetres is no violation
    corner = Place("corner", 1, 1)
    assert TopoMap("m", [HALL, corner], [Passage("hall", "corner", 1.41)]).passages
