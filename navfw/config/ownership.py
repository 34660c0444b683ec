"""Which folders and files belong to this user, so that no other user can have planted them."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path


def owned_by_user(path: Path) -> bool:
    """Whether this user owns ``path``, and what it leads to if it is a link; False if it is gone.

    The administrator counts as one user among others: for root, too, a folder must be root's own.
    """
    user = os.geteuid()
    try:
        return path.lstat().st_uid == user and path.stat().st_uid == user
    except OSError:
        return False


def writable_by_anyone(path: Path) -> bool:
    """Whether every user may write to ``path``, or add files to it; True if it is gone.

    The sticky bit does not count: in ``/tmp``, too, everyone may add files. A group may write: with
    the usual umask of 002 each user has a group of their own.
    """
    try:
        return bool(path.stat().st_mode & stat.S_IWOTH)
    except OSError:
        return True


def own_folders(start: Path) -> Iterator[Path]:
    """``start`` and the folders around it, innermost first, as far as they are this user's alone.

    The first folder that another user owns or that anyone may write to is left out, and with it
    all folders around it. ``start`` is absolute.
    """
    for folder in (start, *start.parents):
        if not owned_by_user(folder) or writable_by_anyone(folder):
            return
        yield folder
