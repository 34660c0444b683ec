"""The check of world, mission, stack and overrides by their files alone, before any run."""

from __future__ import annotations

from pathlib import Path

from navfw.config.lookup import find, find_mission
from navfw.config.overrides import Settings, override_texts
from navfw.missions.missionfile import load_mission
from navfw.missions.run_options import chosen_stack, split_overrides
from navfw.missions.session import with_drops
from navfw.sim.worldfile import load_world
from navfw.stack.stackfile import load_stack


def check_inputs(
    world: str | Path,
    mission: str | Path,
    *,
    stack: str | Path | None = None,
    overrides: Settings = (),
) -> None:
    """Check the files that ``navfw.missions.session.prepare`` reads, in a part of its time.

    What shows only in the floor plan, such as a goal within a wall, is not checked.

    Raises:
        InputError: one of them does not exist, breaks its schema, or contradicts another.

    """
    from navfw.plugins import default_registry

    for_mission, for_stack = split_overrides(override_texts(overrides))
    loaded_world = load_world(find("world", world))
    loaded = load_mission(find_mission(world, mission), for_mission)
    with_drops(loaded_world, loaded)
    stack_file = chosen_stack(loaded, stack)
    load_stack(stack_file, default_registry(), for_stack)
