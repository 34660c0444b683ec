"""Mission files: where to start, where to go, and what counts as success.

::

    description: From the lobby through two doors and the corridor to the lab.
    map: office
    start: [1.2, 1.2, 0.6]        # x, y [m], yaw [rad]; or {place: lobby, yaw: 0.6}
    goals: [lab]                  # places of the map, or {x: 14.6, y: 8.8}
    timeout: 150

``start: unknown`` puts the robot down somewhere in the map without telling it where, by the seed;
``start: {unknown: [kitchen, lab]}`` at one of these places.

Without ``map`` the robot knows start and goals alone: goals are then points, and the map consists
of the start, the goals, and straight passages of unknown width between them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
from pydantic import Field

from navfw.config.document import KeyPath, YamlDocument, key_text, load_yaml
from navfw.config.lookup import find
from navfw.config.overrides import Override, apply_overrides
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, UnknownNameError, WorldError
from navfw.missions.events import EventSpec
from navfw.missions.starts import Unknown, UnknownStart, draw_start, start_candidates
from navfw.robot import RobotModel
from navfw.signals import Array, Pose, Waypoint
from navfw.sim.sensor_models import SensorParams
from navfw.sim.worldspec import DropSpec
from navfw.topomap import Passage, Place, TopoMap, load_map

__all__ = [
    "MissionFile",
    "MissionSpec",
    "PlaceStart",
    "PointGoal",
    "SensorsSpec",
    "SuccessSpec",
    "goals_map",
    "load_mission",
    "mission_spec",
]

Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Yaw = Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi)]


class PlaceStart(StrictModel):
    """A start at a place of the map."""

    place: Annotated[str, Field(description="a place of the map")]
    yaw: Annotated[Yaw, Field(description="counter-clockwise from x [rad]")] = 0.0


class PointGoal(StrictModel):
    """A goal that is no place of the map."""

    x: Annotated[Coordinate, Field(description="in the map frame [m]")]
    y: Annotated[Coordinate, Field(description="in the map frame [m]")]


class SuccessSpec(StrictModel):
    """What counts as success, in truth: the robot has to come this near to every goal."""

    within: Annotated[float, Field(gt=0.0, le=5.0, description="of a goal [m]")] = 0.5


class SensorsSpec(SensorParams):
    """A preset of the sensors, and what differs from it."""

    base: Annotated[
        Literal["perfect", "good", "default", "poor"],
        Field(alias="preset", description="what the others differ from"),
    ] = "default"

    def resolved(self) -> SensorParams:
        """The parameters of the preset, with those that the file gives put over them."""
        given = {name: getattr(self, name) for name in self.model_fields_set - {"base"}}
        return SensorParams.preset(self.base, **given)


class MissionSpec(StrictModel):
    """A mission as its file has it."""

    description: Annotated[str, Field(description="one line for a person")] = ""
    map: Annotated[
        str | None, Field(description="name or file of a topological map; none: only the goals")
    ] = None
    stack: Annotated[
        str | None,
        Field(description="the stack to drive it with, unless --stack says another"),
    ] = None
    start: Annotated[
        tuple[Coordinate, Coordinate, Yaw] | PlaceStart | UnknownStart | Unknown,
        Field(
            description="[x, y, yaw], or {place: ..., yaw: ...}; unknown, or "
            "{unknown: [place, ...]}: the seed draws it, and the robot is not told"
        ),
    ]
    goals: Annotated[
        tuple[str | PointGoal, ...],
        Field(min_length=1, max_length=1000, description="places, or {x: ..., y: ...}, in order"),
    ]
    rounds: Annotated[
        int, Field(ge=1, le=100, description="how often it goes round past all goals")
    ] = 1
    tolerance: Annotated[
        float, Field(ge=0.05, le=5.0, description="how near the stack has to come to a goal [m]")
    ] = 0.4
    success: SuccessSpec = SuccessSpec()
    timeout: Annotated[float, Field(gt=0.0, le=7200.0, description="simulated time [s]")] = 180.0
    stuck_after: Annotated[
        float, Field(gt=0.0, le=7200.0, description="time on one spot that ends the mission [s]")
    ] = 45.0
    sensors: Annotated[SensorsSpec, Field(description="how good the sensors are")] = SensorsSpec()
    robot: Annotated[RobotModel, Field(description="what differs from the usual robot")] = (
        RobotModel()
    )
    drops: Annotated[
        tuple[DropSpec, ...],
        Field(max_length=100, description="holes in the floor beside those of the world"),
    ] = ()
    events: Annotated[
        tuple[EventSpec, ...],
        Field(max_length=1000, description="what happens on the way: faults, changes of the world"),
    ] = ()


class FloorPlanQueries(Protocol):
    """What the check asks of a floor plan (``navfw.sim.floorplan.FloorPlan``)."""

    def check_free(self, x: float, y: float, radius: float, what: str) -> None:
        """Raise WorldError unless a disc of ``radius`` [m] fits at the point."""
        ...

    def shortest_path(
        self, start: tuple[float, float], goal: tuple[float, float], radius: float
    ) -> tuple[float, Array]:
        """Length [m] and corners of the shortest way; WorldError if there is none."""
        ...


@dataclass(frozen=True)
class MissionFile:
    """A mission file that has been read: start and goals as poses and waypoints in ``map``.

    Where the robot is not told its start, ``starts`` are the places from which ``placed`` draws it;
    until then ``start`` is the first of them.
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
        """Whether the robot is told where it begins."""
        return not self.starts

    def placed(self, seed: int, plan: FloorPlanQueries) -> MissionFile:
        """The mission with its start drawn by ``seed``, where that is left open.

        Raises:
            WorldError: the robot can stand at none of the places.

        """
        if self.start_known:
            return self
        radius = self.spec.robot.radius

        def check(place: Place) -> None:
            plan.check_free(place.x, place.y, radius, f"the start {place.name!r}")

        with self._blaming(("start",)):
            return replace(self, start=draw_start(self.starts, seed, check))

    def check(self, plan: FloorPlanQueries) -> float:
        """The length [m] of the shortest way past all goals, in the world of this floor plan.

        Raises:
            WorldError: the start overlaps something, a goal is where the robot cannot stand, or
                there is no way for a robot of this radius.

        """
        radius = self.spec.robot.radius
        total, here = 0.0, (self.start.x, self.start.y)
        legs: dict[tuple[tuple[float, float], tuple[float, float]], float] = {}
        with self._blaming(("start",)):
            plan.check_free(*here, radius, "the start")
        for index, goal in enumerate(self.goals):
            there = (goal.x, goal.y)
            if (here, there) not in legs:  # the same again in every round
                what = f"the goal {goal.place!r}" if goal.place else "the goal"
                with self._blaming(("goals", index % len(self.spec.goals))):
                    plan.check_free(*there, radius, what)
                    legs[here, there] = plan.shortest_path(here, there, radius)[0]
            total += legs[here, there]
            here = there
        return total

    @contextmanager
    def _blaming(self, path: KeyPath) -> Iterator[None]:
        """Whatever is wrong in the world is the fault of this key of the mission."""
        try:
            yield
        except WorldError as error:
            origin = self.document.origin_of(path)
            key = origin.option or key_text(path)
            raise WorldError(str(error), file=origin.file, line=origin.line, key=key) from None


