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
from collections.abc import Iterator
from typing import Any

from navfw.config.input_file import parse_json
from navfw.errors import MapError
from navfw.topomap.elements import Passage
from navfw.topomap.mapfile import EDGE_KEYS, MapImporter, map_data
from navfw.topomap.topological_map import TopoMap

_EDGES = ("MultiLineString", "LineString")


def geojson_text(topo_map: TopoMap, plan_file: str | None = None) -> str:
    """The map as the text of a GeoJSON file, a line a feature; its floor plan is ``plan_file``."""
    ids = {name: number for number, name in enumerate(topo_map.places)}
    features: list[dict[str, Any]] = [
        _feature(
            {"type": "Point", "coordinates": [place.x, place.y]},
            {
                "id": ids[place.name],
                "frame": "map",
                "metadata": {"name": place.name, "kind": place.kind},
            },
        )
        for place in topo_map.places.values()
    ]
    for passage in topo_map.passages:
        for start, end in ((passage.a, passage.b), (passage.b, passage.a)):
            features.append(_edge_feature(topo_map, passage, len(features), (start, end), ids))
    head = [f'"name": {json.dumps(topo_map.name)},']
    if topo_map.landmarks:
        head.append(f'"landmarks": {json.dumps(map_data(topo_map)["landmarks"])},')
    if plan_file is not None:
        head.append(f'"floor_plan": {json.dumps(plan_file)},')
    lines = ",\n".join(json.dumps(feature) for feature in features)
    return '{"type": "FeatureCollection",\n' + "\n".join(head) + f'\n"features": [\n{lines}\n]}}\n'


def _edge_feature(
    topo_map: TopoMap,
    passage: Passage,
    number: int,
    ends: tuple[str, str],
    ids: dict[str, int],
) -> dict[str, Any]:
    places = [topo_map.places[name] for name in ends]
    values = {key: getattr(passage, key) for key in EDGE_KEYS}
    return _feature(
        {"type": "MultiLineString", "coordinates": [[[place.x, place.y] for place in places]]},
        {
            "id": number,
            "startid": ids[ends[0]],
            "endid": ids[ends[1]],
            "cost": passage.length,
            "overridable": True,
            "metadata": {key: value for key, value in values.items() if math.isfinite(value)},
        },
    )


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


