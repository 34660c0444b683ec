"""Find, load and cross-check world, mission and stack, and make a run of them.

>>> import navfw
>>> result = navfw.run("office", "lobby-to-lab", seed=1)              # doctest: +SKIP
>>> result.outcome, result.spl                                        # doctest: +SKIP
>>> with navfw.open_session("office", "lobby-to-lab") as session:     # doctest: +SKIP
...     for tick in session:
...         print(tick.time, tick.command, tick.true_pose)
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from navfw.config.lookup import find, find_mission
from navfw.config.overrides import Override, Settings, override_texts, parse_override
from navfw.errors import ConfigError, UnknownNameError, checked_seed
from navfw.missions.mission_events import resolve_events, with_doors_open
from navfw.missions.missionfile import (
    Destination,
    MissionFile,
    exploration_of,
    load_mission,
    mission_to,
)
from navfw.missions.session import MissionResult, Session, SteppedSession
from navfw.plugins import Registry, default_registry
from navfw.robot.robotfile import robot_section
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.simulation import Simulation
from navfw.sim.world_check import check_world
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack
from navfw.stack.stack_document import read_stack

Mission: TypeAlias = str | Path | tuple[float, float] | Destination | None
"""A mission's name or file; or a point x, y [m] or destination to drive to from the start of the
world's first mission with a known start; None: an exploration from that start."""

_DEFAULT_STACK, _FLOOR_PLAN_STACK, _LANDMARK_STACK = "default", "floor_plan", "landmarks"
"""The stacks of a mission that names none: without a floor plan, with one, with landmarks."""
_EXPLORE_STACK, _EXPLORER = "explore", "explorer"
"""The stack of an exploration that names none; its planner, which gets limit and return."""

_MISSION_PARTS = ("robot", "sensors")
"""Keys of a mission file that overrides may begin with; others need the prefix ``mission.``."""


def run(
    world: str | Path,
    mission: Mission,
    *,
    seed: int = 0,
    stack: str | Path | None = None,
    set: Settings = (),  # noqa: A002 - as on the command line
    record: bool = False,
) -> MissionResult:
    """Drive a mission to its end, as ``navfw run`` does, without writing files.

    Without ``stack``, ``chosen_stack`` takes the mission's own or a default. ``set`` changes
    values, by texts as for ``--set`` or by a mapping such as ``{"avoid.latency": 0.5}``. With
    ``record`` the result has a recording, for ``navfw.missions.run_report.write_run``.

    Raises:
        InputError: world, mission, seed, stack or ``set`` is wrong, or the stack refuses the
            mission.
        KeyboardInterrupt: the user has stopped the run.

    """
    result = prepare(world, mission, seed=seed, stack=stack, overrides=set).run(record=record)
    if result.outcome == "cancelled":  # caught by the loop, and meant for the caller as well
        raise KeyboardInterrupt
    return result


def open_session(
    world: str | Path,
    mission: Mission,
    *,
    seed: int = 0,
    stack: str | Path | None = None,
    set: Settings = (),  # noqa: A002 - as on the command line
) -> SteppedSession:
    """Open a mission that you step tick by tick: a context manager, and an iterator.

    Raises:
        InputError: world, mission, seed, stack or ``set`` is wrong.

    """
    return SteppedSession(prepare(world, mission, seed=seed, stack=stack, overrides=set))


def open_simulation(world: str | Path, mission: Mission, *, seed: int = 0) -> Simulation:
    """Open the simulated robot of a mission at its start, for a program of your own that drives it.

    Use it as a context manager. ``read`` returns what its sensors measure, ``drive`` sets the
    wheels' speeds, ``advance`` lets time pass.

    Raises:
        InputError: world, mission or seed is wrong.

    """
    return prepare(world, mission, seed=seed).simulation()


def prepare(
    world: str | Path,
    mission: Mission,
    *,
    seed: int = 0,
    stack: str | Path | None = None,
    overrides: Settings = (),
    registry: Registry | None = None,
) -> Session:
    """Load world, mission, map and stack, and check them against each other.

    ``stack`` is resolved by ``chosen_stack``. ``overrides`` that begin with ``mission.``
    (``mission.timeout=60``), ``robot.`` or ``sensors.`` apply to the mission, all others
    (``offis.layers=1``) to the stack.

    Raises:
        InputError: one of them does not exist, breaks its schema, or contradicts another; the
            message has file, line and key.

    """
    texts = override_texts(overrides)
    for_mission, _ = split_overrides(texts)
    world_file = find("world", world)
    if mission is None:
        loaded = exploration_of(world, for_mission)
    elif isinstance(mission, tuple | Destination):
        to = Destination(mission) if isinstance(mission, tuple) else mission
        loaded = mission_to(world, to, for_mission)
    else:
        loaded = load_mission(find_mission(world, mission), for_mission)
    spec, name = load_world(world_file), world_file.parent.name
    return session_of(spec, loaded, name, seed, stack, texts, registry or default_registry())


