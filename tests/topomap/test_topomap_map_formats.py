"""Map files of all formats: written, read again, and refused with line and key."""

import json
import math
from pathlib import Path
from typing import Any

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navfw.config.document import parse_yaml
from navfw.errors import ConfigError, InputError, MapError
from navfw.topomap import PLACE_KINDS, Landmark, Passage, Place, TopoMap, load_map
from navfw.topomap.map_formats import load_any_map, save_map
from navfw.topomap.mapfile import map_text, read_map

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


def feature(kind: str, *at: float, **properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": at} if at else {"type": kind}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def nav2_graph() -> dict[str, Any]:
    """A graph as written by Nav2's tools: no names, edges without coordinates, other metadata."""
    return {
        "type": "FeatureCollection",
        "name": "graph",
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}},
        "features": [
            feature("Point", 0.0, 0.0, id=0, frame="map"),
            feature("Point", 3, 4.0, id=1, frame="map", metadata={"class": "hall"}),
            feature("MultiLineString", id=2, startid=0, endid=1, cost=10.0, overridable=False),
            feature("MultiLineString", id=3, startid=1, endid=0, metadata={"speed_limit": 0.8}),
        ],
    }


def write(path: Path, data: Any) -> Path:
    path.write_text(data if isinstance(data, str) else json.dumps(data, indent=1))
    return path


def test_a_graph_of_nav2_is_read(tmp_path: Path) -> None:
    topo_map = load_any_map(write(tmp_path / "graph.geojson", nav2_graph()))
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
        (1, ("properties",), 5, ["features[1].properties.id", "missing"]),
        (1, ("properties", "id"), "one", ["features[1].properties.id", "'one'"]),
        (1, ("properties", "id"), 0, ["features[1].properties.id", "second node with the id 0"]),
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
    tmp_path: Path, index: int, path: tuple[str, ...], value: Any, words: list[str]
) -> None:
    data = nav2_graph()
    part = data["features"][index]
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    file = write(tmp_path / "graph.geojson", data)
    opening = [n for n, row in enumerate(file.read_text().splitlines(), 1) if row == "  {"]
    one_way = "leads only" in words[0]
    located = [] if one_way else [f"graph.geojson:{opening[index]}: "]
    assert_refused(file, InputError, [*located, *words])


def test_one_way_edges_become_passages_on_request(tmp_path: Path) -> None:
    data = nav2_graph()
    path = write(tmp_path / "graph.geojson", data)
    assert len(load_any_map(path, both_ways=True).passages) == 1
    del data["features"][3]
    write(path, data)
    with pytest.raises(MapError, match="leads only from"):
        load_any_map(path)
    assert len(load_any_map(path, both_ways=True).passages) == 1


def test_an_edge_that_is_listed_twice_is_the_shorter_one(tmp_path: Path) -> None:
    data = nav2_graph()
    again = feature("MultiLineString", id=2, startid=0, endid=1, metadata={"length": 6.0})
    data["features"].insert(2, again)  # with the id of another edge, too, as in Nav2's own graphs
    path = write(tmp_path / "graph.geojson", data)
    assert load_any_map(path).passages == (Passage("0", "1", 6.0),)
    (assumption,) = load_any_map(path).assumed
    assert "line 56 lists the same ends again" in str(assumption)
    del data["features"][4]
    write(path, data)
    assert_refused(path, MapError, ["leads only from '0' to '1'"])


def test_both_directions_have_one_length_and_a_frame_may_be_geographic(tmp_path: Path) -> None:
    data = nav2_graph()
    for edge, length in zip(data["features"][2:], (7.0, 9.0), strict=True):
        edge["properties"]["metadata"] = {"length": length}
    topo_map = load_any_map(write(tmp_path / "graph.geojson", data))
    assert topo_map.passages == (Passage("0", "1", 7.0),)
    assert [one.what for one in topo_map.assumed] == ["repeated edges"]
    data = located_graph([[13.73, 51.05], [13.7301, 51.05]], None)
    for place in data["features"][:2]:
        place["properties"]["frame"] = "wgs84"
    topo_map = load_any_map(write(tmp_path / "g.geojson", data))
    assert topo_map.passages[0].length == pytest.approx(7.0123, abs=1e-3)


