"""Map files in YAML: reading, with errors located by file, line and key, and writing.

Maps in other formats become the document of an equivalent map file (``MapImporter``).

::

    name: office
    floor_plan: plans/office.yaml
    places:
      lobby: {x: 2.0, y: 2.0, kind: room}
      lobby-door: {x: 3.2, y: 4.2, kind: door}
    edges:
      - {from: lobby, to: lobby-door, width: 0.95}
    landmarks:
      lobby-marker: {kind: aruco, id: 7, x: 0.1, y: 2.0, z: 0.5, yaw: 0.0, size: 0.25}
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from navfw.assumption import Assumption
from navfw.config.document import Origin, YamlDocument, load_yaml
from navfw.config.lookup import find
from navfw.config.yaml_text import KeyPath, key_text, write_yaml_text
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, MapError, did_you_mean
from navfw.topomap.elements import Landmark, MapViolation, Passage, Place, map_violations
from navfw.topomap.georeference import LocalFrame
from navfw.topomap.mapspec import (
    EdgeSpec,
    MapLandmarkSpec,
    MapSpec,
    PlaceSpec,
)
from navfw.topomap.occupancy_map import load_ros_map
from navfw.topomap.topological_map import TopoMap

PLACE_KEYS = tuple(PlaceSpec.model_fields)
EDGE_KEYS = tuple(key for key in EdgeSpec.model_fields if key not in {"from_", "to"})
_LANDMARK_KEYS = tuple(MapLandmarkSpec.model_fields)

KindCheck = Callable[[str], str]
"""Returns the name of a kind of landmark, or raises ValueError if there is none of that name."""

_SHIPPED_KINDS = ("aruco", "poster")
"""Kinds of landmark known without looking for plugins; posters are those of navfw-benchmarks."""


def _shipped_kind(name: str) -> str:
    if name not in _SHIPPED_KINDS:
        raise ValueError(f"unknown kind of landmark {name!r}: {did_you_mean(name, _SHIPPED_KINDS)}")
    return name


def load_map(name: str | Path, check_kind: KindCheck = _shipped_kind) -> TopoMap:
    """Load the map of that name or file; ``check_kind`` knows the kinds of landmark.

    Raises:
        UnknownNameError: there is no map of that name.
        ConfigError: the file cannot be read or breaks the schema.
        MapError: the map is invalid: an edge names a place that is missing, a length is
            impossible, a passage is given twice. The message lists every error, one a line.

    """
    return read_map(load_yaml(find("map", name)), check_kind)


def read_map(document: YamlDocument, check_kind: KindCheck = _shipped_kind) -> TopoMap:
    """Check a parsed document and return its map; raises like ``load_map``."""
    spec = validate(document, MapSpec)
    for name, at in spec.landmarks.items():
        try:
            check_kind(at.kind)
        except ValueError as error:
            with document.locating(("landmarks", name, "kind")):
                raise ConfigError(str(error)) from None
    places = [Place(name, at.x, at.y, at.kind) for name, at in spec.places.items()]
    place_of = {place.name: place for place in places}
    passages = [_passage(edge, place_of) for edge in spec.edges]
    landmarks = [
        Landmark(name, at.kind, at.id, at.x, at.y, at.yaw, at.z, at.size)
        for name, at in spec.landmarks.items()
    ]
    violations = map_violations(places, passages, landmarks)
    if violations:
        raise _map_error(document, violations)
    plan = None
    if spec.floor_plan is not None:
        plan = load_ros_map(Path(document.file or "").parent / spec.floor_plan)
    return TopoMap(spec.name, places, passages, document.file, landmarks, plan)


def map_data(topo_map: TopoMap, plan_file: str | None = None) -> dict[str, Any]:
    """Convert ``topo_map`` to plain data with the keys of a map file; defaults are left out.

    ``plan_file`` is the yaml file of its floor plan, relative to the map file.
    """
    data: dict[str, Any] = {
        "name": topo_map.name,
        **({} if plan_file is None else {"floor_plan": plan_file}),
        "places": {
            place.name: {"x": place.x, "y": place.y, "kind": place.kind}
            for place in topo_map.places.values()
        },
        "edges": [_edge_data(topo_map, passage) for passage in topo_map.passages],
    }
    if topo_map.landmarks:
        data["landmarks"] = {
            mark.name: {key: getattr(mark, key) for key in _LANDMARK_KEYS}
            for mark in topo_map.landmarks.values()
        }
    return data


def map_text(topo_map: TopoMap, plan_file: str | None = None) -> str:
    """Write a map file's text, one line for each place, edge and landmark (see ``map_data``)."""
    return write_yaml_text(map_data(topo_map, plan_file), width=sys.maxsize)


