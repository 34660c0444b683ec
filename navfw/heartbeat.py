"""The plugin call in progress, in memory that a supervising process reads.

The supervisor ends a process whose call is overdue: a call of compiled code, or a plugin that
switches off the interval timer, cannot be ended from inside.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any

__all__ = [
    "GRACE",
    "HEARTBEAT_SIZE",
    "CallInProgress",
    "begin_call",
    "end_call",
    "postpone",
    "read_call",
    "set_memory",
]

GRACE = 5.0
"""Wall time [s] beyond a call's deadline after which the supervisor ends the process: the interval
timer ends a call of Python code within a fraction of it."""

_LAYOUT = struct.Struct("<d120s")
HEARTBEAT_SIZE = _LAYOUT.size
"""Size of the shared memory [byte]."""

_memory: Any = None


@dataclass(frozen=True, slots=True)
class CallInProgress:
    """The plugin ``call`` in progress, and its ``deadline`` [s] by ``time.monotonic``.

    Between two calls the deadline is infinite and ``call`` the last one.
    """

    call: str
    deadline: float

    @property
    def plugin(self) -> str:
        """Kind and name of the plugin that is being called; "" between two calls."""
        return self.call if self.deadline < math.inf else ""

    def overdue(self, now: float) -> bool:
        """Whether the process is to be ended at ``now`` [s, monotonic]."""
        return now > self.deadline + GRACE


def set_memory(memory: Any) -> None:
    """Write the calls of this process to ``memory``, a shared writable buffer; None: nowhere."""
    global _memory  # noqa: PLW0603 - one supervisor watches one process
    _memory = memory
    end_call()


def begin_call(call: str, deadline: float) -> None:
    """Tell the supervisor that ``call`` is in progress until ``deadline`` [s, monotonic]."""
    if _memory is not None:
        _LAYOUT.pack_into(_memory, 0, deadline, call.encode()[:120])


def postpone(seconds: float) -> None:
    """Move the deadline of the call in progress by ``seconds``; between two calls, nothing."""
    if _memory is not None:
        deadline = struct.unpack_from("<d", _memory, 0)[0]
        struct.pack_into("<d", _memory, 0, deadline + seconds)


def end_call() -> None:
    """Tell the supervisor that no call is in progress; the last one stays readable."""
    if _memory is not None:
        struct.pack_into("<d", _memory, 0, math.inf)


def read_call(memory: Any) -> CallInProgress:
    """The call in ``memory``; the last one, without a deadline, when none is in progress."""
    deadline, call = _LAYOUT.unpack_from(memory, 0)
    return CallInProgress(call.rstrip(b"\0").decode(errors="replace"), deadline)
