"""Map files of several formats, chosen by their suffix: reading and writing.

``.yaml`` is navfw's own format (``mapfile``), ``.geojson`` that of Nav2's route server
(``geojson``), ``.graphml`` the XML format of graph tools such as networkx, yEd and Gephi, read and
written here. All three preserve the whole map; its floor plan is written beside it. ``.tmap2`` of
ROS' topological_navigation, and its lists of nodes before that, are read.

In GraphML the values of a place or passage are data of its node or edge, with the keys of the map
file; landmarks are data of the graph, as JSON, and so is the name of the floor plan's file.
networkx reads and writes such files too, but keeps neither the lines of entries nor the order of
passages.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from navfw.config.document import YamlDocument, parse_mapping, parse_yaml
from navfw.config.foreign_files import line_of, read_xml
from navfw.config.input_file import parse_json, read_input_text, shown_path
from navfw.config.yaml_text import Data, KeyPath
from navfw.errors import MapError, locating
from navfw.process.atomic import write_text
from navfw.topomap import mapfile
from navfw.topomap.geojson import geojson_text, read_geojson
from navfw.topomap.georeference import local_frame
from navfw.topomap.occupancy_map import save_ros_map
from navfw.topomap.topological_map import TopoMap

_NUMBERS = {"double": float, "float": float, "int": int, "long": int}
_VALUES = {"x", "y", *mapfile.EDGE_KEYS}
"""Keys of numbers, also where a tool such as osmnx declares all data as text."""
_TEXTS = ("kind", "landmarks", "floor_plan")
"""Keys of data that are text; all others are numbers."""


def graphml_text(topo_map: TopoMap, plan_file: str | None = None) -> str:
    """Write the map as GraphML text; its floor plan is in ``plan_file``."""
    root = Element("graphml", xmlns="http://graphml.graphdrawing.org/xmlns")
    graph_keys = ("landmarks", "floor_plan")
    for owner, keys in (
        ("node", mapfile.PLACE_KEYS),
        ("edge", mapfile.EDGE_KEYS),
        ("graph", graph_keys),
    ):
        for key in keys:
            kind = "string" if key in _TEXTS else "double"
            names = {"for": owner, "attr.name": key, "attr.type": kind}
            SubElement(root, "key", {"id": f"{owner}-{key}", **names})
    graph = SubElement(root, "graph", id=topo_map.name, edgedefault="undirected")
    landmarks = json.dumps(mapfile.map_data(topo_map)["landmarks"]) if topo_map.landmarks else None
    _add_data(graph, {"landmarks": landmarks, "floor_plan": plan_file})
    for place in topo_map.places.values():
        node = SubElement(graph, "node", id=place.name)
        _add_data(node, {key: getattr(place, key) for key in mapfile.PLACE_KEYS})
    for passage in topo_map.passages:
        edge = SubElement(graph, "edge", source=passage.a, target=passage.b)
        values = {key: getattr(passage, key) for key in mapfile.EDGE_KEYS}
        _add_data(edge, {key: v if math.isfinite(v) else None for key, v in values.items()})
    indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _add_data(owner: Element, values: dict[str, str | float | None]) -> None:
    for key, value in values.items():
        if value is not None:
            data = SubElement(owner, "data", key=f"{owner.tag}-{key}")
            data.text = value if isinstance(value, str) else repr(float(value))


class _GraphmlReader:
    """Reads one file, keeping the line of each element for error messages."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._keys: dict[str, tuple[str, str]] = {}  # id: attr.name, attr.type

    def read(self, both_ways: bool) -> TopoMap:
        file, root = shown_path(self._path), read_xml(self._path, "GraphML")
        for element in root.iter():
            element.tag = element.tag.rpartition(":")[2]
        graph = next(root.iter("graph"), None)
        if graph is None:
            raise MapError("expected GraphML: there is no <graph>", file=file, line=1)
        for key in root.iter("key"):
            kind = key.get("attr.type", "string")
            self._keys[key.get("id", "")] = (key.get("attr.name", ""), kind)
            if (default := key.find("default")) is not None and default.text:
                default.tag, default.attrib["key"] = "data", key.get("id", "")
                for element in list(root.iter(key.get("for", ""))):
                    element.insert(0, default)
        for edge in root.iter("hyperedge"):
            raise self._error(edge, edge.tag, "a passage connects two places: use several edges")
        nodes = [(node, self._values(node)) for node in root.iter("node")]
        points = [(node["x"], node["y"]) for _, node in nodes if "x" in node and "y" in node]
        values, line = self._values(graph), line_of(graph)
        with locating(file=file, line=line, key="crs"):  # navfw's own files are in metres
            crs, metric = str(values.get("crs", "")), "node-x" in self._keys
            frame = local_frame(points, crs, metric=metric)
        importer = mapfile.MapImporter(file, both_ways, frame)
        for node, at in nodes:
            name = self._attribute(node, "id")
            if "x" in at and "y" in at:
                at["x"], at["y"] = frame(at["x"], at["y"])
            importer.add_place(name, at, line_of(node), f"node {name!r}")
        for edge in root.iter("edge"):
            ends = self._attribute(edge, "source"), self._attribute(edge, "target")
            directed = edge.get("directed", graph.get("edgedefault")) in {"true", "directed"}
            importer.add_edge(*ends, self._values(edge), line_of(edge), directed=directed)
        importer.set_floor_plan(values.get("floor_plan"), line)
        with locating(line=line, key="landmarks"):
            landmarks = parse_json(str(values.get("landmarks", "{}")), file)
        if not isinstance(landmarks, dict):
            raise self._error(graph, "landmarks", "expected a JSON object of landmarks by name")
        importer.add_landmarks(landmarks, line)
        return importer.finish(graph.get("id") or "graph")

    def _values(self, element: Element) -> dict[str, Any]:
        """Return the <data> of an element by name, as the types that their keys declare."""
        values: dict[str, Any] = {}
        for data in element.findall("data"):
            key, text = data.get("key", ""), data.text or ""
            name, kind = self._keys.get(key, (key, "string"))
            try:
                value = float(text) if name in _VALUES else _NUMBERS.get(kind, str)(text)
            except ValueError:
                raise self._error(data, name, f"expected a number, got {text!r:.40}") from None
            # without a limit of its width a passage has no such key, as in a map file
            if not isinstance(value, float) or math.isfinite(value):
                values[name] = value
        return values

    def _attribute(self, element: Element, name: str) -> str:
        value = element.get(name, "")
        if not value:
            what = f"expected the attribute {name!r}, as in <{element.tag} {name}=...>"
            raise self._error(element, element.tag, what)
        return value

    def _error(self, element: Element, key: str, message: str) -> MapError:
        return MapError(message, file=shown_path(self._path), line=line_of(element), key=key)