def _edge_data(topo_map: TopoMap, passage: Passage) -> dict[str, Any]:
    a, b = topo_map.places[passage.a], topo_map.places[passage.b]
    bare = _passage(EdgeSpec.model_validate({"from": a.name, "to": b.name}), {a.name: a, b.name: b})
    data: dict[str, Any] = {"from": passage.a, "to": passage.b}
    for key in EDGE_KEYS:
        value = getattr(passage, key)
        if value != getattr(bare, key) and math.isfinite(value):
            data[key] = value
    return data


def _passage(edge: EdgeSpec, places: dict[str, Place]) -> Passage:
    ends = [places[name] for name in (edge.from_, edge.to) if name in places]
    kinds = {place.kind for place in ends}
    # without one of the ends the length is unknown; validation reports the missing end
    straight = ends[0].distance(ends[1].x, ends[1].y) if len(ends) == 2 else math.nan
    return Passage(
        a=edge.from_,
        b=edge.to,
        length=straight if edge.length is None else edge.length,
        width=math.inf if edge.width is None else edge.width,
        danger=float("danger" in kinds) if edge.danger is None else edge.danger,
        doorness=float("door" in kinds) if edge.doorness is None else edge.doorness,
        uncertainty=edge.uncertainty,
    )


def _map_error(document: YamlDocument, violations: Sequence[MapViolation]) -> MapError:
    """Make one error of all violations, in the order of the file, one per line."""
    errors = []
    for violation in violations:
        first = None if violation.first is None else document.line_of(violation.first)
        message = violation.message + ("" if first is None else f" (the first is in line {first})")
        line, key = document.line_of(violation.where), key_text(violation.where)
        errors.append(MapError(message, file=document.file, line=line, key=key))
    errors.sort(key=lambda error: error.line or 0)
    if len(errors) == 1:
        return errors[0]
    return MapError("\n".join([f"{len(errors)} errors", *map(str, errors)]))


_DIFFERENT = 0.01  # chosen
"""Difference [m] of the lengths of a passage in both directions from which there is a note."""


