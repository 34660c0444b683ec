"""``navfw new project``, ``behavior``, ``world``: files of one's own, all of which pass."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add ``new`` with its commands."""
    group = typer.Typer(
        help="Begin a project, or a part of one.", no_args_is_help=True, rich_markup_mode=None
    )
    group.callback()(_group)
    group.command()(project)
    group.command()(behavior)
    group.command()(world)
    app.add_typer(group, name="new")


def _group() -> None:
    """Begin a project, or a part of one."""


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


def behavior(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Its name, such as slow_down.")],
) -> None:
    """Write a behaviour with rules and a test into the project one stands in."""
    from navfw.new_parts import write_behavior

    _tell(write_behavior(name), f"next: put {name} into a stack, then navfw check && pytest tests")


def world(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Its name, such as east-wing.")],
) -> None:
    """Write a world with map, mission and a test into the project one stands in."""
    from navfw.new_parts import write_world

    _tell(write_world(name), f"next: navfw check && navfw run {name} next-room")


def _tell(written: list[str], then: str) -> None:
    typer.echo("wrote:")
    typer.echo("".join(f"  {file}\n" for file in written), nl=False)
    typer.echo(then)
