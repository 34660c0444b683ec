"""``navfw check [PATH...]`` checks data files and plugins; ``navfw schema KIND`` prints schemas."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from navfw.cli.options import JsonList, argument
from navfw.cli.output import echo, print_json, quiet_stdout
from navfw.cli.warm import compile_with_progress
from navfw.config.file_kinds import FILE_KINDS, FileKind
from navfw.config.input_file import no_such_file, real_path, shown_path
from navfw.config.lookup import URDF_SUFFIXES, project_folder
from navfw.errors import ConfigError, InputError, PluginError, UnknownNameError, did_you_mean

if TYPE_CHECKING:
    from navfw.plugins import Registry
    from navfw.testing.behavior_check import Answers

Checked = dict[str, Any]
PLUGIN_FOLDERS = ("behaviors", "plugins")
_SUFFIXES = {".yaml", ".yml"}


def check(
    paths: list[Path] | None = argument(
        None,
        "Files, plugin files, or folders of a project; by default the current project.",
        metavar="[PATH]...",
    ),
    json: JsonList = False,
) -> None:
    """Check files and plugins without driving. Exit with 2 if one is wrong; all errors are listed.

    Missions are checked with world, map, stack and route; rule bases must cover their inputs;
    behaviours and composites are tried in many scenes.
    """
    with quiet_stdout():
        checked = list(_checked(paths or [_project()]))
    wrong = sum(row["error"] is not None for row in checked)
    if json:
        print_json(checked)
    else:
        for row in checked:
            for note in row["notes"]:
                echo(f"note: {note}")
        causes: dict[str, list[str]] = {}  # several files may use one that is wrong
        for row in checked:
            if row["error"] is not None:
                causes.setdefault(row["error"], []).append(row["source"])
        for cause, sources in causes.items():
            echo(cause)
            if others := [source for source in sources if not cause.startswith(source)]:
                using = "1 file that uses" if len(others) == 1 else f"{len(others)} files that use"
                echo(f"    also: {using} it: {', '.join(others)}")
        echo(f"{len(checked)} checked, {wrong} wrong")
    if wrong:
        raise typer.Exit(2)


def schema(
    kind: str = argument(
        ..., f"Kind of file: {', '.join(sorted(FILE_KINDS))}; or result, of a run.", metavar="KIND"
    ),
) -> None:
    """Print the JSON Schema of a kind of file. Editors complete and explain keys with it.

    It has keys, types and bounds. References between files are checked by navfw check.
    """
    if kind not in (known := [*FILE_KINDS, "result"]):
        raise UnknownNameError("kind of file", kind, known)
    with quiet_stdout():
        if kind == "result":
            from navfw.missions.run_metrics import RunResult

            content = RunResult.schema()
        else:
            content = FILE_KINDS[kind].schema()
    print_json(content)


def _project() -> Path:
    folder = project_folder()
    if folder is None:
        what = "no project here: expected a folder with navfw.toml; or name files to check"
        raise ConfigError(what, file=Path.cwd())
    return folder


def _checked(paths: list[Path]) -> Iterator[Checked]:
    from navfw.plugins import default_registry

    missing = [path for path in paths if not path.exists()]
    if missing:
        raise no_such_file(missing[0])
    folders = [path for path in paths if path.is_dir()]
    files = [path for path in paths if not path.is_dir()]
    plugins = {real_path(file) for file in files if file.suffix == ".py"}
    plugins |= {
        real_path(file)
        for folder in folders
        for with_plugins in (folder, *(folder / name for name in PLUGIN_FOLDERS))
        for file in with_plugins.glob("*.py")
        if with_plugins != folder or folder.name in PLUGIN_FOLDERS
    }
    registry, sources = default_registry(), sorted({file.parent for file in plugins})
    for folder in sources:
        registry.discover_folder(folder)
    rows = [row for row in registry.listing() if real_path(row["source"]) in plugins]
    tried = [row for row in rows if row["error"] is None and _can_be_tried(row, registry)]
    elsewhere = _answers_elsewhere(sources, tried)
    for row in rows:
        error = row["error"]
        if row in tried:
            error = _tried(row, registry, elsewhere.get(row["name"]))
        yield {key: row[key] for key in ("name", "kind", "source", "notes")} | {"error": error}
    for file in (*files, *(file for folder in folders for file in data_files(folder))):
        if file.suffix != ".py":
            yield _check_data_file(file, registry)


def _can_be_tried(row: Checked, registry: Registry) -> bool:
    """Whether a plugin is called in scenes, and needs no parameters that a stack has to give."""
    if row["kind"] not in {"behavior", "composite"}:
        return False
    cls = registry.get(row["kind"], row["name"])
    return not any(info.is_required() for info in cls.Params.model_fields.values())


def _answers_elsewhere(folders: list[Path], tried: list[Checked]) -> dict[str, Answers]:
    """What the plugins that are ``tried`` answer in another process, by name."""
    if not tried:
        return {}
    from navfw.testing.behavior_check import answers_elsewhere

    compile_with_progress(loaded=True)
    try:
        answers = answers_elsewhere(folders, [(row["kind"], row["name"]) for row in tried])
    except OSError as error:
        for row in tried:
            row["notes"].append(f"{row['name']} was not tried in another process: {error}")
        return {}
    return {row["name"]: part for row, part in zip(tried, answers, strict=True)}


def _tried(row: Checked, registry: Registry, elsewhere: Answers | None) -> str | None:
    """What is wrong with the answers of a behaviour or composite; None for nothing."""
    from navfw.testing import check_behavior, check_composite

    cls: Any = registry.get(row["kind"], row["name"])
    try:
        if row["kind"] == "behavior":
            check_behavior(cls, budget=math.inf, elsewhere=elsewhere)
        else:
            check_composite(cls, elsewhere=elsewhere)
    except PluginError as error:
        return str(error)
    return None


def _check_data_file(file: Path, registry: Registry) -> Checked:
    """Return a row for a data file; its kind is None where it cannot be known."""
    kind = error = None
    try:
        file_kind = _kind_of(file)
        kind = file_kind.title or file_kind.name
        file_kind.check_file(file, registry)
    except InputError as reason:
        error = str(reason)
    row: Checked = {"name": file.stem, "kind": kind, "source": shown_path(file), "notes": []}
    return row | {"error": error}


def data_files(folder: Path) -> list[Path]:
    """Return the data files in ``folder``, a project or a part of one, sorted by name.

    Rule bases beside a plugin's file are left out: they are checked with the plugin.
    """
    files = {
        file
        for kind in FILE_KINDS.values()
        for pattern in kind.patterns
        for file in (*folder.glob(pattern), *folder.glob(pattern.replace(".yaml", ".yml")))
    }
    if any(real_path(folder).name in kind.folders for kind in FILE_KINDS.values()):
        files.update(folder.glob("*"))
    named = [f for f in files if f.suffix in _SUFFIXES and not f.name.startswith((".", "_"))]
    of_plugins = {f for f in named if f.parent.name in PLUGIN_FOLDERS}
    return sorted(f for f in named if not (f in of_plugins and f.with_suffix(".py").exists()))


def _kind_of(path: Path) -> FileKind:
    """Return the kind of the data file at ``path``: by its own name, its folder's, or its keys."""
    from navfw.config.document import load_yaml

    if path.suffix in URDF_SUFFIXES:
        return FILE_KINDS["robot"]
    for kind in FILE_KINDS.values():
        if path.name == kind.file_name or path.absolute().parent.name in kind.folders:
            return kind
        if kind.file_name == f"{path.stem}.yaml":
            what = f"is not found by this name: rename it to {kind.file_name}"
            raise ConfigError(what, file=shown_path(path))
    data = load_yaml(path).data
    by_key = {kind.key: kind for kind in FILE_KINDS.values() if kind.key}
    for key, kind in by_key.items():
        if key in data:
            return kind
    near = did_you_mean(next(iter(data), ""), by_key)
    what = f"no file of navfw: none of the keys {', '.join(by_key)}; {near}"
    raise ConfigError(what, file=shown_path(path))
