"""``navfw check [PATH...]``: check files and plugins, and tell all errors at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from navfw.cli.output import print_json, quiet_stdout

if TYPE_CHECKING:
    from navfw.plugins import Registry

Checked = dict[str, Any]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(check)


def check(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[PATH]...",
            help="Files, plugin files, or folders of a project; by default the project one stands"
            " in.",
            show_default=False,
        ),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print a JSON list of objects, and nothing else.")
    ] = False,
) -> None:
    """Check files and plugins without driving. Exit with 2 if one is wrong; all errors are told.

    Missions are checked with world, map and stack; rule bases must cover their inputs.
    """
    with quiet_stdout():
        checked = list(_checked(paths or [_project()]))
    wrong = sum(each["error"] is not None for each in checked)
    if json:
        print_json(checked)
    else:
        for each in checked:
            for note in each["notes"]:
                typer.echo(f"note: {note}")
        for each in checked:
            if each["error"] is not None:
                typer.echo(each["error"])
        typer.echo(f"{len(checked)} checked, {wrong} wrong")
    if wrong:
        raise typer.Exit(2)


def _project() -> Path:
    """The project around the working folder.

    Raises:
        ConfigError: there is none.

    """
    from navfw.config.lookup import project_folder
    from navfw.errors import ConfigError

    folder = project_folder()
    if folder is None:
        what = "no project here: expected a folder with navfw.toml; or name files to check"
        raise ConfigError(what, file=Path.cwd())
    return folder


def _checked(paths: list[Path]) -> Iterator[Checked]:
    """A row for each data file and each plugin in ``paths``."""
    from navfw.cli.file_check import data_files
    from navfw.config.input_file import no_such_file
    from navfw.plugins import default_registry

    missing = [path for path in paths if not path.exists()]
    if missing:
        raise no_such_file(missing[0])
    folders = [path for path in paths if path.is_dir()]
    files = [path for path in paths if not path.is_dir()]
    plugins = {file.resolve() for file in files if file.suffix == ".py"}
    plugins |= {
        file.resolve()
        for folder in folders
        for part in (folder, folder / "behaviors", folder / "plugins")
        for file in part.glob("*.py")
        if part != folder or folder.name in {"behaviors", "plugins"}
    }
    known = default_registry()
    for folder in sorted({file.parent for file in plugins}):
        known.discover_folder(folder)
    yield from _plugins(known, plugins)
    data = [file for folder in folders for file in data_files(folder)]
    yield from _data([*(file for file in files if file.suffix != ".py"), *data], known)


def _plugins(registry: Registry, files: set[Path]) -> Iterator[Checked]:
    """A row for each plugin that is in one of ``files``."""
    for row in registry.listing():
        if Path(row["source"]).resolve() in files:
            yield {key: row[key] for key in ("name", "kind", "source", "notes", "error")}


def _data(files: list[Path], registry: Registry) -> Iterator[Checked]:
    """A row for each data file; its kind is None where it cannot be told."""
    from navfw.cli.file_check import check_file, kind_of_file
    from navfw.config.input_file import shown_path
    from navfw.errors import InputError

    for file in files:
        error = check_file(file, registry)
        try:
            kind = kind_of_file(file)
        except InputError:
            kind = None
        yield {
            "name": file.stem,
            "kind": kind,
            "source": shown_path(file),
            "notes": [],
            "error": None if error is None else str(error),
        }
