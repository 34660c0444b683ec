"""The topological map: places and the passages between them, its files, and where the robot is."""

from __future__ import annotations

from navfw.topomap.files import load_map
from navfw.topomap.model import Footing, Passage, Place, PlaceKind, TopoMap

__all__ = ["Footing", "Passage", "Place", "PlaceKind", "TopoMap", "load_map"]
