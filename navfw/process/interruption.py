"""Interruption from outside: Ctrl-C and SIGTERM, raised as KeyboardInterrupt or deferred.

A flag records that a signal has arrived: it distinguishes a KeyboardInterrupt raised by a plugin
from one that the user has sent. A signal that the process ignores is still ignored. Only the main
thread gets signals: others cannot be interrupted.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

INTERRUPTED = 130
"""Exit code of a command ended by Ctrl-C or SIGTERM: the one that shells use for SIGINT."""

_REPEAT = 1.0
"""Wall time [s] after a signal within which another one counts as the same: a terminal sends Ctrl-C
to the waiting and to the driving process of a run, and the former forwards it."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

_Handler = Callable[[int, FrameType | None], None] | signal.Handlers


@dataclass
class _SignalState:
    """What a signal does now, and what the last one did; signals are those of the process.

    ``handled``: the handlers are installed. ``raising``: a signal raises KeyboardInterrupt, else it
    is kept in ``pending``, by name. ``raised`` is when it last raised [s, monotonic].
    """

    handled: bool = False
    raising: bool = False
    interrupted: bool = True
    pending: str = ""
    raised: float = -math.inf


_state = _SignalState()


def check_interrupted(error: BaseException | None = None) -> None:
    """Raise KeyboardInterrupt if a signal has arrived in the innermost ``interruptible`` context.

    Python drops what a handler raises in a finalizer or in a callback of compiled code, so a loop
    that signals are to end calls this. After an ``error`` of a plugin it is called as well, because
    compiled code may raise another error than the interruption. A KeyboardInterrupt outside of any
    context counts as sent by the user.
    """
    if _state.interrupted and (_state.raising or isinstance(error, KeyboardInterrupt)):
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """Context in which Ctrl-C or SIGTERM raise KeyboardInterrupt.

    A signal that was deferred before is raised when the context begins.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _handlers():
        raising, interrupted = _state.raising, _state.interrupted
        try:
            _state.interrupted = False
            _state.raising = True
            _raise_pending()
            yield
        finally:
            _state.raising, _state.interrupted = raising, interrupted


@contextmanager
def deferred() -> Iterator[None]:
    """Context in which Ctrl-C and SIGTERM wait: for ``interruptible``, or for its end.

    At its end a waiting signal is raised as KeyboardInterrupt, unless another exception is being
    raised, or the context is inside another ``deferred``.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _handlers() as outermost:
        raising = _state.raising
        try:
            _state.raising = False
            yield
        finally:
            _state.raising = raising
        if raising or outermost:
            _raise_pending()


def set_handlers(handler: _Handler) -> dict[signal.Signals, Any]:
    """Set ``handler`` for each signal that the process does not ignore; return the old handlers."""
    return {
        number: signal.signal(number, handler)
        for number in _SIGNALS
        if signal.getsignal(number) is not signal.SIG_IGN
    }


@contextmanager
def interrupt_blocked() -> Iterator[None]:
    """Context in which started processes do not get Ctrl-C before ``unblock_interrupt``."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows: it may get it until it ignores it
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock_interrupt() -> None:
    """Let Ctrl-C through in a process that was started with ``interrupt_blocked``."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def ignore_signals() -> None:
    """Ignore both signals from now on: the command has ended, and its exit code is to stay."""
    set_handlers(signal.SIG_IGN)


@contextmanager
def _handlers() -> Iterator[bool]:
    """The handlers of both signals; yields whether they were not installed before."""
    if _state.handled:
        yield False
        return
    handlers, hook = set_handlers(_interrupt), sys.unraisablehook

    def keep(dropped: Any) -> None:
        """What Python drops of a signal waits for the next place that can be interrupted."""
        if dropped.exc_type is KeyboardInterrupt:
            _state.pending = str(dropped.exc_value)
        else:
            hook(dropped)

    _state.handled, _state.pending, sys.unraisablehook = True, "", keep
    try:
        yield True
    finally:
        _state.handled, _state.raised, sys.unraisablehook = False, -math.inf, hook
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _raise_pending() -> None:
    name, _state.pending = _state.pending, ""
    if name:
        _state.interrupted, _state.raised = True, time.monotonic()
        raise KeyboardInterrupt(name)


def _interrupt(number: int, frame: FrameType | None) -> None:
    del frame
    if time.monotonic() < _state.raised + _REPEAT:
        return
    name = signal.Signals(number).name
    if not _state.raising:
        _state.pending = name
        return
    _state.interrupted, _state.raised = True, time.monotonic()
    raise KeyboardInterrupt(name)
