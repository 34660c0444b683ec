"""Maps of ``topological_navigation`` (ROS): tmap2, and the lists of nodes before it.

A node has ``name``, ``pose`` and directed ``edges`` to other nodes; all else is left out.
"""

from __future__ import annotations

from navfw.config.document import YamlDocument
from navfw.config.yaml_text import Data, KeyPath
from navfw.errors import MapError
from navfw.topomap.mapfile import MapImporter
from navfw.topomap.topological_map import TopoMap


def nodes_path(document: YamlDocument) -> KeyPath | None:
    """Return the path of keys to the nodes; None if the document is no such map."""
    for path in ((), ("nodes",)):
        nodes = document.at(path)
        if isinstance(nodes, list) and nodes and isinstance(nodes[0], dict) and "node" in nodes[0]:
            return path
    return None


def read_tmap(document: YamlDocument, path: KeyPath, both_ways: bool) -> TopoMap:
    """Read the map whose nodes are at ``path``; raises as ``read_geojson``."""
    for part in ("translation", "rotation"):
        moved = document.at(("transformation", part))
        if isinstance(moved, dict) and any(moved.get(axis, 0.0) for axis in "xyz"):
            with document.locating(("transformation", part)):
                raise MapError("expected none: move the nodes into the parent frame")
    importer = MapImporter(document.file or "", both_ways)
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
