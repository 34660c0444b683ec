"""Writes a new project, or a new part of the current one; replaces no file.

Files of ``navfw/scaffold/templates/project`` are copied. Their ending ``.template`` is removed: it
keeps tools that look for Python files and for ``.gitignore`` from using the templates themselves.
Besides the copies, ``.vscode`` gets the schemas of files, so that an editor completes and explains
their keys. The kinds of parts are those of ``navfw.scaffold.part_kinds``.
"""

from __future__ import annotations

import json
import keyword
import re
import shlex
import sys
from collections.abc import Mapping
from importlib.metadata import distribution
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

from navfw.config import lookup
from navfw.config.document import load_yaml
from navfw.config.file_kinds import FILE_KINDS
from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import ConfigError, UnknownNameError
from navfw.plugins.built_in import BUILT_IN
from navfw.process.atomic import AtomicFolder, write_text
from navfw.scaffold.part_kinds import PARTS, NameRule

TEMPLATES = Path(__file__).parent / "templates"
"""Folder of the templates: of a project's files in ``project``, of its parts' in ``parts``."""

_NOTHING = re.compile(r"(?!)")
"""Matches no name, so that no file of an existing folder is replaced."""


def write_project(folder: Path) -> list[str]:
    """Write a project to ``folder``, which is new or empty; return the names of its files, sorted.

    Raises:
        ConfigError: ``folder`` is within a project.
        InputError: ``folder`` contains something, or cannot be written.

    """
    above = (folder.absolute(), *folder.absolute().parents)
    around = lookup.project_folder(next(existing for existing in above if existing.is_dir()))
    if around is not None:
        what = f"is within the project {shown_path(around)}; choose a folder outside of it"
        raise ConfigError(what, file=folder)
    name = re.sub(r"[^a-z0-9]+", "-", folder.name.lower()).strip("-") or "robot"
    dependency, source = _requirement()
    words = {r"\bPROJECT\b": name, r"\bNAVFW\b": dependency, r"# SOURCE\n": source}
    words[r" \(ACTIVATE\)"] = f" (`{activation()}`)" if activation() else ""
    texts = _editor_settings()
    templates = TEMPLATES / "project"
    for file in (path for path in templates.rglob("*") if path.is_file()):
        place = file.relative_to(templates).as_posix().removesuffix(".template")
        texts[place] = _rendered(str(file), words)
    with AtomicFolder(folder, _NOTHING, "DIR") as target:
        for place, text in texts.items():
            (target.path / place).parent.mkdir(parents=True, exist_ok=True)
            (target.path / place).write_text(text, encoding="utf-8")
    return sorted(texts)


def _requirement() -> tuple[str, str]:
    """How an installer gets this navfw: the dependency, and its source in ``pyproject.toml``."""
    installed = distribution("navfw")
    origin = json.loads(installed.read_text("direct_url.json") or "{}")
    needed, url = "navfw[sim,report]", origin.get("url", "")
    clone = url2pathname(urlsplit(url).path)
    if "dir_info" in origin and Path(clone, "pyproject.toml").is_file():
        editable = str(origin["dir_info"].get("editable", False)).lower()
        return needed, _CLONE.format(path=json.dumps(clone, ensure_ascii=False), editable=editable)
    if control := origin.get("vcs_info"):
        return f"{needed} @ {control['vcs']}+{url}@{control['commit_id']}", ""
    return f"{needed} @ {url}" if "archive_info" in origin else f"{needed}=={installed.version}", ""


_CLONE = """
# the clone that wrote this project; another machine needs its own path, or a repository's address
[tool.uv.sources]
navfw = {{ path = {path}, editable = {editable} }}
"""


def activation() -> str:
    """Return the shell command that activates this environment; "" if it has no script."""
    script = Path(sys.prefix, "bin", "activate")
    return f"source {shlex.quote(str(script))}" if script.is_file() else ""