def _nodes_path(document: YamlDocument) -> KeyPath | None:
    """Return the path of keys to the nodes; None if the document is no such map."""
    for path in ((), ("nodes",)):
        nodes = document.at(path)
        if isinstance(nodes, list) and nodes and isinstance(nodes[0], dict) and "node" in nodes[0]:
            return path
    return None


def _read_tmap(document: YamlDocument, path: KeyPath, both_ways: bool) -> TopoMap:
    """Read the map of topological_navigation whose nodes are at ``path``; all else is left out."""
    for part in ("translation", "rotation"):
        moved = document.at(("transformation", part))
        if isinstance(moved, dict) and any(moved.get(axis, 0.0) for axis in "xyz"):
            with document.locating(("transformation", part)):
                raise MapError("expected none: move the nodes into the parent frame")
    importer = mapfile.MapImporter(document.file or "", both_ways)
    edges: list[tuple[KeyPath, str, Data]] = []
    for index in range(len(document.at(path))):
        where: KeyPath = (*path, index, "node")
        with document.locating(where):
            name, at = document.at((*where, "name")), document.at((*where, "pose", "position"))
            if not isinstance(name, str | int) or not isinstance(at, dict):
                raise MapError("expected a node with name and pose: {position: {x, y}}")
        importer.add_place(str(name), at, document.line_of(where) or 1, f"node {name!r}")
        listed = document.at((*where, "edges"))
        for number, edge in enumerate(listed if isinstance(listed, list) else ()):
            edges.append(((*where, "edges", number), str(name), edge))
    for where, start, edge in edges:
        with document.locating(where):
            if not isinstance(edge, dict) or "node" not in edge:
                raise MapError("expected an edge with the key node")
        importer.add_edge(start, str(edge["node"]), {}, document.line_of(where) or 1, directed=True)
    name = document.at(("name",)) or document.at((*path, 0, "meta", "pointset"))
    return importer.finish(str(name or "graph"))


