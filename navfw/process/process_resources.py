"""Resources of this process: cores, peak memory, where its output goes."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path


def usable_cores() -> int:
    """Number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return (os.cpu_count() or 1) if affinity is None else len(affinity(0))


def processor_wait() -> float:
    """Time [s] that the main thread has waited for a processor since its start; Linux only, else 0.

    It could have run, but others had all processors, or its container had spent its share.
    """
    try:
        waited = Path("/proc/self/schedstat").read_text(encoding="ascii").split()[1]
    except OSError:  # another system, or a kernel that does not count it
        return 0.0
    return int(waited) / 1e9


def peak_memory_mb() -> float:
    """Return the largest resident memory [MB] that this process has had since its start.

    On Linux it is read from ``VmHWM``, as ``ru_maxrss`` includes what the parent had when it
    started the process. NaN if the system does not say, as on Windows.
    """
    try:
        text = Path("/proc/self/status").read_text(encoding="utf-8")
    except OSError:  # another system
        try:
            import resource
        except ImportError:
            return math.nan
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / (1e6 if sys.platform == "darwin" else 1e3)
    line = next(line for line in text.splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024 / 1e6


@contextlib.contextmanager
def redirected(target: int, *descriptors: int) -> Iterator[None]:
    """Context that sends to ``target`` what Python and libraries write to ``descriptors``."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [os.dup(descriptor) for descriptor in descriptors]
    try:
        for descriptor in descriptors:
            os.dup2(target, descriptor)
        yield
    finally:
        for descriptor, before in zip(descriptors, saved, strict=True):
            os.dup2(before, descriptor)
            os.close(before)


def return_freed_memory() -> None:
    """Return freed memory to the system, if the C library can (glibc).

    Otherwise the library keeps it in pieces that the next run does not fit into.
    """
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
