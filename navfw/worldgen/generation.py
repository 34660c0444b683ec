"""Generates a traversable world with a mission from family, seed and difficulty."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import cast

import numpy as np

from navfw.errors import InputError, PluginError, UnknownNameError, WorldError, checked_seed
from navfw.guard import construct, contained
from navfw.interfaces import WorldFamily
from navfw.missions.missionfile import goals_map
from navfw.missions.missionspec import MissionSpec
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import MAX_CONTRAST, Look
from navfw.worldgen.corridors import Corridors
from navfw.worldgen.hard import Hard
from navfw.worldgen.looks import LOOKS, with_contrast, with_look
from navfw.worldgen.maze import Maze
from navfw.worldgen.open_areas import Clutter, Moving, Poles
from navfw.worldgen.rooms import Rooms
from navfw.worldgen.world_draft import (
    MAP_FILE,
    MIN_PATH,
    MISSION,
    ROBOT,
    MadeWorld,
    Unsuitable,
    WorldDraft,
)

_SHIPPED: dict[str, type[WorldFamily]] = {
    family.name: family for family in (Rooms, Clutter, Corridors, Maze, Moving, Poles, Hard)
}
"""The shipped families by name."""

FAMILIES = tuple(_SHIPPED)
"""Names of the shipped families."""


@dataclass(frozen=True, kw_only=True)
class GeneratedWorld(MadeWorld):
    """The world of a family.

    ``shortest`` [m] is the length of the shortest path for the default robot, ``attempt`` the
    number of sub-seeds that were discarded before it.
    """

    shortest: float
    attempt: int


_ATTEMPTS = 60
"""Largest number of sub-seeds tried; tested seeds need only a few."""


def _family(name: str) -> WorldFamily:
    """Return the family of that name: a shipped one, or a plugin."""
    kind = _SHIPPED.get(name)
    if kind is None:
        from navfw.plugins import default_registry

        kind = cast(type[WorldFamily], default_registry().get("family", name))
    return construct(kind, ROBOT)


def generate(
    family: str,
    seed: int,
    difficulty: float = 0.5,
    contrast: float | None = None,
    look: Look | None = None,
) -> GeneratedWorld:
    """Generate the world of a family and seed; the same arguments give the same world.

    With ``contrast`` [grey levels] every surface has that contrast instead of its own, with
    ``look`` surfaces have that look; all else is the same.

    A draw without a path for the robot with a margin, or with a path shorter than ``MIN_PATH``, is
    discarded, and the next sub-seed is tried.

    Raises:
        UnknownNameError: no family or look has that name.
        PluginError: the family's plugin is broken.
        InputError: the seed is negative, the difficulty is not in [0, 1], the contrast is not
            that of a texture, or a look is given together with a contrast.

    """
    seed = checked_seed(seed)
    _check(difficulty, contrast, look)
    build = _family(family).build
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([zlib.crc32(family.encode()), seed, attempt])
        try:
            with contained(f"family {family}", Unsuitable):
                draft = build(rng, difficulty)
            if not isinstance(draft, WorldDraft):
                what = f"build returned {type(draft).__name__}, not a WorldDraft"
                raise PluginError(what, key=f"family {family}")
            world = draft.world(f"{family}-{seed}")
            check_world(world)
            shortest = _shortest_path(draft)
        except Unsuitable:
            continue
        if contrast is not None:
            world = with_contrast(world, contrast)
        if look is not None:
            world = with_look(world, look, seed)
        return GeneratedWorld(
            world=world,
            missions={MISSION: _mission(draft, family, difficulty, shortest)},
            topo_map=draft.topo_map or goals_map([draft.start[:2], draft.goal]),
            shortest=shortest,
            attempt=attempt,
        )
    raise InputError(
        f"{family} with seed {seed} and difficulty {difficulty:g} gave no traversable world in"
        f" {_ATTEMPTS} attempts; choose another seed"
    )


def _check(difficulty: float, contrast: float | None, look: Look | None) -> None:
    """Raise InputError or UnknownNameError, like ``generate``."""
    if not 0.0 <= difficulty <= 1.0:
        raise InputError(f"expected 0 to 1, got {difficulty:g}", key="difficulty")
    if contrast is not None and not 0.0 <= contrast <= MAX_CONTRAST:
        what = f"expected 0 to {MAX_CONTRAST:g} grey levels, got {contrast:g}"
        raise InputError(what, key="contrast")
    if look is not None and look not in LOOKS:
        raise UnknownNameError("look", look, LOOKS)
    if look is not None and contrast is not None:
        raise InputError("a look has contrasts of its own: leave out one of them", key="contrast")


def _shortest_path(draft: WorldDraft) -> float:
    """Return the length [m] of the shortest path for the default robot; raises Unsuitable."""
    plan, start = draft.geometry(), draft.start[:2]
    try:
        # with the margin first: a path that only just fits does not count
        plan.shortest_path(start, draft.goal, draft.clearance)
        shortest = plan.shortest_path(start, draft.goal, ROBOT.radius)[0]
    except WorldError as error:
        raise Unsuitable(str(error)) from None
    if shortest < MIN_PATH:
        raise Unsuitable(f"a path of only {shortest:.1f} m")
    return shortest


def _mission(draft: WorldDraft, family: str, difficulty: float, shortest: float) -> MissionSpec:
    goal: object = draft.goal_place or {"x": draft.goal[0], "y": draft.goal[1]}
    data: dict[str, object] = {
        "description": f"Cross the {family} (difficulty {difficulty:g}), {shortest:.1f} m.",
        "start": draft.start,
        "goals": [goal],
        "tolerance": 0.15,
        # a quarter of the top speed suffices
        "timeout": float(round(draft.time_allowance + 8.0 * shortest)),
    }
    if draft.topo_map is not None:
        data["map"] = f"../{MAP_FILE}"
    if draft.robot is not ROBOT:
        data["robot"] = draft.robot
    if draft.stack is not None:
        data["stack"] = draft.stack
    if draft.events:
        data["events"] = draft.events
    return MissionSpec.model_validate(data)
