"""Drives on maps that are made first: by teaching a recorded tour of a world, or by exploring it.

A map is made once for the seeds that share it (``TaughtSpec.seeds``), and kept in the folder
``maps`` of the suite. With ``given_map`` the same starts and goals use the world's own map.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
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
from navfw.robot import RobotModel
from navfw.signals import Pose, wrap_angle
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack
from navfw.suite.case import MAPS, Case, drawn_pair
from navfw.suite.suitefile import TaughtSpec
from navfw.topomap import Place, TopoMap, load_map
from navfw.topomap.map_formats import save_map

_ANYWHERE = Destination((0.0, 0.0))
"""A goal for missions from which only the robot is used, or whose goals are replaced."""
_LIMIT = 1500.0
"""Longest simulated time of a tour or exploration [s]."""
_WAIT = 7200.0
"""Longest wall time [s] to wait for another process that makes the same map."""
_TOUR_STREAM, _MOVED_STREAM = 0x70A2, 0x30FE
"""Spawn keys of the random streams that draw the order of a tour, and what is moved."""
_DETOUR = 1.5
"""Largest ratio of the distance of the next place of a tour to that of the nearest place."""
_MOVES, _TRIES = (0.3, 1.2), 30
"""Distance [m] by which furniture is moved, and the number of draws for one piece."""
_ROOM = 0.1
"""Free space [m] that moved furniture leaves beside the robot's path and to other things."""


def driven_session(case: Case, registry: Registry) -> Session:
    """Load the session of ``case``; with ``taught``, its map is made first and written to a file.

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
    """Build a session that checks ``case`` before anything is driven.

    If its map is still to be made, this is the session of the tour or exploration, with the stack
    that will drive on the map: by default ``floor_plan``, as such maps have a floor plan.

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
    mission, (_, for_stack) = session.mission, split_overrides(case.overrides)
    if case.stack or not case.given_map:
        file = find("stack", case.stack or "floor_plan")
    else:
        file = chosen_stack(mission_to(case.world, _ANYWHERE) if case.world else mission)
    stack = Stack.load(file, mission.spec.robot, mission.topo_map, registry, for_stack)
    return replace(session, stack_file=file, stack=stack)


def _made(case: Case, spec: TaughtSpec, registry: Registry) -> tuple[Path, Path]:
    """The files of the case's map and world; one process makes the map, others wait for it."""
    about: list[Any] = [code_fingerprint(), spec.source, spec.seeds, case.difficulty]
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
    """Return the session of the drive that shows the world."""
    texts, seed = [text for text in case.overrides if _of_mission(text)], case.world_seed
    if spec.source == "explore":
        texts.append(f"mission.explore={json.dumps({'limit': _LIMIT})}")
        return prepare(world, None, seed=seed, overrides=texts, registry=registry)
    first = mission_to(world, _ANYWHERE)
    if first.spec.map is None:
        what = f"the missions of {case.key.world} have no map, so there are no places for a tour"
        raise InputError(f"{what}; take source: explore", key="taught.source")
    goals = list(_tour(first.topo_map, first.start, seed))
    texts += [f"mission.goals={json.dumps(goals)}", f"mission.timeout={_LIMIT}"]
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
    """Return the map that the drive of ``session`` gives, however it ends, laid over the world.

    The frame of a map is where its drive began: laid over the world by the true poses at its key
    poses, its coordinates are the world's but for what is bent.
    """
    from navfw.recording.teaching import recorded_drive, teach  # which needs the extra bags

    result = session.run(record=spec.source == "tour")
    if spec.source == "explore":
        made, keys = result.explored_map(name), session.stack.growth.growing_map.keys
    else:
        with scratch_folder("tour") as folder:
            with RunFolder(folder / "tour") as target:
                write_run(result, target)
            taught = teach([recorded_drive(folder / "tour")], name).maps[0]
        made, keys = taught.topo_map, list(taught.keys)
    rows = np.searchsorted(result.log.time, [key.submap.time for key in keys])
    true = result.log.true[np.minimum(rows, len(result.log.true) - 1), :2]
    own = np.array([(key.pose.x, key.pose.y) for key in keys])
    a, b = own - own.mean(axis=0), true - true.mean(axis=0)
    turn = math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
    x, y = true.mean(axis=0) - Pose(0.0, 0.0, turn).points_to_parent(own.mean(axis=0)[None])[0]
    return _placed(made, Pose(float(x), float(y), turn))


def _placed(topo_map: TopoMap, frame: Pose) -> TopoMap:
    """Return the map with its frame at ``frame``."""

    def at(thing: Any) -> dict[str, Any]:
        return dict(zip("xy", frame.to_parent(thing.x, thing.y), strict=True))

    plan, marks = topo_map.floor_plan, topo_map.landmarks.values()
    return topo_map.replaced(
        places=[replace(place, **at(place)) for place in topo_map.places.values()],
        landmarks=[
            replace(mark, **at(mark), yaw=wrap_angle(mark.yaw + frame.yaw)) for mark in marks
        ],
        floor_plan=None if plan is None else replace(plan, origin=frame.compose(plan.origin)),
    )


def _moved(
    world: WorldSpec, share: float, seed: int, ends: tuple[Place, Place], robot: RobotModel
) -> WorldSpec:
    """Return the world with a ``share`` of its furniture moved, and still a path between ``ends``.

    What stands at one point is moved together; what hangs on a wall stays.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_MOVED_STREAM,)))
    start, goal = ((place.x, place.y) for place in ends)
    reach = {pole.at: pole.radius for pole in world.cylinders if pole.base == 0.0}
    reach |= {box.at: 0.5 * math.hypot(*box.size[:2]) for box in world.boxes if box.base == 0.0}
    places = sorted(reach)
    for index in rng.permutation(len(places))[: round(share * len(places))].tolist():
        old = places[index]
        rest = SceneGeometry.from_world(_with(world, {old: None}), robot.height)
        for _ in range(_TRIES):
            step, way = rng.uniform(*_MOVES), rng.uniform(-math.pi, math.pi)
            new = round(old[0] + step * math.cos(way), 2), round(old[1] + step * math.sin(way), 2)
            off_walls = rest.straight_path_free(np.array(old), np.array(new), 0.0)
            if not off_walls or rest.clearance(*new) < reach[old] + _ROOM:
                continue
            changed = _with(world, {old: new})
            with suppress(WorldError):
                plan = SceneGeometry.from_world(changed, robot.height)
                plan.shortest_path(start, goal, robot.radius + _ROOM)
                world = changed
                break
    return world


def _with(world: WorldSpec, moved: Mapping[tuple[float, float], Any]) -> WorldSpec:
    """The world with all that stands at a key of ``moved`` at its value, or without it if None."""
    changes = {}
    for kind in ("boxes", "cylinders"):
        things = [(thing, moved.get(thing.at, thing.at)) for thing in getattr(world, kind)]
        changes[kind] = tuple(
            thing if at == thing.at else thing.model_copy(update={"at": at})
            for thing, at in things
            if at is not None
        )
    return world.model_copy(update=changes)
