"""``navfw list KIND``: lists worlds, missions, maps and other files by name, and plugins."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import typer

from navfw.cli.options import JsonList, SuggestingGroup, World, option
from navfw.cli.output import console, print_json, print_table, quiet_stdout
from navfw.config import lookup
from navfw.config.file_kinds import FILE_KINDS, FileKind
from navfw.config.input_file import shown_path
from navfw.errors import InputError
from navfw.process.printable_text import printable_data

Row = dict[str, Any]


group = typer.Typer(cls=SuggestingGroup)


@group.callback(invoke_without_command=True)
def kinds(ctx: typer.Context, json: JsonList = False) -> None:
    """List worlds, missions and other files by name, and plugins.

    Without a kind, list the kinds with their numbers of files; no plugin is executed.
    """
    if ctx.invoked_subcommand is not None:
        return
    from navfw.plugins.built_in import BUILT_IN

    counts = {
        kind.plural: len(lookup.list_files(kind.name))
        for kind in FILE_KINDS.values()
        if kind.plural
    }
    counts["plugins"] = sum(len(lookup.plugin_files(folder)) for folder in lookup.plugin_folders())
    counts["plugins"] += sum(map(len, BUILT_IN.values()))
    if json:
        print_json([{"name": name, "count": count} for name, count in counts.items()])
    else:
        print_table(["kind", "number"], list(counts.items()), "There are no files.")


def missions(world: World, json: JsonList = False) -> None:
    """List the missions of a world."""
    nothing = f"The world {world} has no missions."
    _show(FILE_KINDS["mission"], lookup.list_missions(world), nothing, as_json=json)


def _lister(kind: FileKind) -> Callable[[bool], None]:
    def command(json: JsonList = False) -> None:
        _show(kind, lookup.list_files(kind.name), f"There are no {kind.plural}.", as_json=json)

    return command


for _kind in FILE_KINDS.values():
    if _kind.name == "mission":
        group.command()(missions)
    elif _kind.plural:
        group.command(_kind.plural, help=f"List the {_kind.plural}.")(_lister(_kind))


@group.command()
def plugins(
    kind: str | None = option(None, "List only this kind, with parameters: behavior, flow, ..."),
    parameters: bool = option(
        False, "List parameters, and verify navfw's own plugins.", "--parameters"
    ),
    json: JsonList = False,
) -> None:
    """List the plugins. Exit with 2 if one is broken; its error is listed.

    With --parameters, --kind or --json the parameters are listed as well.
    """
    with quiet_stdout():
        from navfw.plugins.registry import check_kind, default_registry

        if kind is not None:
            check_kind(kind)  # before any plugin is imported
        detailed = parameters or json or kind is not None
        rows = default_registry().listing(kind, parameters=detailed)
    if json:
        print_json(rows)
    else:
        _print_plugins(rows)
    if any(row["error"] is not None for row in rows):
        raise typer.Exit(2)


def _row(kind: FileKind, file: lookup.NamedFile) -> Row:
    """Return the row of a file; that of an invalid one holds its error."""
    from navfw.cli.data_files import summary

    row: Row = {"name": file.name, "description": ""}
    if kind.name == "world":
        row["missions"] = [mission.name for mission in lookup.list_missions(file.name)]
    error = None
    try:
        row |= summary(kind.name, file.path)
    except InputError as reason:
        error = str(reason)
    status = "ok" if error is None else "broken"
    where = {"source": file.source, "path": shown_path(file.path)}
    return row | {"status": status, **where, "error": error}


def _show(
    kind: FileKind, files: Iterable[lookup.NamedFile], nothing: str, *, as_json: bool
) -> None:
    rows, columns = [_row(kind, file) for file in files], [*kind.columns, "source"]
    if as_json:
        print_json(rows)
        return
    from rich.text import Text

    def about(row: Row) -> Text:
        broken = row["error"] is not None
        return Text(f"broken: {row['error']}", style="red") if broken else Text(row["description"])

    described = any(row["description"] or row["error"] for row in rows)
    cells = [
        [
            Text(row["name"], style="bold"),
            *([about(row)] if described else []),
            *(_cell(row.get(column)) for column in columns),
        ]
        for row in printable_data(rows)
    ]
    print_table(["name", *(["description"] if described else []), *columns], cells, nothing)


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, dict):
        return ", ".join(f"{key} {_cell(item)}".strip() for key, item in value.items())
    if isinstance(value, list):
        return ", ".join(_cell(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _print_plugins(rows: list[Row]) -> None:
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    def line(text: str, style: str = "") -> Padding:
        return Padding(Text(text, style), (0, 0, 0, 4))

    out = console()
    kind = None
    for row in printable_data(rows):
        if row["kind"] != kind:
            kind = row["kind"]
            out.print(Text(f"\n{kind}", style="bold underline"))
        out.print(Text.assemble("  ", (row["name"], "bold"), "  ", (row["source"], "dim")))
        if row["error"] is not None:
            out.print(line(f"broken: {row['error']}", "red"))
            continue
        out.print(line(row["summary"]))
        table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
        for parameter in row.get("parameters", ()):
            default = "required" if parameter["required"] else f"= {_cell(parameter['default'])}"
            texts = (parameter["name"], parameter["type"], default)
            about = (parameter["bounds"], parameter["description"])
            table.add_row("     ", *(Text(text) for text in (*texts, *about)))
        if table.rows:
            out.print(table)
        for note in row.get("notes", ()):
            out.print(line(f"note: {note}", "yellow"))
