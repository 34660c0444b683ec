from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navfw.errors import ConfigError, InputError, MapError
from navfw.topomap import (
    PLACE_KINDS,
    Landmark,
    Passage,
    Place,
    TopoMap,
    load_any_map,
    load_map,
    save_map,
)

MAPS = Path(__file__).parents[2] / "maps"
FORMATS = ["yaml", "graphml", "geojson"]
names = st.text(st.characters(codec="utf-8", exclude_categories=["C"]), min_size=1, max_size=6)
shares = st.floats(0.0, 1.0)
coordinates = st.floats(-1e3, 1e3)


@st.composite
def whole_maps(draw: st.DrawFn) -> TopoMap:
    """Maps with all elements and values."""
    chosen = draw(st.lists(names, min_size=2, max_size=6, unique=True))
    kinds = st.sampled_from(PLACE_KINDS)
    places = [Place(n, draw(coordinates), draw(coordinates), draw(kinds)) for n in chosen]
    pairs = [(a, b) for i, a in enumerate(places) for b in places[:i]]
    widths = st.one_of(st.just(math.inf), st.floats(0.1, 9.0))
    values = st.tuples(widths, shares, shares, shares)
    passages = [
        Passage(a.name, b.name, a.distance(b.x, b.y) + draw(st.floats(0.01, 5.0)), *draw(values))
        for a, b in draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=8, unique=True))
    ]
    marks = [
        Landmark(name, draw(st.sampled_from(["aruco", "poster"])), i, *draw(_poses()))
        for i, name in enumerate(draw(st.lists(names, max_size=3, unique=True)))
    ]
    return TopoMap(draw(names), places, passages, landmarks=marks)


def _poses() -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(
        coordinates, coordinates, st.floats(-6.2, 6.2), st.floats(0, 3), st.floats(0.05, 1)
    )


def assert_refused(path: Path, error: type[InputError], words: list[str]) -> None:
    """Assert that loading ``path`` raises ``error``, and that its message has all ``words``."""
    with pytest.raises(error) as caught:
        load_any_map(path)
    for word in words:
        assert word in str(caught.value)


def content(topo_map: TopoMap) -> tuple[Any, ...]:
    return (
        topo_map.name,
        list(topo_map.places.values()),
        topo_map.passages,
        list(topo_map.landmarks.values()),
    )


@pytest.mark.parametrize("suffix", FORMATS)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(whole_maps())
def test_every_format_preserves_the_map(tmp_path: Path, suffix: str, topo_map: TopoMap) -> None:
    path = tmp_path / f"m.{suffix}"
    save_map(topo_map, path)
    assert content(load_any_map(path)) == content(topo_map)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", ["office", "paper-room", "empty"])
def test_shipped_maps_survive_conversion_through_all_formats(tmp_path: Path, name: str) -> None:
    shipped = load_map(MAPS / f"{name}.yaml")
    topo_map = shipped
    for suffix in ("geojson", "graphml", "yaml", "graphml", "geojson"):
        save_map(topo_map, tmp_path / f"{name}.{suffix}")
        topo_map = load_any_map(tmp_path / f"{name}.{suffix}")
    assert content(topo_map) == content(shipped)


def test_graphml_is_exchanged_with_networkx(tmp_path: Path) -> None:
    office = load_map(MAPS / "office.yaml")
    save_map(office, tmp_path / "a.graphml")
    graph = nx.read_graphml(tmp_path / "a.graphml")
    assert set(graph) == set(office.places)
    assert graph.number_of_edges() == len(office.passages)
    assert graph.nodes["lobby"]["x"] == office.place("lobby").x
    assert graph.edges["lobby", "lobby-west"]["width"] == 1.4
    nx.write_graphml_xml(graph, tmp_path / "b.graphml")
    again = load_any_map(tmp_path / "b.graphml")
    assert dict(again.places) == dict(office.places)
    assert {p.ends for p in again.passages} == {p.ends for p in office.passages}


def feature(kind: str, **properties: Any) -> dict[str, Any]:
    at = properties.pop("at", None)
    geometry = {"type": kind} if at is None else {"type": kind, "coordinates": at}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def nav2_graph() -> dict[str, Any]:
    """A graph as written by Nav2's tools: no names, edges without coordinates, other metadata."""
    return {
        "type": "FeatureCollection",
        "name": "graph",
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}},
        "features": [
            feature("Point", id=0, frame="map", at=[0.0, 0.0]),
            feature("Point", id=1, frame="map", at=[3, 4.0], metadata={"class": "hall"}),
            feature("MultiLineString", id=2, startid=0, endid=1, cost=10.0, overridable=False),
            feature("MultiLineString", id=3, startid=1, endid=0, metadata={"speed_limit": 0.8}),
        ],
    }


def write(folder: Path, data: Any) -> Path:
    path = folder / "graph.geojson"
    path.write_text(data if isinstance(data, str) else json.dumps(data, indent=1))
    return path


def test_a_graph_of_nav2_is_read(tmp_path: Path) -> None:
    topo_map = load_any_map(write(tmp_path, nav2_graph()))
    assert list(topo_map.places) == ["0", "1"]
    assert topo_map.passages == (Passage("0", "1", 5.0),)


def test_geojson_has_what_nav2_requires(tmp_path: Path) -> None:
    office = load_map(MAPS / "office.yaml")
    save_map(office, tmp_path / "office.geojson")
    data = json.loads((tmp_path / "office.geojson").read_text())
    ids = [f["properties"]["id"] for f in data["features"]]
    assert len(set(ids)) == len(ids)
    nodes = {f["properties"]["id"] for f in data["features"] if f["geometry"]["type"] == "Point"}
    edges = [f for f in data["features"] if f["geometry"]["type"] == "MultiLineString"]
    assert len(nodes) + len(edges) == len(ids)
    assert len(edges) == 2 * len(office.passages)
    for edge in edges:
        properties = edge["properties"]
        assert {properties["startid"], properties["endid"]} <= nodes
        assert properties["cost"] > 0.0


