"""The topological map: its elements, what is refused, and problems of valid maps."""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from papfis_maps import joined, row

from navfw.errors import MapError, UnknownNameError
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import Passage, Place, TopoMap, load_map
from navfw.topomap.map_check import check_map

Point = tuple[float, float]
coordinates = st.floats(-20.0, 20.0)
points = st.tuples(coordinates, coordinates)


@st.composite
def chains(draw: st.DrawFn) -> TopoMap:
    """A map whose places are distinct and joined one after the other."""
    spots = draw(st.lists(points, min_size=2, max_size=8, unique=True))
    places = [Place(f"p{i}", x, y) for i, (x, y) in enumerate(spots)]
    pairs = [(a, b) for a, b in pairwise(places) if a.distance(b.x, b.y) > 0]
    return TopoMap("chain", places, [joined(a, b) for a, b in pairs])


def closest_by_sampling(topo_map: TopoMap, passage: Passage, x: float, y: float) -> float:
    a, b = topo_map.place(passage.a), topo_map.place(passage.b)
    share = np.linspace(0.0, 1.0, 2001)
    return float(np.min(np.hypot(a.x + share * (b.x - a.x) - x, a.y + share * (b.y - a.y) - y)))


@given(chains(), points)
def test_projections_are_the_nearest_points_of_passages(topo_map: TopoMap, point: Point) -> None:
    footings = topo_map.project_onto_passages(*point, slack=1e9)
    assert len(footings) == len(topo_map.passages)
    assert [f.aside for f in footings] == sorted(f.aside for f in footings)
    for footing in footings:
        sampled = closest_by_sampling(topo_map, footing.passage, *point)
        assert footing.aside <= sampled + 1e-9
        assert sampled - footing.aside <= footing.span / 2000 + 1e-9
        both = footing.to_end(footing.passage.a) + footing.to_end(footing.passage.b)
        assert both == pytest.approx(footing.passage.length)


def test_a_passage_without_extent_has_its_projection_at_its_first_place() -> None:
    stacked = TopoMap("lift", [Place("up", 1, 2), Place("down", 1, 2)], [Passage("up", "down", 3)])
    (footing,) = stacked.project_onto_passages(4.0, 6.0, slack=0.0)
    assert (footing.aside, footing.to_end("up"), footing.to_end("down")) == (5.0, 0.0, 3.0)


@given(chains(), points, st.floats(0.0, 5.0))
def test_projections_keep_slack_and_choice(topo_map: TopoMap, point: Point, slack: float) -> None:
    everything = topo_map.project_onto_passages(*point, slack=1e9)
    near = topo_map.project_onto_passages(*point, slack=slack)
    assert near == [f for f in everything if f.aside <= everything[0].aside + slack]
    assert topo_map.nearest_passage(*point) == near[0]
    last = everything[-1].passage
    for among in ([last], []):
        near = topo_map.project_onto_passages(*point, slack=0.0, among=among)
        assert [projection.passage for projection in near] == among


@given(chains(), points)
def test_nearest_place_is_no_farther_than_any(topo_map: TopoMap, point: Point) -> None:
    distances = [place.distance(*point) for place in topo_map.places.values()]
    assert topo_map.nearest_place(*point).distance(*point) == pytest.approx(min(distances))
    assert np.allclose(topo_map.place_distances(*point), distances)


HALL, DOOR, CELL = Place("hall", 0, 0), Place("door", 3, 0, "door"), Place("cell", 9, 9)


def test_accessors_return_elements_of_the_graph_or_name_the_nearest() -> None:
    passage = joined(HALL, DOOR, width=0.9)
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
    ],
)
def test_violations_are_refused(passage: Passage, message: str) -> None:
    with pytest.raises(MapError, match=message):
        TopoMap("m", [HALL, DOOR], [passage])


def test_duplicates_are_refused() -> None:
    with pytest.raises(MapError, match="a second place 'hall'"):
        TopoMap("m", [HALL, Place("hall", 1, 1)], [])
    with pytest.raises(MapError, match=r"door - hall is the same passage as edges\.0"):
        TopoMap("m", [HALL, DOOR], [joined(HALL, DOOR), joined(DOOR, HALL)])
    with pytest.raises(MapError, match="at least one place"):
        TopoMap("m", [], [])
    # but a length rounded to centimetres is no violation
    corner = Place("corner", 1, 1)
    assert TopoMap("m", [HALL, corner], [Passage("hall", "corner", 1.41)]).passages


ROOT = Path(__file__).parents[2]
A, B, C = Place("a", 0, 0), Place("b", 4, 0), Place("c", 8, 0)


