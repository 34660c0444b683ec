"""Load mission files, and check them against map and world.

The schema is in ``navfw.missions.missionspec``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from navfw.assumption import Assumption
from navfw.config.document import Origin, YamlDocument, load_yaml
from navfw.config.lookup import find, list_missions
from navfw.config.overrides import Override, apply_overrides
from navfw.config.yaml_text import KeyPath
from navfw.errors import ConfigError, UnknownNameError, WorldError
from navfw.features.landmark_appearance import check_landmark_kind
from navfw.missions.missionspec import (
    MissionSpec,
    PlaceStart,
    PointGoal,
    UnknownStart,
    mission_spec,
)
from navfw.robot.robotfile import with_section
from navfw.signals import Pose, Waypoint
from navfw.sim.scene_geometry import SceneGeometry
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.map_formats import load_any_map

_Point = tuple[float, float]

_STREAM = 1 << 20
"""Spawn key of the random stream that draws starts; the sensors' streams have other keys."""


@dataclass(frozen=True)
class MissionFile:
    """A loaded mission file: start and goals as pose and waypoints in ``map``.

    If the start is unknown, ``starts`` are the places from which ``placed`` draws it; until then
    ``start`` is the first of them. If it is known, ``starts`` is empty.
    """

    file: Path
    document: YamlDocument
    spec: MissionSpec
    topo_map: TopoMap
    start: Pose
    goals: tuple[Waypoint, ...]
    starts: tuple[Place, ...] = ()

    @property
    def start_known(self) -> bool:
        """Whether the stack gets the start pose."""
        return not self.starts

    @property
    def assumed(self) -> tuple[Assumption, ...]:
        """The properties of robot and map that no file gives and that are assumed."""
        from navfw.robot.urdf_measures import robot_assumed  # of a robot without a URDF not needed

        return robot_assumed(self.spec.robot) + self.topo_map.all_assumed

    def placed(self, seed: int, plan: SceneGeometry) -> MissionFile:
        """Return the mission with an unknown start drawn by ``seed``; a known start is kept.

        Raises:
            WorldError: the robot overlaps something at each of the places.

        """
        if self.start_known:
            return self
        with self.document.locating(("start",), only=WorldError):
            return replace(self, start=draw_start(self.starts, seed, plan, self.spec.robot.radius))

    def check(self, plan: SceneGeometry) -> float:
        """Check start and goals in ``plan``; return the length [m] of the shortest path along them.

        Raises:
            WorldError: at the start the robot's body, or at a goal a disc of its radius, would
                overlap something, or there is no path for a robot of this radius.

        """
        robot, of_map = self.spec.robot, ""
        if self.spec.map is not None:
            of_map = f" of the map {self.topo_map.name!r}"
            self._check_map(plan)
        total, last = 0.0, (self.start.x, self.start.y)
        legs: dict[tuple[_Point, _Point], float] = {}
        body = "the start" if robot.footprint is None else "part of the robot's body at the start"
        with self.document.locating(("start",), only=WorldError):
            for x, y, disc_radius in robot.discs:
                plan.check_free(*self.start.to_parent(x, y), disc_radius, body)
        for index, goal in enumerate(self.goals):
            point = (goal.x, goal.y)
            if (last, point) not in legs:  # repeated in every round
                what = f"the goal {goal.place!r}{of_map}" if goal.place else "the goal"
                key = ("goals", index % max(len(self.spec.goals), 1))
                with self.document.locating(key, only=WorldError):
                    plan.check_free(*point, robot.radius, what)
                    legs[last, point] = plan.shortest_path(last, point, robot.radius)[0]
            total += legs[last, point]
            last = point
        return total

    def _check_map(self, plan: SceneGeometry) -> None:
        """Check that at least half of the map's places lie within the world."""
        (x0, y0, x1, y1), places = plan.bounds, list(self.topo_map.places.values())
        off = [p.name for p in places if not (x0 <= p.x <= x1 and y0 <= p.y <= y1)]
        if 2 * len(off) > len(places):
            what = f"{len(off)} of {len(places)} places of the map {self.topo_map.name!r}"
            what += f" lie off the world's floor, x {x0:g} to {x1:g} and y {y0:g} to {y1:g} m"
            with self.document.locating(("map",), only=WorldError):
                raise WorldError(f"{what}: it is the map of another world; name this world's")

    def resolved(self) -> dict[str, Any]:
        """Return the mission with all defaults, as plain data."""
        return {
            **self.spec.model_dump(mode="json"),
            "sensors": self.spec.sensors.resolved().model_dump(mode="json"),
            "start": [self.start.x, self.start.y, self.start.yaw],
            "start_known": self.start_known,
            "goals": [{"place": goal.place, "x": goal.x, "y": goal.y} for goal in self.goals],
            "map": self.topo_map.name,
        }


