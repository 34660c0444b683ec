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
_STARTS = PARTS["behavior"].starts
_Start = Annotated[
    str, typer.Option(metavar="START", help=f"What it begins as: {', '.join(_STARTS)}.")
]


def add_to(app: typer.Typer) -> None:
    """Add ``new`` with its commands."""
    group = command_group("Begin a project, or a part of one.")
    group.command()(project)
    for kind, part in PARTS.items():
        write = _behavior if kind == "behavior" else _writer(kind)
        group.command(kind, help=f"{part.help} They go into the current project.")(write)
    app.add_typer(group, name="new")


def project(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write; new, or empty.")],
) -> None:
    """Write a project: behaviour, rules, stack, world, map, mission and tests.

    All of it passes. Nothing that exists is overwritten. The project is trusted: its plugins are
    those just written.
    """
    from navfw.config.trust_file import TrustFile
    from navfw.scaffold.new_files import write_project

    written = write_project(folder)
    TrustFile().add(folder.resolve(), folder.stat().st_uid)
    typer.echo(f"wrote {folder}, and trusts it:")
    typer.echo("".join(f"  {name}\n" for name in written), nl=False)
    typer.echo(f"next: cd {folder}, then navfw check && navfw run den next-room")


def _writer(kind: str) -> Callable[[str], None]:
    def write(name: _Name) -> None:
        _write(kind, name)

    return write


def _behavior(name: _Name, start: _Start = _STARTS[0]) -> None:
    _write("behavior", name, start)


def _write(kind: str, name: str, start: str = "") -> None:
    from navfw.scaffold.new_files import write_part

    written, then = write_part(kind, name, start)
    typer.echo("wrote:")
    typer.echo("".join(f"  {file}\n" for file in written), nl=False)
    typer.echo(f"next: navfw check && {then}")
