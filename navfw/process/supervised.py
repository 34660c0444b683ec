"""What a supervised process tells its supervisor: text, the run, true positions, the result.

The messages are JSON objects, a line each, in a pipe. A plugin may replace functions of the
standard library; what is used here is therefore bound when this module is imported. A process that
a plugin forks off writes nothing: its messages would be taken for those of the run.
"""

from __future__ import annotations

import io
import mmap
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from json import JSONEncoder
from os import _exit, getpid, write
from typing import Any

from navfw.process.watchdog import set_memory

_encode = JSONEncoder().encode


_pipe = -1
"""Descriptor of the pipe's end of this process; -1 without a supervisor."""


def begin(descriptor: int, memory: mmap.mmap) -> None:
    """Send messages to ``descriptor``; ``memory`` is that of the heartbeat."""
    _connect(descriptor, memory)
    os.register_at_fork(after_in_child=lambda: _connect(-1, None))  # a copy has no supervisor


def _connect(descriptor: int, memory: mmap.mmap | None) -> None:
    global _pipe  # noqa: PLW0603 - one supervisor watches one process
    _pipe = descriptor
    set_memory(memory)


def supervised() -> bool:
    """Whether this process has a supervisor."""
    return _pipe >= 0


def this_process() -> int:
    """The number of this process."""
    return getpid()


def end_copy(process: int) -> None:
    """End this process if it is a copy of ``process`` that a plugin has forked off."""
    if getpid() != process:
        _exit(1)


def send(message: Mapping[str, Any]) -> None:
    """Send ``message``; nothing happens without a supervisor, or if it has died."""
    _send(_encode(message))


def send_position(time: float, x: float, y: float, touched: int) -> None:
    """Tell the true position [m] at ``time`` [s], and the number of bodies in contact."""
    if _pipe >= 0:
        _send(f'{{"at": [{time!r}, {x!r}, {y!r}, {touched}]}}')


def _send(text: str) -> None:
    rest = text.encode() + b"\n" if _pipe >= 0 else b""
    with suppress(OSError):  # the supervisor has died
        while rest:
            rest = rest[write(_pipe, rest) :]


class TextToSupervisor(io.TextIOBase):
    """Standard output of a supervised process: the supervisor prints what is written here."""

    encoding = "utf-8"

    def writable(self) -> bool:
        """Always."""
        return True

    def write(self, text: str) -> int:
        """Send ``text``; its length."""
        send({"out": text})
        return len(text)


@dataclass(frozen=True, slots=True)
class SupervisedRun:
    """What the supervisor needs to judge a run, and to write its result if the process dies.

    ``summary`` are the keys of the result known at the start. ``folder``, absolute, is where the
    result goes; ``limit`` [s] is the wall-clock
    limit. ``goals`` (x, y [m], place) are to be visited in order, within ``radius`` [m].
    ``plugins`` names those that are not navfw's own.
    """

    summary: dict[str, Any]
    folder: str
    as_json: bool
    limit: float
    goals: Sequence[tuple[float, float, str]]
    radius: float
    plugins: str

    def announce(self) -> None:
        """Tell the supervisor, if there is one, that the run begins."""
        send({"run": {name: getattr(self, name) for name in self.__slots__}})


def send_result(summary: Mapping[str, Any], missing: Sequence[str]) -> None:
    """Hand over the result, and what is missing in its folder."""
    send({"result": [summary, list(missing)]})