def test_an_edge_of_one_place_is_left_out_and_an_unknown_end_is_named(tmp_path: Path) -> None:
    data = nav2_graph()
    data["features"].append(feature("LineString", id=9, startid=1, endid=1))
    topo_map = load_any_map(write(tmp_path / "graph.geojson", data))
    assert len(topo_map.passages) == 1
    assert "edges of one place: left out" in str(topo_map.assumed[0])
    unknown = TMAP.replace("node: WayPoint2}", "node: WayPoint3}", 1)
    words = ["farm.tmap2:7: edges[0].to: there is no place 'WayPoint3'"]
    assert_refused(write(tmp_path / "farm.tmap2", unknown), MapError, words)
    assert_refused(write(tmp_path / "a.tmap2", "nodes: []"), MapError, ["expected nodes"])


@pytest.mark.parametrize("ids", [("0", "1"), (0.0, 1.0)])
def test_ids_as_other_tools_write_them(tmp_path: Path, ids: tuple[Any, Any]) -> None:
    data = nav2_graph()
    for place, name in zip(data["features"][:2], ids, strict=True):
        del place["properties"]["id"]
        place["id"] = name
    for edge, ends in ((2, ids), (3, ids[::-1])):
        data["features"][edge]["properties"].update(startid=ends[0], endid=ends[1])
    assert list(load_any_map(write(tmp_path / "g.geojson", data)).places) == ["0", "1"]


def test_the_length_of_a_bent_line_is_that_of_the_passage(tmp_path: Path) -> None:
    data = nav2_graph()
    data["features"][2]["geometry"]["coordinates"] = [[[0, 0], [3, 0], [3, 4]]]
    topo_map = load_any_map(write(tmp_path / "graph.geojson", data))
    assert topo_map.passages == (Passage("0", "1", 7.0),)


def located_graph(ends: list[list[float]], crs: str | None) -> dict[str, Any]:
    """Two places at ``ends``, as QGIS exports them."""
    data = nav2_graph()
    del data["crs"]
    if crs is not None:
        data["crs"] = {"type": "name", "properties": {"name": crs}}
    for place, at in zip(data["features"][:2], ends, strict=True):
        place["geometry"]["coordinates"] = at
        del place["properties"]["frame"]
    return data


MERCATOR = [[1_528_416.611, 6_630_318.985], [1_528_427.743, 6_630_318.985]]
"""13.73 E and 0.0001 degrees east of it, at 51.05 N: of the ellipsoid 7.0123 m."""


@pytest.mark.parametrize(
    ("ends", "crs", "length", "said"),
    [
        (
            [[13.73, 51.05], [13.7301, 51.05]],
            "urn:ogc:def:crs:OGC:1.3:CRS84",
            7.0123,
            "its crs says degrees",
        ),
        ([[13.73, 51.05], [13.7301, 51.05]], None, 7.0123, "degrees by their size"),
        ([[13.73, 51.05], [13.73, 51.0501]], "urn:ogc:def:crs:EPSG::4326", 11.1249, "latitude 51"),
        (MERCATOR, "urn:ogc:def:crs:EPSG::3857", 7.0, "stretches lengths there by 1.591"),
        ([[411_000.0, 5_656_000.0], [411_003.0, 5_656_004.0]], "EPSG:32633", 5.0, "x 411000"),
        ([[411_000.0, 5_656_000.0], [411_003.0, 5_656_004.0]], None, 5.0, "far from its origin"),
        ([[-20.0, 3.0], [-17.0, 7.0]], "urn:ogc:def:crs:EPSG::3857", 5.0, None),
        ([[0.0, 0.0], [0.6, 0.0]], None, 0.6, None),
    ],
)
def test_coordinates_of_the_earth_become_metres(
    tmp_path: Path, ends: list[list[float]], crs: str | None, length: float, said: str | None
) -> None:
    topo_map = load_any_map(write(tmp_path / "g.geojson", located_graph(ends, crs)))
    tolerance = 0.02 if ends is MERCATOR else 1e-3
    assert topo_map.passages[0].length == pytest.approx(length, abs=tolerance)
    assert max(abs(place.x) for place in topo_map.places.values()) < 30.0
    assert [str(said) in str(one) for one in topo_map.assumed] == [True] * (said is not None)


