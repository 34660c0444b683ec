"""The last trace of a process: what it was doing when it crashed, or hung beyond any signal.

The interpreter's ``faulthandler`` writes it to a file from C, when Python cannot run any more.
Another process reads from it which plugin was being called.
"""

from __future__ import annotations

import faulthandler
import json
import math
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

_MAX_LIMIT = 1e8
"""Longest time limit [s] that ``faulthandler`` accepts; three years."""

_FRAME = re.compile(r'File "(.+)", line (\d+) in (.+)')

_file: TextIO | None = None


def keep_trace(file: TextIO) -> None:
    """Let a crash of this process write its trace to ``file``, an open file."""
    global _file  # noqa: PLW0603 - a process has one last trace
    _file = file
    faulthandler.enable(file)


def dump_trace() -> None:
    """Write the present calls of all threads to the file of ``keep_trace``, if there is one."""
    if _file is not None:
        faulthandler.dump_traceback(_file)


def name_plugins(files: Mapping[str, Path]) -> None:
    """Begin the trace file again with the source file of each plugin, by its kind and name."""
    if _file is not None:
        _file.seek(0)
        _file.truncate()
        _file.write(json.dumps({str(file): plugin for plugin, file in files.items()}) + "\n")
        _file.flush()


@contextmanager
def ended_after(limit: float) -> Iterator[None]:
    """Context that ends the process, with a trace, if it lasts longer than ``limit`` [s].

    The timer is a thread in C: it ends even a process that hangs in compiled code.
    """
    if math.isfinite(limit):
        file = sys.stderr if _file is None else _file
        faulthandler.dump_traceback_later(min(limit, _MAX_LIMIT), exit=True, file=file)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def last_call(text: str) -> str:
    r"""Plugin, file and line of the innermost call of a plugin in a trace; "" if there is none.

    >>> last_call('{"/p/hover.py": "behavior hover"}\n  File "/p/hover.py", line 7 in propose\n')
    'behavior hover: hover.py:7, in propose'
    """
    head, _, trace = text.partition("\n")
    if not head.startswith("{"):
        return ""
    plugins = json.loads(head)
    for file, line, function in _FRAME.findall(trace):
        if plugin := plugins.get(file):
            return f"{plugin}: {Path(file).name}:{line}, in {function}"
    return ""
