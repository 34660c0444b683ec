"""The GeoJSON of Nav2's route server: places as Points, edges as MultiLineStrings.

A FeatureCollection in which every feature has a unique number, ``properties.id``. A Point is a
node; its name and kind are in ``properties.metadata``. An edge is directed, from the node
``properties.startid`` to ``properties.endid``, so each passage is two edges; its other values are
in ``metadata`` too. ``cost`` is its length. Landmarks, which Nav2 lacks, are a member ``landmarks``
of the collection: as features Nav2 would read them as nodes. ``floor_plan`` is another member.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from navfw.config.input_file import parse_json
from navfw.errors import MapError, locating
from navfw.topomap.georeference import LocalFrame, local_frame
from navfw.topomap.mapfile import EDGE_KEYS, MapImporter, map_data
from navfw.topomap.topological_map import TopoMap

_EDGES = ("MultiLineString", "LineString")
_DEGREES = re.compile(r"\bwgs[-_ ]?84\b", re.IGNORECASE)
"""Matches the name of a frame of longitude and latitude."""
_VALUE = re.compile(r"[^\s,]")
"""The first character of an item of a list."""


def geojson_text(topo_map: TopoMap, plan_file: str | None = None) -> str:
    """Write the map as GeoJSON text, one line per feature; its floor plan is in ``plan_file``."""
    ids = {name: number for number, name in enumerate(topo_map.places)}
    features: list[dict[str, Any]] = [
        _feature(
            "Point",
            [place.x, place.y],
            id=ids[place.name],
            frame="map",
            metadata={"name": place.name, "kind": place.kind},
        )
        for place in topo_map.places.values()
    ]
    for passage in topo_map.passages:
        values = {key: getattr(passage, key) for key in EDGE_KEYS}
        for ends in ((passage.a, passage.b), (passage.b, passage.a)):
            line = [[topo_map.places[name].x, topo_map.places[name].y] for name in ends]
            edge = _feature(
                "MultiLineString",
                [line],
                id=len(features),
                startid=ids[ends[0]],
                endid=ids[ends[1]],
                cost=passage.length,
                overridable=True,
                metadata={key: value for key, value in values.items() if math.isfinite(value)},
            )
            features.append(edge)
    head = [f'"name": {json.dumps(topo_map.name)},']
    if topo_map.landmarks:
        head.append(f'"landmarks": {json.dumps(map_data(topo_map)["landmarks"])},')
    if plan_file is not None:
        head.append(f'"floor_plan": {json.dumps(plan_file)},')
    lines = ",\n".join(json.dumps(feature) for feature in features)
    return '{"type": "FeatureCollection",\n' + "\n".join(head) + f'\n"features": [\n{lines}\n]}}\n'


def _feature(kind: str, coordinates: list[Any], **properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


@dataclass(frozen=True, slots=True)
class _Feature:
    """A feature of ``file``: its index, its content, and the line at which it begins."""

    file: str
    line: int
    index: int
    data: Any

    def error(self, key: str, message: str) -> MapError:
        key = f"features[{self.index}].{key}"
        return MapError(message, file=self.file, line=self.line, key=key)

    def part(self, *path: str) -> dict[str, Any]:
        """Return the object at a path of keys; empty where there is none."""
        data = self.data
        for key in path:
            data = data.get(key) if isinstance(data, dict) else None
        return data if isinstance(data, dict) else {}

    @property
    def kind(self) -> str:
        """The type of its geometry; MapError if it is neither a Point nor an edge."""
        kind = self.part("geometry").get("type")
        if kind not in ("Point", *_EDGES):
            what = f"expected Point (a place) or MultiLineString (an edge), got {kind!r:.40}"
            raise self.error("geometry.type", what)
        return str(kind)

    def number(self, key: str) -> int:
        """Return the id at ``key`` of the properties; MapError if it is no integer from 0 on.

        Without ``properties.id`` it is the feature's own; tools write integers as 1.0 or "1", too.
        """
        value = self.part("properties").get(key)
        value = self.data.get(key) if value is None else value
        if isinstance(value, int | float | str) and re.fullmatch(r"\d{1,18}(\.0)?", str(value)):
            return int(float(value))
        got = "it is missing" if value is None else f"got {value!r:.40}"
        raise self.error(f"properties.{key}", f"expected the id, an integer: {got}")

    @property
    def metadata(self) -> dict[str, Any]:
        return self.part("properties", "metadata")

    @property
    def name(self) -> str:
        """The name of a place; its number where it has none."""
        name = self.metadata.get("name")
        return name if isinstance(name, str) and name else str(self.number("id"))

    @property
    def point(self) -> tuple[float, float]:
        """The coordinates of a Point, as they are in the file."""
        at = self.part("geometry").get("coordinates")
        numbers = at[:2] if isinstance(at, list) else []
        if len(numbers) < 2 or not all(type(number) in (int, float) for number in numbers):
            raise self.error("geometry.coordinates", f"expected [x, y] [m], got {at!r:.40}")
        return numbers[0], numbers[1]

    def bends(self, frame: LocalFrame) -> float:
        """Return the length [m] of the line of an edge with more than two points; NaN of others."""
        parts: Any = self.part("geometry").get("coordinates")
        parts = [parts] if self.kind == "LineString" else parts
        try:
            points = [frame(point[0], point[1]) for part in parts for point in part]
        except (TypeError, LookupError):
            return math.nan
        return sum(map(math.dist, points, points[1:])) if len(points) > 2 else math.nan


def read_geojson(text: str, file: str, both_ways: bool) -> TopoMap:
    """Read the map in the GeoJSON ``text`` of ``file``, which errors name.

    A node without a name gets its number as name, an edge without a length that of its line.
    With ``both_ways`` a one-way edge becomes a passage.

    Raises:
        ConfigError: it is not JSON, or a value is out of bounds.
        MapError: it is not a FeatureCollection, a feature lacks a property, the id of a node is
            duplicate or unknown, an edge is one-way, or the map is invalid.

    """
    data = parse_json(text, file)
    if not isinstance(data, dict) or data.get("type") != "FeatureCollection":
        raise MapError("expected a FeatureCollection", file=file, line=1, key="type")
    if not isinstance(data.get("features"), list):
        raise MapError("expected a list of features", file=file, line=1, key="features")
    lines = _lines_of_features(text)
    features = [
        _Feature(file, next(lines, 1), index, feature)
        for index, feature in enumerate(data["features"])
    ]
    nodes = [feature for feature in features if feature.kind == "Point"]
    # what names a frame, as Nav2's and navfw's nodes do, is in metres
    frames = {str(f) for node in nodes if (f := node.part("properties").get("frame")) is not None}
    crs = json.dumps(data.get("crs", "")) + " CRS84" * bool(_DEGREES.search(" ".join(frames)))
    points = [node.point for node in nodes]
    with locating(file=file, line=_line_of(text, "crs"), key="crs"):
        frame = local_frame(points, crs, metric=bool(frames))
    importer, places = MapImporter(file, both_ways, frame), dict[int, _Feature]()
    for node in nodes:
        number = node.number("id")
        if number in places:
            what = f"a second node with the id {number} (the first is in line "
            what += f"{places[number].line}); give each its own"
            raise node.error("properties.id", what)
        places[number] = node
        x, y = frame(*node.point)
        values = {"x": x, "y": y, "kind": node.metadata.get("kind")}
        importer.add_place(node.name, values, node.line, f"features[{node.index}]")
    for edge in features:
        if edge.kind != "Point":
            start, end = (_end_of(edge, key, places) for key in ("startid", "endid"))
            straight, bent = math.dist(frame(*start.point), frame(*end.point)), edge.bends(frame)
            longer: dict[str, Any] = {"length": bent} if bent > straight else {}
            values = {**longer, **edge.metadata}
            importer.add_edge(start.name, end.name, values, edge.line, directed=True)
    if isinstance(landmarks := data.get("landmarks"), dict):
        importer.add_landmarks(landmarks, _line_of(text, "landmarks"))
    importer.set_floor_plan(data.get("floor_plan"), _line_of(text, "floor_plan"))
    name = data.get("name")
    return importer.finish(name if isinstance(name, str) and name else "graph")


def _end_of(edge: _Feature, key: str, places: dict[int, _Feature]) -> _Feature:
    number = edge.number(key)
    if number not in places:
        what = f"there is no Point with the id {number}; add it, or remove the edge"
        raise edge.error(f"properties.{key}", what)
    return places[number]


def _lines_of_features(text: str) -> Iterator[int]:
    """Yield the lines at which the features begin."""
    at, last, line = text.index("[", text.index('"features"')) + 1, 0, 1
    with suppress(ValueError):  # at the end of the list
        while True:
            at = next(_VALUE.finditer(text, at)).start()
            line, last = line + text.count("\n", last, at), at
            _, at = json.JSONDecoder().raw_decode(text, at)
            yield line


def _line_of(text: str, member: str) -> int:
    """Return the line of a member of the collection."""
    return text.count("\n", 0, max(text.find(f'"{member}"'), 0)) + 1
