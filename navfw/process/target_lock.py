"""Locks on files and folders that are being written, and removal of leftovers of dead processes.

A process that writes ``NAME`` holds a lock (flock) on the file ``.NAME.navfw-lock`` beside it.
Unfinished content is in ``.NAME.navfw-part``, content that is being replaced in
``.NAME.navfw-old``. The system releases the lock when the process ends, however it ends; the next
holder removes these leftovers. Without flock, the lock is that of SQLite on the file.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import sqlite3
import time
from pathlib import Path
from typing import Any, Self

from navfw.errors import InputError

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

PATIENCE = 0.25
"""Time [s] to wait for a lock: ``sweep`` in another process holds locks for a moment."""

_LOCK = ".navfw-lock"


class TargetInUseError(InputError):
    """Another process is writing the same file or folder."""


class TargetLock:
    """The lock on ``target``, an absolute path; a context manager.

    ``file`` is the lock file, ``part`` the file or folder for unfinished content, ``old`` the
    content that is being replaced. ``unfinished`` is the path of content that is kept when its
    process dies: a recording.

    Raises:
        TargetInUseError: another process, or another lock of this one, holds it.
        OSError: the lock file cannot be created.

    """

    def __init__(self, target: Path) -> None:
        self.target = target
        self.file, self.part, self.old = (
            target.with_name(f".{target.name}.navfw-{word}") for word in ("lock", "part", "old")
        )
        self.unfinished = target.with_name(f"{target.name}-unfinished")
        self._handle: int | sqlite3.Connection | None = None

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *exception: object) -> None:
        self.release()

    def acquire(self, patience: float = PATIENCE) -> None:
        """Acquire the lock within ``patience`` [s], and remove what a dead holder left."""
        deadline = time.monotonic() + patience
        while (handle := self._locked()) is None:
            if time.monotonic() >= deadline:
                raise TargetInUseError("another process is writing it", file=self.target)
            time.sleep(0.01)
        self._handle = handle
        if os.path.lexists(self.old) and not os.path.lexists(self.target):
            self.old.rename(self.target)
        for left in (self.part, self.old):
            if left.is_dir() and not left.is_symlink():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)

    def release(self) -> None:
        """Remove the lock file and release the lock."""
        handle, self._handle = self._handle, None
        if isinstance(handle, int):
            with contextlib.suppress(OSError):
                self.file.unlink()
            os.close(handle)
        elif handle is not None:
            handle.close()
            with contextlib.suppress(OSError):  # Windows: another process waits for it
                self.file.unlink()

    def _locked(self) -> int | sqlite3.Connection | None:
        """Return the lock file, locked; None if it is in use, or was just removed."""
        handle = os.open(self.file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
        if fcntl is None:
            os.close(handle)
            return self._locked_database()
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(handle).st_nlink:
                return handle
        os.close(handle)
        return None

    def _locked_database(self) -> sqlite3.Connection | None:
        """Return the lock file as an empty database, locked; None if it is in use."""
        database = sqlite3.connect(self.file, 0.0, isolation_level=None, check_same_thread=False)
        with contextlib.suppress(sqlite3.OperationalError):
            database.execute("PRAGMA journal_mode = OFF")  # no second file beside it
            database.execute("BEGIN EXCLUSIVE")
            return database
        database.close()
        return None


def lock_first_free(target: Path) -> TargetLock:
    """Lock the first of ``NAME``, ``NAME-2``, ... that neither exists nor is locked."""
    names = (target.name if n == 1 else f"{target.name}-{n}" for n in itertools.count(1))
    while True:
        place = target.with_name(next(names))
        lock = TargetLock(place)
        with contextlib.suppress(TargetInUseError):
            if not (os.path.lexists(place) or os.path.lexists(lock.unfinished)):
                lock.acquire()
                if not os.path.lexists(place):
                    return lock
                lock.release()


def sweep(folder: Path) -> None:
    """Remove what dead processes left unfinished in ``folder``; errors are ignored."""
    with contextlib.suppress(OSError):
        for file in list(folder.glob(f".?*{_LOCK}")):
            with contextlib.suppress(OSError, TargetInUseError):
                lock = TargetLock(folder / file.name[1 : -len(_LOCK)])
                lock.acquire(patience=0.0)
                lock.release()
