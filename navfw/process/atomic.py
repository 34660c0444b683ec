"""Atomic output: a file or folder is written completely or not at all.

Unfinished content lies beside the target, under a lock (``navfw.process.target_lock``).
"""

from __future__ import annotations

import contextlib
import csv
import errno
import os
import re
import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Self

from navfw.errors import InputError, SimulationError
from navfw.process.interruption import deferred
from navfw.process.printable_text import printable, printable_data
from navfw.process.target_lock import TargetInUseError, TargetLock, lock_first_free, sweep

_OF_THE_DISK = {errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EACCES}
"""Errors while content is written that come from the disk, not from the program."""
_SHOWN = {".html", ".md"}
"""Suffixes of pages that people read."""


def output_place(target: Path, option: str, *, replaced: bool = True) -> Path:
    """Check that an output can be written; return its absolute path, links followed.

    ``option`` is the option that named it, for the message.

    Raises:
        InputError: a link that points to nothing, a place below a file or without the right to
            write, or, if it is to be ``replaced``, the root of a mounted file system.

    """
    place = Path(os.path.abspath(target))  # noqa: PTH100 - resolves no links, unlike Path.resolve
    if place.is_symlink():
        if not place.exists():
            what = f"is a link to {place.readlink()}, which does not exist"
            raise InputError(f"{what}; choose another {option}", file=target)
        place = Path(os.path.realpath(place))  # a loop of links stays
    if replaced and place.is_mount():
        raise InputError(f"is a mount point; choose a folder in it as {option}", file=target)
    nearest = next(folder for folder in (place, *place.parents) if folder.exists())
    if nearest != place and not nearest.is_dir():
        raise _unwritable(target, os.strerror(errno.ENOTDIR))
    if not os.access(nearest, os.W_OK):
        raise _unwritable(target, os.strerror(errno.EACCES))
    return place


@contextlib.contextmanager
def writing(target: Path) -> Iterator[None]:
    """Context in which an OSError becomes an InputError: ``target`` cannot be written."""
    try:
        yield
    except OSError as error:
        raise _unwritable(target, error.strerror or error) from error


def _unwritable(target: Path, why: object) -> InputError:
    return InputError(f"cannot be written: {why}", file=target)


def output_file(target: Path, option: str = "") -> Path:
    """Check before the work that a file can be written; return its absolute path.

    ``option`` is the option that named it, for the message.

    Raises:
        InputError: the file cannot be written, or is a folder or a device.

    """
    place = output_place(target, option or "file")
    key = option or None
    if place.is_dir():
        raise InputError("expected a file to write, got a folder", file=target, key=key)
    if place.exists() and not place.is_file():
        raise InputError("is not a regular file; choose another", file=target, key=key)
    return place


class AtomicTarget(ABC):
    """A context manager for writing ``target`` atomically.

    Inside the block, ``path`` is a hidden folder beside the target to write to. If the block ends
    without an exception, the folder, or its content, is moved to the target; else it is removed.
    ``option`` is the command-line option that names the target. A link to a folder is followed.
    With ``numbered=True`` the target is the first of ``NAME``, ``NAME-2``, ... that is free.

    Raises:
        InputError: the target cannot be written, or another process writes it.

    """

    def __init__(self, target: Path, option: str = "--out", *, numbered: bool = False) -> None:
        self.target = target
        self.path = target
        self.option = option
        self.numbered = numbered
        self.place = output_place(target, option)
        self._lock = TargetLock(self.place)

    def __enter__(self) -> Self:
        try:
            with deferred():
                self._claim()
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        with deferred(), writing(self.target):
            try:
                self._finish()
                if kind is None:
                    self._move_into_place()
            finally:
                if not self.kept:
                    shutil.rmtree(self.path, ignore_errors=True)
                self._lock.release()
            if isinstance(error, OSError) and error.errno in _OF_THE_DISK:
                raise error

    @property
    def kept(self) -> bool:
        """Whether unfinished content is kept after an exception."""
        return False

    def _claim(self) -> None:
        """Lock the target and create the folder beside it."""
        try:
            with writing(self.target):
                self.place.parent.mkdir(parents=True, exist_ok=True)
                sweep(self.place.parent)
                if self.numbered:
                    self._lock = lock_first_free(self.place)
                    self.place = self._lock.target
                    self.target = self.target.with_name(self.place.name)
                else:
                    self._lock.acquire()
                self._lock.part.mkdir()
                self.path = self._lock.part
        except TargetInUseError as error:
            what = f"another process is writing it; wait for it, or choose another {self.option}"
            raise TargetInUseError(what, file=self.target) from error

    def _finish(self) -> None:  # noqa: B027 - optional
        """Close open files; called after an exception as well."""

    @abstractmethod
    def _move_into_place(self) -> None:
        """Move the result to the target."""

    def _replace(self) -> None:
        """Move the hidden folder to the place of the target; an earlier one is replaced.

        If the process is killed in between, the next one restores the earlier one.
        """
        if self.place.exists():
            self.place.rename(self._lock.old)
        self.path.rename(self.place)
        shutil.rmtree(self._lock.old, ignore_errors=True)


