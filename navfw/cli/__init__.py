"""The ``navfw`` command: thin; it parses, calls and prints.

Each module of ``COMMANDS`` has a function ``add_to(app)`` that adds its commands. The modules are
imported for every ``navfw --help``, so what is heavy is imported inside the commands.

Exit codes: 0 done, 1 it ran and failed, 2 what was typed or a file is wrong.
"""

from __future__ import annotations

import importlib
import io
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from navfw.errors import InputError, NavfwError

__all__ = ["COMMANDS", "app", "main"]

COMMANDS = (
    "navfw.cli.run",
    "navfw.cli.replay",
    "navfw.cli.explain",
    "navfw.cli.plan",
    "navfw.cli.map",
    "navfw.cli.learn",
    "navfw.cli.perceive",
    "navfw.cli.reproduce",
    "navfw.cli.listings",
    "navfw.cli.generate",
    "navfw.cli.import_world",
    "navfw.cli.bench",
    "navfw.cli.suite",
)
"""The modules with commands, in the order of ``navfw --help``."""


class _Group(TyperGroup):
    """Turns navfw's own errors into one message on stderr and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except NavfwError as error:
            typer.echo(f"navfw: {error}", err=True)
            raise typer.Exit(2 if isinstance(error, InputError) else 1) from None


app = typer.Typer(
    name="navfw",
    cls=_Group,
    help="Drive a one-camera robot by fuzzy behaviours, and see why it does what it does.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,  # an error that is not ours is a bug: show it as it is
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"navfw {version('navfw')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    del version


for _module in COMMANDS:
    importlib.import_module(_module).add_to(app)


def main() -> None:
    """The console script; ends the process with navfw's exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no umlauts is no error
    app()