def wall(x: float) -> Callable[[Array], Array]:
    """A wall of zero thickness at x [m], for y above -1 m."""

    def clearances(points: Array) -> Array:
        beside = np.maximum(-1.0 - points[:, 1], 0.0)
        return np.asarray(np.hypot(points[:, 0] - x, beside))

    return clearances


@pytest.mark.parametrize("length", [90.0, 1e4])
def test_an_obstacle_is_found_on_a_passage_of_any_length(length: float) -> None:
    a, b = Place("a", 0.0, 3.0), Place("b", length, 3.0)

    def post(points: Array) -> Array:
        """A post of 0.1 m, 0.15 m beside the passage."""
        return np.asarray(np.hypot(points[:, 0] - 0.7 * length, points[:, 1] - 3.25) - 0.1)

    (problem,) = check_map(TopoMap("m", [a, b], [Passage("a", "b", length)]), post)
    assert problem.kind == "blocked"
    assert "0.15 m of clearance" in problem.message
    inside = check_map(row(a), lambda points: np.full(len(points), -0.1))
    assert "inside an obstacle" in inside[0].message


NARROW = joined(B, C, width=2.0 * RobotModel().radius)
WIDE, FAIR = (row(Place("low", 0, -1.5), Place("down", 4, -1.5), width=w) for w in (1.2, 1.0))
PROBLEMS: Mapping[str, tuple[TopoMap, float | None, set[str]]] = {
    "parts without a passage": (TopoMap("m", [A, B, C], [joined(A, B)]), None, {"apart c"}),
    "a narrow passage and the place behind it": (
        TopoMap("m", [A, B, C], [joined(A, B), NARROW]),
        None,
        {"narrow b - c", "unreachable c"},
    ),
    "places at one point": (row(A, B, Place("twin", 4.01, 0.0)), None, {"duplicate twin"}),
    "a wall across a passage": (row(A, B, C), 2.0, {"blocked a - b"}),
    "a wall near a place": (row(A, B, C), 4.1, {"in-wall b", "blocked a - b", "blocked b - c"}),
    "a curved passage, of unknown way": (TopoMap("m", [A, B], [joined(A, B, 9.0)]), 2.0, set()),
    "a width above the free width": (WIDE, 2.0, {"width low - down"}),
    "the free width": (FAIR, 2.0, set()),
}
"""Maps, the x [m] of a wall if there is one, and the problems."""


@pytest.mark.parametrize("name", PROBLEMS)
def test_problems_are_found_and_no_others(name: str) -> None:
    topo_map, x, expected = PROBLEMS[name]
    problems = check_map(topo_map, None if x is None else wall(x))
    assert {f"{problem.kind} {problem.where}" for problem in problems} == expected


def test_a_width_above_the_free_width_is_told_with_its_place() -> None:
    (problem,) = check_map(WIDE, wall(2.0))
    assert "1.2 m wide in the map, 1.00 m in the world at (1.99, -1.50)" in problem.message


MARGIN = 0.05


def load(name: str) -> tuple[TopoMap, SceneGeometry]:
    world = load_world(ROOT / "worlds" / name / "world.yaml")
    return load_map(ROOT / "maps" / f"{name}.yaml"), SceneGeometry.from_world(world)


@pytest.mark.parametrize("name", ["office", "hospital", "paper-room", "empty"])
def test_the_shipped_maps_have_no_problems_and_passages_as_wide_as_mapped(name: str) -> None:
    topo_map, plan = load(name)
    assert check_map(topo_map, plan.clearances) == []
    assert len(topo_map.parts) == 1
    radius = RobotModel().radius
    assert topo_map.passages
    for passage in topo_map.passages:
        a, b = topo_map.place(passage.a), topo_map.place(passage.b)
        share = np.linspace(0.0, 1.0, 2 + int(passage.length / 0.02))[:, None]
        line = np.array([a.x, a.y]) * (1 - share) + np.array([b.x, b.y]) * share
        free = float(plan.clearances(line).min())
        assert free >= radius + MARGIN, f"{passage}: {free:.2f} m free"
        if math.isfinite(passage.width):
            assert 0.5 * passage.width <= free + 1e-6, f"{passage}: {2 * free:.2f} m wide"


@pytest.mark.parametrize("name", ["office", "hospital", "paper-room"])
def test_doors_are_approached_straight(name: str) -> None:
    """Every door has places before and behind it, in line: robots cross it at a right angle."""
    topo_map, _ = load(name)
    doors = [place for place in topo_map.places.values() if place.kind == "door"]
    assert doors
    for door in doors:
        before, behind = (
            topo_map.place(p.other(door.name)) for p in topo_map.passages_at(door.name)
        )
        assert math.dist((before.x, before.y), (behind.x, behind.y)) == pytest.approx(
            before.distance(door.x, door.y) + behind.distance(door.x, door.y)
        )
        assert before.distance(door.x, door.y) >= 0.75
