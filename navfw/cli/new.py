"""``navfw new project DIR``: a project of one's own, all of which passes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add ``new`` with its commands."""
    group = typer.Typer(help="Begin a project.", no_args_is_help=True, rich_markup_mode=None)
    group.callback()(_group)
    group.command()(project)
    app.add_typer(group, name="new")


def _group() -> None:
    """Begin a project."""


def project(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write; new, or empty.")],
) -> None:
    """Write a project: behaviour, rules, stack, world, map, mission and tests.

    All of it passes. Nothing that exists is overwritten.
    """
    from navfw.new_project import write_project

    written = write_project(folder)
    typer.echo(f"wrote {folder}:")
    typer.echo("".join(f"  {name}\n" for name in written), nl=False)
    typer.echo(f"next: cd {folder}, then navfw trust . && navfw check && navfw run den next-room")
