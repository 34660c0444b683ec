"""Finds the files of a project, and navfw's own, by name or path; their kinds are ``FILE_KINDS``.

A project is the nearest folder, from the working folder upwards, that has a ``navfw.toml`` or a
``pyproject.toml`` with a ``[tool.navfw]`` table.

A project has the same folders as navfw's repository, with plugins in ``behaviors/*.py``. A file of
the project takes precedence over the shipped one of the same name, and that over the one of an
installed package. Outside of a project the working folder's files come last: those that navfw just
wrote there. Packages of ROS are folders, whose roots are given by environment variables.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from navfw.config import input_file
from navfw.config.file_kinds import FILE_KINDS
from navfw.config.installed_packages import file_folders
from navfw.errors import ConfigError, UnknownNameError

_SUFFIXES = {".yaml", ".yml"}
URDF_SUFFIXES = {".urdf", ".xacro"}
"""Suffixes of files that are robots by themselves, given by their path."""
_PACKAGE = input_file.real_path(__file__).parents[1]

_Source: TypeAlias = Literal["project", "shipped", "installed"]


@dataclass(frozen=True)
class NamedFile:
    """A file of one of ``FILE_KINDS``: its name, its path, and who provides it."""

    name: str
    path: Path
    source: _Source


def project_folder(start: Path | None = None) -> Path | None:
    """Return the project around ``start`` (default: the working folder); None if there is none."""
    try:
        start = Path.cwd() if start is None else start.absolute()
    except FileNotFoundError:  # the working folder has been removed
        return None
    return next((folder for folder in (start, *start.parents) if _is_project(folder)), None)


def _is_project(folder: Path) -> bool:
    if input_file.is_file(folder / "navfw.toml"):
        return True
    try:
        text = input_file.read_input_text(folder / "pyproject.toml")
    except ConfigError:
        return False
    return re.search(r"^\s*\[tool\.navfw\b", text, re.MULTILINE) is not None


def shipped_folder() -> Path:
    """Return the folder with navfw's own worlds, maps and behaviours.

    It is ``navfw/shipped`` in an installed package, the repository's root in a checkout.
    """
    installed = _PACKAGE / "shipped"
    return installed if installed.is_dir() else _PACKAGE.parent


def own_project(start: Path | None = None) -> Path | None:
    """Return the project around ``start``; None in a checkout of navfw, whose files are shipped."""
    project = project_folder(start)
    shipped = shipped_folder()
    return None if project is None or input_file.real_path(project) == shipped else project


def _roots(room: str = "") -> Iterator[tuple[_Source, Path]]:
    """The folders that the patterns of files begin in: project, shipped, of installed packages.

    ``room`` is the folder of navfw's package that has the shipped files, if one has.
    """
    project = own_project()
    if project is not None:
        yield "project", project
    yield "shipped", _PACKAGE / room if room else shipped_folder()
    for folder in file_folders():
        yield "installed", folder
    if project_folder() is None:
        yield "project", Path()


def plugin_folders() -> list[Path]:
    """Folders with plugins: the shipped one, then the project's ``behaviors`` and ``plugins``."""
    shipped = shipped_folder() / "behaviors"
    return [shipped] * shipped.is_dir() + project_plugin_folders()


def project_plugin_folders(start: Path | None = None) -> list[Path]:
    """Return the folders ``behaviors`` and ``plugins`` of the project around ``start``.

    Empty in a checkout of navfw, as what it ships is no project.
    """
    project = own_project(start)
    folders = () if project is None else (project / "behaviors", project / "plugins")
    return [folder for folder in folders if folder.is_dir()]


def plugin_files(folder: Path) -> list[Path]:
    """Return the files in a plugin folder that are imported: all ``*.py`` except ``_*.py``.

    Raises:
        OSError: ``folder`` cannot be read.

    """
    files = (path for path in folder.iterdir() if path.suffix == ".py")
    return sorted(path for path in files if not path.name.startswith(("_", ".")))


def list_files(kind: str) -> list[NamedFile]:
    """Return all files of a kind of ``FILE_KINDS`` by name; missions are ``world/mission``."""
    return _first_of_each_name(_files(kind))


def _files(kind: str) -> Iterator[NamedFile]:
    """Yield all files of a kind; of those with one name the first takes precedence."""
    if kind == "mission":
        for world in list_files("world"):
            for mission in list_missions(world.name):
                yield NamedFile(f"{world.name}/{mission.name}", mission.path, mission.source)
        return
    about = FILE_KINDS[kind]
    for source, root in _roots(about.room):
        yield from _matching(root, about.pattern, source)


