"""``navfw check`` and ``navfw list`` of data files whose kind needs more than a load.

The functions are named in ``navfw.config.file_kinds``. Checks are those before a run. Summaries are
read from a file alone: worlds are not built, and maps not checked.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, create_model

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.yamlfile import validate
from navfw.errors import InputError, PluginError
from navfw.stack.stack_document import STAGES, read_stack

if TYPE_CHECKING:
    from navfw.missions.session import Session
    from navfw.plugins import Registry
    from navfw.robot import RobotModel


_KEYS: dict[str, dict[str, Any]] = {
    "file": {},
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


def _read(kind: str, document: YamlDocument) -> dict[str, Any]:
    """The description and the keys of a ``kind`` in a file; other keys are not checked."""
    about: Any = {"description": (str, ""), **_KEYS[kind]}
    model: type[BaseModel] = create_model(kind, __config__=ConfigDict(extra="ignore"), **about)
    return validate(document, model).model_dump()


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
    return _read("file", load_yaml(path))


def mission_summary(path: Path) -> dict[str, Any]:
    """Description, map, start, goals and timeout [s] in a mission file."""
    return _read("mission", load_yaml(path))


def map_summary(path: Path) -> dict[str, Any]:
    """The description in a map file, and the numbers of its places and edges."""
    return _counted(_read("map", load_yaml(path)))


def stack_summary(path: Path) -> dict[str, Any]:
    """The description of a stack, and the names of the plugins of each stage."""
    stages = _read("stack", read_stack(path))
    text = stages.pop("description")
    return {"description": text, "plugins": {stage: list(stages[stage]) for stage in stages}}


def suite_summary(path: Path) -> dict[str, Any]:
    """The description of a suite, and the numbers of its entries and variants."""
    return _counted(_read("suite", load_yaml(path)))


def _counted(values: dict[str, Any]) -> dict[str, Any]:
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