@pytest.mark.parametrize(
    ("index", "path", "value", "words"),
    [
        (1, ("properties", "id"), None, ["features[1].properties.id", "missing"]),
        (1, ("properties", "id"), "one", ["features[1].properties.id", "'one'"]),
        (1, ("properties", "id"), 0, ["features[1].properties.id", "second feature with the id 0"]),
        (3, ("properties", "id"), 2, ["features[3].properties.id", "second feature", "nodes and"]),
        (2, ("properties", "startid"), None, ["features[2].properties.startid", "missing"]),
        (2, ("properties", "endid"), 7, ["features[2].properties.endid", "no Point with the id 7"]),
        (1, ("geometry", "coordinates"), [1.0], ["features[1].geometry.coordinates", "[x, y]"]),
        (1, ("geometry", "type"), "Polygon", ["features[1].geometry.type", "'Polygon'"]),
        (2, ("properties", "metadata"), {"length": -1}, ["edges[0].length", "more than 0 m"]),
        (3, ("properties", "endid"), 1, ["leads only from '0' to '1'", "--both-ways"]),
        (0, ("properties", "metadata"), {"kind": "x"}, ["places.0.kind", "known: corner"]),
    ],
)
def test_errors_in_geojson_name_their_line(
    tmp_path: Path, index: int, path: tuple[str, str], value: Any, words: list[str]
) -> None:
    data = nav2_graph()
    data["features"][index][path[0]][path[1]] = value
    file = write(tmp_path, data)
    opening = [n for n, row in enumerate(file.read_text().splitlines(), 1) if row == "  {"]
    one_way = "leads only" in words[0]
    located = [] if one_way else [f"graph.geojson:{opening[index]}: "]
    assert_refused(file, InputError, [*located, *words])


def test_one_way_edges_become_passages_on_request(tmp_path: Path) -> None:
    data = nav2_graph()
    del data["features"][3]
    with pytest.raises(MapError, match="leads only from"):
        load_any_map(write(tmp_path, data))
    assert len(load_any_map(write(tmp_path, data), both_ways=True).passages) == 1
    both = load_any_map(write(tmp_path, nav2_graph()), both_ways=True)
    assert len(both.passages) == 1


GRAPHML = """\
<?xml version="1.0"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
<key id="d0" for="node" attr.name="x" attr.type="double"/>
<key id="d1" for="node" attr.name="y" attr.type="double"/>
<key id="d2" for="edge" attr.name="length" attr.type="double"/>
<graph id="g" edgedefault="undirected">
<node id="a"><data key="d0">0</data><data key="d1">0</data></node>
<node id="b"><data key="d0">2</data><data key="d1">0</data></node>
<edge source="a" target="b"><data key="d2">2</data></edge>
</graph>
</graphml>
"""


@pytest.mark.parametrize(
    ("old", "new", "error", "line", "words"),
    [
        ('id="b"', 'id="a"', MapError, 8, ["second place 'a'", "line 7"]),
        ('target="b"', 'target="c"', MapError, 9, ["edges[0].to", "no place 'c'"]),
        ('target="b"', "", MapError, 9, ["attribute 'target'"]),
        ('<data key="d0">2</data>', "", ConfigError, 8, ["places.b.x", "missing"]),
        ('<data key="d0">2</data>', '<data key="d0">two</data>', MapError, 8, ["x", "'two'"]),
        ('<data key="d2">2</data>', '<data key="d2">0</data>', MapError, 9, ["more than 0 m"]),
        ('"undirected"', '"directed"', MapError, 9, ["leads only", "--both-ways"]),
        ("</graph>\n", "", ConfigError, 10, ["expected GraphML", "not XML", "mismatched tag"]),
        ("<?xml", '<!DOCTYPE g [<!ENTITY e "x">]><!-- ', ConfigError, 1, ["entities are not"]),
        ("<edge", "<hyperedge/><edge", MapError, 9, ["connects two places"]),
    ],
)
def test_errors_in_graphml_name_their_line(
    tmp_path: Path, old: str, new: str, error: type[InputError], line: int, words: list[str]
) -> None:
    assert old in GRAPHML
    path = tmp_path / "g.graphml"
    path.write_text(GRAPHML)
    assert len(load_any_map(path).passages) == 1
    path.write_text(GRAPHML.replace(old, new, 1))
    assert_refused(path, error, [f"g.graphml:{line}: ", *words])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("m.geojson", "{", ["m.geojson:1", "not valid JSON"]),
        ("m.geojson", '{"type": "Feature"}', ["type", "FeatureCollection"]),
        ("m.geojson", '{"type": "FeatureCollection"}', ["features", "list"]),
        ("m.geojson", '{"type": "FeatureCollection", "features": []}', ["at least one place"]),
        ("m.geojson", '{"a": NaN}', ["NaN is not a number"]),
        ("m.geojson", "[" * 100_000, ["not valid JSON"]),
        ("m.graphml", "<a/>", ["there is no <graph>"]),
        ("m.txt", "", [".graphml", "m.txt"]),
        ("none.geojson", None, ["none.geojson", "no such file"]),
    ],
)
def test_files_that_are_not_maps_are_errors(
    tmp_path: Path, name: str, text: str | None, words: list[str]
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    assert_refused(tmp_path / name, InputError, words)
