"""``navfw new project``, and ``navfw new KIND NAME``: files of one's own, all of which pass."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.command_groups import command_group
from navfw.scaffold.part_kinds import PARTS

_Name = Annotated[
    str, typer.Argument(metavar="NAME", help="Its name: slow_down for code, east-wing for files.")
]


def add_to(app: typer.Typer) -> None:
    """Add ``new`` with its commands."""
    group = command_group("Begin a project, or a part of one.")
    group.command()(project)
    for kind, part in PARTS.items():
        group.command(kind, help=f"{part.help} They go into the current project.")(_writer(kind))
    app.add_typer(group, name="new")


def project(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write; new, or empty.")],
) -> None:
    """Write a project: behaviour, rules, stack, world, map, mission and tests.

    All of it passes. Nothing that exists is overwritten.
    """
    from navfw.scaffold.new_files import write_project

    written = write_project(folder)
    typer.echo(f"wrote {folder}:")
    typer.echo("".join(f"  {name}\n" for name in written), nl=False)
    typer.echo(f"next: cd {folder}, then navfw trust . && navfw check && navfw run den next-room")


def _writer(kind: str) -> Callable[[str], None]:
    def write(name: _Name) -> None:
        from navfw.scaffold.new_files import write_part

        written, then = write_part(kind, name)
        typer.echo("wrote:")
        typer.echo("".join(f"  {file}\n" for file in written), nl=False)
        typer.echo(f"next: navfw check && {then}")

    return write
