"""Standard output and error that are closed, full, or without a reader: no traceback.

``navfw list worlds > /dev/full`` ends with a message and exit code 1, ``navfw list worlds | head
-0`` with exit code 1, and with a closed standard output everything runs without it.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator

_OUTPUTS = (1, 2)
"""Descriptors of standard output and standard error."""


@contextlib.contextmanager
def standard_streams() -> Iterator[None]:
    """Run the block with usable standard streams; exit with 1 if the output cannot be written."""
    _replace_closed()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # for terminals without Unicode
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
    except OSError as error:
        if error.filename is not None:  # a file, not a stream
            raise
        if not isinstance(error, BrokenPipeError):  # a reader that has seen enough is no failure
            with contextlib.suppress(OSError):
                sys.stderr.write(f"navfw: cannot write the output: {error.strerror}\n")
                sys.stderr.flush()
        _discard()
        sys.exit(1)


def _replace_closed() -> None:
    """Give closed outputs a descriptor, so that no file that is opened later gets theirs."""
    for descriptor, name in zip(_OUTPUTS, ("stdout", "stderr"), strict=True):
        try:
            os.fstat(descriptor)
        except OSError:
            _to_null(descriptor)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.dup(descriptor), "w", encoding="utf-8"))


def _discard() -> None:
    """Let the interpreter's last flush succeed: what is still in the buffers goes nowhere."""
    for descriptor in _OUTPUTS:
        _to_null(descriptor)


def _to_null(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != descriptor:
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
