"""``navfw trust DIR``, the option ``--trust`` of all commands, and the question on a terminal."""

from __future__ import annotations

import functools
import inspect
import pwd
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from navfw.cli.output import echo
from navfw.config.input_file import real_path
from navfw.config.project_code import ProjectCode, require_trust_in_settings, trusting
from navfw.errors import InputError

if TYPE_CHECKING:
    from navfw.config.trust_file import TrustedFolder

TrustOnce = Annotated[
    bool,
    typer.Option("--trust", help="Execute the project's own plugins, for this command alone."),
]


def trust(
    folder: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="Folder of a project.")
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="List the trusted projects.")] = False,
    remove: Annotated[bool, typer.Option("--remove", help="Trust DIR no longer.")] = False,
) -> None:
    """Trust the plugins of a project: they are executed from now on."""
    from navfw.config.trust_file import TrustFile

    trusted = TrustFile()
    if list_ != (folder is None) or (list_ and remove):
        raise typer.BadParameter("expected DIR, --remove DIR, or --list alone")
    if folder is None:
        folders = trusted.folders()
        echo("\n".join(map(_listed, folders)) if folders else "No project is trusted.")
    elif remove:
        trusted.remove(real_path(folder))
        echo(f"no longer trusted: {real_path(folder)}")
    else:
        code = _code_of(folder)
        trusted.add(code.folder, code.owner)
        echo(f"trusted: {code.folder}, of {_user(code.owner)}")
        echo("".join(f"  {name}\n" for name in code.names() or ["no plugins yet"]), nl=False)


def accept_trust(app: typer.Typer) -> None:
    """Give every command of ``app``, but ``trust``, the option ``--trust``."""
    for group in app.registered_groups:
        if group.typer_instance is not None:
            accept_trust(group.typer_instance)
    for command in app.registered_commands:
        if command.callback is not None and command.callback is not trust:
            command.callback = _with_trust(command.callback)


@functools.cache
def ask_on_terminal(code: ProjectCode) -> bool:
    """Whether the user agrees to execute ``code``; asked once, and only on a terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    files = "".join(f"  {name}\n" for name in code.names())
    echo(
        f"The project in {str(code.folder)!r}, of {_user(code.owner)}, has code that this"
        f" command would execute:\n{files}"
        "They may do whatever you may do. Trust this project from now on? [y/N] ",
        err=True,
        nl=False,
    )
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def _with_trust(callback: Callable[..., Any]) -> Callable[..., Any]:
    """``callback`` with a further parameter ``trust``, which typer reads from its signature.

    Before the command imports a library, the library's settings in the working folder are checked.
    """

    @functools.wraps(callback)
    def command(*arguments: Any, trust: bool = False, **options: Any) -> Any:
        with trusting() if trust else nullcontext():
            require_trust_in_settings()
            return callback(*arguments, **options)

    signature = inspect.signature(callback, eval_str=True)
    own = inspect.Parameter(
        "trust", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=TrustOnce
    )
    parameters = [*signature.parameters.values(), own]
    command.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def _code_of(folder: Path) -> ProjectCode:
    """The code of the project around ``folder``, if it can be trusted at all."""
    code = None
    if folder.is_dir():
        code = ProjectCode.around(folder) or ProjectCode.settings_in(folder)
    if code is None:
        what = "expected a folder with navfw.toml, or with pyproject.toml and [tool.navfw] in it"
        raise InputError(what, file=folder)
    unsafe = code.unsafe_part()
    if unsafe is not None:
        what = "some other user can write to it, so it cannot be trusted; chmod o-w it"
        raise InputError(what, file=unsafe)
    return code


def _listed(entry: TrustedFolder) -> str:
    folder = Path(entry.path)
    same = folder.is_dir() and folder.stat().st_uid == entry.owner
    return f"{folder}  of {_user(entry.owner)}" + ("" if same else "; gone, or another user's now")


def _user(number: int) -> str:
    """The user of that id, by name where there is one."""
    try:
        return f"user {pwd.getpwuid(number).pw_name}"
    except KeyError:
        return f"user {number}"
