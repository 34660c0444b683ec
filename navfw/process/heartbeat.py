"""The plugin call in progress, in memory that a supervising process reads.

The supervisor ends a process whose call is overdue: a call of compiled code, or a plugin that
switches off the interval timer, cannot be ended from inside.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

GRACE = 5.0
"""Wall time [s] beyond a call's deadline after which the supervisor ends the process: the interval
timer ends a call of Python code within a fraction of it."""

MAX_GAP = 1.0
"""Longest wall time [s] between two looks that counts: in a longer one the process, or the whole
machine, was stopped (Ctrl-Z, suspended), and so were the plugins."""


class _Heartbeat(ctypes.Structure):
    """The shared memory.

    ``deadline`` [s, monotonic] is infinite between two calls. It is written in one piece, so that
    no half of it is read. ``call`` is the one in progress, or the last.
    """

    _fields_ = (("deadline", ctypes.c_double), ("call", ctypes.c_char * 120))
    deadline: float
    call: bytes


HEARTBEAT_SIZE = ctypes.sizeof(_Heartbeat)
"""Size of the shared memory [byte]."""

_own: _Heartbeat | None = None


def set_memory(memory: Any) -> None:
    """Write the calls of this process to ``memory``, a shared writable buffer; None: nowhere."""
    global _own  # noqa: PLW0603 - one supervisor watches one process
    _own = None if memory is None else _Heartbeat.from_buffer(memory)
    end_call()


def begin_call(call: str, deadline: float) -> None:
    """Tell the supervisor that ``call`` is in progress until ``deadline`` [s, monotonic]."""
    if _own is not None:
        _own.call = call.encode()[:120]
        _own.deadline = deadline


def postpone(seconds: float) -> None:
    """Move the deadline of the call in progress by ``seconds``; between two calls, nothing."""
    if _own is not None:
        _own.deadline += seconds


def end_call() -> None:
    """Tell the supervisor that no call is in progress; the last one stays readable."""
    if _own is not None:
        _own.deadline = math.inf


class HeartbeatMonitor:
    """The supervisor's side: whether the process that writes to ``memory`` is to be ended."""

    def __init__(self, memory: Any) -> None:
        self._read = _Heartbeat.from_buffer(memory)
        self._looked = math.inf
        self._overdue = 0.0

    @property
    def last_call(self) -> str:
        """The call in progress, or the last one."""
        return self._read.call.decode(errors="replace")

    @property
    def plugin(self) -> str:
        """Kind and name of the plugin that is being called; "" between two calls."""
        return self.last_call if self._read.deadline < math.inf else ""

    def overdue(self, now: float) -> bool:
        """Whether the process is to be ended at ``now`` [s, monotonic]; to be asked every 0.2 s.

        The call must have been beyond its deadline for GRACE seconds of the supervisor's own looks:
        after a pause of both processes the deadline lies in the past without any call being late.
        """
        if now <= self._read.deadline:
            self._overdue = 0.0
        else:
            self._overdue += min(max(now - self._looked, 0.0), MAX_GAP)
        self._looked = now
        return self._overdue > GRACE
