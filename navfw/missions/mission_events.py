"""Events of a mission: checked before a run, begun and ended during it, and recorded.

They are checked against the mission's map, its world and the behaviours of the stack.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias, cast

from pydantic import ValidationError

from navfw.config.yaml_text import KeyPath, key_text
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, PluginError, UnknownNameError
from navfw.guard import construct, contained
from navfw.interfaces import MissionEvent
from navfw.missions.missionfile import MissionFile
from navfw.missions.missionspec import BehaviorFault, EventSpec
from navfw.plugins import Registry
from navfw.signals import Pose
from navfw.signals.immutability import immutable
from navfw.sim.event_actions import DoorChange, EventAction, Obstacle, Textureless
from navfw.sim.solids import drop_under
from navfw.sim.textures import STOCK
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack
from navfw.topomap import Place

if TYPE_CHECKING:
    from navfw.plugins.fault_injection import FaultInjector
    from navfw.sim.simulation import Simulation


@dataclass(slots=True)
class EventRecord:
    """An event that happened, from ``began_s`` to ``ended_s`` [s]; None: to the end of the run.

    ``event`` is the event as the mission file gives it.
    """

    event: Mapping[str, Any]
    began_s: float
    ended_s: float | None = None


EventTarget: TypeAlias = "Simulation | FaultInjector"
"""What an event's action is applied to: the simulation, or a behaviour of the stack."""


class EventClock:
    """Begins and ends the events of one run, and records their times.

    ``places`` of the map, by name, are those that events can be near to. ``told`` is called with
    the records of all events so far whenever one has begun or ended.
    """

    def __init__(
        self,
        events: Iterable[tuple[EventSpec, EventTarget]],
        places: Mapping[str, Place] | None = None,
        told: Callable[[Sequence[EventRecord]], object] = lambda _: None,
    ) -> None:
        self._told = told
        self._places = places or {}
        self._waiting = list(events)
        self._running: list[tuple[EventSpec, EventTarget, EventRecord]] = []
        self._log: list[EventRecord] = []

    @property
    def log(self) -> tuple[EventRecord, ...]:
        """The records of the events so far, in the order in which they began."""
        return tuple(self._log)

    def tick(self, time: float, robot: Pose) -> None:
        """End and begin the events due at ``time`` [s]; ``robot`` is the robot's true pose."""
        if not (self._running or self._waiting):
            return
        running = len(self._running)
        for event, target, record in self._running:
            if event.lasting is not None and time - record.began_s >= event.lasting - 1e-9:
                target.end(event.action)
                record.ended_s = time
        self._running = [running for running in self._running if running[2].ended_s is None]
        due = [waiting for waiting in self._waiting if self._due(waiting[0], time, robot)]
        self._waiting = [waiting for waiting in self._waiting if waiting not in due]
        for event, target in due:
            target.begin(event.action)
            as_given = event.model_dump(mode="json", exclude_unset=True)
            self._log.append(EventRecord(as_given, time))
            self._running.append((event, target, self._log[-1]))
        if due or len(self._running) < running:
            self._told(self._log)

    def _due(self, event: EventSpec, time: float, robot: Pose) -> bool:
        near = event.near
        if near is None:
            return time >= (event.at or 0.0) - 1e-9
        at = near if near.place is None else self._places[near.place]
        return math.hypot(robot.x - (at.x or 0.0), robot.y - (at.y or 0.0)) <= near.within


def resolve_events(
    mission: MissionFile, world: WorldSpec, stack: Stack, plugins: Registry
) -> tuple[EventSpec, ...]:
    """Check the events of a mission file against map, world and ``stack``, and return them.

    An event of a plugin is replaced by the events that the plugin composes.

    Raises:
        ConfigError: an event lies after the mission's timeout, or an obstacle off the floor or over
            a drop.
        UnknownNameError: an event names a place, door, behaviour, wall, object, texture or plugin
            that does not exist.
        PluginError: an event plugin is broken, or its actions are not valid.

    """
    checker = _Checker(mission, world, stack)
    return tuple(
        checker.check(index, composed)
        for index, spec in enumerate(mission.spec.events)
        for composed in checker.composed(index, spec, plugins)
    )


def with_doors_open(world: WorldSpec, specs: Sequence[EventSpec]) -> WorldSpec:
    """Return ``world`` with all doors open that an event opens: paths may lead through them."""
    opened = {s.door.name for s in specs if s.door is not None and s.door.state == "open"}
    doors = tuple(
        door.model_copy(update={"state": "open"}) if door.name in opened else door
        for door in world.doors
    )
    return world.model_copy(update={"doors": doors})


