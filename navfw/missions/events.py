"""What happens during a mission: faults of sensors, drive and behaviours, changes of the world.

An event has one trigger, one action, and may end by itself::

    events:
      - {at: 8, lasting: 4, camera: black}                    # simulated seconds
      - {at: 0, camera: {hfov_error: 0.05}}                   # from the start on
      - {near: {place: door, within: 1.5}, door: {name: lab-door, state: closed}}
      - {near: {x: 3, y: 2, within: 1}, behavior: {name: avoid, does: raises}}

The robot is told nothing of them. ``near`` looks at its true position.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NoReturn, Protocol, Self

from pydantic import Field, model_validator

from navfw.config.document import KeyPath, YamlDocument, key_text
from navfw.config.strict_model import StrictModel
from navfw.errors import ConfigError, UnknownNameError
from navfw.fault_injection import Failure
from navfw.signals import Pose
from navfw.sim.drop_geometry import drop_under
from navfw.sim.event_actions import (
    CameraFault,
    DoorChange,
    EncoderFault,
    EventAction,
    GyroFault,
    LightChange,
    Obstacle,
    Slippery,
    Textureless,
    WeakWheel,
)
from navfw.sim.textures import STOCK
from navfw.sim.worldspec import WorldSpec
from navfw.topomap import TopoMap

__all__ = [
    "BehaviorFault",
    "Event",
    "EventClock",
    "EventRecord",
    "EventSpec",
    "EventTarget",
    "NearTrigger",
    "resolve_events",
    "with_doors_open",
]

_TRIGGERS = ("at", "near")

Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Seconds = Annotated[float, Field(ge=0.0, le=7200.0)]
Duration = Annotated[float, Field(gt=0.0, le=7200.0)]


class NearTrigger(StrictModel):
    """The robot comes near to a place of the map, or to a point."""

    place: Annotated[str | None, Field(description="a place of the map")] = None
    x: Annotated[Coordinate | None, Field(description="or a point [m]")] = None
    y: Annotated[Coordinate | None, Field(description="in the map frame [m]")] = None
    within: Annotated[float, Field(gt=0.0, le=100.0, description="of it, from its middle [m]")]

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        point = self.x is not None and self.y is not None
        if point == (self.place is not None) or (self.x is None) != (self.y is None):
            raise ValueError("expected either place, or x and y")
        return self


class BehaviorFault(StrictModel):
    """A behaviour of the stack that fails whenever it is asked."""

    name: Annotated[str, Field(description="of a behaviour of the stack")]
    does: Annotated[Failure, Field(description="how it fails")]


class EventSpec(StrictModel):
    """One thing that happens during a mission: a trigger and an action."""

    at: Annotated[Seconds | None, Field(description="when [s], simulated")] = None
    near: Annotated[NearTrigger | None, Field(description="or when the robot first is so near")] = (
        None
    )
    lasting: Annotated[Duration | None, Field(description="[s]; left out: to the end")] = None
    camera: Annotated[CameraFault | None, Field(description="wrong pictures")] = None
    gyro: Annotated[GyroFault | None, Field(description="wrong turning rates")] = None
    encoders: Annotated[EncoderFault | None, Field(description="wheels that are not counted")] = (
        None
    )
    weak_wheel: Annotated[WeakWheel | None, Field(description="a wheel that lags behind")] = None
    slippery: Annotated[Slippery | None, Field(description="wheels that spin")] = None
    light: Annotated[LightChange | None, Field(description="lamps that go dim or out")] = None
    textureless: Annotated[Textureless | None, Field(description="walls that go blank")] = None
    behavior: Annotated[BehaviorFault | None, Field(description="a plugin that fails")] = None
    door: Annotated[DoorChange | None, Field(description="a door that opens or closes")] = None
    obstacle: Annotated[Obstacle | None, Field(description="a thing that appears")] = None

    @model_validator(mode="after")
    def _one_trigger_one_action(self) -> Self:
        actions = [key for key in _actions() if getattr(self, key) is not None]
        if len(actions) != 1:
            got = " and ".join(actions) or "none of them"
            raise ValueError(f"expected exactly one of {', '.join(_actions())}; got {got}")
        if (self.at is None) == (self.near is None):
            got = "none of them" if self.at is None else "at and near"
            raise ValueError(f"expected exactly one of at, near; got {got}")
        return self

    @property
    def key(self) -> str:
        """Which action it has."""
        return next(key for key in _actions() if getattr(self, key) is not None)


def _actions() -> list[str]:
    return [key for key in EventSpec.model_fields if key not in (*_TRIGGERS, "lasting")]


@dataclass(frozen=True, slots=True)
class Event:
    """An event that has been checked: begins at ``at`` [s], or within ``within`` [m] of ``point``.

    ``lasting`` [s] may be infinite. ``given`` is the action as the file has it.
    """

    action: EventAction | BehaviorFault
    given: Mapping[str, Any]
    at: float | None = None
    point: tuple[float, float] | None = None
    within: float = 0.0
    lasting: float = math.inf

    def due(self, time: float, robot: Pose) -> bool:
        """Whether it begins now, with the robot truly there."""
        if self.at is not None:
            return time >= self.at - 1e-9
        assert self.point is not None  # noqa: S101 - one of both is there
        return math.hypot(robot.x - self.point[0], robot.y - self.point[1]) <= self.within


@dataclass(frozen=True, slots=True)
class EventRecord:
    """An event that happened: from ``began`` to ``ended`` [s]; None: to the end of the run."""

    given: Mapping[str, Any]
    began: float
    ended: float | None = None

    def as_data(self) -> dict[str, Any]:
        """Plain data for ``result.json``."""
        return {"event": dict(self.given), "began_s": self.began, "ended_s": self.ended}


class EventTarget(Protocol):
    """Where events happen: a simulation for most, a stack's behaviour for some."""

    def begin(self, action: Any) -> None:
        """Make it happen."""
        ...

    def end(self, action: Any) -> None:
        """Undo it."""
        ...