def mission_spec(document: YamlDocument) -> MissionSpec:
    """A mission as its document has it; its robot knows the data sheets of its sensors' preset.

    What the mission itself says of the data sheets stays.

    Raises:
        ConfigError: the document breaks the schema.

    """
    spec = validate(document, MissionSpec)
    told = spec.robot.odometry
    sheet = SensorParams.preset(spec.sensors.base).sheet
    sheet = sheet.model_copy(update={name: getattr(told, name) for name in told.model_fields_set})
    robot = spec.robot.model_copy(update={"odometry": sheet})
    return spec.model_copy(update={"robot": robot})


def load_mission(path: str | Path, overrides: Sequence[str | Override] = ()) -> MissionFile:
    """Read a mission file and the map it names; ``check`` it against its world after that.

    Raises:
        ConfigError: the file breaks the schema.
        UnknownNameError: it names a map, or a place of its map, that does not exist.
        MapError: the map contradicts itself.

    """
    path = Path(path)
    document = apply_overrides(load_yaml(path), overrides)
    spec = mission_spec(document)
    if spec.map is None:
        topo_map = _map_of_goals(document, spec)
    else:
        topo_map = _find_map(path, document, spec.map)
    return MissionFile(
        file=path,
        document=document,
        spec=spec,
        topo_map=topo_map,
        start=_start(document, spec, topo_map),
        goals=_goals(document, spec, topo_map),
        starts=_starts(document, spec, topo_map),
    )