def test_a_frame_that_is_named_is_metric_unless_the_crs_is_of_degrees(tmp_path: Path) -> None:
    for crs, length in ((None, 1e-4), ("urn:ogc:def:crs:OGC:1.3:CRS84", 7.0123)):
        data = located_graph([[13.73, 51.05], [13.7301, 51.05]], crs)
        for place in data["features"][:2]:
            place["properties"]["frame"] = "map"
        topo_map = load_any_map(write(tmp_path / "g.geojson", data))
        assert topo_map.passages[0].length == pytest.approx(length, abs=1e-3 * length)


def test_a_floor_plan_is_no_map(tmp_path: Path) -> None:
    plan = "image: plan.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"
    words = ["plan.yaml: is a floor plan of map_server: navfw world import"]
    assert_refused(write(tmp_path / "plan.yaml", plan), MapError, words)


@pytest.mark.parametrize("ends", [[[2.0, 3.0], [5.0, 7.0]], [[200.0, 3.0], [200.1, 3.0]]])
def test_a_crs_of_degrees_with_metres_is_refused(tmp_path: Path, ends: list[list[float]]) -> None:
    path = write(tmp_path / "g.geojson", located_graph(ends, "urn:ogc:def:crs:OGC:1.3:CRS84"))
    assert_refused(path, MapError, ["g.geojson:", "crs", "if they are metres, remove the crs"])


OSMNX = """\
<?xml version='1.0' encoding='utf-8'?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
<key id="d5" for="edge" attr.name="length" attr.type="string"/>
<key id="d4" for="node" attr.name="street_count" attr.type="string"/>
<key id="d3" for="node" attr.name="x" attr.type="string"/>
<key id="d2" for="node" attr.name="y" attr.type="string"/>
<key id="d1" for="graph" attr.name="crs" attr.type="string"/>
<graph edgedefault="directed">
<data key="d1">epsg:4326</data>
<edge source="26" target="27" id="0"><data key="d5">105.03</data></edge>
<edge source="27" target="26" id="0"><data key="d5">105.03</data></edge>
<edge source="27" target="26" id="1"><data key="d5">95.5</data></edge>
<edge source="27" target="28" id="0"><data key="d5">29.69</data></edge>
<edge source="28" target="27" id="0"><data key="d5">29.69</data></edge>
<node id="26"><data key="d2">53.4538295</data><data key="d3">141.9744235</data></node>
<node id="27"><data key="d2">53.4538961</data><data key="d3">141.9758529</data></node>
<node id="28"><data key="d2">53.4538961</data><data key="d3">141.9763013</data></node>
</graph></graphml>
"""


def test_graphs_of_osmnx_have_numbers_as_text_and_degrees(tmp_path: Path) -> None:
    topo_map = load_any_map(write(tmp_path / "streets.graphml", OSMNX))
    first, second = topo_map.passages
    assert first.length == 95.5  # the shorter of two
    place = topo_map.places["27"]
    assert (place.x, place.y) == pytest.approx((95.0, 7.41), abs=0.05)
    assert second.length == pytest.approx(29.8, abs=0.02)  # osmnx' sphere is a little smaller
    assert [one.what for one in topo_map.assumed] == ["coordinates", "repeated edges"]
    write(tmp_path / "streets.graphml", OSMNX.replace(">29.69<", ">['29', '30']<", 1))
    words = ["streets.graphml:13: length", "expected a number"]
    assert_refused(tmp_path / "streets.graphml", MapError, words)


