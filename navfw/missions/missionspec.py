"""Schema of a mission file: start, goals, limits, sensors, robot, drops and events.

::

    description: From the lobby through two doors and the corridor to the lab.
    map: office
    start: [1.2, 1.2, 0.6]        # x, y [m], yaw [rad]; or {place: lobby, yaw: 0.6}
    goals: [lab]                  # places of the map, or {x: 14.6, y: 8.8}
    timeout: 150
    events:
      - {at: 8, lasting: 4, camera: black}                    # simulated seconds
      - {at: 0, camera: {hfov_error: 0.05}}                   # from the start on
      - {near: {place: door, within: 1.5}, door: {name: lab-door, state: closed}}
      - {near: {x: 3, y: 2, within: 1}, behavior: {name: avoid, does: raises}}

With ``start: unknown`` the seed draws a start from the places of the map, with
``start: {unknown: [kitchen, lab]}`` from these places; the stack is not given the start.

Without ``map`` the stack gets only start and goals. Goals are then points, and the map consists of
the start, the goals, and straight passages of unknown width between them.

With ``explore: {limit: 600, return: true}`` instead of goals the robot starts knowing nothing, and
maps all floor that it can reach. A ``map`` is then used only to look up a place to start at.

An event has one trigger (``at`` or ``near``), one action, and optionally a duration. ``near`` is
evaluated with the true position. The stack gets no information about events. Checks against map,
world and stack: ``navfw.missions.mission_events``. The shipped event plugin is composed of other
events.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from navfw.config.document import YamlDocument
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.interfaces import MissionEvent
from navfw.plugins.fault_injection import Failure
from navfw.robot import RobotModel
from navfw.robot.robotfile import with_robot
from navfw.robot.urdf_drive import with_urdf
from navfw.sim.event_actions import (
    CameraFault,
    DoorChange,
    EncoderFault,
    GyroFault,
    LightChange,
    Obstacle,
    Slippery,
    Textureless,
    WeakWheel,
)
from navfw.sim.sensor_models import SensorParams
from navfw.sim.worldspec import DropSpec

_TRIGGERS = ("at", "near")

Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Seconds = Annotated[float, Field(ge=0.0, le=7200.0)]
Duration = Annotated[float, Field(gt=0.0, le=7200.0)]


class NearTrigger(StrictModel):
    """Triggers when the robot's true centre comes within a distance of a place, or of a point."""

    place: str | None = Field(None, description="a place of the map")
    x: Coordinate | None = Field(None, description="or a point: x [m] in the map frame")
    y: Coordinate | None = Field(None, description="y [m] in the map frame")
    within: float = Field(
        gt=0.0, le=100.0, description="distance of the robot's centre from it [m]"
    )

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        point = self.x is not None and self.y is not None
        if point == (self.place is not None) or (self.x is None) != (self.y is None):
            raise ValueError("expected either place, or x and y")
        return self


class BehaviorFault(StrictModel):
    """Makes a behaviour of the stack fail at every proposal while the event lasts."""

    name: str = Field(description="name of a behaviour of the stack")
    does: Failure = Field(description="how it fails")


class EventSpec(StrictModel):
    """An event of a mission: one trigger, one action."""

    at: Seconds | None = Field(None, description="trigger: simulated time [s]")
    near: NearTrigger | None = Field(None, description="or trigger: the robot is first this near")
    lasting: Duration | None = Field(
        None, description="duration [s]; left out: to the end of the mission"
    )
    camera: CameraFault | None = Field(None, description="a fault of the camera")
    gyro: GyroFault | None = Field(None, description="a fault of the gyro")
    encoders: EncoderFault | None = Field(None, description="encoders that stop counting")
    weak_wheel: WeakWheel | None = Field(None, description="a wheel slower than commanded")
    slippery: Slippery | None = Field(None, description="wheel slip")
    light: LightChange | None = Field(None, description="lamps dimmed or off")
    textureless: Textureless | None = Field(None, description="walls without texture")
    behavior: BehaviorFault | None = Field(None, description="a behaviour that fails")
    door: DoorChange | None = Field(None, description="a door that opens or closes")
    obstacle: Obstacle | None = Field(None, description="an obstacle that appears")
    plugin: dict[str, dict[str, Any] | None] | None = Field(
        None, min_length=1, max_length=1, description="an event plugin, as {NAME: {parameters}}"
    )

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
        """The key of the event's action, such as ``camera``."""
        return next(key for key in _actions() if getattr(self, key) is not None)

    @property
    def action(self) -> Any:
        """The action that begins and ends with the event; for ``behavior``, its ``does``."""
        return getattr(self, self.key) if self.behavior is None else self.behavior.does


