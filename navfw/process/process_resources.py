"""Resources of this process: cores, the largest memory it has had, what goes to stderr."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import sys
from collections.abc import Iterator
from pathlib import Path

_STATUS = Path("/proc/self/status")


def usable_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def peak_memory_mb() -> float:
    """The largest resident memory [MB] of this process since its start.

    On Linux by ``VmHWM``: ``ru_maxrss`` of a process counts what its parent had when it started it.
    """
    try:
        text = _STATUS.read_text(encoding="utf-8")
    except OSError:  # another system
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / (1e6 if sys.platform == "darwin" else 1e3)
    line = next(line for line in text.splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024 / 1e6


@contextlib.contextmanager
def stderr_to(descriptor: int) -> Iterator[None]:
    """Send to ``descriptor`` what native libraries write to stderr inside the block."""
    sys.stderr.flush()
    saved = os.dup(2)
    os.dup2(descriptor, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


def return_freed_memory() -> None:
    """Give memory that has been freed back to the system, where the C library can (glibc).

    The library keeps it otherwise, in pieces that the next run does not fit into.
    """
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).malloc_trim(0)