def load_mission(path: str | Path, overrides: Sequence[str | Override] = ()) -> MissionFile:
    """Load a mission file and its map; ``MissionFile.check`` checks it against its world.

    Raises:
        ConfigError: the file breaks the schema.
        UnknownNameError: it names a map, or a place of its map, that does not exist.
        MapError: the map contradicts itself.

    """
    path = Path(path)
    return mission_in(apply_overrides(with_section(load_yaml(path)), overrides), path)


def mission_in(document: YamlDocument, path: Path, topo_map: TopoMap | None = None) -> MissionFile:
    """Make the mission of ``document``, from the file ``path``, on ``topo_map`` or its own map.

    Raises the errors of ``load_mission``.
    """
    spec = mission_spec(document, path.parent)
    if spec.map is None:
        topo_map = topo_map or _map_of_goals(document, spec)
    elif topo_map is None:
        with document.locating(("map",), only=UnknownNameError):
            file = find("map", spec.map, base=path.parent)
        topo_map = load_any_map(file, check_kind=check_landmark_kind)
    starts = _starts(document, spec, topo_map)
    if isinstance(spec.start, PlaceStart):
        place = _place(document, ("start", "place"), topo_map, spec.start.place)
        start = Pose(place.x, place.y, spec.start.yaw)
    elif isinstance(spec.start, tuple):
        start = Pose(*spec.start)
    else:
        start = Pose(starts[0].x, starts[0].y, 0.0)
    goals = _goals(document, spec, topo_map)
    if spec.explore is not None:  # of the map the robot gets nothing
        topo_map = goals_map([(start.x, start.y)])
        goals = (Waypoint.goal(start.x, start.y, spec.tolerance, "start"),)
    return MissionFile(path, document, spec, topo_map, start, goals, starts)


_OF_WORLD = ("map", "stack", "start", "robot", "sensors")
"""Keys that a mission to a point copies from a mission of the world."""


@dataclass(frozen=True, slots=True)
class Destination:
    """The end and the map of a mission that begins at the start of a world's first mission.

    ``goal`` is a point (x, y) [m, ``map``] or the name of a place of the map. ``topo_map`` is the
    map's name or file; None: that of the first mission.
    """

    goal: _Point | str
    topo_map: str | None = None


def mission_to(
    world: str | Path, to: Destination, overrides: Sequence[Override] = ()
) -> MissionFile:
    """Make a mission to a point or place, from the start of the first mission of ``world``.

    The first mission is the first by name that has a known start; map, stack, robot and sensors are
    copied from it. On another map, ``chosen_stack`` chooses the stack by what that map contains.

    Raises:
        ConfigError: the world has no mission with a known start, or an override is wrong.
        UnknownNameError: there is no such world, map or place.

    """
    goal: Any
    if isinstance(to.goal, str):
        name, goal = to.goal, to.goal
    else:
        name, goal = f"{to.goal[0]:g},{to.goal[1]:g}", {"x": to.goal[0], "y": to.goal[1]}
    task: dict[str, Any] = {"goals": [goal], "timeout": 900.0}
    shown = name if isinstance(goal, str) else f"({name.replace(',', ', ')})"
    task["description"] = f"To {shown} from the start of"
    if to.topo_map is not None:
        file = Path(to.topo_map)
        task["map"] = str(file.absolute()) if file.is_file() else to.topo_map
    return _from_start(world, task, f"--goal {name}", f"to-{name}", overrides)


def exploration_of(world: str | Path, overrides: Sequence[Override] = ()) -> MissionFile:
    """Make the exploration of ``world``, from the start of the same mission as ``mission_to``.

    Raises the errors of ``mission_to``.
    """
    task = {"explore": {}, "description": "Explore from the start of"}
    return _from_start(world, task, "--explore", "explore", overrides)


def _from_start(
    world: str | Path,
    task: Mapping[str, Any],
    option: str,
    name: str,
    overrides: Sequence[Override],
) -> MissionFile:
    """Return the mission ``name`` with the keys of ``task``, which ``option`` asks for.

    To the description the name of the mission with the start is added.
    """
    for named in list_missions(world):
        document = load_yaml(named.path)
        start = document.data.get("start")
        if isinstance(start, list) or (isinstance(start, dict) and "place" in start):
            break
    else:
        raise ConfigError(f"{world} has no mission with a known start to go from", key=option)
    if "map" in task:  # another map does not know the place to start from
        start = mission_in(with_section(document), named.path).start
        task = {**task, "start": [start.x, start.y, start.yaw]}
    changed = with_section(with_task(document, task, option))
    changed.data["description"] += f" {named.name}."
    return mission_in(apply_overrides(changed, overrides), named.path.with_name(f"{name}.yaml"))


