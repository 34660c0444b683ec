"""Where things are: a name such as ``office`` is a path, or of the user's project, or shipped.

A project is the nearest folder, from the working folder upwards, that has a ``navfw.toml`` or a
``pyproject.toml`` with a ``[tool.navfw]`` table. It has the same shape as navfw's repository:
``worlds/<world>/world.yaml``, ``worlds/<world>/missions/*.yaml``, ``maps/*.yaml``,
``stacks/*.yaml``, ``behaviors/*.py``. What it has goes before what ships under the same name.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import navfw
from navfw.config.document import no_such_file
from navfw.errors import ConfigError, UnknownNameError

__all__ = [
    "Found",
    "Kind",
    "behavior_folders",
    "find",
    "find_mission",
    "list_maps",
    "list_missions",
    "list_stacks",
    "list_worlds",
    "project_folder",
    "shipped_folder",
]

Kind: TypeAlias = Literal["world", "map", "stack", "mission"]
_SUFFIXES = {".yaml", ".yml"}


@dataclass(frozen=True)
class Found:
    """One thing that has a name: its file, and whether it is the project's or shipped."""

    name: str
    path: Path
    source: Literal["project", "shipped"]


@dataclass(frozen=True)
class _Layer:
    source: Literal["project", "shipped"]
    worlds: Path
    maps: Path
    stacks: Path
    behaviors: Path


def project_folder(start: Path | None = None) -> Path | None:
    """The user's project around ``start`` (default: the working folder), or None.

    Raises:
        ConfigError: a ``pyproject.toml`` that mentions ``tool.navfw`` is not readable TOML.

    """
    try:
        start = Path.cwd() if start is None else start.absolute()
    except FileNotFoundError:  # the working folder has been removed
        return None
    return next((folder for folder in (start, *start.parents) if _is_project(folder)), None)


def _is_project(folder: Path) -> bool:
    try:
        if (folder / "navfw.toml").is_file():
            return True
        text = (folder / "pyproject.toml").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    if "navfw" not in text:
        return False
    try:
        tool = tomllib.loads(text).get("tool", {})
    except tomllib.TOMLDecodeError as error:
        if "tool.navfw" not in text:
            return False
        raise ConfigError(f"not valid TOML: {error}", file=folder / "pyproject.toml") from None
    return isinstance(tool, dict) and "navfw" in tool


def shipped_folder() -> Path:
    """The folder with navfw's own worlds, maps and behaviours.

    ``navfw/shipped`` in an installed package, the repository's root in a checkout.
    """
    package = Path(navfw.__file__).parent
    installed = package / "shipped"
    return installed if installed.is_dir() else package.parent


def _layers() -> list[_Layer]:
    shipped = shipped_folder()
    layers = [
        _Layer(
            "shipped",
            shipped / "worlds",
            shipped / "maps",
            Path(navfw.__file__).parent / "stacks",
            shipped / "behaviors",
        )
    ]
    project = project_folder()
    if project is not None and project.resolve() != shipped.resolve():
        folders = (project / part for part in ("worlds", "maps", "stacks", "behaviors"))
        layers.insert(0, _Layer("project", *folders))
    return layers


def behavior_folders() -> list[Path]:
    """The folders whose Python files are behaviours: the shipped one, then the project's."""
    return [layer.behaviors for layer in reversed(_layers()) if layer.behaviors.is_dir()]


def list_worlds() -> list[Found]:
    """All worlds by name; ``path`` is the world file."""
    return _first_of_each_name(
        Found(file.parent.name, file, layer.source)
        for layer in _layers()
        for file in sorted(layer.worlds.glob("*/world.yaml"))
        if not file.parent.name.startswith((".", "_"))
    )


def list_missions(world: str | Path) -> list[Found]:
    """All missions of a world (name or path); a project may add missions to a shipped world.

    Raises:
        UnknownNameError: there is no such world.
        ConfigError: ``world`` is a path to nothing.

    """
    file = find("world", world)
    folders: list[tuple[Literal["project", "shipped"], Path]] = []
    in_layers = [(layer.source, layer.worlds / file.parent.name) for layer in _layers()]
    if any(file.parent.resolve() == folder.resolve() for _, folder in in_layers):
        folders += in_layers
    else:
        folders.append(("project", file.parent))
    return _first_of_each_name(
        found for source, folder in folders for found in _yaml_files(folder / "missions", source)
    )


def list_maps() -> list[Found]:
    """All topological maps by name."""
    return _first_of_each_name(
        f for layer in _layers() for f in _yaml_files(layer.maps, layer.source)
    )


def list_stacks() -> list[Found]:
    """All stack files by name."""
    return _first_of_each_name(
        f for layer in _layers() for f in _yaml_files(layer.stacks, layer.source)
    )


def find(kind: Kind, name: str | Path, base: Path | None = None) -> Path:
    """The file of a world, map, stack or mission.

    ``name`` is a path when it ends in ``.yaml`` or has a ``/`` in it (relative to ``base``, or to
    the working folder); a world's folder will do for a world. A mission is named
    ``world/mission``.

    Raises:
        UnknownNameError: nothing of this kind has that name; the message names the nearest.
        ConfigError: ``name`` is a path to nothing.

    """
    text = str(name)
    if kind == "mission" and Path(text).suffix not in _SUFFIXES and text.count("/") == 1:
        world, _, mission = text.partition("/")
        return find_mission(world, mission)
    as_path = _as_path(kind, name, base)
    if as_path is not None:
        return as_path
    match kind:
        case "world":
            known = list_worlds()
        case "map":
            known = list_maps()
        case "stack":
            known = list_stacks()
        case "mission":
            known = [
                Found(f"{world.name}/{mission.name}", mission.path, mission.source)
                for world in list_worlds()
                for mission in list_missions(world.name)
            ]
    return _pick(kind, text, known)


def find_mission(world: str | Path, name: str | Path) -> Path:
    """The file of a mission of ``world``; ``name`` may be a path as well.

    Raises:
        UnknownNameError: there is no such world, or it has no such mission.
        ConfigError: one of both is a path to nothing.

    """
    as_path = _as_path("mission", name, None)
    if as_path is not None:
        find("world", world)  # a mission alone does not excuse an unknown world
        return as_path
    return _pick("mission", str(name), list_missions(world))


def _as_path(kind: Kind, name: str | Path, base: Path | None) -> Path | None:
    path = (base or Path()) / name
    text = str(name)
    looks_like_path = path.suffix in _SUFFIXES or "/" in text or "\\" in text
    if kind == "world" and (path / "world.yaml").is_file():
        return path / "world.yaml"
    if not looks_like_path:
        return None
    if not path.is_file():
        raise no_such_file(path)
    return path


def _pick(what: str, name: str, known: list[Found]) -> Path:
    for found in known:
        if found.name == name:
            return found.path
    raise UnknownNameError(what, name, (found.name for found in known))


def _yaml_files(folder: Path, source: Literal["project", "shipped"]) -> Iterator[Found]:
    for file in sorted(folder.glob("*.yaml")):
        if not file.name.startswith((".", "_")):
            yield Found(file.stem, file, source)


def _first_of_each_name(found: Iterator[Found]) -> list[Found]:
    by_name: dict[str, Found] = {}
    for item in found:
        by_name.setdefault(item.name, item)
    return sorted(by_name.values(), key=lambda item: item.name)