def session_of(
    world: WorldSpec,
    mission: MissionFile,
    world_name: str,
    seed: int,
    stack: str | Path | None,
    overrides: tuple[str, ...],
    registry: Registry,
) -> Session:
    """Make the session of a loaded mission in ``world``; only overrides of the stack are applied.

    Raises:
        InputError: world, mission and stack contradict each other.

    """
    seed = checked_seed(seed)
    world = with_drops(world, mission)
    spec = mission.spec
    plan = SceneGeometry.from_world(world, spec.robot.height)
    with_all_ways = SceneGeometry.from_world(with_doors_open(world, spec.events), spec.robot.height)
    mission = mission.placed(seed, with_all_ways)
    shortest = mission.check(with_all_ways)
    stack_file = chosen_stack(mission, stack)
    _, for_stack = split_overrides(overrides)
    for_stack = [*_task_of(mission, stack_file), *for_stack]
    built = Stack.load(stack_file, spec.robot, mission.topo_map, registry, for_stack)
    return Session(
        world_name=world_name,
        mission_name=mission.file.stem,
        seed=seed,
        world=world,
        plan=plan,
        mission=mission,
        shortest=shortest,
        passable=with_all_ways,
        stack_file=stack_file,
        stack=built,
        overrides=overrides,
        events=resolve_events(mission, world, built, registry),
    )


def with_drops(world: WorldSpec, mission: MissionFile) -> WorldSpec:
    """Return ``world`` with the drops that the mission adds to its floor.

    Raises:
        WorldError: a drop contradicts the world; the message has the mission's file, line and key.

    """
    drops = mission.spec.drops
    if not drops:
        return world
    changed = world.model_copy(update={"drops": (*drops, *world.drops)})
    # the world has been checked, and the mission's drops come first: indices are those of its file
    check_world(changed, file=mission.file, line_of=mission.document.line_of)
    return changed


def chosen_stack(mission: MissionFile, stack: str | Path | None = None) -> Path:
    """Find the file of ``stack``; without one, of the stack that the mission names.

    If it names none, it is ``explore`` for an exploration, ``floor_plan`` where its map has a floor
    plan, else ``default``; ``landmarks`` if a map with a plan has them and the start is unknown.

    Raises:
        UnknownNameError: there is no stack of that name; for the mission's, the message has its
            file and line.

    """
    if stack is not None:
        return find("stack", stack)
    unnamed = _DEFAULT_STACK if mission.topo_map.floor_plan is None else _FLOOR_PLAN_STACK
    if unnamed == _FLOOR_PLAN_STACK and mission.topo_map.landmarks and not mission.start_known:
        unnamed = _LANDMARK_STACK  # they tell rooms apart that have the same walls
    unnamed = _EXPLORE_STACK if mission.spec.explore else unnamed
    with mission.document.locating(("stack",), only=UnknownNameError):
        return find("stack", mission.spec.stack or unnamed)


def _task_of(mission: MissionFile, stack_file: Path) -> list[str]:
    """What the planner gets of an exploration, as overrides: its time, and whether to return.

    Raises:
        ConfigError: the stack does not grow a map, without which no planner can explore.

    """
    explore = mission.spec.explore
    if explore is None:
        return []
    stack = read_stack(stack_file)
    if not stack.data.get("growing_map"):
        what = f"the stack {stack_file.stem!r} has no `growing_map: true`, without which nothing is"
        raise ConfigError(f"{what} explored; take the stack explore, or base: explore")
    if _EXPLORER not in (stack.data.get("planner") or {}):
        return []  # a planner of the user's own has its own parameters
    back = json.dumps(explore.return_home)
    return [f"{_EXPLORER}.limit={explore.limit!r}", f"{_EXPLORER}.return_home={back}"]


def split_overrides(overrides: Sequence[str]) -> tuple[list[Override], list[str]]:
    """Split overrides into those for the mission file, and the others, which are for the stack.

    ``robot=NAME`` replaces the whole robot of the mission.

    >>> mission, stack = split_overrides(["mission.timeout=9", "robot.radius=1", "dis.x=1"])
    >>> [override.path for override in mission], stack
    ([('timeout',), ('robot', 'radius')], ['dis.x=1'])

    Raises:
        ConfigError: one is malformed.

    """
    for_mission: list[Override] = []
    for_stack: list[str] = []
    for text in overrides:
        override = parse_override(text)
        if override.path[0] == "mission" and len(override.path) > 1:
            for_mission.append(Override(override.path[1:], override.value, override.text))
        elif override.path == ("robot",):
            for_mission.append(replace(override, value=robot_section(override.value)))
        elif override.path[0] in _MISSION_PARTS:
            for_mission.append(override)
        else:
            for_stack.append(text)
    return for_mission, for_stack
