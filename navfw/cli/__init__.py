"""The ``navfw`` command: it parses arguments, calls the other packages and prints results.

A command is the function of its name in a module of ``PANELS``, a group of commands the ``group``
of its module. All modules are imported for every ``navfw --help``; expensive imports are therefore
inside the commands.

Exit codes: 0 success, 1 the command ran and failed, 2 an argument, option or file is wrong, 3 it
ran, but its results could not be written completely, 130 interrupted by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any

import typer

from navfw.cli.installed_commands import installed_commands, load_command, summary_of
from navfw.cli.options import SuggestingGroup, option
from navfw.cli.output import echo, standard_streams
from navfw.cli.supervisor import supervise
from navfw.cli.trust import TrustOnce, accept_trust, ask_on_terminal
from navfw.config.project_trust import asking, trusting
from navfw.errors import InputError, NavfwError
from navfw.process.interruption import INTERRUPTED, ignore_signals, interruptible

__all__ = ["PANELS", "app", "main"]

PANELS = {
    "Drive": {
        "demo": "demo",
        "run": "run",
        "replay": "replay",
        "perceive": "perceive",
        "ros": "ros",
    },
    "Look": {"list": "listings", "explain": "explain", "report": "recordings", "export": "replay"},
    "Make": {"world": "world", "map": "map", "rules": "edit_rules"},
    "Measure": {"suite": "suite", "tune": "tune"},
    "Project": {
        "new": "new",
        "check": "check",
        "schema": "check",
        "trust": "trust",
        "warm": "warm",
    },
}
"""The commands by their heading in ``navfw --help``, each with its module."""

_OF_PACKAGES = "Of installed packages"
"""The heading in ``navfw --help`` of commands that other packages add."""

UsageError: Any = typer.BadParameter.__base__
"""The exception for a wrong command line; typer has no public name for it."""


class _Navfw(SuggestingGroup):
    """Prints a ``NavfwError`` as one message on stderr and exits with its code.

    Before it executes a project's plugins for the first time, it asks, if there is a terminal.
    """

    @property
    def panels(self) -> dict[str, Any]:
        """The commands of ``PANELS`` and of installed packages, by heading."""
        return PANELS | ({_OF_PACKAGES: self._others} if self._others else {})

    @property
    def _others(self) -> dict[str, Any]:
        own = {name for names in PANELS.values() for name in names}
        return {name: point for name, point in installed_commands().items() if name not in own}

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands, those of installed packages last."""
        return [*{**dict.fromkeys(super().list_commands(ctx)), **self._others}]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of that name; if an installed package has it, it is imported."""
        if cmd_name not in self.commands and cmd_name in self._others:
            self.commands[cmd_name] = load_command(self._others[cmd_name])
        return super().get_command(ctx, cmd_name)

    def summary(self, name: str) -> str:
        """Return the first sentence on a command; packages are not imported for it."""
        return summary_of(self._others[name]) if name in self._others else super().summary(name)

    def invoke(self, ctx: Any) -> Any:
        try:
            # SIGTERM ends a command as Ctrl-C does: nothing is left behind
            with interruptible(), asking(ask_on_terminal):
                return super().invoke(ctx)
        except NavfwError as error:
            echo(f"navfw: {error}", err=True)
            raise typer.Exit(2 if isinstance(error, InputError) else 1) from None
        except UsageError as error:
            if error.ctx is None or error.message == error.ctx.get_help():  # a group's own help
                raise
            hint = f"Try '{error.ctx.command_path} -h' for help."
            echo(f"{error.ctx.get_usage()}\n{hint}\n\nError: {error.format_message()}", err=True)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            echo("navfw: interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    name="navfw",
    cls=_Navfw,
    help="Drive a one-camera robot by fuzzy behaviours, with an explanation of every command.",
    no_args_is_help=True,
    rich_markup_mode=None,  # rich would drop units such as [m] and defaults in brackets
    pretty_exceptions_enable=False,  # any other exception is a bug: show its traceback
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        echo(f"navfw {version('navfw')}")
        raise typer.Exit


@app.callback()
def _root(
    ctx: typer.Context,
    version: bool = option(
        False, "Show the version.", "--version", callback=_version, is_eager=True
    ),
    trust: TrustOnce = False,
) -> None:
    del version
    if trust:
        ctx.with_resource(trusting())


for _commands in PANELS.values():
    for _name, _module_name in _commands.items():
        _module = importlib.import_module(f"navfw.cli.{_module_name}")
        if hasattr(_module, "group"):
            app.add_typer(_module.group, name=_name)
        else:
            app.command()(getattr(_module, _name))
accept_trust(app)


def main() -> None:
    """Run the console script, and exit with navfw's exit code."""
    command = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
    with standard_streams():
        try:
            if command != "run":
                app()
            sys.exit(supervise(_run))
        except KeyboardInterrupt:  # after the command's own end
            sys.exit(INTERRUPTED)
        finally:
            ignore_signals()  # the interpreter's end would take them for a failure


def _run() -> None:
    """The command in a child process, with its own check that its output was written."""
    with standard_streams():
        app()
