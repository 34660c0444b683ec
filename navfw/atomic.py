"""Atomic output: a file or folder is written completely or not at all."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from abc import ABC, abstractmethod
from pathlib import Path
from types import TracebackType
from typing import Self

from navfw.errors import InputError

__all__ = ["AtomicFolder", "AtomicTarget"]


class AtomicTarget(ABC):
    """A context manager for writing ``target`` atomically.

    Inside the block, ``path`` is a temporary folder beside the target. Without an exception, the
    folder, or its content, is moved to the target at the end; after an exception it is removed.

    Raises:
        InputError: the target cannot be written.

    """

    def __init__(self, target: Path) -> None:
        self.target = target
        self.path = target

    def __enter__(self) -> Self:
        parent = self.target.absolute().parent
        try:
            parent.mkdir(parents=True, exist_ok=True)
            self.path = Path(tempfile.mkdtemp(prefix=f".{self.target.name}.", dir=parent))
            self.path.chmod(0o755)
        except OSError as error:
            raise self._unwritable(error) from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._finish()
            if kind is None:
                self._move_into_place()
        except OSError as failure:
            raise self._unwritable(failure) from failure
        finally:
            shutil.rmtree(self.path, ignore_errors=True)

    def _finish(self) -> None:  # noqa: B027 - optional
        """Close open files; called after an exception as well."""

    @abstractmethod
    def _move_into_place(self) -> None:
        """Move the result to the target."""

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(f"cannot be written: {error.strerror or error}", file=self.target)


class AtomicFolder(AtomicTarget):
    """A folder that is written atomically and replaces an earlier one.

    ``replaceable`` matches the names of files that an earlier folder may contain; ``option`` is the
    command line option that names the target.

    Raises:
        InputError: the target contains other files, or cannot be written.

    """

    def __init__(self, target: Path, replaceable: re.Pattern[str], option: str) -> None:
        super().__init__(target)
        self._replaceable, self._option = replaceable, option
        self._refuse_foreign()

    def _move_into_place(self) -> None:
        if self.target.exists():
            self._refuse_foreign()
            shutil.rmtree(self.target)
        self.path.rename(self.target)

    def _refuse_foreign(self) -> None:
        if not os.path.lexists(self.target):
            return
        if not self.target.is_dir():
            raise InputError("expected a folder, got a file", file=self.target)
        names = sorted(entry.name for entry in self.target.iterdir())
        foreign = [name for name in names if not self._replaceable.fullmatch(name)]
        if foreign:
            raise InputError(
                f"contains {foreign[0]!r}, so it is not replaced; choose another {self._option}",
                file=self.target,
            )
