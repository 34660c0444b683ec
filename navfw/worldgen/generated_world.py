"""What a generator gives: a world, a mission in it, and a map; and how it becomes a folder."""

from __future__ import annotations

import io
import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from navfw.errors import InputError
from navfw.missions.missionspec import MissionSpec
from navfw.sim.worldspec import WorldSpec
from navfw.topomap import TopoMap

__all__ = ["MAP_FILE", "MISSION", "GeneratedWorld", "write_world"]

MISSION = "cross"
"""Name of the mission in a written folder."""

MAP_FILE = "map.yaml"
"""The map in a written folder, beside ``world.yaml``."""

_HEADER = "# Made by navfw"
_NOTICE = f"{_HEADER}; whoever makes it again loses changes.\n"


@dataclass(frozen=True)
class GeneratedWorld:
    """A world, a mission that can be accomplished in it, and a topological map.

    Where a family has no map (``has_map`` is false), ``topo_map`` holds start and goal alone and
    the mission names no map. ``shortest`` [m] is the length of the shortest way for the mission's
    robot; ``attempt`` counts the sub-seeds that gave no passable world before this one.
    """

    family: str
    seed: int
    difficulty: float
    world: WorldSpec
    mission: MissionSpec
    topo_map: TopoMap
    has_map: bool
    shortest: float
    attempt: int = 0

    def write(self, folder: str | Path) -> Path:
        """Write ``world.yaml``, ``missions/cross.yaml`` and the map, if any; returns the folder.

        Raises:
            InputError: the folder cannot be written, or holds what was not written by this.

        """
        return write_world(
            folder, self.world, self.mission, self.topo_map if self.has_map else None
        )


def write_world(
    folder: str | Path, world: WorldSpec, mission: MissionSpec, topo_map: TopoMap | None
) -> Path:
    """Write a world's folder as ``navfw run FOLDER cross`` reads it; an older one is replaced.

    Raises:
        InputError: the folder cannot be written, or holds what was not written by this.

    """
    folder = Path(folder)
    _check_target(folder)
    try:
        missions = folder / "missions"
        missions.mkdir(parents=True, exist_ok=True)
        _write_yaml(folder / "world.yaml", _plain(world))
        _write_yaml(missions / f"{MISSION}.yaml", _plain(mission))
        if topo_map is not None:
            _write_yaml(folder / MAP_FILE, map_data(topo_map))
        else:
            (folder / MAP_FILE).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=folder) from None
    return folder


def _check_target(folder: Path) -> None:
    """Overwrite nothing but what was made here before."""
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file; choose a folder to write the world to", file=folder)
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    try:
        with (folder / "world.yaml").open(encoding="utf-8") as stream:
            made_here = stream.readline().startswith(_HEADER)
    except (OSError, UnicodeDecodeError):
        made_here = False
    if not made_here:
        raise InputError(
            "is not empty, and what it holds was not made by navfw; choose another folder",
            file=folder,
        )


def map_data(topo_map: TopoMap) -> dict[str, Any]:
    """``topo_map`` as a map file has it."""
    edges = []
    for passage in topo_map.passages:
        edge: dict[str, Any] = {"from": passage.a, "to": passage.b}
        straight = topo_map.places[passage.a].distance(*_at(topo_map, passage.b))
        if abs(passage.length - straight) > 0.005:
            edge["length"] = round(passage.length, 3)
        if math.isfinite(passage.width):
            edge["width"] = round(passage.width, 3)
        edges.append(edge)
    places = {p.name: {"x": p.x, "y": p.y, "kind": p.kind} for p in topo_map.places.values()}
    return {"name": topo_map.name, "places": places, "edges": edges}


def _at(topo_map: TopoMap, name: str) -> tuple[float, float]:
    place = topo_map.places[name]
    return place.x, place.y


def _plain(spec: WorldSpec | MissionSpec) -> dict[str, Any]:
    data: dict[str, Any] = spec.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    return data


def _write_yaml(path: Path, data: Mapping[str, Any]) -> None:
    """One entry of every list a line: as a person would write it."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None  # innermost collections inline, the others as blocks
    yaml.width = 100
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    stream = io.StringIO()
    yaml.dump(dict(data), stream)
    part = path.with_suffix(".part")
    part.write_text(_NOTICE + stream.getvalue(), encoding="utf-8")
    shutil.move(part, path)
