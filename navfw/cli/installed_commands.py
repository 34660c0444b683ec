"""Commands of other installed packages: entry points of the group ``navfw.commands``.

An entry point has the name of the command, and refers to a function, as in ``typer``, or to a
``typer.Typer``, which is a group of commands. Its module is imported when the command is used;
``navfw --help`` shows the first line of the module's docstring. If navfw has a command of the same
name, navfw's is used.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.metadata import EntryPoint
from typing import Any

import typer

from navfw.cli.trust import accept_trust
from navfw.config.installed_packages import file_of, package_of, points_of
from navfw.errors import PluginError


def installed_commands() -> dict[str, EntryPoint]:
    """Return the entry points of commands, by name."""
    return {point.name: point for point in points_of("navfw.commands")}


def summary_of(point: EntryPoint) -> str:
    """Return the first line of the command's module, or the reason why it cannot be used."""
    file = file_of(point.module)
    if file is None:
        return f"Broken: there is no module {point.module}."
    with file.open(encoding="utf-8", errors="replace") as source:
        first_line = source.readline().strip()
    return first_line.strip('"') or f"See navfw {point.name} --help."


@lru_cache(maxsize=32)  # the options are added to its functions once
def load_command(point: EntryPoint) -> Any:
    """Import the command of an entry point.

    Raises:
        PluginError: it cannot be imported, or is not a command.

    """
    app = typer.Typer(rich_markup_mode=None)
    try:
        target = point.load()
        if isinstance(target, typer.Typer):
            app.add_typer(target, name=point.name)
        else:
            app.command(point.name)(target)
        accept_trust(app)
        return typer.main.get_group(app).commands[point.name]
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        what = f"the command {point.name!r} of {package_of(point)} cannot be used: {reason}"
        raise PluginError(what) from error