class GeoJsonReader:
    """Reads the text of one file, keeping the line of each feature for error messages.

    A node without a name gets its number as name, an edge without a length its straight distance.
    With ``both_ways`` a one-way edge is a passage.
    """

    def __init__(self, text: str, file: str, both_ways: bool) -> None:
        self._text = text
        self._file = file
        self._importer = MapImporter(file, both_ways)
        self._names: dict[int, str] = {}
        self._lines: dict[int, int] = {}

    def read(self) -> TopoMap:
        """The map in the file.

        Raises:
            ConfigError: it is not JSON, or a value is out of bounds.
            MapError: it is not a FeatureCollection, a feature lacks a property, an id is duplicate
                or unknown, an edge is one-way, or the map is invalid.

        """
        data = parse_json(self._text, self._file, "exchanged map")
        if not isinstance(data, dict) or data.get("type") != "FeatureCollection":
            raise self._error("type", "expected a FeatureCollection", 1)
        features = data.get("features")
        if not isinstance(features, list):
            raise self._error("features", "expected a list of features", 1)
        placed = list(zip(features, _lines_of_features(self._text), strict=True))
        for index, (feature, line) in enumerate(placed):
            if self._geometry(feature, index, line) == "Point":
                self._add_node(feature, index, line)
        for index, (feature, line) in enumerate(placed):
            if feature["geometry"]["type"] in _EDGES:
                self._add_edge(feature, index, line)
        if isinstance(landmarks := data.get("landmarks"), dict):
            self._importer.add_landmarks(landmarks, self._line_of("landmarks"))
        self._importer.set_floor_plan(data.get("floor_plan"), self._line_of("floor_plan"))
        name = data.get("name")
        return self._importer.finish(name if isinstance(name, str) and name else "graph")

    def _geometry(self, feature: Any, index: int, line: int) -> str:
        geometry = feature.get("geometry") if isinstance(feature, dict) else None
        kind = geometry.get("type") if isinstance(geometry, dict) else None
        if kind == "Point" or kind in _EDGES:
            return str(kind)
        raise self._error(
            f"features[{index}].geometry.type",
            f"expected Point (a place) or MultiLineString (an edge), got {_short(kind)}",
            line,
        )

    def _add_node(self, feature: dict[str, Any], index: int, line: int) -> None:
        key = f"features[{index}]"
        number, properties = self._number(feature, index, "id", line)
        if number in self._names:
            raise self._duplicate_id(f"{key}.properties.id", number, line)
        at = feature["geometry"].get("coordinates")
        if not (isinstance(at, list) and len(at) >= 2 and all(map(_is_number, at[:2]))):
            raise self._error(
                f"{key}.geometry.coordinates", f"expected [x, y] [m], got {_short(at)}", line
            )
        metadata = self._metadata(properties)
        name = metadata.get("name")
        name = name if isinstance(name, str) and name else str(number)
        self._names[number], self._lines[number] = name, line
        kind = {"kind": metadata["kind"]} if "kind" in metadata else {}
        self._importer.add_place(name, {"x": at[0], "y": at[1], **kind}, line, key)

    def _add_edge(self, feature: dict[str, Any], index: int, line: int) -> None:
        number, properties = self._number(feature, index, "id", line)
        if number in self._lines:
            raise self._duplicate_id(f"features[{index}].properties.id", number, line)
        self._lines[number] = line
        start, end = (self._end(feature, index, key, line) for key in ("startid", "endid"))
        self._importer.add_edge(start, end, self._metadata(properties), line, directed=True)

    def _end(self, feature: dict[str, Any], index: int, key: str, line: int) -> str:
        number, _ = self._number(feature, index, key, line)
        if number not in self._names:
            raise self._error(
                f"features[{index}].properties.{key}",
                f"there is no Point with the id {number}; add it, or remove the edge",
                line,
            )
        return self._names[number]

    def _line_of(self, member: str) -> int:
        """The line of a member of the collection."""
        return self._text.count("\n", 0, max(self._text.find(f'"{member}"'), 0)) + 1

    def _number(
        self, feature: dict[str, Any], index: int, key: str, line: int
    ) -> tuple[int, dict[str, Any]]:
        """A property that is an id, and all properties."""
        properties = feature.get("properties")
        value = properties.get(key) if isinstance(properties, dict) else None
        if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
            return value, properties or {}
        got = "it is missing" if value is None else f"got {_short(value)}"
        raise self._error(
            f"features[{index}].properties.{key}", f"expected the id, an integer: {got}", line
        )

    @staticmethod
    def _metadata(properties: dict[str, Any]) -> dict[str, Any]:
        metadata = properties.get("metadata")
        return metadata if isinstance(metadata, dict) else {}

    def _duplicate_id(self, key: str, number: int, line: int) -> MapError:
        return self._error(
            key,
            f"a second feature with the id {number} (the first is in line {self._lines[number]}); "
            "nodes and edges share their numbers, so give each its own",
            line,
        )

    def _error(self, key: str, message: str, line: int) -> MapError:
        return MapError(message, file=self._file, line=line, key=key)


def _lines_of_features(text: str) -> Iterator[int]:
    """The 1-based line at which each element of the root's member ``features`` begins."""
    decode = json.JSONDecoder().raw_decode
    at = _next(text, text.index("{") + 1)
    starts: list[int] = []
    while text[at] == '"':
        member, at = decode(text, at)
        at = _next(text, _next(text, at) + 1)  # past the colon
        if member != "features" or text[at] != "[":
            at = decode(text, at)[1]
        else:
            starts = []
            at = _next(text, at + 1)
            while text[at] != "]":
                starts.append(at)
                at = _next(text, decode(text, at)[1])
            at += 1
        at = _next(text, at)
    line, before = 1, 0
    for start in starts:
        line += text.count("\n", before, start)
        before = start
        yield line


def _next(text: str, at: int) -> int:
    """The index of the next character that is neither space nor comma."""
    while text[at] in " \t\r\n,":
        at += 1
    return at


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _short(value: object) -> str:
    return f"{value!r:.40}"
