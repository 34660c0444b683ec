"""Map files: YAML in, with every mistake named by file, line and key; YAML out.

::

    name: office
    places:
      lobby: {x: 2.0, y: 2.0, kind: room}
      lobby-door: {x: 3.2, y: 4.2, kind: door}
    edges:
      - {from: lobby, to: lobby-door, width: 0.95}
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from navfw.config.yamlfile import YamlDocument, key_text, load_yaml, validate
from navfw.errors import MapError
from navfw.topomap.contradictions import Contradiction, contradictions
from navfw.topomap.model import Passage, Place, PlaceKind, TopoMap

__all__ = ["EdgeSpec", "MapSpec", "PlaceSpec", "load_map", "read_map"]

MAX_BYTES = 8_000_000
"""Room for maps of some ten thousand places."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]


class _Spec(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class PlaceSpec(_Spec):
    """A place as the file has it."""

    x: Annotated[Coordinate, Field(description="in the map frame [m]")]
    y: Annotated[Coordinate, Field(description="in the map frame [m]")]
    kind: Annotated[PlaceKind, Field(description="what a robot finds there")] = "room"


class EdgeSpec(_Spec):
    """A passage as the file has it; lengths that are wrong are found with the places known."""

    from_: Annotated[str, Field(alias="from", description="a place")]
    to: Annotated[str, Field(description="another place")]
    length: Annotated[
        float | None, Field(description="[m]; the straight distance when left out")
    ] = None
    width: Annotated[
        float | None, Field(description="free width at the narrowest point [m]; wide open if none")
    ] = None
    danger: Annotated[
        Share | None, Field(description="0 to 1; 1 at danger places, else 0, when left out")
    ] = None
    doorness: Annotated[
        Share | None, Field(description="0 to 1; 1 at door places, else 0, when left out")
    ] = None
    uncertainty: Annotated[Share, Field(description="0 to 1: is it open at all?")] = 0.0


class MapSpec(_Spec):
    """A whole map file."""

    name: Annotated[str, Field(min_length=1, description="of the map")]
    places: Annotated[dict[str, PlaceSpec], Field(description="by name")]
    edges: Annotated[list[EdgeSpec], Field(description="passages between places")] = []


def load_map(path: str | Path) -> TopoMap:
    """The map in the file at ``path``.

    Raises:
        ConfigError: the file cannot be read or breaks the schema.
        MapError: what it says contradicts itself: an edge names a place that is missing, a length
            is impossible, a passage is given twice. The message lists all of it, a line each.

    """
    return read_map(load_yaml(path, max_bytes=MAX_BYTES))


def read_map(document: YamlDocument) -> TopoMap:
    """The map in a document that has been read already; raises like ``load_map``."""
    spec = validate(document, MapSpec)
    places = [Place(name, at.x, at.y, at.kind) for name, at in spec.places.items()]
    known = {place.name: place for place in places}
    passages = [_passage(edge, known) for edge in spec.edges]
    found = contradictions(places, passages)
    if found:
        raise _map_error(document, found)
    return TopoMap(spec.name, places, passages, file=document.file)


def _passage(edge: EdgeSpec, places: dict[str, Place]) -> Passage:
    ends = [places[name] for name in (edge.from_, edge.to) if name in places]
    kinds = {place.kind for place in ends}
    # with an end missing there is no length to tell; the missing end is what gets reported
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


def _map_error(document: YamlDocument, found: Sequence[Contradiction]) -> MapError:
    """One error for all contradictions, in the order of the file, one a line."""
    errors = [
        MapError(
            each.message,
            file=document.file,
            line=document.line_of(each.where),
            key=key_text(each.where),
        )
        for each in found
    ]
    errors.sort(key=lambda error: error.line or 0)
    if len(errors) == 1:
        return errors[0]
    return MapError("\n".join([f"{len(errors)} contradictions", *map(str, errors)]))
