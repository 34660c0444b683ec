"""Import of maps in other formats: entries with their line numbers, validated like a map file."""

from __future__ import annotations

from typing import Any

from navfw.config.document import KeyPath, Origin, YamlDocument
from navfw.errors import MapError
from navfw.topomap.mapfile import read_map
from navfw.topomap.mapspec import EdgeSpec, MapLandmarkSpec, PlaceSpec
from navfw.topomap.topological_map import TopoMap

PLACE_KEYS = tuple(PlaceSpec.model_fields)
EDGE_KEYS = tuple(key for key in EdgeSpec.model_fields if key not in {"from_", "to"})
_LANDMARK_KEYS = tuple(MapLandmarkSpec.model_fields)


class MapImporter:
    """Collects places, edges and landmarks, and builds the document of an equivalent map file.

    Of the given values only the keys of a map file are kept. With ``both_ways`` a one-way edge
    counts as a passage; without it the opposite edge is required.
    """

    def __init__(self, file: str, both_ways: bool) -> None:
        self._file = file
        self._both_ways = both_ways
        self._origins: dict[KeyPath, Origin] = {}
        self._places: dict[str, dict[str, Any]] = {}
        self._landmarks: dict[str, dict[str, Any]] = {}
        self._edges: list[dict[str, Any]] = []
        self._floor_plan: Any = None
        self._one_way: dict[tuple[str, str], int] = {}
        self._directed: set[tuple[str, str]] = set()

    def add_place(self, name: str, values: dict[str, Any], line: int, key: str) -> None:
        """Add a place; ``key`` names it in error messages.

        Raises:
            MapError: there is already a place of that name.

        """
        if name in self._places:
            first = self._origins["places", name].line
            raise MapError(
                f"a second place {name!r} (the first is in line {first}); give it another name",
                file=self._file,
                line=line,
                key=key,
            )
        self._places[name] = _kept(values, PLACE_KEYS)
        self._origins["places", name] = Origin(self._file, line)

    def add_edge(
        self, a: str, b: str, values: dict[str, Any], line: int, directed: bool = False
    ) -> None:
        """Add an edge; a ``directed`` one makes a passage together with the opposite edge."""
        if directed and not self._both_ways:
            if (b, a) in self._one_way:
                del self._one_way[b, a]
                return
            self._one_way[a, b] = len(self._edges)
        elif directed:
            if (b, a) in self._directed:
                return
            self._directed.add((a, b))
        self._origins["edges", len(self._edges)] = Origin(self._file, line)
        self._edges.append({"from": a, "to": b, **_kept(values, EDGE_KEYS)})

    def add_landmark(self, name: str, values: dict[str, Any], line: int) -> None:
        """Add a landmark."""
        self._landmarks[name] = _kept(values, _LANDMARK_KEYS)
        self._origins["landmarks", name] = Origin(self._file, line)

    def set_floor_plan(self, name: Any, line: int) -> None:
        """Set the file of the floor plan; None: the map has none."""
        self._floor_plan = name
        self._origins["floor_plan",] = Origin(self._file, line)

    def finish(self, name: str) -> TopoMap:
        """The map.

        Raises:
            ConfigError: a value is missing or out of bounds.
            MapError: an edge is one-way only, or the map is invalid.

        """
        for (a, b), index in self._one_way.items():
            raise MapError(
                f"leads only from {a!r} to {b!r}, but passages are two-way: add the edge from "
                f"{b!r} to {a!r}, or convert with --both-ways",
                file=self._file,
                line=self._origins["edges", index].line,
                key=f"edges[{index}]",
            )
        data: dict[str, Any] = {"name": name, "places": self._places, "edges": self._edges}
        if self._floor_plan is not None:
            data["floor_plan"] = self._floor_plan
        if self._landmarks:
            data["landmarks"] = self._landmarks
        return read_map(YamlDocument(self._file, data, {(): Origin(self._file), **self._origins}))


def _kept(values: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: values[key] for key in keys if values.get(key) is not None}
