"""GraphML, the XML format of graph tools: nodes with x, y and kind, undirected edges.

The values of a place or passage are data of its node or edge, with the keys of the map file;
landmarks are data of the graph, as JSON, and so is the name of the floor plan's file.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from navfw.config.json_file import parse_json
from navfw.errors import ConfigError, MapError
from navfw.topomap.map_import import EDGE_KEYS, PLACE_KEYS, MapImporter
from navfw.topomap.mapfile import map_data
from navfw.topomap.topological_map import TopoMap

_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_MAX_DEPTH = 60
"""Largest nesting of elements."""

_NUMBERS = {"double": float, "float": float, "int": int, "long": int}


_TEXTS = ("kind", "landmarks", "floor_plan")
"""Keys of data that are text; all others are numbers."""


def graphml_text(topo_map: TopoMap, plan_file: str | None = None) -> str:
    """The map as the text of a GraphML file, with its floor plan in ``plan_file``."""
    return "\n".join(_lines(topo_map, plan_file)) + "\n"


def _lines(topo_map: TopoMap, plan_file: str | None) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="utf-8"?>'
    yield f'<graphml xmlns="{_NAMESPACE}">'
    graph_keys = ("landmarks", "floor_plan")
    for owner, keys in (("node", PLACE_KEYS), ("edge", EDGE_KEYS), ("graph", graph_keys)):
        for key in keys:
            kind = "string" if key in _TEXTS else "double"
            yield (
                f'  <key id="{owner}-{key}" for="{owner}" attr.name="{key}" attr.type="{kind}"/>'
            )
    yield f'  <graph id={quoteattr(topo_map.name)} edgedefault="undirected">'
    if topo_map.landmarks:
        yield "    " + _data("graph", "landmarks", json.dumps(map_data(topo_map)["landmarks"]))
    if plan_file is not None:
        yield "    " + _data("graph", "floor_plan", plan_file)
    for place in topo_map.places.values():
        data = "".join(_data("node", key, getattr(place, key)) for key in PLACE_KEYS)
        yield f"    <node id={quoteattr(place.name)}>{data}</node>"
    for passage in topo_map.passages:
        values = {key: getattr(passage, key) for key in EDGE_KEYS}
        data = "".join(_data("edge", k, v) for k, v in values.items() if math.isfinite(v))
        ends = f"source={quoteattr(passage.a)} target={quoteattr(passage.b)}"
        yield f"    <edge {ends}>{data}</edge>"
    yield "  </graph>"
    yield "</graphml>"


def _data(owner: str, key: str, value: str | float) -> str:
    text = escape(value) if isinstance(value, str) else repr(float(value))
    return f'<data key="{owner}-{key}">{text}</data>'


def read_graphml(text: str, file: str, both_ways: bool = False) -> TopoMap:
    """The map in the text of a GraphML file.

    Raises:
        ConfigError: it is not XML, declares entities, or a value is missing or out of bounds.
        MapError: it has no graph, an edge is directed and its counterpart is missing (unless
            ``both_ways``), or the map is invalid.

    """
    return _GraphmlReader(file, both_ways).read(text)


class _GraphmlReader:
    """Reads one file by expat's events, keeping the line of each element for error messages."""

    def __init__(self, file: str, both_ways: bool) -> None:
        self._file = file
        self._importer = MapImporter(file, both_ways)
        self._keys: dict[str, tuple[str, str]] = {}  # id: attr.name, attr.type
        self._name: str | None = None
        self._directed = False
        self._open: list[tuple[str, dict[str, str], int]] = []  # element, attributes, line
        self._values: list[dict[str, Any]] = []  # the data of each open element
        self._text: list[str] = []
        # UTF-8 whatever the declaration says: the text has been decoded already
        self._parser = expat.ParserCreate("utf-8", " ")
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.EntityDeclHandler = self._entity

    def read(self, text: str) -> TopoMap:
        try:
            self._parser.Parse(text.encode(), True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise ConfigError(
                f"not valid XML: {reason}", file=self._file, line=error.lineno
            ) from None
        if self._name is None:
            raise MapError("expected GraphML: there is no <graph>", file=self._file, line=1)
        return self._importer.finish(self._name or "graph")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = tag.rpartition(" ")[2]
        if len(self._open) >= _MAX_DEPTH:
            raise self._error(element, f"nested too deeply: more than {_MAX_DEPTH} levels")
        self._open.append((element, attributes, self._parser.CurrentLineNumber))
        self._values.append({})
        self._text = []
        if element == "key":
            name = attributes.get("attr.name", "")
            self._keys[attributes.get("id", "")] = (name, attributes.get("attr.type", "string"))
        elif element == "graph" and self._name is None:
            self._name = attributes.get("id", "")
            self._directed = attributes.get("edgedefault") == "directed"
        elif element == "hyperedge":
            raise self._error(element, "a passage connects two places: use several edges")

    def _characters(self, text: str) -> None:
        self._text.append(text)

    def _end(self, _: str) -> None:
        element, attributes, line = self._open.pop()
        values = self._values.pop()
        if element == "data" and self._open:
            self._store_data(attributes.get("key", ""), line)
        elif element == "node":
            name = self._attribute(element, attributes, "id", line)
            self._importer.add_place(name, values, line, f"node {name!r}")
        elif element == "edge":
            a = self._attribute(element, attributes, "source", line)
            b = self._attribute(element, attributes, "target", line)
            directed = attributes.get("directed", str(self._directed).lower()) == "true"
            self._importer.add_edge(a, b, values, line, directed)
        elif element == "graph":
            self._importer.set_floor_plan(values.get("floor_plan"), line)
            if "landmarks" in values:
                self._add_landmarks(values["landmarks"], line)

    def _store_data(self, key: str, line: int) -> None:
        """Store a <data> value in its parent element, as the type that its key declares."""
        name, kind = self._keys.get(key, (key, "string"))
        text = "".join(self._text)
        value: Any = text
        if kind in _NUMBERS:
            try:
                value = _NUMBERS[kind](text)
            except ValueError:
                raise MapError(
                    f"expected a number, got {text!r:.40}",
                    file=self._file,
                    line=line,
                    key=name,
                ) from None
            if isinstance(value, float) and not math.isfinite(value):
                return  # unlimited width: the key is left out, as in a map file
        self._values[-1][name] = value

    def _add_landmarks(self, text: str, line: int) -> None:
        try:
            landmarks = parse_json(text, self._file)
        except ConfigError:
            landmarks = None
        if not isinstance(landmarks, dict):
            raise MapError(
                "expected a JSON object of landmarks by name",
                file=self._file,
                line=line,
                key="landmarks",
            )
        for name, values in landmarks.items():
            self._importer.add_landmark(name, values if isinstance(values, dict) else {}, line)

    def _attribute(self, element: str, attributes: dict[str, str], name: str, line: int) -> str:
        value = attributes.get(name, "")
        if not value:
            raise MapError(
                f"expected the attribute {name!r}, as in <{element} {name}=...>",
                file=self._file,
                line=line,
                key=element,
            )
        return value

    def _entity(self, *_: object) -> None:
        raise ConfigError(
            "entity declarations are not supported; write the text itself",
            file=self._file,
            line=self._parser.CurrentLineNumber,
        )

    def _error(self, key: str, message: str) -> MapError:
        return MapError(message, file=self._file, line=self._parser.CurrentLineNumber, key=key)
