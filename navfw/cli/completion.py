"""Names that the shell completes: worlds, missions, maps, stacks, robots, suites, behaviours.

Each function returns the names that begin with ``incomplete``. They list files and execute no code
of a project: a behaviour has the name of its file. Whatever is wrong, a shell must not see an
error in the middle of a line: then nothing is completed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps

import typer

from navfw.config.lookup import (
    list_maps,
    list_missions,
    list_robots,
    list_stacks,
    list_worlds,
    plugin_files,
    plugin_folders,
)
from navfw.errors import InputError

Names = Callable[[typer.Context], Iterable[str]]
_Completer = Callable[[typer.Context, str], list[str]]

_PARTS_OF_MISSION = ("mission.", "robot.", "sensors.")
"""What ``--set`` may begin with besides a behaviour's name."""


def _completer(names: Names) -> _Completer:
    @wraps(names)
    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            return [name for name in names(ctx) if name.startswith(incomplete)]
        except (InputError, OSError):
            return []

    # the shell's own parameters, not those of ``names``
    complete.__annotations__ = {"ctx": typer.Context, "incomplete": str, "return": list[str]}
    del complete.__wrapped__
    return complete


@_completer
def complete_world(_: typer.Context) -> Iterable[str]:
    """The worlds."""
    return (found.name for found in list_worlds())


@_completer
def complete_mission(ctx: typer.Context) -> Iterable[str]:
    """The missions of the world typed before."""
    world = ctx.params.get("world")
    return (found.name for found in list_missions(world)) if world else ()


@_completer
def complete_map(_: typer.Context) -> Iterable[str]:
    """The maps."""
    return (found.name for found in list_maps())


@_completer
def complete_stack(_: typer.Context) -> Iterable[str]:
    """The stacks."""
    return (found.name for found in list_stacks())


@_completer
def complete_robot(_: typer.Context) -> Iterable[str]:
    """The robots."""
    return (found.name for found in list_robots())


@_completer
def complete_suite(_: typer.Context) -> Iterable[str]:
    """The suites."""
    from navfw.suite.suitefile import list_suites

    return sorted(list_suites())


@_completer
def complete_setting(_: typer.Context) -> Iterable[str]:
    """What ``--set`` may begin with: behaviours, and parts of the mission."""
    folders = (folder for folder in plugin_folders() if folder.name == "behaviors")
    behaviors = {f"{file.stem}." for folder in folders for file in plugin_files(folder)}
    return sorted({*behaviors, *_PARTS_OF_MISSION})
