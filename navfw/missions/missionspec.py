"""Schema of a mission file: start, goals, limits, sensors, robot, drops and events.

::

    description: From the lobby through two doors and the corridor to the lab.
    map: office
    start: [1.2, 1.2, 0.6]        # x, y [m], yaw [rad]; or {place: lobby, yaw: 0.6}
    goals: [lab]                  # places of the map, or {x: 14.6, y: 8.8}
    timeout: 150

With ``start: unknown`` the seed draws a start from the places of the map, with
``start: {unknown: [kitchen, lab]}`` from these places; the stack does not get it.

Without ``map`` the stack gets start and goals alone. Goals are then points, and the map consists of
the start, the goals, and straight passages of unknown width between them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from navfw.config.document import YamlDocument
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.missions.eventspec import EventSpec
from navfw.robot import RobotModel
from navfw.robot.robotfile import with_robot
from navfw.robot.urdf_drive import with_urdf
from navfw.sim.sensor_models import SensorParams
from navfw.sim.worldspec import DropSpec

Coordinate = Annotated[float, Field(ge=-500.0, le=500.0)]
Yaw = Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi)]
Unknown = Literal["unknown"]
"""``start: unknown``: any place of the map (see ``navfw.missions.missionfile``)."""


class PlaceStart(StrictModel):
    """A start at a place of the map."""

    place: Annotated[str, Field(description="a place of the map")]
    yaw: Annotated[Yaw, Field(description="counter-clockwise from x [rad]")] = 0.0


class UnknownStart(StrictModel):
    """A start at one of these places, unknown to the stack; the seed draws place and yaw."""

    unknown: Annotated[
        tuple[str, ...], Field(min_length=1, max_length=1000, description="places of the map")
    ]


class PointGoal(StrictModel):
    """A goal that is not a place of the map."""

    x: Annotated[Coordinate, Field(description="in the map frame [m]")]
    y: Annotated[Coordinate, Field(description="in the map frame [m]")]


class SuccessSpec(StrictModel):
    """The true distance from each goal that has to be reached; what a score is relative to."""

    within: Annotated[float, Field(gt=0.0, le=5.0, description="distance from a goal [m]")] = 0.5
    reference: Annotated[
        float | None,
        Field(
            gt=0.0,
            le=1e5,
            description="length of a benchmark's reference path, to which its score is relative"
            " [m]; left out: the robot's shortest path",
        ),
    ] = None


class SensorsSpec(SensorParams):
    """A preset of the sensors' parameters, and changes to it."""

    base: Annotated[
        Literal["perfect", "good", "default", "poor"],
        Field(alias="preset", description="the preset that the other keys change"),
    ] = "default"

    def resolved(self) -> SensorParams:
        """The parameters of the preset, overridden by those given in the file."""
        changed = {name: getattr(self, name) for name in self.model_fields_set - {"base"}}
        return SensorParams.preset(self.base, **changed)


class MissionSpec(StrictModel):
    """A mission as its file has it."""

    description: Annotated[str, Field(description="one line for people")] = ""
    map: Annotated[
        str | None,
        Field(description="name or file of a topological map; left out: start and goals alone"),
    ] = None
    stack: Annotated[
        str | None,
        Field(
            description="name or file of the stack; left out: `floor_plan` if the map has a floor"
            " plan, else `default`; --stack takes precedence"
        ),
    ] = None
    start: Annotated[
        tuple[Coordinate, Coordinate, Yaw] | PlaceStart | UnknownStart | Unknown,
        Field(
            description="[x, y, yaw], or {place: ..., yaw: ...}; unknown, or "
            "{unknown: [place, ...]}: drawn by the seed, not given to the stack"
        ),
    ]
    goals: Annotated[
        tuple[str | PointGoal, ...],
        Field(min_length=1, max_length=1000, description="places, or {x: ..., y: ...}, in order"),
    ]
    rounds: Annotated[
        int, Field(ge=1, le=100, description="number of times that the goals are visited in turn")
    ] = 1
    tolerance: Annotated[
        float,
        Field(ge=0.05, le=5.0, description="estimated distance at which a goal is reached [m]"),
    ] = 0.4
    success: SuccessSpec = SuccessSpec()
    timeout: Annotated[float, Field(gt=0.0, le=7200.0, description="simulated time [s]")] = 180.0
    stuck_after: Annotated[
        float,
        Field(gt=0.0, le=7200.0, description="time without progress that ends the mission [s]"),
    ] = 45.0
    sensors: Annotated[SensorsSpec, Field(description="errors of the sensors")] = SensorsSpec()
    robot: Annotated[
        RobotModel,
        Field(
            description="a robot's name or file, or {base: ..., KEY: ...}: changes to it; without"
            " base to the robot default. --robot takes precedence"
        ),
    ] = RobotModel()
    drops: Annotated[
        tuple[DropSpec, ...],
        Field(max_length=100, description="drops in the floor, added to those of the world"),
    ] = ()
    events: Annotated[
        tuple[EventSpec, ...],
        Field(max_length=1000, description="faults and changes of the world during the mission"),
    ] = ()


def mission_spec(document: YamlDocument, folder: Path) -> MissionSpec:
    """The mission in ``document``, of a file in ``folder``, with its robot completed.

    The robot gets the error data of the sensors' preset; those given by mission or robot file
    (``robot.odometry``) take precedence.

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
    return spec.model_copy(update={"robot": robot})