TMAP = """\
meta: {last_updated: 2022-03-02_10-07-31}
name: farm
nodes:
- meta: {map: map_2d, node: WayPoint1, pointset: farm}
  node:
    edges:
    - {action: NavigateToPose, config: &id001 [], edge_id: WayPoint1_WayPoint2, node: WayPoint2}
    name: WayPoint1
    pose:
      orientation: {w: 1.0, x: 0.0, y: 0.0, z: 0.0}
      position: {x: 0.0, y: 0.0, z: 0.0}
    restrictions_planning: 'True'
- meta: {map: map_2d, node: WayPoint2, pointset: farm}
  node:
    edges:
    - {action: NavigateToPose, config: *id001, edge_id: WayPoint2_WayPoint1, node: WayPoint1}
    name: WayPoint2
    pose: {position: {x: 3.0, y: 4.0, z: 0.0}}
    verts: [{x: 0.69, y: 0.28}]
transformation: {rotation: {w: 1.0, x: 0.0, y: 0.0, z: 0.0}, translation: {x: 0.0, y: 0.0, z: 0.0}}
"""


@pytest.mark.parametrize("name", ["farm.tmap2", "farm.yaml"])
def test_maps_of_topological_navigation_are_read(tmp_path: Path, name: str) -> None:
    topo_map = load_any_map(write(tmp_path / name, TMAP))
    assert topo_map.name == "farm"
    assert topo_map.passages == (Passage("WayPoint1", "WayPoint2", 5.0),)
    nodes = TMAP[TMAP.index("- meta") : TMAP.index("transformation")]
    older = load_any_map(write(tmp_path / "older.yaml", nodes))
    assert older.passages == topo_map.passages
    assert older.name == "farm"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "node: WayPoint1}\n    name",
            "node: Way}\n    name",
            ["farm.tmap2:16: ", "no place 'Way'"],
        ),
        ("edge_id: WayPoint1_WayPoint2, node: WayPoint2", "edge_id: a", ["7: ", "the key node"]),
        ("position: {x: 3.0", "at: {x: 3.0", ["farm.tmap2:14: nodes[1].node", "name and pose"]),
        ("x: 3.0, y: 4.0", "y: 4.0", ["places.WayPoint2.x", "missing"]),
        ("translation: {x: 0.0", "translation: {x: 2.0", ["farm.tmap2:20: ", "parent frame"]),
    ],
)
def test_errors_in_a_tmap_name_their_line(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    assert old in TMAP
    assert_refused(write(tmp_path / "farm.tmap2", TMAP.replace(old, new, 1)), InputError, words)


GRAPHML = """\
<?xml version="1.0"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
<key id="d0" for="node" attr.name="x" attr.type="double"/>
<key id="d1" for="node" attr.name="y" attr.type="double"/>
<key id="d2" for="edge" attr.name="length" attr.type="double"/>
<graph id="d0" edgedefault="undirected">
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
        ("<edge", "<hyperedge/><edge", MapError, 9, ["connects two places"]),
    ],
)
def test_errors_in_graphml_name_their_line(
    tmp_path: Path, old: str, new: str, error: type[InputError], line: int, words: list[str]
) -> None:
    assert old in GRAPHML
    path = write(tmp_path / "g.graphml", GRAPHML)
    assert len(load_any_map(path).passages) == 1
    write(path, GRAPHML.replace(old, new, 1))
    assert_refused(path, error, [f"g.graphml:{line}: ", *words])


def test_defaults_of_graphml_hold_where_a_value_is_left_out(tmp_path: Path) -> None:
    text = GRAPHML.replace(
        'attr.name="length" attr.type="double"/>',
        'attr.name="width" attr.type="double"><default>0.9</default></key>',
    )
    more = '<node id="c"><data key="d0">2</data><data key="d1">4</data></node>'
    more += '<edge source="b" target="c"/></graph>'
    topo_map = load_any_map(write(tmp_path / "g.graphml", text.replace("</graph>", more, 1)))
    assert [passage.width for passage in topo_map.passages] == [2.0, 0.9]


def test_a_crs_in_feet_is_refused(tmp_path: Path) -> None:
    crs = "+proj=lcc +units=us-ft"
    path = write(tmp_path / "g.geojson", located_graph([[980_000, 2e5], [980_300, 2.004e5]], crs))
    assert_refused(path, MapError, ["crs: the crs is in feet: convert"])


ONE_PLACE = (
    '"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"id": 1},'
    ' "geometry": {"type": "Point", "coordinates": [0, 0]}}]'
)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("m.geojson", "{", ["m.geojson:1", "not valid JSON"]),
        ("m.geojson", '{"type": "Feature"}', ["type", "FeatureCollection"]),
        ("m.geojson", '{"type": "GeometryCollection", "features": []}', ["FeatureCollection"]),
        ("m.geojson", '{"type": "FeatureCollection"}', ["features", "list"]),
        ("m.geojson", '{"type": "FeatureCollection", "features": []}', ["at least one place"]),
        ("m.geojson", '{"a": NaN}', ["NaN is not a number"]),
        ("m.geojson", "[" * 100_000, ["nested too deeply"]),
        ("m.geojson", f'{{\n"floor_plan": 1, {ONE_PLACE}}}', ["m.geojson:2: floor_plan"]),
        ("m.graphml", "<a/>", ["there is no <graph>"]),
        ("m.txt", "", [".graphml", "m.txt"]),
        ("none.geojson", None, ["none.geojson", "no such file"]),
    ],
)
def test_files_that_are_not_maps_are_errors(
    tmp_path: Path, name: str, text: str | None, words: list[str]
) -> None:
    if text is not None:
        write(tmp_path / name, text)
    assert_refused(tmp_path / name, InputError, words)


texts = st.one_of(
    st.sampled_from(
        ["yes", "null", "1e5", "0x1f", "2001-01-01", "a: b", "- x", "#", "~", "é", "="]
    ),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), min_size=1, max_size=8),
)
GOOD = """\
name: flat
places:
  hall: {x: 0, y: 0}
  door: {x: 3, y: 0, kind: door}
  stairs: {x: 3, y: 4, kind: danger}
edges:
  - {from: hall, to: door, width: 0.9}
  - {from: door, to: stairs, length: 5, uncertainty: 0.5, doorness: 0.2}
landmarks:
  sign: {kind: aruco, id: 7, x: 0.1, y: 2, z: 0.6, yaw: 1.57, size: 0.2}
  notice: {kind: poster, id: 7, x: 3, y: 1, yaw: -3.14}
"""


SECOND_ID = ["landmarks.notice.id", "second aruco-7", "'sign' has that id", "first is in line 10"]


def test_values_left_out_get_defaults(tmp_path: Path) -> None:
    topo_map = load_map(write(tmp_path / "flat.yaml", GOOD))
    assert topo_map.name == "flat"
    assert topo_map.place("hall").kind == "room"
    first, second = topo_map.passages
    assert (first.length, first.width, first.doorness, first.danger) == (3.0, 0.9, 1.0, 0.0)
    assert (second.length, second.width, second.doorness, second.danger) == (5, math.inf, 0.2, 1.0)
    assert second.uncertainty == 0.5
    sign, notice = topo_map.landmarks.values()
    assert sign == Landmark("sign", "aruco", 7, 0.1, 2.0, 1.57, 0.6, 0.2)
    assert (notice.identity, notice.z, notice.size) == ("poster-7", 0.5, 0.25)
    assert topo_map.landmarks_by_identity["aruco-7"] is sign


@pytest.mark.parametrize(
    ("old", "new", "error", "line", "words"),
    [
        ("to: door,", "to: dor,", MapError, 7, ["edges[0].to", "'dor'", "did you mean 'door'"]),
        ("length: 5", "length: 0", MapError, 8, ["edges[1].length", "more than 0 m", "leave it"]),
        ("length: 5", "length: -1", MapError, 8, ["edges[1].length", "got -1"]),
        ("length: 5", "length: 3.5", MapError, 8, ["shorter than the straight line", "4.00 m"]),
        ("width: 0.9", "width: 0", MapError, 7, ["edges[0].width", "more than 0 m"]),
        ("to: stairs", "to: hall", MapError, 8, ["same passage as", "the first is in line 7"]),
        ("to: stairs", "to: door", MapError, 8, ["itself"]),
        ("kind: danger", "kind: dnger", ConfigError, 5, ["places.stairs.kind", "'danger'"]),
        ("length: 5", "lenght: 5", ConfigError, 8, ["lenght", "did you mean 'length'"]),
        ("from: hall", "form: hall", ConfigError, 7, ["form", "did you mean 'from'"]),
        ("x: 0, ", "", ConfigError, 3, ["places.hall.x", "missing"]),
        ("x: 0, ", "x: wide, ", ConfigError, 3, ["places.hall.x", "number", "wide"]),
        ("x: 0, ", "x: .nan, ", ConfigError, 3, ["places.hall.x"]),
        ("  stairs:", "  hall:", ConfigError, 5, ["duplicate key"]),
        ("kind: poster", "kind: aruco", MapError, 11, SECOND_ID),
        ("kind: poster", "kind: postr", ConfigError, 11, ["landmarks.notice.kind", "'poster'"]),
        ("yaw: -3.14", "yw: -3.14", ConfigError, 11, ["yw", "did you mean 'yaw'"]),
        ("  notice:", "  sign:", ConfigError, 11, ["duplicate key"]),
        ("size: 0.2", "size: 0", ConfigError, 10, ["landmarks.sign.size", "0"]),
        ("size: 0.2", "size: 10.1", ConfigError, 10, ["landmarks.sign.size", "10"]),
        ("id: 7, x: 3", "id: -1, x: 3", ConfigError, 11, ["landmarks.notice.id", "-1"]),
        ("uncertainty: 0.5", "danger: 2", ConfigError, 8, ["edges[1].danger", "2"]),
    ],
)
def test_errors_name_file_line_and_key(
    tmp_path: Path, old: str, new: str, error: type[InputError], line: int, words: list[str]
) -> None:
    assert old in GOOD
    path = write(tmp_path / "flat.yaml", GOOD.replace(old, new, 1))
    assert_refused(path, error, [f"flat.yaml:{line}: ", *words])


def test_landmarks_may_be_10_m_large_and_100_m_high(tmp_path: Path) -> None:
    text = GOOD.replace("z: 0.6", "z: 100").replace("size: 0.2", "size: 10")
    sign = load_map(write(tmp_path / "flat.yaml", text)).landmarks["sign"]
    assert (sign.z, sign.size) == (100.0, 10.0)


def test_one_message_lists_all_errors(tmp_path: Path) -> None:
    text = GOOD.replace("to: door", "to: dor").replace("length: 5", "length: 0")
    with pytest.raises(MapError) as caught:
        load_map(write(tmp_path / "flat.yaml", text))
    lines = str(caught.value).splitlines()
    assert "2 errors" in lines[0]
    assert "flat.yaml:7: edges[0].to" in lines[1]
    assert "flat.yaml:8: edges[1].length" in lines[2]


def test_unconnected_parts_are_no_error_and_a_map_without_places_is(tmp_path: Path) -> None:
    apart = GOOD.replace("  - {from: hall, to: door, width: 0.9}\n", "")
    assert len(load_map(write(tmp_path / "flat.yaml", apart)).parts) == 2
    with pytest.raises(MapError, match="places: expected at least one place"):
        load_map(write(tmp_path / "flat.yaml", "name: none\nplaces: {}\n"))


@given(texts, st.floats(1e-6, 1e6), shares, st.floats(-6.2, 6.2))
def test_names_and_numbers_are_kept(name: str, length: float, share: float, yaw: float) -> None:
    places = [Place(name, 0.0, 0.0), Place(name + "2", 0.0, 1e-7, "danger")]
    passage = Passage(name, name + "2", length, danger=share)
    mark = Landmark(name, "poster", 3, length, -length, yaw)
    first = TopoMap(name, places, [passage], landmarks=[mark])
    again = read_map(parse_yaml(map_text(first), "m.yaml"))
    assert content(again) == (name, places, (passage,), [mark])
