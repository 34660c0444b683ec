"""Drives on maps that are made before: by teaching a recorded tour of a world, or by exploring it.

A map is made once for the seeds that share it (``TaughtSpec.seeds``), and kept in the folder
``maps`` of the suite. On the world's own map (``given_map``) the same starts and goals are driven.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np

from navfw.config.input_file import is_file
from navfw.config.lookup import find
from navfw.errors import InputError, WorldError
from navfw.missions.missionfile import Destination, mission_to, start_candidates
from navfw.missions.run_report import write_run
from navfw.missions.session import Session
from navfw.missions.session_setup import chosen_stack, prepare, session_of, split_overrides
from navfw.plugins import Registry
from navfw.process.atomic import scratch_folder
from navfw.process.target_lock import TargetLock
from navfw.recording.provenance import code_fingerprint, files_fingerprint, files_in, fingerprint
from navfw.recording.run_folder import RunFolder
from navfw.recording.teaching import recorded_drive, teach
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import BoxSpec, CylinderSpec, WorldSpec
from navfw.stack import Stack
from navfw.suite.case import MAPS, Case, drawn_pair
from navfw.suite.suitefile import TaughtSpec
from navfw.topomap import Place, TopoMap, load_map
from navfw.topomap.map_formats import save_map

_ANYWHERE = Destination((0.0, 0.0))
"""A goal for missions of which only the world's part is used, or that get other goals."""
_WAIT = 7200.0
"""Longest wall time [s] to wait for another process that makes the same map."""
_TOUR_STREAM, _MOVED_STREAM = 0x70A2, 0x30FE
"""Spawn keys of the random streams that draw the order of a tour, and what is moved."""
_DETOUR = 1.5
"""Largest ratio by which the next place of a tour is farther than the nearest one."""
_MOVES, _TRIES = (0.3, 1.2), 30
"""Distance [m] by which furniture is moved, and the number of draws for one piece."""
_ROOM = 0.1
"""Room [m] that moved furniture leaves beside the robot on its way, and to other things."""
_TALLEST = 2.0
"""Height [m] from which on a thing is part of the building."""


def driven_session(case: Case, registry: Registry) -> Session:
    """The session of ``case``; its map is made first if it is a taught one.

    Raises:
        InputError: world, mission or stack is wrong, or no map could be made.

    """
    if not case.taught:
        return case.session(registry)
    spec = TaughtSpec.model_validate_json(case.taught)
    file, world_file = _made(case, spec, registry)
    topo_map, world = load_map(file), load_world(world_file)
    for_mission, _ = split_overrides(case.overrides)
    robot = mission_to(world_file, _ANYWHERE, for_mission).spec.robot
    plan = SceneGeometry.from_world(world, robot.height)
    free = [p for p in start_candidates(topo_map, ()) if plan.clearance(p.x, p.y) >= robot.radius]
    a, b, yaw = drawn_pair(topo_map, [place.name for place in free], case.seed)
    start, goal = topo_map.places[a], topo_map.places[b]
    to = Destination((goal.x, goal.y), None if case.given_map else str(file))
    mission = mission_to(world_file, to, for_mission)
    starts = (start,) if spec.start == "unknown" else ()
    mission = replace(mission, start=Pose(start.x, start.y, yaw), starts=starts)
    world = _moved(world, spec.moved, case.seed, (start, goal), robot)
    run = world, mission, case.key.world, case.seed, case.stack, case.overrides, registry
    return session_of(*run)


def planned_session(case: Case, registry: Registry) -> Session:
    """A session to check ``case`` by before anything is driven.

    For a map that is still to be made it is that of the drive that shows the world, with the stack
    that will drive on the map: without one of its own, ``floor_plan``, as such maps have one.

    Raises:
        InputError: world, mission or stack is wrong.

    """
    if not case.taught:
        return case.session(registry)
    spec = TaughtSpec.model_validate_json(case.taught)
    if case.family:
        plain = replace(case, taught="", mission="", stack="", seed=case.world_seed)
        session = plain.session(registry)
    else:
        session = _showing(case, spec, Path(case.world), registry)
    if case.stack or not case.given_map:
        file = find("stack", case.stack or "floor_plan")
    else:
        file = chosen_stack(mission_to(case.world, _ANYWHERE)) if case.world else session.stack_file
    mission, (_, for_stack) = session.mission, split_overrides(case.overrides)
    stack = Stack.load(file, mission.spec.robot, mission.topo_map, registry, for_stack)
    return replace(session, stack_file=file, stack=stack)


def _made(case: Case, spec: TaughtSpec, registry: Registry) -> tuple[Path, Path]:
    """The files of the case's map and world; one process makes the map, others wait for it."""
    about: list[Any] = [code_fingerprint(), spec.source, spec.limit, spec.seeds, case.difficulty]
    about += [case.contrast, case.look, [text for text in case.overrides if _of_mission(text)]]
    world = Path(case.world)
    if not case.family:
        about.append(files_fingerprint((str(name), f) for f, name in files_in(world.parent)))
    name = f"{Path(case.key.world).name}-{case.world_seed}-{fingerprint(about)[:8]}"
    folder = case.pictures.with_name(MAPS) / name
    folder.mkdir(parents=True, exist_ok=True)
    file, lock = folder / "map.yaml", TargetLock(folder / "made")
    lock.acquire(_WAIT)
    try:
        if case.family:
            world = folder / "world" / "world.yaml"
            if not is_file(world):
                case.made_world().write(world.parent)
        if not is_file(file):
            session = _showing(case, spec, world, registry)
            save_map(_map_of(session, spec, case.key.world), file)
    finally:
        lock.release()
    return file, world


