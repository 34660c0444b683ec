"""The code of a project, and whether this user has agreed to execute it.

The files in ``behaviors`` and ``plugins`` of a project are Python, and a project may come from
anywhere: they are imported only after the user has said so, by ``navfw trust``, by an answer on the
terminal, or by the environment variable ``NAVFW_TRUST``. What navfw ships needs no trust.

Two libraries read settings from the working folder, with the same power: numba may be told to load
compiled code from there, and matplotlib to typeset by LaTeX. Such files need trust, too.
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

from navfw.config import lookup
from navfw.config.input_file import real_path
from navfw.errors import UntrustedCodeError

TRUST_VARIABLE = "NAVFW_TRUST"
"""Environment variable: ``1`` trusts whatever project is in use; else folders of projects to trust,
separated as in ``PATH``. Child processes inherit it."""

LIBRARY_SETTINGS = (".numba_config.yaml", "matplotlibrc")
"""Files that numba and matplotlib read in the working folder."""

MAX_NAMED = 20
"""Largest number of files that a message names."""


@dataclass(frozen=True)
class ProjectCode:
    """The files of a project that would be executed; ``folder`` is the project's, resolved.

    ``owner`` is the user id of the folder's owner.
    """

    folder: Path
    owner: int
    files: tuple[Path, ...]

    @classmethod
    def around(cls, start: Path | None = None) -> Self | None:
        """The plugins of the project around ``start`` (default: the working folder), if any is.

        Raises:
            ConfigError: the project's ``pyproject.toml`` is not valid TOML.

        """
        project = lookup.project_folder(start)
        if project is None:
            return None
        folders = lookup.project_plugin_folders(start)
        files = tuple(real_path(file) for folder in folders for file in _files_of(folder))
        return cls(real_path(project), project.stat().st_uid, files)

    @classmethod
    def settings_in(cls, start: Path) -> Self | None:
        """The settings of libraries in ``start``; they count as part of the project around it."""
        files = tuple(start / name for name in LIBRARY_SETTINGS if os.path.lexists(start / name))
        if not files:
            return None
        folder = real_path(lookup.project_folder(start) or start)
        return cls(folder, folder.stat().st_uid, files)

    def unsafe_part(self) -> Path | None:
        """The first file or folder that some other user could have written; None if there is none.

        Written by the owner of the project is no reason: that is who is trusted.
        """
        trusted = {self.owner, os.geteuid()}
        parts = dict.fromkeys((self.folder, *(file.parent for file in self.files), *self.files))
        for part in parts:
            if lookup.writable_by_anyone(part) or part.stat().st_uid not in trusted:
                return part
        return None

    def names(self) -> list[str]:
        """The files relative to the project, at most ``MAX_NAMED``; characters are printable."""
        names = [_printable(os.path.relpath(file, self.folder)) for file in self.files]
        more = len(names) - MAX_NAMED
        return names if more <= 0 else [*names[:MAX_NAMED], f"and {more} more"]


Question: TypeAlias = Callable[[ProjectCode], bool]
_question: ContextVar[Question | None] = ContextVar("question", default=None)


@contextmanager
def asking(question: Question) -> Iterator[None]:
    """Have ``question`` decide on code that is not trusted yet; a yes is remembered."""
    token = _question.set(question)
    try:
        yield
    finally:
        _question.reset(token)


@contextmanager
def trusting(folder: Path | None = None) -> Iterator[None]:
    """Trust the project in ``folder``, or any project, in this context and in its processes."""
    before = os.environ.get(TRUST_VARIABLE)
    also = [before] if before else []
    if before != "1":
        trusted = "1" if folder is None else os.pathsep.join([*also, str(real_path(folder))])
        os.environ[TRUST_VARIABLE] = trusted
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(TRUST_VARIABLE, None)
        else:
            os.environ[TRUST_VARIABLE] = before


def require_trust() -> None:
    """Return if the plugins of the project around the working folder may be executed.

    So they may if there are none, if the project is trusted, or if the user agrees when asked.

    Raises:
        UntrustedCodeError: the user has not agreed.
        ConfigError: the file of trusted folders is damaged.

    """
    _require(ProjectCode.around())


def require_trust_in_settings() -> None:
    """Return if libraries may read their settings in the working folder; before their import.

    Raises:
        UntrustedCodeError: there are some, and the user has not agreed.
        ConfigError: the file of trusted folders is damaged.

    """
    try:
        folder = Path.cwd()
    except FileNotFoundError:  # the working folder has been removed
        return
    _require(ProjectCode.settings_in(folder))


def _require(code: ProjectCode | None) -> None:
    by_environment = os.environ.get(TRUST_VARIABLE, "")
    if code is None or not code.files or by_environment == "1":
        return
    if str(code.folder) in by_environment.split(os.pathsep):
        return
    from navfw.config.trust_file import TrustFile

    trusted, unsafe = TrustFile(), code.unsafe_part()
    if unsafe is not None:
        raise UntrustedCodeError(
            "some other user can write to it, so nothing of the project is executed; chmod o-w it,"
            f" or set {TRUST_VARIABLE}=1",
            file=_printable(str(unsafe)),
        )
    if trusted.has(code.folder, code.owner):
        return
    question = _question.get()
    if question is None or not question(code):
        raise UntrustedCodeError(
            f"not trusted, so its code is not executed: {', '.join(code.names())}; read it, then"
            f" run navfw trust {shlex.quote(_printable(str(code.folder)))}, or allow this command"
            f" alone by --trust or {TRUST_VARIABLE}=1",
            file=_printable(str(code.folder)),
        )
    trusted.add(code.folder, code.owner)


def _files_of(folder: Path) -> list[Path]:
    try:
        return lookup.plugin_files(folder)
    except OSError:  # the registry reports it
        return []


def _printable(text: str) -> str:
    """``text`` without characters that move the cursor or hide other characters."""
    return "".join(char if char.isprintable() else "?" for char in text)
