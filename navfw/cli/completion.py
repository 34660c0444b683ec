"""Names that the shell completes: of data files, and of settings.

Each completer returns the names that begin with ``incomplete``. They list files and execute no code
of a project: a behaviour has the name of its file. Whatever is wrong, a shell must not see an
error in the middle of a line: then nothing is completed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps

import typer

from navfw.config.lookup import list_files, list_missions, plugin_files, plugin_folders
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


def completer_of(kind: str) -> _Completer:
    """What completes the names of files of a kind of ``FILE_KINDS``."""

    def names(_: typer.Context) -> Iterable[str]:
        return (file.name for file in list_files(kind))

    return _completer(names)


@_completer
def complete_mission(ctx: typer.Context) -> Iterable[str]:
    """The missions of the world typed before."""
    world = ctx.params.get("world")
    return (mission.name for mission in list_missions(world)) if world else ()


@_completer
def complete_setting(_: typer.Context) -> Iterable[str]:
    """What ``--set`` may begin with: behaviours, and parts of the mission."""
    folders = (folder for folder in plugin_folders() if folder.name == "behaviors")
    behaviors = {f"{file.stem}." for folder in folders for file in plugin_files(folder)}
    return sorted({*behaviors, *_PARTS_OF_MISSION})
