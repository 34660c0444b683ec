"""``navfw trust DIR``, the option ``--trust`` of all commands, and the question on a terminal."""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import argument, option
from navfw.cli.output import echo
from navfw.config import project_trust as trusted
from navfw.config.input_file import real_path
from navfw.config.project_trust import ProjectCode, trusting
from navfw.errors import InputError

TrustOnce = Annotated[
    bool,
    typer.Option("--trust", help="Execute the project's own plugins, for this command only."),
]


def trust(
    folder: Path | None = argument(None, "Folder of a project.", metavar="DIR"),
    list_: bool = option(False, "List the trusted projects.", "--list"),
    remove: bool = option(False, "Trust DIR no longer.", "--remove"),
) -> None:
    """Trust the plugins of a project: they are executed from now on."""
    if list_ != (folder is None) or (list_ and remove):
        raise typer.BadParameter("expected DIR, --remove DIR, or --list by itself")
    if folder is None:
        echo("\n".join(trusted.trusted_folders()) or "No project is trusted.")
    elif remove:
        trusted.distrust(folder)
        echo(f"no longer trusted: {real_path(folder)}")
    else:
        code = ProjectCode.around(folder) if folder.is_dir() else None
        if code is None:
            what = "expected a folder with navfw.toml, or with pyproject.toml and [tool.navfw]"
            raise InputError(what, file=folder)
        trusted.trust(code.folder)
        echo(f"trusted: {code.folder}")
        echo("".join(f"  {name}\n" for name in code.names() or ["no plugins yet"]), nl=False)


def accept_trust(app: typer.Typer) -> None:
    """Add the option ``--trust`` to every command of ``app`` except ``trust``."""
    for group in app.registered_groups:
        if group.typer_instance is not None:
            accept_trust(group.typer_instance)
    for command in app.registered_commands:
        if command.callback is not None and command.callback is not trust:
            command.callback = _with_trust(command.callback)


@functools.cache
def ask_on_terminal(code: ProjectCode) -> bool:
    """Ask once, on a terminal, whether to execute ``code``; False without a terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    files = "".join(f"  {name}\n" for name in code.names())
    echo(
        f"The project in {str(code.folder)!r} has code that this command would execute:\n{files}"
        "It may do whatever you may do. Trust this project from now on? [y/N] ",
        err=True,
        nl=False,
    )
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def _with_trust(callback: Callable[..., Any]) -> Callable[..., Any]:
    """``callback`` with a further parameter ``trust``, which typer reads from its signature."""

    @functools.wraps(callback)
    def command(*arguments: Any, trust: bool = False, **options: Any) -> Any:
        with trusting() if trust else nullcontext():
            return callback(*arguments, **options)

    signature = inspect.signature(callback, eval_str=True)
    own = inspect.Parameter(
        "trust", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=TrustOnce
    )
    parameters = [*signature.parameters.values(), own]
    command.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return command