def with_task(document: YamlDocument, task: Mapping[str, Any], option: str) -> YamlDocument:
    """Return the mission of ``document`` with the keys of ``task`` instead of its own.

    Map, stack, start, robot and sensors are kept; the stack is not if the task is an exploration or
    names another map. Errors in the task name the command-line ``option``.
    """
    kept = [key for key in _OF_WORLD if key != "stack" or not {"explore", "map"} & set(task)]
    data = {key: value for key, value in document.data.items() if key in kept} | dict(task)
    origins = {
        path: at
        for path, at in document.origins.items()
        if path[:1] not in {(key,) for key in task}
    }
    origins |= {(key,): Origin(option="--map" if key == "map" else option) for key in task}
    return YamlDocument(document.file, data, origins)


def _starts(document: YamlDocument, spec: MissionSpec, topo_map: TopoMap) -> tuple[Place, ...]:
    """Return the places from which an unknown start is drawn; none for a known start."""
    if isinstance(spec.start, UnknownStart):
        return tuple(
            _place(document, ("start", "unknown", index), topo_map, name)
            for index, name in enumerate(spec.start.unknown)
        )
    if not isinstance(spec.start, str):
        return ()
    places = start_candidates(topo_map, [goal for goal in spec.goals if isinstance(goal, str)])
    if not places:
        with document.locating(("start",)):
            raise ConfigError(
                f"no place to start from: the map {topo_map.name!r} has only doors, dangers and"
                " goals; add a place, or give a start"
            )
    return tuple(places)


def start_candidates(topo_map: TopoMap, goals: Sequence[str]) -> list[Place]:
    """Return the places where a random start may be: all but doors, dangers and ``goals``."""
    return [
        place
        for place in topo_map.places.values()
        if place.kind not in {"door", "danger"} and place.name not in goals
    ]


def draw_start(places: Sequence[Place], seed: int, plan: SceneGeometry, radius: float) -> Pose:
    """Draw a pose at one of ``places``, with a random yaw, by ``seed``.

    Places are skipped where a disc of ``radius`` [m] would overlap something in ``plan``.

    Raises:
        WorldError: none of the places is free; the error is that of the first one tried.

    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_STREAM,)))
    order = rng.permutation(len(places)).tolist()
    yaw = float(rng.uniform(-math.pi, math.pi))
    refusals: list[WorldError] = []
    for place in (places[index] for index in order):
        try:
            plan.check_free(place.x, place.y, radius, f"the start {place.name!r}")
        except WorldError as error:
            refusals.append(error)
        else:
            return Pose(place.x, place.y, yaw)
    raise refusals[0]


def _goals(document: YamlDocument, spec: MissionSpec, topo_map: TopoMap) -> tuple[Waypoint, ...]:
    waypoints = []
    for index, goal in enumerate(spec.goals):
        if isinstance(goal, PointGoal):
            x, y, name = goal.x, goal.y, ""
        else:
            place = _place(document, ("goals", index), topo_map, goal)
            x, y, name = place.x, place.y, place.name
        waypoints.append(Waypoint.goal(x, y, spec.tolerance, name))
    return tuple(waypoints) * spec.rounds


def _place(document: YamlDocument, path: KeyPath, topo_map: TopoMap, name: str) -> Place:
    with document.locating(path):
        if name not in topo_map.places:
            raise UnknownNameError("place", name, topo_map.places)
    return topo_map.places[name]


def _map_of_goals(document: YamlDocument, spec: MissionSpec) -> TopoMap:
    """Return a map for a mission without one: start and goals, joined by straight passages."""
    points: list[_Point] = []
    keys: list[KeyPath] = [("start",), *(("goals", index) for index in range(len(spec.goals)))]
    for key, at in zip(keys, (spec.start, *spec.goals), strict=True):
        if isinstance(at, tuple):
            points.append(at[:2])
        elif isinstance(at, PointGoal):
            points.append((at.x, at.y))
        else:
            name = at.place if isinstance(at, PlaceStart) else at
            what = "an unknown start" if key == ("start",) and name is at else f"the place {name!r}"
            with document.locating(key if name is at else (*key, "place")):
                raise ConfigError(
                    f"{what} needs a map, and the mission names none: add 'map: NAME', or give"
                    " coordinates"
                )
    if spec.rounds > 1:
        points.append(points[1])  # the next round
    return goals_map(points)


def goals_map(points: Sequence[_Point]) -> TopoMap:
    """Make a map of ``points`` [m] in the order of the mission, joined by straight passages."""
    unique = list(dict.fromkeys(points))
    names = ["start", *(f"goal-{index}" for index in range(1, len(unique)))]
    places = [Place(name, *point) for name, point in zip(names, unique, strict=True)]
    legs = {frozenset(leg) for leg in pairwise(points) if leg[0] != leg[1]}
    by_point = dict(zip(unique, names, strict=True))
    passages = [
        Passage(by_point[a], by_point[b], float(np.hypot(a[0] - b[0], a[1] - b[1])))
        for a, b in (sorted(leg) for leg in legs)
    ]
    return TopoMap("goals", places, passages)