class EventClock:
    """Begins and ends the events of one run, and keeps when that was."""

    def __init__(self, events: Iterable[tuple[Event, EventTarget]]) -> None:
        self._waiting = list(events)
        self._running: list[tuple[Event, EventTarget, int]] = []
        self._log: list[EventRecord] = []

    @property
    def log(self) -> tuple[EventRecord, ...]:
        """What has happened so far, in the order in which it began."""
        return tuple(self._log)

    def tick(self, time: float, robot: Pose) -> None:
        """Let end and begin what is due at ``time`` [s]; ``robot`` is its true pose."""
        if not (self._running or self._waiting):
            return
        for event, stage, number in self._running:
            if time - self._log[number].began >= event.lasting - 1e-9:
                stage.end(event.action)
                began = self._log[number].began
                self._log[number] = EventRecord(event.given, began, time)
        self._running = [r for r in self._running if self._log[r[2]].ended is None]
        due = [waiting for waiting in self._waiting if waiting[0].due(time, robot)]
        self._waiting = [waiting for waiting in self._waiting if waiting not in due]
        for event, stage in due:
            stage.begin(event.action)
            self._running.append((event, stage, len(self._log)))
            self._log.append(EventRecord(event.given, time))


# --- from the file to events that can be ----------------------------------------------------------


def resolve_events(
    document: YamlDocument,
    specs: Sequence[EventSpec],
    timeout: float,
    topo_map: TopoMap,
    world: WorldSpec,
    behaviors: Iterable[str],
) -> tuple[Event, ...]:
    """The events of a mission file, checked against its map, its world and the stack's behaviours.

    Raises:
        ConfigError: an event lies after the ``timeout`` [s], or a thing lies off the floor or over
            a hole in it.
        UnknownNameError: it names a place, door, behaviour, wall, thing or texture that is not
            there.

    """
    checker = _Checker(document, topo_map, world, tuple(behaviors))
    return tuple(checker.event(index, spec, timeout) for index, spec in enumerate(specs))