_WRITERS: dict[str, Callable[[TopoMap, str | None], str]] = {
    ".yaml": mapfile.map_text,
    ".yml": mapfile.map_text,
    ".graphml": graphml_text,
    ".geojson": geojson_text,
    ".json": geojson_text,
}

_YAML = (".yaml", ".yml", ".tmap", ".tmap2")
SUFFIXES: tuple[str, ...] = (*_WRITERS, ".tmap", ".tmap2")
"""The suffixes of map files; the last two are only read."""


def load_any_map(
    path: str | Path, both_ways: bool = False, check_kind: mapfile.KindCheck | None = None
) -> TopoMap:
    """Load the map in a file of any format, chosen by its suffix.

    With ``both_ways`` a one-way edge becomes a passage, which is always two-way. ``check_kind``
    knows the kinds of landmark of YAML maps; other formats have only the shipped ones.

    Raises:
        ConfigError: the file cannot be read, is not of its format, declares XML entities, or a
            value is missing or out of bounds.
        MapError: the suffix is unknown, something that the format requires is missing, an edge is
            one-way, or the map is invalid.

    """
    path = Path(path)
    if path.suffix.lower() in _YAML:
        text, name = read_input_text(path), shown_path(path)
        document = parse_yaml(text, name)
        if (nodes := _nodes_path(document)) is not None:
            return _read_tmap(document, nodes, both_ways)
        if document.at(("image",)) and document.at(("resolution",)):
            what = "is a floor plan of map_server: navfw world import makes a world and map of it"
            raise MapError(what, file=name)
        if path.suffix.lower() not in _WRITERS:
            raise MapError("expected nodes, as of topological_navigation", file=name)
        if not isinstance(document.data, dict):
            document = parse_mapping(text, name)  # raises
        return mapfile.read_map(document, *([] if check_kind is None else [check_kind]))
    if _WRITERS[_suffix(path)] is graphml_text:
        return _GraphmlReader(path).read(both_ways)
    text = read_input_text(path)
    return read_geojson(text, shown_path(path), both_ways)


def save_map(topo_map: TopoMap, path: str | Path) -> None:
    """Write the map in the format of the suffix, replacing an old file atomically.

    Its floor plan, if any, goes to ``plans/NAME.yaml`` below its folder: in a folder of maps, a
    file beside it would count as another map.

    Raises:
        MapError: the suffix is unknown.
        InputError: the file cannot be written.

    """
    path = Path(path)
    writer = _WRITERS[_suffix(path)]
    plan_file = None
    if topo_map.floor_plan is not None:
        plan_file = f"plans/{path.stem}.yaml"
        save_ros_map(topo_map.floor_plan, path.parent / plan_file)
    write_text(path, writer(topo_map, plan_file), parents=True)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        suffixes = ", ".join(_WRITERS)
        raise MapError(
            f"expected a map file ({suffixes}), got {path.name!r}", file=shown_path(path)
        )
    return suffix
