"""``navfw check`` and ``navfw list`` of data files whose kind needs more than a load.

The functions are named in ``navfw.config.file_kinds``. Checks are those before a run. Summaries are
read from a file alone: worlds are not built, and maps not checked.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict

from navfw.config.document import load_yaml
from navfw.config.yamlfile import validate
from navfw.errors import InputError, PluginError
from navfw.stack.stack_document import read_stack

if TYPE_CHECKING:
    from navfw.missions.session import Session
    from navfw.plugins import Registry
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


class _SuiteSummary(_FileSummary):
    entries: list[Any]
    variants: dict[str, Any] = {}


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


def check_map(path: Path, registry: Registry) -> None:
    """Check a map by itself, and its kinds of landmark."""
    from navfw.topomap.mapfile import load_map

    def landmark_kind(name: str) -> str:
        try:
            return registry.get("landmark", name).name
        except InputError as error:
            raise ValueError(str(error)) from None

    load_map(path, landmark_kind)


def check_mission(path: Path, registry: Registry) -> None:
    """Check a mission with its world, its map and its stack, as before a run."""
    from navfw.missions.missionfile import load_mission
    from navfw.missions.session_setup import prepare

    folder = path.absolute().parents[1]
    if (folder / "world.yaml").is_file():
        _check_start(prepare(folder, path.absolute(), registry=registry))
    elif path.absolute().parent.name == "missions" and folder.parent.name == "worlds":
        _check_start(prepare(folder.name, path.absolute(), registry=registry))  # a shipped world
    else:
        load_mission(path)


def _check_start(session: Session) -> None:
    """Let the stack begin the mission, as at the first tick, and plan the way to its goals."""
    import numpy as np

    from navfw.guard import PluginCallError
    from navfw.signals import Belief

    known, pose = session.mission.start_known, session.mission.start
    try:
        session.stack.start(pose if known else None, session.mission.goals)
        if known:
            with session.stack.guard.watchdog.on_duty():
                session.stack.planner.update(Belief(0.0, pose, np.zeros((3, 3))))
    except PluginCallError as error:
        raise PluginError(str(error)) from None


def check_stack(path: Path, registry: Registry) -> None:
    """Check a stack with all parameters of its plugins, and the files that these read."""
    from navfw.stack.stackfile import load_stack

    for chosen in load_stack(path, registry).plugins:
        chosen.check_files()


def description(path: Path) -> dict[str, Any]:
    """The description in a file."""
    return {"description": _read(path, _FileSummary).description}


def mission_summary(path: Path) -> dict[str, Any]:
    """Description, map, start, goals and timeout [s] in a mission file."""
    return _read(path, _MissionSummary).model_dump()


def map_summary(path: Path) -> dict[str, Any]:
    """The description in a map file, and the numbers of its places and edges."""
    return _counted(validate(load_yaml(path), _MapSummary))


def stack_summary(path: Path) -> dict[str, Any]:
    """The description of a stack, and the names of the plugins of each stage."""
    spec = validate(read_stack(path), _StackSummary)
    stages = spec.model_dump(exclude={"description"})
    return {
        "description": spec.description,
        "plugins": {stage: list(chosen) for stage, chosen in stages.items()},
    }


def suite_summary(path: Path) -> dict[str, Any]:
    """The description of a suite, and the numbers of its entries and variants."""
    return _counted(_read(path, _SuiteSummary))


def _counted(spec: _FileSummary) -> dict[str, Any]:
    values = spec.model_dump()
    return {key: value if key == "description" else len(value) for key, value in values.items()}


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
    footprint = robot.footprint
    if footprint is None:
        return f"round, radius {robot.radius:g} m, height {robot.height:g} m"
    return f"{footprint.front + footprint.rear:g} x {footprint.width:g} x {robot.height:g} m"


def _read(path: Path, model: type[SummaryT]) -> SummaryT:
    return validate(load_yaml(path), model)
