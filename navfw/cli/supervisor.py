"""Supervision of ``navfw run``: a child process drives, its parent waits and can end it.

The child is forked before anything large is imported. It announces its run, and tells by the
heartbeat which plugin it calls. A child that dies, or hangs where no signal reaches it, is ended by
the parent, which writes the result in its place.
"""

from __future__ import annotations

import atexit
import ctypes
import json
import math
import mmap
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from navfw.process.interruption import ignore_signals, set_handlers
from navfw.process.watchdog import HEARTBEAT_SIZE, HeartbeatMonitor, set_memory

PATIENCE = 10.0
"""Wall time [s] for a run to end by itself after a signal, or beyond its wall-clock limit."""

_SAVING = 600.0
"""Wall time [s] to write the files of a finished drive; a signal does not shorten it."""

_LAST_STEPS = 5.0
"""Wall time [s] for a process to end after its last message: threads of plugins may not end."""

_PERIOD = 0.2
"""Period [s] of looking at the heartbeat."""

_PR_SET_PDEATHSIG = 1
"""``prctl``: the signal to get when the parent dies (Linux)."""

_messages = -1
"""The descriptor to which the child writes its messages; -1 without a supervisor."""


@dataclass(frozen=True, slots=True)
class _Announcement:
    """What the parent needs for a result: the run's ``summary``, its folder, how to print it."""

    summary: dict[str, Any]
    folder: str
    numbered: bool
    as_json: bool
    limit: float


def announce(
    summary: dict[str, Any], folder: Path, *, numbered: bool, as_json: bool, limit: float
) -> None:
    """Tell the supervisor, if there is one, that a run begins.

    ``summary`` are the keys of the result known by now; ``folder``, absolute, is where the result
    goes, with a number if it is taken and ``numbered``; ``limit`` [s] is the wall-clock limit.
    """
    _send({"run": [summary, str(folder), numbered, as_json, limit]})


def announce_end() -> None:
    """Tell the supervisor, if there is one, that the drive is over, and its files are written."""
    _send({"driven": True})


def supervise(command: Callable[[], object]) -> int:
    """Call ``command`` in a child process; its exit code, or 1 if the child was ended."""
    if not hasattr(os, "fork"):  # Windows: only the watchdog inside the process
        command()
        return 0
    memory = mmap.mmap(-1, HEARTBEAT_SIZE)
    receiving, sending = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    parent, child = os.getpid(), os.fork()
    if child == 0:
        os.close(receiving)
        _begin_child(sending, memory, parent)
        _end_child(_exit_code(command))
    os.close(sending)
    return _Supervisor(child, receiving, memory).wait()


# --- in the child --------------------------------------------------------------------------------


def _begin_child(messages: int, memory: mmap.mmap, parent: int) -> None:
    global _messages  # noqa: PLW0603 - a process has one supervisor
    _messages = messages
    set_memory(memory)
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # it has died meanwhile
        os._exit(1)


def _exit_code(command: Callable[[], object]) -> int:
    try:
        command()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        sys.stderr.write(f"{end.code}\n")
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def _end_child(code: int) -> None:
    """End the process, whatever threads plugins have left behind."""
    ignore_signals()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    _send({"finished": code})
    with suppress(BaseException):
        atexit._run_exitfuncs()
    os._exit(code)


def _send(message: dict[str, Any]) -> None:
    if _messages >= 0:
        with suppress(OSError):  # the supervisor has died
            os.write(_messages, json.dumps(message).encode() + b"\n")


# --- in the parent -------------------------------------------------------------------------------


class _Supervisor:
    """Waits for the child; ends it when a call is overdue, after a signal, or at the limit."""

    def __init__(self, child: int, messages: int, memory: mmap.mmap) -> None:
        self._child = child
        self._messages = messages
        self._heartbeat = HeartbeatMonitor(memory)
        self._text = b""
        self._run: _Announcement | None = None
        self._code: int | None = None
        self._deadline = math.inf
        self._stopped = False
        self._driven = False
        self._ended = False

    def wait(self) -> int:
        """The exit code of the child, or of the result written in its place."""
        self._forward_signals()
        status = self._watch()
        self._ended = True
        if self._code is not None:
            return self._code
        if isinstance(status, int):
            how = os.waitstatus_to_exitcode(status)
            what = f"exit code {how}" if how >= 0 else signal.Signals(-how).name
            status = f"the process of the run ended ({what})"
        return self._conclude(status, self._heartbeat.plugin)

    def _watch(self) -> int | str:
        """The status of the ended child, or why it was killed."""
        while True:
            with suppress(InterruptedError):
                select.select([self._messages], [], [], _PERIOD)
            self._receive()
            ended, status = os.waitpid(self._child, os.WNOHANG)
            if ended:
                self._receive()
                return status
            why = self._overdue(time.monotonic())
            if why:
                os.kill(self._child, signal.SIGKILL)
                os.waitpid(self._child, 0)
                return why

    def _overdue(self, now: float) -> str:
        """Why the child is to be killed; "" if it is not."""
        if self._heartbeat.overdue(now):
            return "no result in time, and no signal ended it"
        if now < self._deadline:
            return ""
        if self._code is not None:
            return "finished, but did not end"
        if self._driven:
            return "the files of the run were not written in time"
        if self._stopped:
            return "stopped by the user"
        return "exceeded the wall-clock limit"

    def _receive(self) -> None:
        """Read what the child has written by now, without waiting."""
        while select.select([self._messages], [], [], 0.0)[0]:
            part = os.read(self._messages, 65536)
            if not part:
                time.sleep(0.01)  # the child is ending
                return
            *lines, self._text = (self._text + part).split(b"\n")
            for line in lines:
                self._take(json.loads(line))

    def _take(self, message: dict[str, Any]) -> None:
        now = time.monotonic()
        if "run" in message:
            self._run = _Announcement(*message["run"])
            self._deadline = now + self._run.limit + PATIENCE
        elif "driven" in message:
            self._driven = True
            self._deadline = now + _SAVING
        else:
            self._code = int(message["finished"])
            self._deadline = now + _LAST_STEPS

    def _forward_signals(self) -> None:
        """Forward signals to the child; it takes Ctrl-C from a terminal, sent to both, once.

        A signal that arrives after the child has ended changes nothing.
        """

        def stop(number: int, frame: FrameType | None) -> None:
            del frame
            if self._ended:
                return
            with suppress(ProcessLookupError):  # it ends at this moment
                os.kill(self._child, number)
            if not self._stopped and not self._driven:
                self._stopped = True
                self._deadline = min(self._deadline, time.monotonic() + PATIENCE)

        set_handlers(stop)

    def _conclude(self, why: str, plugin: str) -> int:
        """Print and write the result of a run whose process has ended without one."""
        reason = f"{plugin}: {why}" if plugin else why
        if self._run is None:
            sys.stderr.write(f"navfw: {reason}\n")
            return 1
        from navfw.errors import InputError
        from navfw.recording.run_folder import RESULT, RunFolder

        run = self._run
        outcome = "cancelled" if self._stopped else "fault"
        faults = [reason] if plugin else []
        summary = {**run.summary, "outcome": outcome, "reason": reason, "faults": faults}
        folder = RunFolder(run.folder, numbered=run.numbered)
        try:
            with folder:
                folder.write_json(RESULT, summary)
        except InputError as error:
            sys.stderr.write(f"navfw: {error}\n")
        if run.as_json:
            where = None if folder.final is None else str(folder.final)
            sys.stdout.write(json.dumps({**summary, "run_folder": where}, indent=2) + "\n")
        else:
            sys.stdout.write(f"{outcome}: {reason}\n")
        return 1
