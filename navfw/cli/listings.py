"""``navfw worlds``, ``missions``, ``maps``, ``stacks``, ``robots``, ``plugins``: listings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from navfw.cli.options import World
from navfw.cli.output import console, print_json, print_table, quiet_stdout

if TYPE_CHECKING:
    from navfw.config.lookup import NamedFile

Json = Annotated[
    bool, typer.Option("--json", help="Print a JSON list of objects, and nothing else.")
]
Row = dict[str, Any]


def add_to(app: typer.Typer) -> None:
    """Add the listing commands."""
    app.command()(worlds)
    app.command()(missions)
    app.command()(maps)
    app.command()(stacks)
    app.command()(robots)
    app.command()(plugins)


def worlds(json: Json = False) -> None:
    """List the worlds with their missions."""
    from navfw.config.lookup import list_missions, list_worlds

    def read(found: NamedFile) -> Row:
        return {"missions": [mission.name for mission in list_missions(found.name)]}

    rows = _rows(list_worlds(), _describe, read)
    _show(rows, ["missions", "source"], "There are no worlds.", as_json=json)


def missions(world: World, json: Json = False) -> None:
    """List the missions of a world."""
    from navfw.config.lookup import list_missions

    def read(found: NamedFile) -> Row:
        from navfw.cli.file_summaries import mission_summary

        return mission_summary(found.path)

    rows = _rows(list_missions(world), read)
    nothing = f"The world {world} has no missions."
    _show(rows, ["start", "goals", "timeout", "source"], nothing, as_json=json)


def maps(json: Json = False) -> None:
    """List the topological maps."""
    from navfw.config.lookup import list_maps

    def read(found: NamedFile) -> Row:
        from navfw.cli.file_summaries import map_summary

        return map_summary(found.path)

    _show(
        _rows(list_maps(), read), ["places", "edges", "source"], "There are no maps.", as_json=json
    )


def stacks(json: Json = False) -> None:
    """List the stacks with their plugins."""
    from navfw.config.lookup import list_stacks

    def read(found: NamedFile) -> Row:
        from navfw.cli.file_summaries import stack_summary

        return stack_summary(found.path)

    rows = _rows(list_stacks(), read)
    _show(rows, ["plugins", "source"], "There are no stacks.", as_json=json)


def robots(json: Json = False) -> None:
    """List the robots."""
    from navfw.config.lookup import list_robots

    def read(found: NamedFile) -> Row:
        from navfw.cli.file_summaries import robot_summary

        return robot_summary(found.path)

    rows = _rows(list_robots(), read)
    _show(rows, ["body", "speed", "camera", "source"], "There are no robots.", as_json=json)


def plugins(
    kind: Annotated[
        str | None,
        typer.Option("--kind", help="Only plugins of this kind: behavior, flow, planner, ..."),
    ] = None,
    json: Json = False,
) -> None:
    """List the plugins with their parameters. Exit with 2 if one is broken; its error is listed."""
    with quiet_stdout():
        from navfw.plugins.registry import check_kind, default_registry

        if kind is not None:
            check_kind(kind)  # before any plugin is imported
        rows = default_registry().listing(kind)
    if json:
        print_json(rows)
    else:
        _print_plugins(rows)
    if any(row["error"] is not None for row in rows):
        raise typer.Exit(2)


def _describe(found: NamedFile) -> Row:
    from navfw.cli.file_summaries import world_summary

    return world_summary(found.path)


def _rows(files: Iterable[NamedFile], *readers: Callable[[NamedFile], Row]) -> list[Row]:
    """A row per file; the row of an invalid file holds its error."""
    from navfw.config.input_file import shown_path
    from navfw.errors import InputError

    rows = []
    for found in files:
        row: Row = {"name": found.name, "description": ""}
        error = None
        for read in readers:
            try:
                row |= read(found)
            except InputError as reason:
                error = str(reason)
        rows.append(
            row
            | {
                "status": "ok" if error is None else "broken",
                "source": found.source,
                "path": shown_path(found.path),
                "error": error,
            }
        )
    return rows


def _show(rows: list[Row], columns: list[str], nothing: str, *, as_json: bool) -> None:
    if as_json:
        print_json(rows)
        return
    from rich.text import Text

    def about(row: Row) -> Text:
        if row["error"] is None:
            return Text(row["description"])
        return Text(f"broken: {row['error']}", style="red")

    described = any(about(row) for row in rows)
    cells = [
        [
            Text(row["name"], style="bold"),
            *([about(row)] if described else []),
            *(_cell(row.get(column)) for column in columns),
        ]
        for row in rows
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
    from rich.table import Table
    from rich.text import Text

    out = console()
    kind = None
    for row in rows:
        if row["kind"] != kind:
            kind = row["kind"]
            out.print(Text(f"\n{kind}", style="bold underline"))
        headline = Text.assemble("  ", (row["name"], "bold"), "  ", (row["source"], "dim"))
        out.print(headline)
        if row["error"] is not None:
            out.print(Text(f"    broken: {row['error']}", style="red"))
            continue
        out.print(Text(f"    {row['summary']}"))
        table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
        for parameter in row["parameters"]:
            default = "required" if parameter["required"] else f"= {_cell(parameter['default'])}"
            texts = (parameter["name"], parameter["type"], default)
            about = (parameter["bounds"], parameter["description"])
            table.add_row("     ", *(Text(text) for text in (*texts, *about)))
        if row["parameters"]:
            out.print(table)
        for note in row["notes"]:
            out.print(Text(f"    note: {note}", style="yellow"))
