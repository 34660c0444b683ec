"""Interruption of a run from outside: Ctrl-C and SIGTERM, both as KeyboardInterrupt.

The handlers also set a flag, so that a KeyboardInterrupt raised by a plugin can be told from one
that the user has sent.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["interrupted", "interruptible"]

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

_interrupted = False


def interrupted() -> bool:
    """Whether the innermost ``interruptible`` context has been interrupted."""
    return _interrupted


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt inside this context on Ctrl-C or SIGTERM.

    A signal that the process ignores stays ignored, and a thread other than the main one has no
    signals: it cannot be interrupted.
    """
    global _interrupted  # noqa: PLW0603 - signals are those of the process
    before = _interrupted
    _interrupted = False
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {
        number: signal.signal(number, _interrupt)
        for number in _SIGNALS
        if signal.getsignal(number) is not signal.SIG_IGN
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        _interrupted = before


def _interrupt(number: int, frame: FrameType | None) -> None:
    del frame
    global _interrupted  # noqa: PLW0603 - signals are those of the process
    _interrupted = True
    raise KeyboardInterrupt(signal.Signals(number).name)
