"""A new project, or a new part of the current one: all of its files are written, or none.

A file of ``navfw/scaffold/templates/project`` is copied as it is. The ending ``.template`` is left
out: it keeps tools that look for Python files and for ``.gitignore`` from taking templates for
their own. Beside the copies, ``.vscode`` gets the schemas of files, so that an editor completes and
explains their keys. The kinds of parts are those of ``navfw.scaffold.part_kinds``.
"""

from __future__ import annotations

import json
import keyword
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from navfw.config.document import load_yaml
from navfw.config.file_kinds import FILE_KINDS
from navfw.config.input_bounds import max_bytes
from navfw.config.input_file import read_input_text, shown_path
from navfw.config.lookup import (
    NamedFile,
    list_files,
    list_missions,
    plugin_files,
    plugin_folders,
    project_folder,
)
from navfw.errors import ConfigError
from navfw.plugins.built_in import BUILT_IN
from navfw.process.atomic import AtomicFolder, write_text
from navfw.scaffold.part_kinds import PARTS, NameRule

TEMPLATES = Path(__file__).parent / "templates"
"""The templates: of a project's files in ``project``, of its parts' in ``parts``."""

_PROJECT = TEMPLATES / "project"

_ENDING = ".template"
_NOTHING = re.compile(r"(?!)")
"""Matches no name: no file of an existing folder is replaced."""

_HIDDEN = {"gitignore": ".gitignore"}
"""Files whose name begins with a dot in the project, by their name among the templates."""


def write_project(folder: Path) -> list[str]:
    """Write a project to ``folder``, which is new or empty; the names of its files, sorted.

    Raises:
        ConfigError: ``folder`` is within a project.
        InputError: ``folder`` contains something, or cannot be written.

    """
    above = (folder.absolute(), *folder.absolute().parents)
    around = project_folder(next(existing for existing in above if existing.is_dir()))
    if around is not None:
        what = f"is within the project {shown_path(around)}; choose a folder outside of it"
        raise ConfigError(what, file=folder)
    names = {_name(file): file for file in sorted(_PROJECT.rglob("*")) if file.is_file()}
    settings = {f".vscode/{name}": content for name, content in _editor_settings().items()}
    with AtomicFolder(folder, _NOTHING, "DIR") as target:
        for name, template in names.items():
            (target.path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(template, target.path / name)
        for name, content in settings.items():
            (target.path / name).parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps(content, indent=2) + "\n"
            (target.path / name).write_text(text, encoding="utf-8")
    return sorted((*names, *settings))


def _editor_settings() -> dict[str, Any]:
    """Files of ``.vscode`` with their content: each kind's schema, and where it applies.

    They are understood by editors with the YAML language server, VS Code's YAML extension first.
    """
    schemas = {f"schemas/{kind.name}.json": kind.schema() for kind in FILE_KINDS.values()}
    patterns = {f"./.vscode/schemas/{kind.name}.json": kind.pattern for kind in FILE_KINDS.values()}
    return {"settings.json": {"yaml.schemas": patterns}, **schemas}


def _name(template: Path) -> str:
    """The name of a template's copy, relative to the project."""
    name = template.relative_to(_PROJECT).as_posix().removesuffix(_ENDING)
    return _HIDDEN.get(name, name)


_HYPHENATED = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def write_part(kind: str, name: str) -> tuple[list[str], str]:
    """Write a part of a ``kind`` of ``PARTS``; the files, relative to the project, and what next.

    The name of a mission is ``world/mission``.

    Raises:
        ConfigError: the name is none for this kind or is taken, a file exists, or the working
            folder is in no project.
        UnknownNameError: there is no world of a mission's name.
        InputError: a file cannot be written.

    """
    part = PARTS[kind]
    project = project_folder()
    if project is None:
        what = "is in no project; change into one, or write one by navfw new project DIR"
        raise ConfigError(what, file=Path.cwd())
    world, _, own = name.rpartition("/")
    if name.count("/") != (kind == "mission"):
        expected = "WORLD/NAME, such as office/evening" if kind == "mission" else "no '/'"
        raise ConfigError(f"expected {expected}; got {name!r}", key="NAME")
    _check_spelling(own, part.rule)
    for sort in part.unique:
        taken = _taken(sort, world)
        if own in taken:
            what = f"there is a {sort} {own!r} in {taken[own]}; choose another name"
            raise ConfigError(what, key="NAME")
    fields = {
        "name": own,
        "module": re.sub(r"\W", "_", name),
        "class_name": "".join(word.title() for word in own.split("_")),
        "world": world,
    }
    if kind == "mission":
        model = _model(world)
        fields |= {"model": str(model.path), "model_name": model.name}
    files = {file.format(**fields): t.format(**fields) for file, t in part.files.items()}
    words = {word: by.format(**fields) for word, by in part.words.items()}
    _write(project, {name: _rendered(template, words) for name, template in files.items()})
    return sorted(files), part.then.format(**fields)


def _check_spelling(name: str, rule: NameRule) -> None:
    if rule == "hyphenated":
        if not _HYPHENATED.fullmatch(name):
            what = "expected small letters, digits and single hyphens, such as east-wing"
            raise ConfigError(f"{what}; got {name!r}", key="NAME")
    elif (
        not (name.isascii() and name.isidentifier() and name == name.lower())
        or keyword.iskeyword(name)
        or name.startswith("_")
    ):
        what = "expected a Python identifier in small letters, such as slow_down"
        raise ConfigError(f"{what}; got {name!r}", key="NAME")


def _taken(sort: str, world: str) -> dict[str, str]:
    """Names that are taken among things of that ``sort``, each with where it is."""
    if sort in FILE_KINDS:
        files = list_missions(world) if sort == "mission" else list_files(sort)
        return {file.name: shown_path(file.path) for file in files}
    shipped = {name: "navfw" for names in BUILT_IN.values() for name in names}
    plugins = (file for folder in plugin_folders() for file in plugin_files(folder))
    return shipped | {file.stem: shown_path(file) for file in plugins}


def _model(world: str) -> NamedFile:
    """The mission of ``world`` that a new one begins as: the first one without events.

    Raises:
        ConfigError: the world has no such mission.

    """
    for mission in list_missions(world):
        data = load_yaml(mission.path).data
        if isinstance(data, dict) and "events" not in data:
            return mission
    what = f"the world {world!r} has no mission without events that a new one could begin as"
    raise ConfigError(f"{what}; see docs/worlds.md for its keys", key="NAME")


def _rendered(template: str, words: Mapping[str, str]) -> str:
    """The text of a template, or of the file at an absolute path, with ``words`` replaced."""
    text = read_input_text(TEMPLATES / template, max_bytes("template or page"))
    for word, by in words.items():
        text = re.sub(word, by, text)
    return text


def _write(project: Path, texts: Mapping[str, str]) -> None:
    """Write each of ``texts`` by its name in ``project``: all, or none."""
    files = {project / name: text for name, text in texts.items()}
    for file in files:
        if file.exists():
            raise ConfigError("exists, and is not replaced", file=shown_path(file))
    above = {folder for file in files for folder in file.parents if not folder.exists()}
    written: list[Path] = []
    try:
        for file, text in files.items():
            write_text(file, text, parents=True)
            written.append(file)
    except BaseException:
        for file in written:
            file.unlink(missing_ok=True)
        for folder in sorted(above, reverse=True):
            with suppress(OSError):
                folder.rmdir()
        raise
