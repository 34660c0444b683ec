"""Schema of a mission's events: faults of sensors, drive and behaviours, changes of the world.

An event has one trigger (``at`` or ``near``), one action, and optionally a duration::

    events:
      - {at: 8, lasting: 4, camera: black}                    # simulated seconds
      - {at: 0, camera: {hfov_error: 0.05}}                   # from the start on
      - {near: {place: door, within: 1.5}, door: {name: lab-door, state: closed}}
      - {near: {x: 3, y: 2, within: 1}, behavior: {name: avoid, does: raises}}

``near`` is evaluated with the true position. The stack gets no information about events.
Checks against map, world and stack: ``navfw.missions.mission_events``. The shipped event plugin is
composed of other events.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.interfaces import MissionEvent
from navfw.plugins.fault_injection import Failure
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

_TRIGGERS = ("at", "near")

Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Seconds = Annotated[float, Field(ge=0.0, le=7200.0)]
Duration = Annotated[float, Field(gt=0.0, le=7200.0)]


class NearTrigger(StrictModel):
    """The robot's true centre comes within a distance of a place of the map, or of a point."""

    place: Annotated[str | None, Field(description="a place of the map")] = None
    x: Annotated[Coordinate | None, Field(description="or a point: x [m] in the map frame")] = None
    y: Annotated[Coordinate | None, Field(description="y [m] in the map frame")] = None
    within: Annotated[
        float, Field(gt=0.0, le=100.0, description="distance of the robot's centre from it [m]")
    ]

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        point = self.x is not None and self.y is not None
        if point == (self.place is not None) or (self.x is None) != (self.y is None):
            raise ValueError("expected either place, or x and y")
        return self


class BehaviorFault(StrictModel):
    """A behaviour of the stack fails at every proposal."""

    name: Annotated[str, Field(description="name of a behaviour of the stack")]
    does: Annotated[Failure, Field(description="how it fails")]


class EventSpec(StrictModel):
    """An event of a mission: one trigger, one action."""

    at: Annotated[Seconds | None, Field(description="trigger: simulated time [s]")] = None
    near: Annotated[
        NearTrigger | None, Field(description="or trigger: the robot is first this near")
    ] = None
    lasting: Annotated[
        Duration | None, Field(description="duration [s]; left out: to the end of the mission")
    ] = None
    camera: Annotated[CameraFault | None, Field(description="a fault of the camera")] = None
    gyro: Annotated[GyroFault | None, Field(description="a fault of the gyro")] = None
    encoders: Annotated[EncoderFault | None, Field(description="encoders that stop counting")] = (
        None
    )
    weak_wheel: Annotated[WeakWheel | None, Field(description="a wheel slower than commanded")] = (
        None
    )
    slippery: Annotated[Slippery | None, Field(description="wheel slip")] = None
    light: Annotated[LightChange | None, Field(description="lamps dimmed or off")] = None
    textureless: Annotated[Textureless | None, Field(description="walls without texture")] = None
    behavior: Annotated[BehaviorFault | None, Field(description="a behaviour that fails")] = None
    door: Annotated[DoorChange | None, Field(description="a door that opens or closes")] = None
    obstacle: Annotated[Obstacle | None, Field(description="an obstacle that appears")] = None
    plugin: Annotated[
        dict[str, dict[str, Any] | None] | None,
        Field(min_length=1, max_length=1, description="an event plugin, as {NAME: {parameters}}"),
    ] = None

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
        """The key of its action."""
        return next(key for key in _actions() if getattr(self, key) is not None)


def _actions() -> list[str]:
    return [key for key in EventSpec.model_fields if key not in (*_TRIGGERS, "lasting")]


class Blackout(MissionEvent):
    """A power failure: the lamps dim, and all open doors of the world close."""

    name: ClassVar[str] = "blackout"

    class Params(MissionEvent.Params):
        """The emergency lighting."""

        light: Annotated[float, Field(ge=0.0, le=1.0, description="share of light left")] = 0.3

    params: Params

    def actions(self, world: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Dim the lamps, and close every open door."""
        doors = [door["name"] for door in world["doors"] if door["state"] == "open"]
        return [
            {"light": {"share": self.params.light}},
            *({"door": {"name": name, "state": "closed"}} for name in doors),
        ]
