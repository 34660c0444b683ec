"""Files and folders that appear whole or not at all."""

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
    """A context manager that works beside its ``target``; an exception leaves nothing behind.

    Inside, ``path`` is a temporary folder; leaving without an exception moves what is in it, or all
    of it, into place.

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

    def _finish(self) -> None:  # noqa: B027 - most have nothing open
        """Close what is open, after an exception too."""

    @abstractmethod
    def _move_into_place(self) -> None:
        """Move what was made to the target."""

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(f"cannot be written: {error.strerror or error}", file=self.target)


class AtomicFolder(AtomicTarget):
    """A folder, written whole or not at all. An earlier one is replaced.

    ``ours`` matches the names of the files that it may hold; ``option`` is what named it.

    Raises:
        InputError: the target holds something else, or cannot be written.

    """

    def __init__(self, target: Path, ours: re.Pattern[str], option: str) -> None:
        super().__init__(target)
        self._ours, self._option = ours, option
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
            raise InputError("is a file; a folder is needed", file=self.target)
        names = sorted(entry.name for entry in self.target.iterdir())
        foreign = [name for name in names if not self._ours.fullmatch(name)]
        if foreign:
            raise InputError(
                f"holds {foreign[0]!r}, so it is not replaced; choose another {self._option}",
                file=self.target,
            )