def with_doors_open(world: WorldSpec, specs: Sequence[EventSpec]) -> WorldSpec:
    """The world in which every door stands open that an event opens: there a way must be."""
    opened = {s.door.name for s in specs if s.door is not None and s.door.state == "open"}
    doors = tuple(
        door.model_copy(update={"state": "open"}) if door.name in opened else door
        for door in world.doors
    )
    return world.model_copy(update={"doors": doors})


class _Checker:
    """Everything that names and places in events are checked against."""

    def __init__(
        self,
        document: YamlDocument,
        topo_map: TopoMap,
        world: WorldSpec,
        behaviors: tuple[str, ...],
    ) -> None:
        self.document = document
        self.topo_map = topo_map
        self.world = world
        self.behaviors = behaviors
        self.doors = [door.name for door in world.doors]
        self.things = [
            *(wall.name for wall in world.walls),
            *(box.name for box in world.boxes),
            *(cylinder.name for cylinder in world.cylinders),
        ]
        movers = [mover.name for mover in world.movers]
        drops = [drop.name for drop in world.drops]
        self.taken = {"floor", *self.things, *self.doors, *movers, *drops}

    def event(self, index: int, spec: EventSpec, timeout: float) -> Event:
        """The event with this index in the file."""
        path: KeyPath = ("events", index)
        if spec.at is not None and spec.at >= timeout:
            what = f"expected a time before the mission's timeout, {timeout:g} s, got {spec.at:g}"
            self._refuse((*path, "at"), what)
        action = getattr(spec, spec.key)
        self._check(action, (*path, spec.key))
        given = spec.model_dump(mode="json", exclude_unset=True)
        lasting = math.inf if spec.lasting is None else spec.lasting
        if spec.near is None:
            return Event(action, given, at=spec.at, lasting=lasting)
        point = self._point(spec.near, (*path, "near"))
        return Event(action, given, point=point, within=spec.near.within, lasting=lasting)

    def _point(self, near: NearTrigger, path: KeyPath) -> tuple[float, float]:
        if near.place is None:
            return near.x or 0.0, near.y or 0.0
        self._known("place", near.place, self.topo_map.places, (*path, "place"))
        place = self.topo_map.places[near.place]
        return place.x, place.y

    def _check(self, action: EventAction | BehaviorFault, path: KeyPath) -> None:
        match action:
            case BehaviorFault():
                self._known("behavior", action.name, self.behaviors, (*path, "name"))
            case DoorChange():
                self._known("door", action.name, self.doors, (*path, "name"))
            case Textureless(name=str(name)):
                self._known("wall or thing", name, self.things, (*path, "name"))
            case Obstacle():
                self._check_obstacle(action, path)
            case _:
                pass

    def _check_obstacle(self, obstacle: Obstacle, path: KeyPath) -> None:
        textures = {*STOCK, *self.world.textures}
        self._known("texture", obstacle.texture, textures, (*path, "texture"))
        if obstacle.name in self.taken:
            what = f"the name {obstacle.name!r} is taken; give the obstacle a name of its own"
            self._refuse((*path, "name"), what)
        self.taken.add(obstacle.name)
        if obstacle.at is not None:
            (x, y), world = obstacle.at, self.world
            if not (world.x[0] <= x <= world.x[1] and world.y[0] <= y <= world.y[1]):
                floor = f"x {list(world.x)} y {list(world.y)} [m]"
                self._refuse((*path, "at"), f"{[x, y]} lies off the floor, {floor}")
            if hole := drop_under(world, obstacle.footprint(x, y)):
                what = f"{obstacle.name!r} would stand on nothing over {hole.name!r}, x"
                what += f" {list(hole.x)} y {list(hole.y)} [m]; move it, or make it smaller"
                self._refuse((*path, "at"), what)

    def _known(self, what: str, name: str, known: Iterable[str], path: KeyPath) -> None:
        names = list(known)
        if name not in names:
            raise UnknownNameError(what, name, names, **self._where(path))

    def _refuse(self, path: KeyPath, what: str) -> NoReturn:
        raise ConfigError(what, **self._where(path))

    def _where(self, path: KeyPath) -> dict[str, Any]:
        origin = self.document.origin_of(path)
        return {
            "file": origin.file,
            "line": origin.line,
            "key": origin.option or key_text(path),
        }
