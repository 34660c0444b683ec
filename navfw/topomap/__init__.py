"""The topological map: places, passages and landmarks, its files, and where the robot is."""

from __future__ import annotations

from navfw.topomap.files import load_map
from navfw.topomap.model import (
    Footing,
    Landmark,
    LandmarkKind,
    Passage,
    Place,
    PlaceKind,
    TopoMap,
)

__all__ = [
    "Footing",
    "Landmark",
    "LandmarkKind",
    "Passage",
    "Place",
    "PlaceKind",
    "TopoMap",
    "load_map",
]