def _find_map(path: Path, document: YamlDocument, name: str) -> TopoMap:
    try:
        file = find("map", name, base=path.parent)
    except UnknownNameError as error:
        raise _unknown(document, ("map",), error.what, name, error.known) from None
    return load_map(file)


def _start(document: YamlDocument, spec: MissionSpec, topo_map: TopoMap) -> Pose:
    if isinstance(spec.start, PlaceStart):
        place = _place(document, ("start", "place"), topo_map, spec.start.place)
        return Pose(place.x, place.y, spec.start.yaw)
    if isinstance(spec.start, tuple):
        return Pose(*spec.start)
    first = _starts(document, spec, topo_map)[0]
    return Pose(first.x, first.y, 0.0)


def _starts(document: YamlDocument, spec: MissionSpec, topo_map: TopoMap) -> tuple[Place, ...]:
    """The places from which an unknown start is drawn; none where the start is known."""
    if isinstance(spec.start, UnknownStart):
        return tuple(
            _place(document, ("start", "unknown", index), topo_map, name)
            for index, name in enumerate(spec.start.unknown)
        )
    if not isinstance(spec.start, str):
        return ()
    found = start_candidates(topo_map, [goal for goal in spec.goals if isinstance(goal, str)])
    if not found:
        origin = document.origin_of(("start",))
        raise ConfigError(
            f"the map {topo_map.name!r} has only doors, dangers and goals: there is nowhere to "
            "start from; add a place, or give a start",
            file=origin.file,
            line=origin.line,
            key=origin.option or "start",
        )
    return tuple(found)


def _goals(document: YamlDocument, spec: MissionSpec, topo_map: TopoMap) -> tuple[Waypoint, ...]:
    waypoints = []
    for index, goal in enumerate(spec.goals):
        if isinstance(goal, PointGoal):
            x, y, name = goal.x, goal.y, ""
        else:
            place = _place(document, ("goals", index), topo_map, goal)
            x, y, name = place.x, place.y, place.name
        waypoints.append(Waypoint(x, y, spec.tolerance, name, "goal", final=True))
    return tuple(waypoints) * spec.rounds


def _place(document: YamlDocument, path: KeyPath, topo_map: TopoMap, name: str) -> Place:
    try:
        return topo_map.places[name]
    except KeyError:
        raise _unknown(document, path, "place", name, topo_map.places) from None


def _unknown(
    document: YamlDocument, path: KeyPath, what: str, name: str, known: Iterable[str]
) -> UnknownNameError:
    origin = document.origin_of(path)
    key = origin.option or key_text(path)
    return UnknownNameError(what, name, known, file=origin.file, line=origin.line, key=key)


def _mapless(document: YamlDocument, path: KeyPath, name: str) -> ConfigError:
    origin = document.origin_of(path)
    return ConfigError(
        f"the place {name!r} needs a map, and the mission names none: add 'map: NAME', or give"
        " coordinates",
        file=origin.file,
        line=origin.line,
        key=origin.option or key_text(path),
    )


def _map_of_goals(document: YamlDocument, spec: MissionSpec) -> TopoMap:
    """A map for a mission without one: start and goals in a row, straight passages between."""
    points: list[tuple[float, float]] = []
    if isinstance(spec.start, PlaceStart):
        raise _mapless(document, ("start", "place"), spec.start.place)
    if not isinstance(spec.start, tuple):
        origin = document.origin_of(("start",))
        raise ConfigError(
            "an unknown start needs a map to find it in, and the mission names none: "
            "add 'map: NAME'",
            file=origin.file,
            line=origin.line,
            key=origin.option or "start",
        )
    points.append(spec.start[:2])
    for index, goal in enumerate(spec.goals):
        if not isinstance(goal, PointGoal):
            raise _mapless(document, ("goals", index), goal)
        points.append((goal.x, goal.y))
    if spec.rounds > 1:
        points.append(points[1])  # and round again
    return goals_map(points)


def goals_map(points: Sequence[tuple[float, float]]) -> TopoMap:
    """The map where there is none: points [m] in the order of the mission, and nothing between."""
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