def _editor_settings() -> dict[str, str]:
    """Files of ``.vscode`` with their text: each kind's schema, and where it applies.

    They are understood by editors with the YAML language server, VS Code's YAML extension first.
    """
    schemas: dict[str, Any] = {
        f"schemas/{kind.name}.json": kind.schema() for kind in FILE_KINDS.values()
    }
    patterns = {f"./.vscode/schemas/{kind.name}.json": kind.pattern for kind in FILE_KINDS.values()}
    files = {"settings.json": {"yaml.schemas": patterns}, **schemas}
    return {f".vscode/{name}": json.dumps(file, indent=2) + "\n" for name, file in files.items()}


_SPELLINGS: dict[NameRule, tuple[str, str]] = {
    "hyphenated": (r"[a-z][a-z0-9]*(-[a-z0-9]+)*", "small letters, digits and single hyphens"),
    "identifier": (r"[a-z][a-z0-9_]*", "a Python identifier in small letters, such as slow_down"),
}
"""The pattern of names by their rule, and the rule in words."""


def write_part(kind: str, name: str, start: str = "") -> tuple[list[str], str]:
    """Write a part of a ``kind`` of ``PARTS``; return its files, and the command to type next.

    Files are relative to the project. The name of a mission is ``world/mission``; ``start`` is one
    of the kind's.

    Raises:
        ConfigError: the name is invalid for this kind or taken, a file exists, or the working
            folder is not in a project.
        UnknownNameError: there is no world of a mission's name, or no such start.
        InputError: a file cannot be written.

    """
    part = PARTS[kind]
    if (start := start or part.starts[0]) not in part.starts:
        raise UnknownNameError("start", start, part.starts)
    project = lookup.project_folder()
    if project is None:
        what = "is in no project; change into one, or write one by navfw new project DIR"
        raise ConfigError(what, file=Path.cwd())
    world, _, own = name.rpartition("/")
    if name.count("/") != (kind == "mission"):
        expected = "WORLD/NAME, such as office/evening" if kind == "mission" else "no '/'"
        raise ConfigError(f"expected {expected}; got {name!r}", key="NAME")
    pattern, expected = _SPELLINGS[part.rule]
    if not re.fullmatch(pattern, own) or keyword.iskeyword(own):
        raise ConfigError(f"expected {expected}; got {name!r}", key="NAME")
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
        "start": start,
    }
    if kind == "mission":
        model = _model(world)
        fields |= {"model": str(model.path), "model_name": model.name}
    files = {file.format(**fields): t.format(**fields) for file, t in part.files.items()}
    words = {word: by.format(**fields) for word, by in part.words.items()}
    targets = {project / file: template for file, template in files.items()}
    for target in targets:
        if target.exists():
            raise ConfigError("exists, and is not replaced", file=shown_path(target))
    for target, template in targets.items():
        write_text(target, _rendered(template, words), parents=True)
    return sorted(files), part.then.format(**fields)


def _taken(sort: str, world: str) -> dict[str, str]:
    """Names that are taken among things of that ``sort``, each with where it is."""
    if sort in FILE_KINDS:
        files = lookup.list_missions(world) if sort == "mission" else lookup.list_files(sort)
        return {file.name: shown_path(file.path) for file in files}
    shipped = {name: "navfw" for names in BUILT_IN.values() for name in names}
    plugins = (file for folder in lookup.plugin_folders() for file in lookup.plugin_files(folder))
    return shipped | {file.stem: shown_path(file) for file in plugins}


def _model(world: str) -> lookup.NamedFile:
    """Return the mission of ``world`` that a new one begins as: the first one without events.

    Raises:
        ConfigError: the world has no such mission.

    """
    for mission in lookup.list_missions(world):
        data = load_yaml(mission.path).data
        if isinstance(data, dict) and "events" not in data:
            return mission
    what = f"the world {world!r} has no mission without events that a new one could begin as"
    raise ConfigError(f"{what}; see docs/worlds.md for its keys", key="NAME")


def _rendered(template: str, words: Mapping[str, str]) -> str:
    """The text of a template, or of the file at an absolute path, with ``words`` replaced."""
    text = read_input_text(TEMPLATES / template)
    for word, by in words.items():
        text = re.sub(word, by.replace("\\", r"\\"), text)
    return text
