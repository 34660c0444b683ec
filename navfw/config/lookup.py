"""Find worlds, missions, maps, stacks, robots and behaviours by name or path.

A project is the nearest folder, from the working folder upwards, that has a ``navfw.toml`` or a
``pyproject.toml`` with a ``[tool.navfw]`` table. The search ends below the first folder that
another user owns or that anyone may write to, as ``/tmp``: a project planted there is never used.
The working folder itself is always looked at.

A project has the same shape as navfw's repository:
``worlds/<world>/world.yaml``, ``worlds/<world>/missions/*.yaml``, ``maps/*.yaml``,
``stacks/*.yaml``, ``robots/*.yaml``, ``behaviors/*.py``. A file of the project takes precedence
over the shipped one of the same name.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal, TypeAlias

from navfw.config.input_file import is_file, no_such_file, read_input_text
from navfw.config.ownership import own_folders
from navfw.errors import ConfigError, UnknownNameError

Kind: TypeAlias = Literal["world", "map", "stack", "robot", "mission"]
_SUFFIXES = {".yaml", ".yml"}
_PACKAGE = Path(__file__).parents[1]
_MAX_PROJECT = 500_000
"""Largest size of a ``pyproject.toml`` [byte]."""


@dataclass(frozen=True)
class NamedFile:
    """A world, mission, map, stack or robot: name, file, and whether the project's or shipped."""

    name: str
    path: Path
    source: Literal["project", "shipped"]


@dataclass(frozen=True)
class _DataFolders:
    """The data folders of the project, or the shipped ones."""

    source: Literal["project", "shipped"]
    worlds: Path
    maps: Path
    stacks: Path
    robots: Path
    behaviors: Path


def project_folder(start: Path | None = None) -> Path | None:
    """The user's project around ``start`` (default: the working folder), or None.

    Raises:
        ConfigError: a ``pyproject.toml`` that contains ``tool.navfw`` is not valid TOML.

    """
    try:
        start = Path.cwd() if start is None else start.absolute()
    except FileNotFoundError:  # the working folder has been removed
        return None
    around = (folder for folder in own_folders(start) if folder != start)
    return next((folder for folder in (start, *around) if _is_project(folder)), None)


def _is_project(folder: Path) -> bool:
    try:
        if is_file(folder / "navfw.toml"):
            return True
        text = read_input_text(folder / "pyproject.toml", _MAX_PROJECT)
    except ConfigError:
        return False
    try:
        return "navfw" in text and _has_section(text)
    except (ValueError, RecursionError) as error:  # also an integer of thousands of digits
        if "tool.navfw" not in text:
            return False
        reason = "nested too deeply" if isinstance(error, RecursionError) else error
        raise ConfigError(f"not valid TOML: {reason}", file=folder / "pyproject.toml") from None


@lru_cache(maxsize=8)
def _has_section(text: str) -> bool:
    """Whether the TOML ``text`` has a section ``tool.navfw``."""
    tool = tomllib.loads(text).get("tool", {})
    return isinstance(tool, dict) and "navfw" in tool


def shipped_folder() -> Path:
    """The folder with navfw's own worlds, maps and behaviours.

    ``navfw/shipped`` in an installed package, the repository's root in a checkout.
    """
    installed = _PACKAGE / "shipped"
    return installed if installed.is_dir() else _PACKAGE.parent


def _data_folders(start: Path | None = None) -> list[_DataFolders]:
    shipped = shipped_folder()
    found = [
        _DataFolders(
            "shipped",
            shipped / "worlds",
            shipped / "maps",
            _PACKAGE / "stack" / "stacks",
            _PACKAGE / "robot" / "robots",
            shipped / "behaviors",
        )
    ]
    project = project_folder(start)
    if project is not None and project.resolve() != shipped.resolve():
        parts = ("worlds", "maps", "stacks", "robots", "behaviors")
        folders = (project / part for part in parts)
        found.insert(0, _DataFolders("project", *folders))
    return found


def plugin_folders() -> list[Path]:
    """Folders with plugins: the shipped one, then the project's ``behaviors`` and ``plugins``."""
    shipped = _data_folders()[-1].behaviors
    return [shipped] * shipped.is_dir() + project_plugin_folders()


def project_plugin_folders(start: Path | None = None) -> list[Path]:
    """The folders ``behaviors`` and ``plugins`` of the project around ``start``, if they exist.

    None in a checkout of navfw: what it ships is no project.
    """
    folders = [part.behaviors for part in _data_folders(start) if part.source == "project"]
    folders += [folder.with_name("plugins") for folder in folders]
    return [folder for folder in folders if folder.is_dir()]