class MapImporter:
    """Collects places, edges and landmarks, and builds the document of an equivalent map file.

    Of the given values only the keys of a map file are kept. With ``both_ways`` a one-way edge
    counts as a passage; without it the opposite edge is required. Of edges that are listed twice,
    or of different lengths in both directions, the shortest counts. ``frame`` has converted the
    coordinates of the places.
    """

    def __init__(self, file: str, both_ways: bool, frame: LocalFrame | None = None) -> None:
        self._file = file
        self._both_ways = both_ways
        self._frame = frame or LocalFrame()
        self._origins: dict[KeyPath, Origin] = {(): Origin(file)}
        self._data: dict[str, Any] = {"places": {}, "edges": [], "landmarks": {}}
        self._ways: dict[tuple[str, str], int] = {}
        """The index of the passage of each directed edge, by its ends."""
        self._repeated: list[str] = []
        self._loops: list[str] = []

    def add_place(self, name: str, values: dict[str, Any], line: int, key: str) -> None:
        """Add a place of ``line`` in the file; ``key`` names it in error messages.

        Raises:
            MapError: there is already a place of that name.

        """
        if (first := self._origins.get(("places", name))) is not None:
            raise MapError(
                f"a second place {name!r} (the first is in line {first.line}); rename one",
                file=self._file,
                line=line,
                key=key,
            )
        self._data["places"][name] = _kept(values, PLACE_KEYS)
        self._origins["places", name] = Origin(self._file, line)

    def add_edge(
        self, a: str, b: str, values: dict[str, Any], line: int, directed: bool = False
    ) -> None:
        """Add an edge from place ``a`` to ``b``, with ``values`` of a map file, in ``line``.

        A ``directed`` edge makes a passage together with the opposite one.
        """
        edge, edges = {"from": a, "to": b, **_kept(values, EDGE_KEYS)}, self._data["edges"]
        if directed and a == b:
            self._loops.append(str(line))
        elif directed and (index := self._ways.get((a, b), self._ways.get((b, a)))) is not None:
            apart = abs(_length(edge) - _length(edges[index]))
            if (a, b) in self._ways or _DIFFERENT < apart < math.inf:
                self._repeated.append(str(line))
                edges[index] = min(edges[index], edge, key=_length)
            self._ways[a, b] = index
        else:
            if directed:
                self._ways[a, b] = len(edges)
            self._origins["edges", len(edges)] = Origin(self._file, line)
            edges.append(edge)

    def add_landmarks(self, landmarks: dict[str, Any], line: int) -> None:
        """Add landmarks by name; ``finish`` refuses one that is no mapping: it lacks all values."""
        for name, values in landmarks.items():
            self._data["landmarks"][name] = _kept(values, _LANDMARK_KEYS)
            self._origins["landmarks", name] = Origin(self._file, line)

    def set_floor_plan(self, name: Any, line: int) -> None:
        """Set the file name of the floor plan; None: the map has none."""
        self._data["floor_plan"] = name
        self._origins["floor_plan",] = Origin(self._file, line)

    def finish(self, name: str) -> TopoMap:
        """Check what was collected and return the map, called ``name``.

        Raises:
            ConfigError: a value is missing or out of bounds.
            MapError: an edge is one-way only, or the map is invalid.

        """
        places, edges = self._data["places"], self._data["edges"]
        # of an end that is no place it is said first
        known = all({edge["from"], edge["to"]} <= places.keys() for edge in edges)
        for (a, b), index in self._ways.items() if known and not self._both_ways else ():
            if (b, a) not in self._ways:
                raise MapError(
                    f"leads only from {a!r} to {b!r}, but passages are two-way: add the edge from "
                    f"{b!r} to {a!r}, or convert with --both-ways",
                    file=self._file,
                    line=self._origins["edges", index].line,
                    key=f"edges[{index}]",
                )
        for edge in edges if known and self._frame.assumed else ():
            # a length a little below the distance is that of another projection
            (ax, bx), (ay, by) = (
                [places[edge[end]].get(key, math.nan) for end in ("from", "to")] for key in "xy"
            )
            straight = math.hypot(ax - bx, ay - by)
            if 0.99 * straight <= _length(edge) < straight:
                del edge["length"]
        made = read_map(YamlDocument(self._file, {"name": name, **self._data}, self._origins))
        assumed = [*self._frame.assumed]
        for what, taken, lines, why in (
            ("repeated edges", "the shortest of each", self._repeated, "lists the same ends again"),
            ("edges of one place", "left out", self._loops, "leads back to where it begins"),
        ):
            if lines:
                listed = ", ".join(lines[:5]) + (", ..." if len(lines) > 5 else "")
                assumed.append(Assumption(what, taken, f"line {listed} {why}"))
        return made.replaced(assumed=assumed)


def _length(edge: Mapping[str, Any]) -> float:
    """Return the length [m] of an edge; infinite where it has none."""
    length = edge.get("length")
    return length if isinstance(length, int | float) else math.inf


def _kept(values: object, keys: tuple[str, ...]) -> dict[str, Any]:
    data = values if isinstance(values, dict) else {}
    return {key: data[key] for key in keys if data.get(key) is not None}
