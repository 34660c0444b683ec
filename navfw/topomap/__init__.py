"""The topological map: places, passages and landmarks; its files, checks, and maps from geometry.

``elements`` and ``mapspec`` are plain data, ``validation`` checks them, ``topological_map`` holds
them as a graph, ``mapfile`` and ``map_formats`` read and write them. ``map_check`` reports what is
suspect in a valid map; ``map_builder`` derives a map from a world's geometry, ``landmark_mapping``
estimates landmark poses from a drive.
"""

from __future__ import annotations

from navfw.topomap.elements import (
    PLACE_KINDS,
    Landmark,
    Passage,
    Place,
    PlaceKind,
)
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
