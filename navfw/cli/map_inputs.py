"""Inputs of the commands about maps: the map, and the floor plan of its world."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navfw.recording.top_view import WorldOutline
    from navfw.sim.floorplan import FloorPlan
    from navfw.topomap import TopoMap


def find_map(name: str, both_ways: bool = False) -> TopoMap:
    """The map called ``name``, or in the file ``name`` of any supported format.

    Raises:
        InputError: it does not exist, or its file is invalid.

    """
    from navfw.config.lookup import find
    from navfw.features.landmark_appearance import check_landmark_kind
    from navfw.topomap.map_formats import SUFFIXES, load_any_map

    path = Path(name)
    foreign = path.suffix.lower() in SUFFIXES and path.suffix.lower() not in {".yaml", ".yml"}
    return load_any_map(path if foreign else find("map", name), both_ways, check_landmark_kind)


def floor_plan(topo_map: TopoMap, world: str | None) -> FloorPlan | None:
    """The floor plan of ``world``; by default of the world with the map's name, None without one.

    Raises:
        InputError: ``world`` does not exist, or its file is invalid.

    """
    from navfw.config.lookup import find, list_worlds
    from navfw.sim.floorplan import FloorPlan
    from navfw.sim.worldfile import load_world

    if world is None:
        known = {found.name: found.path for found in list_worlds()}
        file = known.get(topo_map.name)
    else:
        file = find("world", world)
    return None if file is None else FloorPlan.from_world(load_world(file))


def outline_for(topo_map: TopoMap, world: str | None) -> WorldOutline | None:
    """The outline, seen from above, of the world of ``floor_plan``; None without one."""
    from navfw.missions.world_outline import outline_of

    plan = floor_plan(topo_map, world)
    return None if plan is None else outline_of(plan)
