"""Rows of the listings, read from a file alone: worlds are not built and maps not checked."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict

from navfw.config.document import load_yaml
from navfw.config.yamlfile import validate
from navfw.stack.stack_document import read_stack
from navfw.topomap.mapspec import MAX_BYTES, MAX_NODES

if TYPE_CHECKING:
    from navfw.robot import RobotModel


class _FileSummary(BaseModel):
    """The keys that listings show; the other keys are not checked."""

    model_config = ConfigDict(extra="ignore")

    description: str = ""


class _MissionSummary(_FileSummary):
    map: str | None = None
    start: list[float] | dict[str, Any] | str
    goals: list[str | dict[str, Any]]
    timeout: float | None = None


class _MapSummary(_FileSummary):
    places: dict[str, Any]
    edges: list[Any] = []


class _StackSummary(_FileSummary):
    flow: dict[str, Any]
    perception: dict[str, Any]
    features: dict[str, Any]
    localizer: dict[str, Any]
    planner: dict[str, Any]
    behaviors: dict[str, Any]
    fusion: dict[str, Any]
    controller: dict[str, Any]


SummaryT = TypeVar("SummaryT", bound=_FileSummary)


def world_summary(path: Path) -> dict[str, Any]:
    """The description in a world file."""
    return {"description": _read(path, _FileSummary).description}


def mission_summary(path: Path) -> dict[str, Any]:
    """Description, map, start, goals and timeout [s] in a mission file."""
    return _read(path, _MissionSummary).model_dump()


def map_summary(path: Path) -> dict[str, Any]:
    """The description in a map file, and the numbers of its places and edges."""
    spec = validate(load_yaml(path, MAX_BYTES, MAX_NODES), _MapSummary)
    return {
        "description": spec.description,
        "places": len(spec.places),
        "edges": len(spec.edges),
    }


def stack_summary(path: Path) -> dict[str, Any]:
    """The description of a stack, and the names of the plugins of each stage."""
    spec = validate(read_stack(path), _StackSummary)
    stages = spec.model_dump(exclude={"description"})
    return {
        "description": spec.description,
        "plugins": {stage: list(chosen) for stage, chosen in stages.items()},
    }


def robot_summary(path: Path) -> dict[str, Any]:
    """The description of a robot, its body [m], top speed [m/s] and camera."""
    from navfw.robot.robotfile import load_robot

    robot = load_robot(path)
    camera = robot.camera
    degrees = round(math.degrees(camera.hfov))
    return {
        "description": robot.description,
        "body": _body(robot),
        "speed": robot.max_v,
        "camera": f"{camera.width} x {camera.height}, {degrees} deg, {camera.rate:g} Hz",
    }


def _body(robot: RobotModel) -> str:
    """The measures of a body [m]."""
    footprint = robot.footprint
    if footprint is None:
        return f"round, radius {robot.radius:g} m, height {robot.height:g} m"
    return f"{footprint.front + footprint.rear:g} x {footprint.width:g} x {robot.height:g} m"


def _read(path: Path, model: type[SummaryT]) -> SummaryT:
    return validate(load_yaml(path), model)