def _actions() -> list[str]:
    return [key for key in EventSpec.model_fields if key not in (*_TRIGGERS, "lasting")]


class Blackout(MissionEvent):
    """A power failure: the lamps dim, and all open doors of the world close."""

    name: ClassVar[str] = "blackout"

    class Params(MissionEvent.Params):
        """The emergency lighting."""

        light: float = Field(0.3, ge=0.0, le=1.0, description="share of light left")

    params: Params

    def actions(self, world: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Return the actions that dim the lamps and close every open door."""
        doors = [door["name"] for door in world["doors"] if door["state"] == "open"]
        return [
            {"light": {"share": self.params.light}},
            *({"door": {"name": name, "state": "closed"}} for name in doors),
        ]


Yaw = Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi, description="[rad]")]
Unknown = Literal["unknown"]
"""``start: unknown``: a random place of the map (see ``navfw.missions.missionfile``)."""


class PlaceStart(StrictModel):
    """A start at a place of the map."""

    place: str = Field(description="a place of the map")
    yaw: Yaw = Field(0.0, description="counter-clockwise from x [rad]")


class UnknownStart(StrictModel):
    """A start at one of these places, not given to the stack; the seed draws place and yaw."""

    unknown: tuple[str, ...] = Field(min_length=1, max_length=1000, description="places of the map")


class PointGoal(StrictModel):
    """A goal that is not a place of the map."""

    x: Coordinate = Field(description="in the map frame [m]")
    y: Coordinate = Field(description="in the map frame [m]")


class ExploreSpec(StrictModel):
    """An exploration: the robot observes all floor that it can reach, and drives back."""

    limit: float = Field(
        1800.0, gt=0.0, le=7200.0, description="time to be back at the start, or to stop [s]"
    )
    return_home: bool = Field(
        True, alias="return", description="drive back to the start; false: stop anywhere"
    )


class SuccessSpec(StrictModel):
    """How near the robot must truly come to each goal, and the reference length of the score."""

    within: float = Field(0.5, gt=0.0, le=5.0, description="distance from a goal [m]")
    reference: float | None = Field(
        None,
        gt=0.0,
        le=1e5,
        description="length of a benchmark's reference path, to which its score is relative"
        " [m]; left out: the robot's shortest path",
    )


class SensorsSpec(SensorParams):
    """A preset of the sensors' parameters, and changes to it."""

    base: Literal["perfect", "good", "default", "poor"] = Field(
        "default", alias="preset", description="the preset that the other keys change"
    )

    def resolved(self) -> SensorParams:
        """Return the parameters of the preset, overridden by those given in the file."""
        changed = {name: getattr(self, name) for name in self.model_fields_set - {"base"}}
        return SensorParams.preset(self.base, **changed)


class MissionSpec(StrictModel):
    """The schema of a mission file."""

    description: str = Field("", description="one line for people")
    map: str | None = Field(
        None, description="name or file of a topological map; left out: only start and goals"
    )
    stack: str | None = Field(
        None,
        description="name or file of the stack; left out: `explore` to explore, `floor_plan` if"
        " the map has a floor plan (from an unknown start `landmarks`, if it has these too), "
        "else `default`; --stack takes precedence",
    )
    start: tuple[Coordinate, Coordinate, Yaw] | PlaceStart | UnknownStart | Unknown = Field(
        description="[x, y, yaw], {place: ..., yaw: ...}, unknown, or {unknown: [place, ...]}"
    )
    goals: tuple[str | PointGoal, ...] = Field(
        (), min_length=1, max_length=1000, description="places, or {x: ..., y: ...}, in order"
    )
    explore: ExploreSpec | None = Field(
        None, description="instead of goals: explore without any map, {limit: ..., return: ...}"
    )
    rounds: int = Field(
        1, ge=1, le=100, description="number of times that the goals are visited in turn"
    )
    tolerance: float = Field(
        0.4, ge=0.05, le=5.0, description="estimated distance at which a goal is reached [m]"
    )
    success: SuccessSpec = SuccessSpec()
    timeout: float = Field(180.0, gt=0.0, le=7200.0, description="simulated time [s]")
    stuck_after: float = Field(
        45.0, gt=0.0, le=7200.0, description="time without progress that ends the mission [s]"
    )
    sensors: SensorsSpec = Field(SensorsSpec(), description="errors of the sensors")
    robot: RobotModel = Field(
        RobotModel(),
        description="a robot's name or file, or {base: ..., KEY: ...}: changes to it; without"
        " base to the robot default. --robot takes precedence",
    )
    drops: tuple[DropSpec, ...] = Field(
        (), max_length=100, description="drops in the floor, added to those of the world"
    )
    events: tuple[EventSpec, ...] = Field(
        (), max_length=1000, description="faults and changes of the world during the mission"
    )

    @model_validator(mode="after")
    def _goals_or_explore(self) -> Self:
        if bool(self.goals) == (self.explore is not None):
            got = "got both" if self.goals else "got neither"
            raise ValueError(f"expected either goals, or explore; {got}")
        if self.explore is not None and (self.rounds > 1 or self.unknown_start):
            what = "rounds" if self.rounds > 1 else "an unknown start"
            raise ValueError(f"{what} and explore exclude each other: the map begins at the start")
        return self

    @property
    def unknown_start(self) -> bool:
        """Whether the start is drawn by the seed and not given to the stack."""
        return isinstance(self.start, str | UnknownStart)


def mission_spec(document: YamlDocument, folder: Path) -> MissionSpec:
    """Validate the mission in ``document``, from a file in ``folder``, and complete its robot.

    The robot gets the odometry errors of the sensors' preset; those given in the mission or robot
    file (``robot.odometry``) take precedence.

    Raises:
        ConfigError: the document or the robot's file breaks the schema.
        UnknownNameError: there is no such robot.

    """
    document = with_robot(document, folder)
    spec = validate(document, MissionSpec)
    own = spec.robot.odometry
    sheet = SensorParams.preset(spec.sensors.base).sheet
    sheet = sheet.model_copy(update={name: getattr(own, name) for name in own.model_fields_set})
    robot = with_urdf(spec.robot, document, ("robot",)).model_copy(update={"odometry": sheet})
    return _completed(spec.model_copy(update={"robot": robot}))


EXPLORED_WITHIN, EXPLORED_TOLERANCE = 0.3, 0.15
"""The true and the estimated distance [m] from the start at which an exploration has returned."""
_AFTER_LIMIT = 60.0
"""Time [s] after an exploration's limit at which the mission times out."""


def _completed(spec: MissionSpec) -> MissionSpec:
    """Return the mission with the defaults of an exploration, if it is one."""
    if spec.explore is None:
        return spec
    changes: dict[str, Any] = {"timeout": spec.explore.limit + _AFTER_LIMIT}
    changes["tolerance"] = EXPLORED_TOLERANCE
    if "within" not in spec.success.model_fields_set:
        changes["success"] = spec.success.model_copy(update={"within": EXPLORED_WITHIN})
    own = spec.model_fields_set - {"success"}
    return spec.model_copy(update={k: v for k, v in changes.items() if k not in own})
