"""The topological map: places, passages and landmarks; its files, checks, and maps from geometry.

``elements`` and ``mapspec`` are plain data, ``topological_map`` holds
them as a graph, ``mapfile`` and ``map_formats`` read and write them. ``map_check`` reports what is
suspect in a valid map; ``map_builder`` derives a map from a world's geometry, ``landmark_mapping``
estimates landmark poses from a drive. ``occupancy_map`` is the floor plan that a map may come with,
``ros_map`` its files.

``load_map``, ``TopoMap`` and ``PassageProjection`` are imported on first access, with the library
for graphs: the keys and limits of a map file need none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfw.lazy_names import first_access
from navfw.topomap.elements import (
    PLACE_KINDS,
    Landmark,
    Passage,
    Place,
    PlaceKind,
)

if TYPE_CHECKING:
    from navfw.topomap.mapfile import load_map
    from navfw.topomap.topological_map import PassageProjection, TopoMap

__all__ = [
    "PLACE_KINDS",
    "Landmark",
    "Passage",
    "PassageProjection",
    "Place",
    "PlaceKind",
    "TopoMap",
    "load_map",
]

_HOMES = {
    "PassageProjection": "navfw.topomap.topological_map",
    "TopoMap": "navfw.topomap.topological_map",
    "load_map": "navfw.topomap.mapfile",
}


def __getattr__(name: str) -> Any:
    return first_access(__name__, name, _HOMES)
