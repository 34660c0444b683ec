"""Trust in a project: whether its plugins may be executed.

A project may come from anywhere, and the files in its ``behaviors`` and ``plugins`` are Python.
They are imported only after the user has agreed: by ``navfw trust``, by an answer on the terminal,
or by the environment variable ``NAVFW_TRUST``. What navfw ships needs no trust.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Self, TypeAlias

from platformdirs import user_config_path

from navfw.config import lookup
from navfw.config.input_file import read_input_text, real_path
from navfw.errors import UnknownNameError, UntrustedCodeError
from navfw.process.atomic import write_text
from navfw.process.printable_text import printable

TRUST_VARIABLE = "NAVFW_TRUST"
"""Environment variable: ``1`` trusts any project; otherwise it lists folders of trusted projects,
separated as in ``PATH``. Child processes inherit it."""

MAX_NAMED = 20
"""Largest number of files that a message names."""


@dataclass(frozen=True)
class ProjectCode:
    """The plugin files of a project, and its ``folder``, with links resolved."""

    folder: Path
    files: tuple[Path, ...]

    @classmethod
    def around(cls, start: Path | None = None) -> Self | None:
        """Return the plugins of the project around ``start`` (default: working folder), or None."""
        project = lookup.project_folder(start)
        if project is None:
            return None
        folders = lookup.project_plugin_folders(start)
        return cls(
            real_path(project), tuple(file for folder in folders for file in _files_of(folder))
        )

    def names(self) -> list[str]:
        """List the files relative to the project, at most ``MAX_NAMED``, in printable text."""
        names = [printable(os.path.relpath(real_path(file), self.folder)) for file in self.files]
        more = len(names) - MAX_NAMED
        return names if more <= 0 else [*names[:MAX_NAMED], f"and {more} more"]


Question: TypeAlias = Callable[[ProjectCode], bool]
_question: ContextVar[Question | None] = ContextVar("question", default=None)


@contextmanager
def asking(question: Question) -> Iterator[None]:
    """Context in which ``question`` decides on code that is not trusted; a yes is remembered."""
    token = _question.set(question)
    try:
        yield
    finally:
        _question.reset(token)


@contextmanager
def trusting(folder: Path | None = None) -> Iterator[None]:
    """Context that trusts the project in ``folder``, or any, also in child processes."""
    before = os.environ.get(TRUST_VARIABLE)
    if before != "1":
        folders = [*([before] if before else []), str(folder and real_path(folder))]
        os.environ[TRUST_VARIABLE] = "1" if folder is None else os.pathsep.join(folders)
    try:
        yield
    finally:
        os.environ.pop(TRUST_VARIABLE, None)
        if before is not None:
            os.environ[TRUST_VARIABLE] = before


def require_trust() -> None:
    """Check that the plugins of the project around the working folder may be executed.

    They may if there are none, if it is trusted, or if the user agrees to trust it from now on.

    Raises:
        UntrustedCodeError: the user has not agreed.

    """
    code, allowed = ProjectCode.around(), os.environ.get(TRUST_VARIABLE, "")
    if code is None or not code.files or allowed == "1":
        return
    if str(code.folder) in (*allowed.split(os.pathsep), *trusted_folders()):
        return
    question = _question.get()
    if question is None or not question(code):
        folder = printable(str(code.folder))
        raise UntrustedCodeError(
            f"not trusted, so its code is not executed: {', '.join(code.names())}; read it, then"
            f" run navfw trust {shlex.quote(folder)}, or allow this command only by --trust or"
            f" {TRUST_VARIABLE}=1",
            file=folder,
        )
    trust(code.folder)


def trust_file() -> Path:
    """Return the path of the user's file of trusted folders, which has one per line."""
    return user_config_path("navfw") / "trusted-folders.txt"


def trusted_folders() -> list[str]:
    """Return the folders of the projects that this user trusts, with links resolved, sorted."""
    file = trust_file()
    return sorted(read_input_text(file).splitlines()) if file.is_file() else []


def trust(folder: Path) -> None:
    """Trust the project in ``folder`` from now on; written to ``trust_file``."""
    _write({*trusted_folders(), str(real_path(folder))})


def distrust(folder: Path) -> None:
    """Stop trusting the project in ``folder``.

    Raises:
        UnknownNameError: the project is not trusted.

    """
    folders, name = trusted_folders(), str(real_path(folder))
    if name not in folders:
        raise UnknownNameError("trusted folder", name, folders)
    _write({*folders} - {name})


def _write(folders: set[str]) -> None:
    write_text(trust_file(), "".join(f"{name}\n" for name in sorted(folders)), parents=True)


def _files_of(folder: Path) -> list[Path]:
    try:
        return lookup.plugin_files(folder)
    except OSError:  # the registry reports it
        return []