def _of_mission(text: str) -> bool:
    return bool(split_overrides([text])[0])


def _showing(case: Case, spec: TaughtSpec, world: Path, registry: Registry) -> Session:
    """The session of the drive that shows the world."""
    texts, seed = [text for text in case.overrides if _of_mission(text)], case.world_seed
    if spec.source == "explore":
        texts.append(f"mission.explore={json.dumps({'limit': spec.limit})}")
        return prepare(world, None, seed=seed, overrides=texts, registry=registry)
    first = mission_to(world, _ANYWHERE)
    if first.spec.map is None:
        what = f"the missions of {case.key.world} have no map, so there are no places for a tour"
        raise InputError(f"{what}; take source: explore", key="taught.source")
    goals = list(_tour(first.topo_map, first.start, seed))
    texts += [f"mission.goals={json.dumps(goals)}", f"mission.timeout={spec.limit}"]
    stack = "landmarks" if first.topo_map.landmarks else None
    return prepare(world, _ANYWHERE, seed=seed, stack=stack, overrides=texts, registry=registry)


def _tour(topo_map: TopoMap, start: Pose, seed: int) -> Iterator[str]:
    """All places that can be reached from ``start``, each time one of the nearest by passages."""
    stream = np.random.SeedSequence(seed, spawn_key=(_TOUR_STREAM,))
    rng = np.random.default_rng(stream)
    at = min(topo_map.places.values(), key=lambda place: place.distance(start.x, start.y)).name
    left = {p.name for p in start_candidates(topo_map, ()) if p.name in topo_map.part_of(at)}
    while left:
        away = nx.single_source_dijkstra_path_length(topo_map.graph, at, weight="length")
        at = min(sorted(left), key=lambda name: away[name] * rng.uniform(1.0, _DETOUR))
        left.remove(at)
        yield at


def _map_of(session: Session, spec: TaughtSpec, name: str) -> TopoMap:
    """The map that the drive of ``session`` gives, however it ends."""
    if spec.source == "explore":
        return session.run().explored_map(name)
    result = session.run(record=True)
    with scratch_folder("tour") as folder:
        with RunFolder(folder / "tour") as target:
            write_run(result, target)
        return teach([recorded_drive(folder / "tour")], name).topo_map


def _moved(
    world: WorldSpec,
    share: float,
    seed: int,
    ends: tuple[Place, Place],
    robot: RobotModel,
) -> WorldSpec:
    """The world with a ``share`` of its furniture moved, and still a path between ``ends``."""
    start, goal = ((place.x, place.y) for place in ends)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_MOVED_STREAM,)))
    things: list[BoxSpec | CylinderSpec] = [*world.boxes, *world.cylinders]
    places = sorted({thing.at for thing in things if thing.base == 0.0 and _top(thing) < _TALLEST})
    for index in rng.permutation(len(places))[: round(share * len(places))].tolist():
        x, y = old = places[index]
        reach = max(_reach(thing) for thing in things if thing.at == old)
        rest = SceneGeometry.from_world(_with(world, old, None), robot.height)
        for _ in range(_TRIES):
            step, way = rng.uniform(*_MOVES), rng.uniform(-math.pi, math.pi)
            new = round(x + step * math.cos(way), 2), round(y + step * math.sin(way), 2)
            off_walls = rest.straight_path_free(np.array(old), np.array(new), 0.0)
            if not off_walls or rest.clearance(*new) < reach + _ROOM:
                continue
            changed = _with(world, old, new)
            try:
                plan = SceneGeometry.from_world(changed, robot.height)
                plan.shortest_path(start, goal, robot.radius + _ROOM)
            except WorldError:
                continue
            world = changed
            break
    return world


def _top(thing: BoxSpec | CylinderSpec) -> float:
    return thing.base + (thing.size[2] if isinstance(thing, BoxSpec) else thing.height)


def _reach(thing: BoxSpec | CylinderSpec) -> float:
    """The distance [m] of the thing's farthest corner from its middle."""
    return 0.5 * math.hypot(*thing.size[:2]) if isinstance(thing, BoxSpec) else thing.radius


def _with(world: WorldSpec, old: tuple[float, float], new: Any) -> WorldSpec:
    """The world with all that stands at ``old`` moved to ``new``, or without it."""

    def changed(things: Sequence[Any]) -> tuple[Any, ...]:
        kept = [
            thing.model_copy(update={"at": new}) if thing.at == old else thing for thing in things
        ]
        return tuple(thing for thing in kept if thing.at is not None)

    return world.model_copy(
        update={"boxes": changed(world.boxes), "cylinders": changed(world.cylinders)}
    )
