"""The session of one run: from files, or in a generated world."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from navfw.config.document import parse_yaml
from navfw.config.overrides import apply_overrides
from navfw.errors import ConfigError, WorldError
from navfw.missions.event_check import resolve_events
from navfw.missions.missionfile import MissionFile
from navfw.missions.missionspec import MissionSpec, PlaceStart, PointGoal, mission_spec
from navfw.missions.run_options import chosen_stack, split_overrides
from navfw.missions.session import Session, prepare
from navfw.signals import Pose, Waypoint
from navfw.sim.floorplan import FloorPlan
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack
from navfw.suite.suitefile import Look
from navfw.topomap import TopoMap

if TYPE_CHECKING:
    from navfw.plugins import Registry

_DEFAULT_DIFFICULTY = 0.5
"""Difficulty of generated worlds in entries without one: the middle of the range 0 to 1."""


class Generated(Protocol):
    """The result of a world generator (``navfw.worldgen.GeneratedWorld``)."""

    @property
    def world(self) -> WorldSpec: ...  # noqa: D102
    @property
    def mission(self) -> MissionSpec: ...  # noqa: D102
    @property
    def topo_map(self) -> TopoMap: ...  # noqa: D102


def generate(
    family: str,
    seed: int,
    difficulty: float,
    contrast: float | None = None,
    look: Look | None = None,
) -> Generated:
    """A generated world; raises InputError if there is no such family."""
    from navfw import worldgen

    made: Generated = worldgen.generate(family, seed, difficulty, contrast, look)
    return made


def prepared_session(
    world: str,
    mission: str,
    seed: int,
    *,
    stack: str | None,
    overrides: Sequence[str],
    registry: Registry,
) -> Session:
    """The session of a world and mission in files (see ``navfw.missions.session.prepare``)."""
    return prepare(world, mission, seed=seed, stack=stack, overrides=overrides, registry=registry)


def generated_session(
    family: str,
    seed: int,
    difficulty: float | None,
    contrast: float | None = None,
    look: Look | None = None,
    *,
    stack: str | None,
    overrides: Sequence[str],
    registry: Registry,
    world_name: str,
) -> Session:
    """The session of a generated world; ``seed`` determines the world and all noise.

    ``stack`` is that of ``navfw.missions.run_options.chosen_stack``.

    Raises:
        InputError: there is no such family or difficulty, an override is invalid, or the mission is
            impossible in the world.

    """
    difficulty = _DEFAULT_DIFFICULTY if difficulty is None else difficulty
    made = generate(family, seed, difficulty, contrast, look)
    for_mission, for_stack = split_overrides(overrides)
    text = json.dumps(made.mission.model_dump(mode="json", by_alias=True, exclude_unset=True))
    document = apply_overrides(parse_yaml(text, world_name), for_mission)
    spec = mission_spec(document, Path())
    mission = MissionFile(
        file=Path(world_name),
        document=document,
        spec=spec,
        topo_map=made.topo_map,
        start=_start(spec, made.topo_map),
        goals=_goals(spec, made.topo_map),
    )
    plan = FloorPlan.from_world(made.world, spec.robot.height)
    shortest = mission.check(plan)
    stack_file = chosen_stack(mission, stack)
    built = Stack.load(stack_file, spec.robot, made.topo_map, registry, for_stack)
    return Session(
        world_name=world_name,
        mission_name="cross",
        seed=seed,
        world=made.world,
        plan=plan,
        mission=mission,
        shortest=shortest,
        stack_file=stack_file,
        stack=built,
        overrides=tuple(overrides),
        events=resolve_events(
            document,
            spec.events,
            spec.timeout,
            made.topo_map,
            made.world,
            built,
            registry,
        ),
    )


def _start(spec: MissionSpec, topo_map: TopoMap) -> Pose:
    if isinstance(spec.start, PlaceStart):
        return Pose(*_place(topo_map, spec.start.place), spec.start.yaw)
    if isinstance(spec.start, tuple):
        return Pose(*spec.start)
    raise WorldError("a generated world needs a known start; give the mission a start", key="start")


def _goals(spec: MissionSpec, topo_map: TopoMap) -> tuple[Waypoint, ...]:
    waypoints = []
    for goal in spec.goals:
        if isinstance(goal, PointGoal):
            (x, y), name = (goal.x, goal.y), ""
        else:
            (x, y), name = _place(topo_map, goal), goal
        waypoints.append(Waypoint(x, y, spec.tolerance, name, "goal", final=True))
    return tuple(waypoints)


def _place(topo_map: TopoMap, name: str) -> tuple[float, float]:
    if name not in topo_map.places:
        raise ConfigError(f"the generated map has no place {name!r}")
    place = topo_map.places[name]
    return place.x, place.y