class _Checker:
    """Checks the names and positions in events; collects the names of obstacles that they add."""

    def __init__(self, mission: MissionFile, world: WorldSpec, stack: Stack) -> None:
        self.mission = mission
        self.world = world
        self.stack = stack
        self.doors = [door.name for door in world.doors]
        self.objects = [
            *(wall.name for wall in world.walls),
            *(box.name for box in world.boxes),
            *(cylinder.name for cylinder in world.cylinders),
        ]
        movers = [mover.name for mover in world.movers]
        drops = [drop.name for drop in world.drops]
        meshes = [mesh.name for mesh in world.meshes]
        self.taken = {"floor", *self.objects, *self.doors, *meshes, *movers, *drops}

    def composed(self, index: int, spec: EventSpec, plugins: Registry) -> Sequence[EventSpec]:
        """Return the event itself, or the events that its plugin composes it of."""
        if spec.plugin is None:
            return (spec,)
        ((name, _),) = spec.plugin.items()
        path: KeyPath = ("events", index, "plugin")
        document, shown = self.mission.document, key_text((*path, name))
        with document.locating(path, shown, only=UnknownNameError):
            plugin = cast(type[MissionEvent], plugins.get("event", name))
        params = validate(document, plugin.Params, (*path, name))
        trigger = spec.model_dump(exclude_unset=True, exclude={"plugin"})
        with document.locating(path, shown):
            try:
                contents = immutable(self.world.model_dump(mode="json"))
                event = construct(plugin, self.stack.robot, params)
                with contained(f"event {name}"):
                    actions = [dict(action) for action in event.actions(contents)]
                return [EventSpec.model_validate({**trigger, **action}) for action in actions]
            except ValidationError as error:
                first = error.errors(include_url=False)[0]
                what = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
                raise PluginError(f"the event plugin gave an invalid action: {what}") from None

    def check(self, index: int, spec: EventSpec) -> EventSpec:
        """Return the event with this index in the file, checked."""
        path: KeyPath = ("events", index)
        timeout = self.mission.spec.timeout
        if spec.at is not None and spec.at >= timeout:
            what = f"expected a time before the mission's timeout, {timeout:g} s, got {spec.at:g}"
            self._refuse((*path, "at"), what)
        self._check(getattr(spec, spec.key), (*path, spec.key))
        if spec.near is not None and spec.near.place is not None:
            places = self.mission.topo_map.places
            self._check_name("place", spec.near.place, places, (*path, "near", "place"))
        return spec

    def _check(self, action: EventAction | BehaviorFault, path: KeyPath) -> None:
        match action:
            case BehaviorFault():
                behaviors = self.stack.mofis.behaviors
                self._check_name("behavior", action.name, behaviors, (*path, "name"))
            case DoorChange():
                self._check_name("door", action.name, self.doors, (*path, "name"))
            case Textureless(name=str(name)):
                self._check_name("wall or object", name, self.objects, (*path, "name"))
            case Obstacle():
                self._check_obstacle(action, path)

    def _check_obstacle(self, obstacle: Obstacle, path: KeyPath) -> None:
        textures = {*STOCK, *self.world.textures}
        self._check_name("texture", obstacle.texture, textures, (*path, "texture"))
        if obstacle.name in self.taken:
            what = f"the name {obstacle.name!r} is taken; choose another name for the obstacle"
            self._refuse((*path, "name"), what)
        self.taken.add(obstacle.name)
        if obstacle.at is not None:
            (x, y), world = obstacle.at, self.world
            if not (world.x[0] <= x <= world.x[1] and world.y[0] <= y <= world.y[1]):
                floor = f"x {list(world.x)} y {list(world.y)} [m]"
                self._refuse((*path, "at"), f"{[x, y]} lies off the floor, {floor}")
            if hole := drop_under(world, obstacle.footprint(x, y)):
                what = f"{obstacle.name!r} would have no floor under it at {hole.name!r}, x"
                what += f" {list(hole.x)} y {list(hole.y)} [m]; move it, or make it smaller"
                self._refuse((*path, "at"), what)

    def _check_name(self, what: str, name: str, names: Collection[str], path: KeyPath) -> None:
        if name not in names:
            with self.mission.document.locating(path):
                raise UnknownNameError(what, name, names)

    def _refuse(self, path: KeyPath, what: str) -> NoReturn:
        with self.mission.document.locating(path):
            raise ConfigError(what)
