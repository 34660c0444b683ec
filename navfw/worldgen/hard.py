"""The family ``hard``: rooms that differ from their map, with many sources of failure.

Map and floor plan are those of the rooms as ``rooms`` makes them. Then hazards change only the
world; it lists its hazards, so that failures can be counted by them. ``VERSION`` names the frozen
family: a change of its worlds is a new version.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import ClassVar

import networkx as nx
import numpy as np

from navfw.errors import WorldError
from navfw.sim.shapes import Circle
from navfw.sim.worldspec import DoorSpec, LightSpec, OpeningSpec
from navfw.worldgen.open_areas import add_person
from navfw.worldgen.plan_exchange import exported_plan
from navfw.worldgen.rooms import DOOR_TO_CORNER, Rooms, furnish, inner_spans
from navfw.worldgen.world_draft import WALL, Unsuitable, WorldDraft, blend

VERSION = "navfw-hard-v1"
"""Name and version of the family's worlds."""

_STACK = "default"
"""The stack whose successes calibrated the family."""

_ENDS_FREE, _DOORS_FREE = 0.55, 0.6
"""Radius [m] around start and goal, and around doors, in which no furniture is added."""

_CLOSES_WITHIN = 1.3
"""Distance of the robot from a door at which it closes [m]: the robot sees it and can avoid it."""

_ELEVATION = 0.25
"""Slope of the rays of the low sun: walls that face it are glaring, the floor is not."""


class Hard(Rooms):
    """Four to six rooms with hazards that their map lacks: navfw-hard-v1."""

    name: ClassVar[str] = "hard"
    loops: ClassVar[float] = 0.9

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw furnished rooms; more hazards, and stronger ones, when difficult."""
        draft = super().build(rng, blend(0.5, 1.0, difficulty))
        if draft.topo_map is None:
            raise Unsuitable("rooms without a map")
        plan = exported_plan(draft.world("plan"), walls_only=True)
        draft.topo_map = draft.topo_map.replaced(name="generated-hard", floor_plan=plan)
        draft.stack = _STACK
        chance = blend(0.35, 0.65, difficulty)
        drawn = [name for name in _HAZARDS if rng.random() < chance]
        draft.hazards = [name for name in drawn if _HAZARDS[name](draft, difficulty)]
        # closed until here, so that hazards leave a way beside it
        draft.doors = [door.model_copy(update={"state": "open"}) for door in draft.doors]
        hazards = ", ".join(draft.hazards) or "no hazards"
        draft.description = f"{VERSION}: {len(draft.rooms)} furnished rooms with {hazards}."
        return draft


def _narrow_doors(draft: WorldDraft, difficulty: float) -> bool:
    """Make the doors narrower than on the map."""
    width = blend(0.74, 0.6, difficulty)
    _change_doors(
        draft, lambda door, axis: {"width": round(float(draft.rng.uniform(width, 0.78)), 2)}
    )
    return True


def _move_doors(draft: WorldDraft, difficulty: float) -> bool:
    """Move the doors along their walls: where the map has a door there is a wall, in part."""

    def moved(door: OpeningSpec, axis: int) -> Mapping[str, object]:
        farthest = DOOR_TO_CORNER - 0.5 * door.width - WALL
        off = blend(0.5, 0.9, difficulty) * farthest * float(draft.rng.choice((-1.0, 1.0)))
        x, y = door.at
        return {"at": (round(x + off, 3), y) if axis == 0 else (x, round(y + off, 3))}

    _change_doors(draft, moved)
    return True


def _furnish_more(draft: WorldDraft, difficulty: float) -> bool:
    """Add furniture that the map lacks, also on its passages."""
    doors = [door.at for wall in draft.walls for door in wall.openings]
    draft.free = [Circle(*at, _DOORS_FREE) for at in doors]
    draft.free += [Circle(*at, _ENDS_FREE) for at in (draft.start[:2], draft.goal)]
    before = len(draft.shapes)
    rooms = [(room.name, *inner_spans(draft, room)) for room in draft.rooms]
    furnish(draft, rooms, density=blend(0.2, 0.4, difficulty), gap=blend(0.75, 0.62, difficulty))
    return len(draft.shapes) > before


def _close_door(draft: WorldDraft, difficulty: float) -> bool:
    """Let a door on the shortest route close as the robot comes, if map and world have another."""
    del difficulty
    if draft.topo_map is None:
        return False
    graph, ends = draft.topo_map.graph, (draft.start[:2], draft.goal)
    route = nx.dijkstra_path(graph, "start", "goal", weight="length")
    for name in [name for name in route if draft.topo_map.places[name].kind == "door"]:
        if not nx.has_path(nx.restricted_view(graph, [name], []), "start", "goal"):
            continue
        draft.doors = [DoorSpec(name=f"{name}-leaf", opening=name)]
        with contextlib.suppress(WorldError):
            draft.time_allowance += 8.0 * draft.geometry().shortest_path(*ends, draft.clearance)[0]
            near = {"place": name, "within": _CLOSES_WITHIN}
            draft.events = [{"near": near, "door": {"name": f"{name}-leaf", "state": "closed"}}]
            return True
    draft.doors = []
    return False


def _add_walkers(draft: WorldDraft, difficulty: float) -> bool:
    """Add people who do not yield, each in a room of their own."""
    clothes, plan = draft.palette.draw("person"), draft.geometry()
    for index in draft.rng.permutation(len(draft.rooms)):
        area = inner_spans(draft, draft.rooms[index])
        if len(draft.movers) < round(blend(1.0, 3.0, difficulty)):
            with contextlib.suppress(Unsuitable):
                add_person(draft, plan, f"person-{index + 1}", False, clothes, area)
    return bool(draft.movers)


def _fade(draft: WorldDraft, difficulty: float) -> bool:
    """Lower the contrast of all surfaces."""
    for name, texture in draft.palette.textures.items():
        contrast = float(draft.rng.uniform(blend(8.0, 4.5, difficulty), 13.0))
        update = {"contrast": round(contrast, 1)}
        draft.palette.textures[name] = texture.model_copy(update=update)
    return True


def _dazzle(draft: WorldDraft, difficulty: float) -> bool:
    """Let a low sun shine in: walls that face it are overexposed."""
    yaw = float(draft.rng.uniform(-math.pi, math.pi))
    direction = round(math.cos(yaw), 3), round(math.sin(yaw), 3), _ELEVATION
    draft.light = LightSpec(
        direction=direction, ambient=0.6, diffuse=round(blend(0.8, 1.4, difficulty), 3)
    )
    return True


_HAZARDS: Mapping[str, Callable[[WorldDraft, float], bool]] = MappingProxyType(
    {
        "narrow doors": _narrow_doors,
        "moved doors": _move_doors,
        "unmapped furniture": _furnish_more,
        "closing door": _close_door,
        "walkers": _add_walkers,
        "low contrast": _fade,
        "glare": _dazzle,
    }
)
"""By name, in the order in which they change a draft; each returns False if it found no place."""


def _change_doors(
    draft: WorldDraft, change: Callable[[OpeningSpec, int], Mapping[str, object]]
) -> None:
    """Change all doors; ``change`` gets each with the axis of its wall (0: along x)."""
    for index, wall in enumerate(draft.walls):
        axis = int(wall.points[0][0] == wall.points[1][0])
        openings = tuple(door.model_copy(update=change(door, axis)) for door in wall.openings)
        draft.walls[index] = wall.model_copy(update={"openings": openings})