def list_missions(world: str | Path) -> list[NamedFile]:
    """Return all missions of a world (name or path); a project may add missions to a shipped world.

    Raises:
        UnknownNameError: there is no such world.
        ConfigError: ``world`` is a path, and no such file exists.

    """
    folder = find("world", world).parent
    by_name = [(source, root / "worlds" / folder.name) for source, root in _roots()]
    if not any(input_file.real_path(folder) == input_file.real_path(other) for _, other in by_name):
        by_name = [("project", folder)]
    return _first_of_each_name(
        file for source, other in by_name for file in _matching(other, "missions/*.yaml", source)
    )


def find(kind: str, name: str | Path, base: Path | None = None) -> Path:
    """Find the file of a kind of ``FILE_KINDS`` that has this name.

    ``name`` is a path (relative to ``base``, or to the working folder) when it ends in ``.yaml``,
    of a robot in ``.urdf`` or ``.xacro``, contains a ``/``, or is a file with another suffix; a
    world may be given by its folder.
    The name of a mission is ``world/mission``.

    Raises:
        UnknownNameError: there is none of that name; the message gives the nearest name.
        ConfigError: ``name`` is a path, and no such file exists.

    """
    text = str(name)
    if kind == "mission" and Path(text).suffix not in _SUFFIXES and text.count("/") == 1:
        world, _, mission = text.partition("/")
        return find_mission(world, mission)
    as_path = _as_path(kind, name, base)
    return _pick(kind, text, _files(kind)) if as_path is None else as_path


def find_mission(world: str | Path, name: str | Path) -> Path:
    """Find the file of a mission of ``world``; ``name`` may also be a path.

    Raises:
        UnknownNameError: there is no such world, or it has no such mission.
        ConfigError: ``world`` or ``name`` is a path, and no such file exists.

    """
    as_path = _as_path("mission", name, None)
    if as_path is not None:
        find("world", world)  # raises for an unknown world
        return as_path
    return _pick("mission", str(name), list_missions(world))


def _as_path(kind: str, name: str | Path, base: Path | None) -> Path | None:
    path = (base or Path()) / name
    text = str(name)
    in_folder = FILE_KINDS[kind].file_name
    if in_folder is not None and input_file.is_file(path / in_folder):
        return path / in_folder
    suffixes = _SUFFIXES | (URDF_SUFFIXES if kind == "robot" else set())
    is_file = input_file.is_file(path)
    is_name = path.suffix not in suffixes and "/" not in text and "\\" not in text
    if is_name and not (path.suffix and is_file):
        return None
    if not is_file:
        raise input_file.no_such_file(path)
    return path


def _pick(kind: str, name: str, files: Iterable[NamedFile]) -> Path:
    others = set()
    for file in files:
        if file.name == name:
            return file.path
        others.add(file.name)
    raise UnknownNameError(kind, name, sorted(others))


def _matching(root: Path, pattern: str, source: _Source) -> Iterator[NamedFile]:
    """Yield the files below ``root``; a file with a fixed name is called as its folder."""
    for file in sorted((*root.glob(pattern), *root.glob(pattern.replace("*.yaml", "*.yml")))):
        name = file.stem if "*" in pattern.rsplit("/", maxsplit=1)[-1] else file.parent.name
        if input_file.is_file(file) and not name.startswith((".", "_")):
            yield NamedFile(name, file, source)


def _first_of_each_name(files: Iterator[NamedFile]) -> list[NamedFile]:
    by_name = {file.name: file for file in reversed([*files])}
    return sorted(by_name.values(), key=lambda file: file.name)


def package_roots(path: Path, folders: Iterable[str]) -> Iterator[Path]:
    """Yield the folders that may contain packages of ROS, for the file at ``path``.

    They are ``folders``, those of the environment's ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``,
    and those around the file.
    """
    yield from map(Path, folders)
    yield from map(Path, filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)))
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    yield from (Path(prefix) / "share" for prefix in prefixes)
    yield from path.absolute().parents


def package_folders(name: str, roots: Iterable[Path]) -> Iterator[Path]:
    """Yield the folders that may be the package ``name``: in the roots, or a root of that name."""
    for root in roots:
        yield root / name
        if root.name == name:
            yield root
