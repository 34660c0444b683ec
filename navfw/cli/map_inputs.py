"""What the commands about maps share: finding a map, and the world that it is a map of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navfw.recording.top_view import WorldOutline
    from navfw.sim.floorplan import FloorPlan
    from navfw.topomap import TopoMap

__all__ = ["find_map", "floor_plan", "outline_for"]


def find_map(name: str, both_ways: bool = False) -> TopoMap:
    """The map of that name, or in the file of any format.

    Raises:
        InputError: there is none, or it is not usable.

    """
    from navfw.config.lookup import find
    from navfw.topomap.map_formats import SUFFIXES, load_any_map

    path = Path(name)
    foreign = path.suffix.lower() in SUFFIXES and path.suffix.lower() not in {".yaml", ".yml"}
    return load_any_map(path if foreign else find("map", name), both_ways)


def floor_plan(topo_map: TopoMap, world: str | None) -> FloorPlan | None:
    """The floor plan of the world named, or else of the one with the map's name, if there is one.

    Raises:
        InputError: there is no world of the name given, or its file is wrong.

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
    """The world seen from above, where ``floor_plan`` finds one."""
    from navfw.missions.run_report import outline_of

    plan = floor_plan(topo_map, world)
    return None if plan is None else outline_of(plan)
