"""Supervision of ``navfw run``: a child process drives, its parent waits for it.

The child is forked before anything large is imported, and does all of the work, including printing.
If it ends without a result, because it crashed, was killed, or hung beyond any signal, the parent
writes and prints one instead: the outcome is a fault, and the reason names the plugin that was
being called.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NoReturn, TextIO

from navfw.cli.output import show_result
from navfw.errors import InputError
from navfw.process.interruption import INTERRUPTED
from navfw.process.last_trace import keep_trace, last_call
from navfw.recording.run_folder import RESULT, RunFolder

PATIENCE = 10
"""Wall time [s] that a run has to end by itself after a signal, or beyond its time limit."""

_PR_SET_PDEATHSIG = 1
"""Option of ``prctl``: the signal to receive when the parent dies."""

_pipe = -1
"""Descriptor of the pipe to the parent, in the child."""


def supervise(command: Callable[[], object]) -> int:
    """Call ``command`` in a child process; return its exit code, or 1 if it has no result."""
    if sys.platform != "linux" or not hasattr(os, "fork"):
        command()
        return 0
    sys.stdout.flush()
    sys.stderr.flush()
    receiving, sending = os.pipe()
    signals = [s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) != signal.SIG_IGN]
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as trace:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        parent, child = os.getpid(), os.fork()
        if child == 0:
            os.close(receiving)
            _drive(command, sending, trace, parent, before)
        os.close(sending)
        return _Supervisor(child, receiving, trace).wait(signals, before)


# --- in the child --------------------------------------------------------------------------------


def announce(**message: Any) -> None:
    """Report to the parent that a ``run`` begins, is ``driven``, has printed and ``ended``."""
    if _pipe >= 0:
        with suppress(OSError):  # the parent has died
            os.write(_pipe, json.dumps(message).encode() + b"\n")


def _drive(
    command: Callable[[], object], pipe: int, trace: TextIO, parent: int, mask: set[Any]
) -> NoReturn:
    global _pipe  # noqa: PLW0603 - a process has one parent
    _pipe = pipe
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # it has died meanwhile
        os._exit(1)
    keep_trace(trace)
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    code = 1
    try:
        command()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except BaseException:
        traceback.print_exc()
    finally:
        announce(ended=code)
        os._exit(code)  # whatever threads plugins have left behind


# --- in the parent -------------------------------------------------------------------------------


class _Supervisor:
    """Waits for the child; ends it some time after a signal."""

    def __init__(self, child: int, pipe: int, trace: TextIO) -> None:
        self._child = child
        self._pipe = pipe
        self._trace = trace
        self._messages: dict[str, Any] = {}
        self._stopped = False

    def wait(self, signals: Sequence[signal.Signals], mask: set[Any]) -> int:
        """Return the exit code of the child, or of the result that is written in its place."""
        for number in signals:
            signal.signal(number, self._forward)
        signal.signal(signal.SIGALRM, self._kill)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        _, status = os.waitpid(self._child, 0)
        for number in (*signals, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)
        self._receive()
        code: int = self._messages.get("ended", os.waitstatus_to_exitcode(status))
        run = self._messages.get("run")
        if code >= 0 and (run is None or "ended" in self._messages):
            return code
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        reason = self._reason(f"the process of the run ended ({how})")
        if run is None:
            sys.stderr.write(f"navfw: {'interrupted' if self._stopped else reason}\n")
            return INTERRUPTED if self._stopped else 1
        return self._conclude(run, reason)

    def _forward(self, number: int, frame: object) -> None:
        """Forward a signal; a terminal sends Ctrl-C to the child as well, which takes it once."""
        del frame
        self._stopped = True
        with suppress(ProcessLookupError):
            os.kill(self._child, number)
        signal.alarm(PATIENCE)

    def _kill(self, number: int, frame: object) -> None:
        """Kill a child that does not end; the files of a finished drive get their time."""
        del number, frame
        self._receive()
        if "driven" not in self._messages:
            os.kill(self._child, signal.SIGKILL)

    def _receive(self) -> None:
        """Read what the child has written by now, a few short lines."""
        os.set_blocking(self._pipe, False)
        with suppress(BlockingIOError):
            for line in os.read(self._pipe, 65536).splitlines():
                self._messages = json.loads(line) | self._messages

    def _reason(self, why: str) -> str:
        """Why there is no result, with the plugin that was being called."""
        self._trace.seek(0)
        text = self._trace.read()
        if "\nTimeout (" in text:
            why = "exceeded the wall-clock limit"
        who = last_call(text)
        return f"{who}: {why}" if who else why

    def _conclude(self, run: Mapping[str, Any], reason: str) -> int:
        """Print and write the result of a run whose process has ended without one; exit code."""
        summary = {
            **run["summary"],
            "outcome": "cancelled" if self._stopped else "fault",
            "reason": "stopped by the user" if self._stopped else reason,
            "faults": [] if self._stopped or ": " not in reason else [reason],
        }
        missing = []
        folder = RunFolder(run["folder"])  # which the dead process has claimed
        try:
            with folder:
                folder.write_json(RESULT, {**folder.adopt_unfinished(), **summary})
        except InputError as error:
            missing.append(str(error))
        where = None if folder.final is None else str(folder.final)
        show_result({**summary, "run_folder": where}, missing, run["as_json"])
        return INTERRUPTED if self._stopped else 1
