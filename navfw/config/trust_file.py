"""The file of trusted projects: folders whose plugins this user has agreed to execute.

``navfw/trusted.json`` in the user's configuration folder, ``$XDG_CONFIG_HOME`` or ``~/.config``. A
folder is trusted as long as it has the owner that it had when it was added.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

from platformdirs import user_config_path
from pydantic import Field

from navfw.config.lookup import owned_by_user, writable_by_anyone
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import load_model
from navfw.errors import ConfigError, InputError, UnknownNameError
from navfw.process.atomic import write_text


class TrustedFolder(StrictModel):
    """A trusted project: its resolved path, and the user id of its owner."""

    path: Annotated[str, Field(pattern="^/")]
    owner: Annotated[int, Field(ge=0)]


class _TrustedFolders(StrictModel):
    trusted: tuple[TrustedFolder, ...]


class TrustFile:
    """The trusted folders as stored; each method reads the file anew.

    Raises:
        ConfigError: the file is damaged, or another user could have written it. No folder is
            trusted then.
        InputError: the file cannot be written.

    """

    def __init__(self) -> None:
        self.path = user_config_path("navfw") / "trusted.json"

    def folders(self) -> tuple[TrustedFolder, ...]:
        """All trusted folders by path."""
        if not os.path.lexists(self.path):
            return ()
        for part in (self.path, self.path.parent):
            if not owned_by_user(part) or writable_by_anyone(part):
                raise ConfigError("some other user can write to it; remove it", file=part)
        try:
            return load_model(self.path, _TrustedFolders).trusted
        except ConfigError as error:
            remedy = "correct or remove the file of trusted folders"
            raise ConfigError(f"{error}; {remedy}", file=None) from None

    def has(self, folder: Path, owner: int) -> bool:
        """Whether ``folder``, resolved, is trusted with that owner."""
        return TrustedFolder(path=str(folder), owner=owner) in self.folders()

    def add(self, folder: Path, owner: int) -> None:
        """Trust ``folder``, resolved, as long as ``owner`` owns it."""
        if not str(folder).isprintable():
            what = f"has a character that cannot be printed: {str(folder)!r}; rename the folder"
            raise InputError(what, key="navfw trust")
        kept = [entry for entry in self.folders() if entry.path != str(folder)]
        self._write([*kept, TrustedFolder(path=str(folder), owner=owner)])

    def remove(self, folder: Path) -> None:
        """Trust ``folder``, resolved, no longer.

        Raises:
            UnknownNameError: it is not trusted.

        """
        entries = self.folders()
        kept = [entry for entry in entries if entry.path != str(folder)]
        if len(kept) == len(entries):
            raise UnknownNameError("trusted folder", str(folder), (entry.path for entry in entries))
        self._write(kept)

    def _write(self, folders: list[TrustedFolder]) -> None:
        content = _TrustedFolders(trusted=tuple(sorted(folders, key=lambda entry: entry.path)))
        text = json.dumps(content.model_dump(), indent=1, ensure_ascii=False) + "\n"
        write_text(self.path, text, parents=True, mode=0o600)