def plugin_files(folder: Path) -> list[Path]:
    """The files of a folder of plugins that are imported: all ``*.py`` but ``_*.py``.

    Raises:
        OSError: ``folder`` cannot be read.

    """
    files = (path for path in folder.iterdir() if path.suffix == ".py")
    return sorted(path for path in files if not path.name.startswith(("_", ".")))


def list_worlds() -> list[NamedFile]:
    """All worlds by name; ``path`` is the world file."""
    return _first_of_each_name(
        NamedFile(file.parent.name, file, part.source)
        for part in _data_folders()
        for file in sorted(part.worlds.glob("*/world.yaml"))
        if is_file(file) and not file.parent.name.startswith((".", "_"))
    )


def list_missions(world: str | Path) -> list[NamedFile]:
    """All missions of a world (name or path); a project may add missions to a shipped world.

    Raises:
        UnknownNameError: there is no such world.
        ConfigError: ``world`` is a path, and no such file exists.

    """
    file = find("world", world)
    folders: list[tuple[Literal["project", "shipped"], Path]] = []
    by_name = [(part.source, part.worlds / file.parent.name) for part in _data_folders()]
    if any(file.parent.resolve() == folder.resolve() for _, folder in by_name):
        folders += by_name
    else:
        folders.append(("project", file.parent))
    return _first_of_each_name(
        found for source, folder in folders for found in _yaml_files(folder / "missions", source)
    )


def list_maps() -> list[NamedFile]:
    """All topological maps by name."""
    return _first_of_each_name(
        f for part in _data_folders() for f in _yaml_files(part.maps, part.source)
    )


def list_stacks() -> list[NamedFile]:
    """All stack files by name."""
    return _first_of_each_name(
        f for part in _data_folders() for f in _yaml_files(part.stacks, part.source)
    )


def list_robots() -> list[NamedFile]:
    """All robot files by name."""
    return _first_of_each_name(
        f for part in _data_folders() for f in _yaml_files(part.robots, part.source)
    )


def find(kind: Kind, name: str | Path, base: Path | None = None) -> Path:
    """The file of a world, map, stack, robot or mission.

    ``name`` is a path (relative to ``base``, or to the working folder) when it ends in ``.yaml`` or
    contains a ``/``; a world may be given by its folder. The name of a mission is
    ``world/mission``.

    Raises:
        UnknownNameError: there is none of that name; the message gives the nearest name.
        ConfigError: ``name`` is a path, and no such file exists.

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
        case "robot":
            known = list_robots()
        case "mission":
            known = [
                NamedFile(f"{world.name}/{mission.name}", mission.path, mission.source)
                for world in list_worlds()
                for mission in list_missions(world.name)
            ]
    return _pick(kind, text, known)


def find_mission(world: str | Path, name: str | Path) -> Path:
    """The file of a mission of ``world``; ``name`` may be a path as well.

    Raises:
        UnknownNameError: there is no such world, or it has no such mission.
        ConfigError: ``world`` or ``name`` is a path, and no such file exists.

    """
    as_path = _as_path("mission", name, None)
    if as_path is not None:
        find("world", world)  # raises for an unknown world
        return as_path
    return _pick("mission", str(name), list_missions(world))


def _as_path(kind: Kind, name: str | Path, base: Path | None) -> Path | None:
    path = (base or Path()) / name
    text = str(name)
    looks_like_path = path.suffix in _SUFFIXES or "/" in text or "\\" in text
    if kind == "world" and is_file(path / "world.yaml"):
        return path / "world.yaml"
    if not looks_like_path:
        return None
    if not is_file(path):
        raise no_such_file(path)
    return path


def _pick(what: str, name: str, known: list[NamedFile]) -> Path:
    for found in known:
        if found.name == name:
            return found.path
    raise UnknownNameError(what, name, (found.name for found in known))


def _yaml_files(folder: Path, source: Literal["project", "shipped"]) -> Iterator[NamedFile]:
    for file in sorted(folder.glob("*.yaml")):
        if is_file(file) and not file.name.startswith((".", "_")):
            yield NamedFile(file.stem, file, source)


def _first_of_each_name(found: Iterator[NamedFile]) -> list[NamedFile]:
    by_name: dict[str, NamedFile] = {}
    for item in found:
        by_name.setdefault(item.name, item)
    return sorted(by_name.values(), key=lambda item: item.name)
