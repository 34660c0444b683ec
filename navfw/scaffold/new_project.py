"""A new project from ``navfw/scaffold/templates/project``, written whole or not at all.

A file of the templates is copied as it is. The ending ``.template`` is left out: it keeps tools
that look for Python files and for ``.gitignore`` from taking templates for their own. Beside the
copies, ``.vscode`` gets the schemas of files, so that an editor completes and explains their keys.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

from navfw.config.file_kinds import FILE_KINDS
from navfw.config.input_file import shown_path
from navfw.config.lookup import project_folder
from navfw.errors import ConfigError
from navfw.process.atomic import AtomicFolder

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
    around = project_folder(_nearest_existing(folder.absolute()))
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


def _nearest_existing(folder: Path) -> Path:
    return next(each for each in (folder, *folder.parents) if each.is_dir())
