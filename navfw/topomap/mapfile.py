"""Map files in YAML: reading, with errors located by file, line and key, and writing.

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
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from navfw.config.document import YamlDocument, key_text, load_yaml
from navfw.config.lookup import find
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, MapError, did_you_mean
from navfw.topomap.elements import Landmark, MapViolation, Passage, Place, map_violations
from navfw.topomap.mapspec import MAX_BYTES, MAX_NODES, EdgeSpec, MapSpec
from navfw.topomap.occupancy_map import OccupancyMap
from navfw.topomap.ros_map import load_ros_map
from navfw.topomap.topological_map import TopoMap

_PLAIN = re.compile(r"(?!(?i:true|false|yes|no|on|off|null|nan|inf)$)[A-Za-z][\w-]*", re.ASCII)
"""Texts that YAML reads as text without quotes."""


KindCheck = Callable[[str], str]
"""Returns the name of a kind of landmark, or raises ValueError if there is none of that name."""

_SHIPPED_KINDS = ("aruco", "poster")


def _shipped_kind(name: str) -> str:
    if name not in _SHIPPED_KINDS:
        raise ValueError(f"unknown kind of landmark {name!r}: {did_you_mean(name, _SHIPPED_KINDS)}")
    return name


def load_map(name: str | Path, check_kind: KindCheck = _shipped_kind) -> TopoMap:
    """The map of that name or file; ``check_kind`` knows the kinds of landmark.

    Raises:
        UnknownNameError: there is no map of that name.
        ConfigError: the file cannot be read or breaks the schema.
        MapError: the map is invalid: an edge names a place that is missing, a length is
            impossible, a passage is given twice. The message lists every error, one a line.

    """
    return read_map(load_yaml(find("map", name), MAX_BYTES, MAX_NODES), check_kind)


def read_map(document: YamlDocument, check_kind: KindCheck = _shipped_kind) -> TopoMap:
    """The map in a parsed document; raises like ``load_map``."""
    spec = validate(document, MapSpec)
    for name, at in spec.landmarks.items():
        try:
            check_kind(at.kind)
        except ValueError as error:
            path = ("landmarks", name, "kind")
            line, key = document.line_of(path), key_text(path)
            raise ConfigError(str(error), file=document.file, line=line, key=key) from None
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
    plan = _floor_plan(document, spec)
    return TopoMap(spec.name, places, passages, document.file, landmarks, plan)


def map_data(topo_map: TopoMap, plan_file: str | None = None) -> dict[str, Any]:
    """``topo_map`` as plain data with the keys of a map file, without values that are defaults.

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
            mark.name: {
                key: getattr(mark, key) for key in ("kind", "id", "x", "y", "z", "yaw", "size")
            }
            for mark in topo_map.landmarks.values()
        }
    return data


def map_text(topo_map: TopoMap, plan_file: str | None = None) -> str:
    """The text of a map file, one line for each place, edge and landmark (see ``map_data``)."""
    data = map_data(topo_map, plan_file)
    lines = [f"{key}: {_scalar(data[key])}" for key in ("name", "floor_plan") if key in data]
    lines += ["", "places:"]
    lines += [f"  {_scalar(name)}: {_flow(values)}" for name, values in data["places"].items()]
    if data["edges"]:
        lines += ["", "edges:", *(f"  - {_flow(values)}" for values in data["edges"])]
    if "landmarks" in data:
        marks = data["landmarks"].items()
        lines += ["", "landmarks:", *(f"  {_scalar(name)}: {_flow(at)}" for name, at in marks)]
    return "\n".join(lines) + "\n"


def _floor_plan(document: YamlDocument, spec: MapSpec) -> OccupancyMap | None:
    """The floor plan that a map names, if it names one."""
    if spec.floor_plan is None:
        return None
    return load_ros_map(Path(document.file or "").parent / spec.floor_plan)


def _edge_data(topo_map: TopoMap, passage: Passage) -> dict[str, Any]:
    a, b = topo_map.places[passage.a], topo_map.places[passage.b]
    bare = _passage(EdgeSpec.model_validate({"from": a.name, "to": b.name}), {a.name: a, b.name: b})
    data: dict[str, Any] = {"from": passage.a, "to": passage.b}
    for key in ("length", "width", "danger", "doorness", "uncertainty"):
        value = getattr(passage, key)
        if value != getattr(bare, key) and math.isfinite(value):
            data[key] = value
    return data


def _flow(values: dict[str, Any]) -> str:
    return "{" + ", ".join(f"{key}: {_scalar(value)}" for key, value in values.items()) + "}"


def _scalar(value: str | float) -> str:
    """A scalar in YAML; texts in quotes where YAML would read them as another type."""
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) else f'"{"".join(map(_escaped, value))}"'
    # YAML reads 1e-07 as text: a number needs a point in its mantissa
    text = repr(float(value)) if isinstance(value, float) else str(value)
    return re.sub(r"^(-?\d+)e", r"\1.0e", text)


def _escaped(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08x}"


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


def _first_line(document: YamlDocument, violation: MapViolation) -> str:
    line = None if violation.first is None else document.line_of(violation.first)
    return "" if line is None else f" (the first is in line {line})"


def _map_error(document: YamlDocument, violations: Sequence[MapViolation]) -> MapError:
    """One error with all violations, in the order of the file, one a line."""
    errors = [
        MapError(
            violation.message + _first_line(document, violation),
            file=document.file,
            line=document.line_of(violation.where),
            key=key_text(violation.where),
        )
        for violation in violations
    ]
    errors.sort(key=lambda error: error.line or 0)
    if len(errors) == 1:
        return errors[0]
    return MapError("\n".join([f"{len(errors)} errors", *map(str, errors)]))