class AtomicFolder(AtomicTarget):
    """A folder that is written atomically and replaces an earlier one.

    ``replaceable`` matches the names of files that an earlier folder may contain.

    Raises:
        InputError: the target contains other files, or cannot be written.

    """

    def __init__(self, target: Path, replaceable: re.Pattern[str], option: str) -> None:
        super().__init__(target, option)
        self._replaceable = replaceable
        self._refuse_foreign()

    def _move_into_place(self) -> None:
        self._refuse_foreign()
        self._replace()

    def _refuse_foreign(self) -> None:
        if not self.place.exists():
            return
        if not self.place.is_dir():
            raise InputError("expected a folder, got a file", file=self.target)
        names = sorted(entry.name for entry in self.place.iterdir())
        foreign = [name for name in names if not self._replaceable.fullmatch(name)]
        if foreign:
            raise InputError(
                f"contains {foreign[0]!r}, so it is not replaced; choose another {self.option}",
                file=self.target,
            )


@contextlib.contextmanager
def atomic_file(path: Path, *, parents: bool = False) -> Iterator[Path]:
    """Yield a hidden file to write beside ``path``; at the end of the context it replaces ``path``.

    ``parents`` creates the missing folders above it.

    Raises:
        InputError: the file cannot be written, or another process writes it; an existing one stays
            unchanged.

    """
    place = output_file(path)
    with writing(path):
        if parents:
            place.parent.mkdir(parents=True, exist_ok=True)
        with deferred(), TargetLock(place) as lock:
            try:
                yield lock.part
                lock.part.replace(lock.target)
            finally:
                lock.part.unlink(missing_ok=True)


def write_text(
    path: Path, content: str | Iterable[Iterable[str]], *, parents: bool = False
) -> None:
    """Replace the file at ``path`` by a text, or by rows of CSV, atomically (``atomic_file``).

    In pages and tables, invisible characters are escaped (``printable``); not in other files.
    """
    with (
        atomic_file(path, parents=parents) as unfinished,
        unfinished.open("x", encoding="utf-8", newline="") as stream,
    ):
        if isinstance(content, str):
            stream.write(printable(content) if path.suffix in _SHOWN else content)
        else:
            csv.writer(stream, lineterminator="\n").writerows(printable_data(list(content)))


@contextlib.contextmanager
def scratch_folder(purpose: str) -> Iterator[Path]:
    """Yield a private folder in the system's temporary folder; it is removed at the end.

    Raises:
        SimulationError: the folder cannot be written.

    """
    folder = tempfile.gettempdir()
    try:
        with tempfile.TemporaryDirectory(prefix=f"navfw-{purpose}-") as name:
            yield Path(name)
    except OSError as error:
        raise SimulationError(str(_unwritable(Path(folder), error.strerror or error))) from error
