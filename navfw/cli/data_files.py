"""Checks and summaries of data files for ``navfw check`` and ``navfw list``.

``navfw.config.file_kinds`` names the checks: they are those before a run. Summaries are read only
from the file: worlds are not built, and maps not checked.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, create_model

from navfw.config.document import load_yaml
from navfw.config.yamlfile import validate
from navfw.errors import PluginError
from navfw.stack.stack_document import STAGES, read_stack

if TYPE_CHECKING:
    from navfw.missions.session import Session
    from navfw.plugins import Registry
    from navfw.robot import RobotModel


def check_map(path: Path, registry: Registry) -> None:
    """Check a map and its kinds of landmarks."""
    from navfw.features.landmark_appearance import check_landmark_kind
    from navfw.topomap.mapfile import load_map

    del registry
    load_map(path, check_landmark_kind)


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
    """Check a stack, all parameters of its plugins, and the files that these read."""
    from navfw.stack.stackfile import load_stack

    for chosen in load_stack(path, registry).plugins:
        chosen.check_files()


_KEYS: dict[str, dict[str, Any]] = {
    "mission": {
        "map": (str | None, None),
        "start": (list[float] | dict[str, Any] | str, ...),
        "goals": (list[str | dict[str, Any]], ...),
        "timeout": (float | None, None),
    },
    "map": {"places": (dict[str, Any], ...), "edges": (list[Any], [])},
    "suite": {"entries": (list[Any], ...), "variants": (dict[str, Any], {})},
    # all have a composite
    "stack": dict.fromkeys((*STAGES[:-3], "behaviors", *STAGES[-2:]), (dict[str, Any], ...)),
}
"""The keys that listings show besides the description, each with type and default."""


def summary(kind: str, path: Path) -> dict[str, Any]:
    """What ``navfw list`` shows of the file of a ``kind`` at ``path``: description and columns.

    Other keys are not checked. For maps and suites it has the numbers of parts; for stacks the
    names of each stage's plugins.

    Raises:
        InputError: the file cannot be read, or lacks what is shown.

    """
    if kind == "robot":
        return _robot_summary(path)
    about: Any = {"description": (str, ""), **_KEYS.get(kind, {})}
    model: type[BaseModel] = create_model(kind, __config__=ConfigDict(extra="ignore"), **about)
    document = read_stack(path) if kind == "stack" else load_yaml(path)
    values = validate(document, model).model_dump()
    if kind == "mission":
        return values
    text = {"description": values.pop("description")}
    if kind == "stack":
        return text | {"plugins": {stage: list(values[stage]) for stage in values}}
    return text | {key: len(value) for key, value in values.items()}


def _robot_summary(path: Path) -> dict[str, Any]:
    """Return the description of a robot, its body [m], top speed [m/s] and camera."""
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
