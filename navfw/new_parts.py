"""A further behaviour or world for the project one stands in, after the project's templates.

The files are those of ``navfw/templates/project`` under another name, so that what a new project
shows and what a new part shows is the same.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from pathlib import Path

from navfw.atomic import write_text
from navfw.config.input_file import read_input_text, shown_path
from navfw.config.lookup import list_worlds, plugin_files, plugin_folders, project_folder
from navfw.errors import ConfigError, InputError
from navfw.new_project import TEMPLATES

__all__ = ["write_behavior", "write_world"]

_MAX_TEMPLATE = 100_000
_WORLD_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def write_behavior(name: str) -> list[str]:
    """Write behaviour, rules and test; the names of the files, relative to the project.

    Raises:
        ConfigError: the name is no identifier in small letters or is taken, a file exists, or the
            working folder is in no project.
        InputError: a file cannot be written.

    """
    if not (name.isascii() and name.isidentifier() and name == name.lower()) or (
        keyword.iskeyword(name) or name.startswith("_")
    ):
        what = "expected a Python identifier in small letters, such as slow_down"
        raise ConfigError(f"{what}; got {name!r}", key="NAME")
    taken = {file.stem: file for folder in plugin_folders() for file in plugin_files(folder)}
    if name in taken:
        what = f"there is a plugin {name!r} in {shown_path(taken[name])}; choose another name"
        raise ConfigError(what, key="NAME")
    words = {"cautious": name, "Cautious": "".join(part.title() for part in name.split("_"))}
    return _write(
        words,
        {
            f"behaviors/{name}.py": "behaviors/cautious.py.template",
            f"behaviors/{name}.yaml": "behaviors/cautious.yaml",
            f"tests/test_{name}.py": "tests/test_cautious.py.template",
        },
    )


def write_world(name: str) -> list[str]:
    """Write world, map, mission ``next-room`` and its test; the names of the files.

    Raises:
        ConfigError: the name is not of small letters, digits and hyphens, or is taken, a file
            exists, or the working folder is in no project.
        InputError: a file cannot be written.

    """
    if not _WORLD_NAME.fullmatch(name):
        what = "expected small letters, digits and single hyphens, such as east-wing"
        raise ConfigError(f"{what}; got {name!r}", key="NAME")
    taken = {found.name: found.path for found in list_worlds()}
    if name in taken:
        what = f"there is a world {name!r} in {shown_path(taken[name])}; choose another name"
        raise ConfigError(what, key="NAME")
    words = {r"\bden\b": name, r"\nstack: careful[^\n]*": "", ', stack="careful"': ""}
    return _write(
        words,
        {
            f"worlds/{name}/world.yaml": "worlds/den/world.yaml",
            f"worlds/{name}/missions/next-room.yaml": "worlds/den/missions/next-room.yaml",
            f"maps/{name}.yaml": "maps/den.yaml",
            f"tests/test_{name.replace('-', '_')}.py": "tests/test_next_room.py.template",
        },
    )


def _write(words: Mapping[str, str], files: Mapping[str, str]) -> list[str]:
    """Write each of ``files`` after its template with ``words`` replaced: all, or none."""
    project = project_folder()
    if project is None:
        what = "is in no project; change into one, or write one by navfw new project DIR"
        raise ConfigError(what, file=Path.cwd())
    for name in files:
        if (project / name).exists():
            raise ConfigError("exists, and is not replaced", file=shown_path(project / name))
    written: list[Path] = []
    try:
        for name, template in files.items():
            text = read_input_text(TEMPLATES / template, _MAX_TEMPLATE)
            for old, new in words.items():
                text = re.sub(old, new, text)
            write_text(project / name, text, parents=True)
            written.append(project / name)
    except InputError:
        for path in written:
            path.unlink(missing_ok=True)
        raise
    return sorted(files)
