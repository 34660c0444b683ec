"""Check of one data file by its kind, which its folder or its keys tell."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from navfw.config.document import load_yaml
from navfw.config.input_file import shown_path
from navfw.errors import ConfigError, InputError, did_you_mean

if TYPE_CHECKING:
    from navfw.plugins import Registry

_FOLDERS = {
    "maps": "map",
    "missions": "mission",
    "robots": "robot",
    "stacks": "stack",
    "suites": "suite",
}
"""The kind of the files in a folder of that name."""

KEYS = {
    "places": "map",
    "goals": "mission",
    "rules": "rule base",
    "entries": "suite",
    "behaviors": "stack",
    "walls": "world",
}
"""The kind of a file elsewhere, by a key that only files of that kind have."""

_SUFFIXES = {".yaml", ".yml"}
_RULES = ("behaviors", "plugins")
_OF_A_WORLD = ("world.yaml", "missions/*")


def data_files(folder: Path) -> list[Path]:
    """The data files in ``folder``, of a project or one of its parts, in the order of their names.

    Rule bases beside a plugin's file are not among them: they are checked with the plugin.
    """
    worlds = [f"{part}{name}" for part in ("", "*/", "worlds/*/") for name in _OF_A_WORLD]
    parts = [f"{name}/*" for name in (*_FOLDERS, *_RULES)]
    whole = ["*"] if folder.resolve().name in {*_FOLDERS, *_RULES} else []
    found = {
        file
        for pattern in (*worlds, "worlds/suites/*", *parts, *whole)
        for file in folder.glob(pattern)
    }
    return sorted(file for file in found if _is_data_file(file))


def _is_data_file(file: Path) -> bool:
    of_plugin = file.parent.name in _RULES and file.with_suffix(".py").exists()
    return file.suffix in _SUFFIXES and not file.name.startswith((".", "_")) and not of_plugin


def kind_of_file(path: Path) -> str:
    """The kind of the data file at ``path``: map, mission, robot, rule base, stack, suite, world.

    Raises:
        ConfigError: neither its folder nor its keys tell, or it cannot be read.

    """
    folder = path.absolute().parent.name
    if path.name == "world.yaml":
        return "world"
    if folder in _FOLDERS:
        return _FOLDERS[folder]
    if folder in _RULES:
        return "rule base"
    data = load_yaml(path).data
    kinds = [kind for key, kind in KEYS.items() if isinstance(data, dict) and key in data]
    if not kinds:
        near = did_you_mean(next(iter(data), "") if isinstance(data, dict) else "", KEYS)
        what = f"no file of navfw: none of the keys {', '.join(KEYS)}; {near}"
        raise ConfigError(what, file=shown_path(path))
    return kinds[0]


def check_file(path: Path, registry: Registry) -> InputError | None:
    """What is wrong in the data file at ``path``; None if nothing is.

    A mission is checked with its world, its map and its stack, as before a run. A map is checked
    by itself; a stack with all parameters of its plugins.
    """
    try:
        checks: dict[str, Callable[[Path, Registry], None]] = {
            "map": _check_map,
            "mission": _check_mission,
            "robot": _check_robot,
            "rule base": _check_rule_base,
            "stack": _check_stack,
            "suite": _check_suite,
            "world": _check_world,
        }
        checks[kind_of_file(path)](path, registry)
    except InputError as error:
        return error
    return None


def _check_map(path: Path, registry: Registry) -> None:
    from navfw.topomap.mapfile import load_map

    def landmark_kind(name: str) -> str:
        try:
            return registry.get("landmark", name).name
        except InputError as error:
            raise ValueError(str(error)) from None

    load_map(path, landmark_kind)


def _check_mission(path: Path, registry: Registry) -> None:
    from navfw.missions.missionfile import load_mission
    from navfw.missions.session import prepare

    folder = path.absolute().parents[1]
    if (folder / "world.yaml").is_file():
        prepare(folder, path.absolute(), registry=registry)
    elif path.absolute().parent.name == "missions" and folder.parent.name == "worlds":
        prepare(folder.name, path.absolute(), registry=registry)  # of a shipped world
    else:
        load_mission(path)


def _check_robot(path: Path, registry: Registry) -> None:
    from navfw.robot.robotfile import load_robot

    del registry
    load_robot(path.absolute())


def _check_rule_base(path: Path, registry: Registry) -> None:
    from navfw.fuzzy import load_rule_base

    del registry
    load_rule_base(path)


def _check_stack(path: Path, registry: Registry) -> None:
    from navfw.stack.stackfile import load_stack

    for chosen in load_stack(path, registry).plugins:
        chosen.check_files()


def _check_suite(path: Path, registry: Registry) -> None:
    from navfw.suite.suitefile import load_suite

    del registry
    load_suite(path.absolute())


def _check_world(path: Path, registry: Registry) -> None:
    from navfw.sim.worldfile import load_world

    del registry
    load_world(path)
