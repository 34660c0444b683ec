"""Locks on files and folders that are being written, and removal of what dead processes left.

A process that writes ``NAME`` holds a lock (flock) on the file ``.NAME.navfw-lock`` beside it. The
unfinished content is in ``.NAME.navfw-part``, content that is being replaced in
``.NAME.navfw-old``. The system releases the lock when the process ends, however it ends: a lock
file without a lock proves that the process is dead, and that what lies beside is left over.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
import re
import shutil
import time
from pathlib import Path
from typing import Self

from navfw.errors import InputError

PATIENCE = 0.25
"""Time [s] to wait for a lock: ``sweep`` of another process holds locks for a moment."""

_LOCK_FILE = re.compile(r"\.(.+)\.navfw-lock", re.DOTALL)


class TargetInUseError(InputError):
    """Another process writes the same file or folder."""


class TargetLock:
    """The lock on ``target``, an absolute path; a context manager.

    ``file`` is the lock file, ``part`` the file or folder for unfinished content, ``old`` the
    content that is being replaced. ``unfinished`` is where content is that stays when its process
    dies: a recording.

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
        self._handle: int | None = None

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *exception: object) -> None:
        self.release()

    def acquire(self, patience: float = PATIENCE) -> None:
        """Take the lock within ``patience`` [s], and remove what a dead holder of it left."""
        deadline = time.monotonic() + patience
        while True:
            handle, left = self._opened()
            try:
                if _locked(handle) and self._is_current(handle):
                    if left:
                        self._clear()
                    self._handle, handle = handle, -1
                    return
            finally:
                if handle >= 0:
                    os.close(handle)
            if time.monotonic() >= deadline:
                raise TargetInUseError("another process is writing it", file=self.target)
            time.sleep(0.01)

    def release(self) -> None:
        """Remove the lock file and release the lock."""
        if self._handle is not None:
            with contextlib.suppress(OSError):
                self.file.unlink()
            os.close(self._handle)
            self._handle = None

    def _opened(self) -> tuple[int, bool]:
        """A handle of the lock file, and whether the file was there before."""
        flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            return os.open(self.file, flags | os.O_CREAT | os.O_EXCL, 0o600), False
        except FileExistsError:
            return os.open(self.file, flags | os.O_CREAT, 0o600), True

    def _is_current(self, handle: int) -> bool:
        """Whether the handle is that of the file at the path: the last holder removes the file."""
        try:
            return os.path.samestat(os.fstat(handle), self.file.lstat())
        except FileNotFoundError:
            return False

    def _clear(self) -> None:
        """Remove unfinished content; restore the old one if it was about to be replaced."""
        if os.path.lexists(self.old) and not os.path.lexists(self.target):
            self.old.rename(self.target)
        for left in (self.part, self.old):
            if left.is_dir() and not left.is_symlink():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)


def _locked(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def lock_first_free(target: Path) -> TargetLock:
    """The lock on the first of ``NAME``, ``NAME-2``, ... that neither exists nor is locked."""
    for number in itertools.count(1):
        place = target if number == 1 else target.with_name(f"{target.name}-{number}")
        lock = TargetLock(place)
        if os.path.lexists(place) or os.path.lexists(lock.unfinished):
            continue
        try:
            lock.acquire()
        except TargetInUseError:
            continue
        if not os.path.lexists(place):
            return lock
        lock.release()
    raise AssertionError("numbers have no end")


def sweep(folder: Path) -> None:
    """Remove what dead processes of this user left unfinished in ``folder``; best effort."""
    with contextlib.suppress(OSError):
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if _is_ours(entry)]
        for name in names:
            with contextlib.suppress(OSError, TargetInUseError):
                lock = TargetLock(folder / _LOCK_FILE.sub(r"\1", name))
                lock.acquire(patience=0.0)
                lock.release()


def _is_ours(entry: os.DirEntry[str]) -> bool:
    """Whether it is a lock file of this user."""
    if not _LOCK_FILE.fullmatch(entry.name) or not entry.is_file(follow_symlinks=False):
        return False
    return entry.stat(follow_symlinks=False).st_uid == os.getuid()
