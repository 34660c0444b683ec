"""Commands on a pseudo-terminal: what its screen shows, keys that are pressed, windows resized."""

import fcntl
import os
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import pytest

pyte = pytest.importorskip("pyte", reason="pyte is not installed")

ROWS = 4000
"""Rows of a terminal: all that a command prints stays on its screen."""

WAIT = 300.0
"""Longest time [s] to wait for a text or an end: machines of CI are slow."""

_START = (
    "import fcntl, os, sys, termios;"
    "fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execvp(sys.argv[1], sys.argv[1:])"
)
"""Makes standard input the controlling terminal, which sends the signals of its keys."""

ESCAPES = ("\\x1b", "^[", "[2K", "[?25", "[0m", "\x1b")
"""What a screen shows of sequences that it should have obeyed."""


class Terminal:
    """A command that runs on a pseudo-terminal of so many ``columns``; a context manager.

    Two screens take in what it prints: one of these columns, and one on which no line is too long.
    """

    def __init__(
        self,
        words: Sequence[object],
        *,
        columns: int = 80,
        cwd: Path | None = None,
        env: dict[str, str | None] | None = None,
    ) -> None:
        own, its = os.openpty()
        self._own = own
        self.columns = columns
        self._screens = [pyte.Screen(width, ROWS) for width in (columns, 5000)]
        self._streams = [pyte.ByteStream(screen) for screen in self._screens]
        fcntl.ioctl(own, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, columns, 0, 0))
        self._modes = termios.tcgetattr(its)
        environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": None, **(env or {})}
        self._process = subprocess.Popen(  # noqa: S603 - the tests' own words
            [sys.executable, "-S", "-c", _START, *map(str, words)],
            stdin=its,
            stdout=its,
            stderr=its,
            cwd=cwd,
            env={name: value for name, value in environment.items() if value is not None},
            start_new_session=True,
        )
        self._its = its
        self.printed = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._process.poll() is None:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, 9)
            self._process.wait()
        os.close(self._own)
        os.close(self._its)

    def press(self, keys: str) -> None:
        """Press keys; ``\\x03`` is Ctrl-C."""
        os.write(self._own, keys.encode())

    def wait_for(self, text: str) -> None:
        """Wait until the screen shows the text."""
        deadline = time.monotonic() + WAIT
        while text not in self.text():
            assert self._process.poll() is None, f"ended without {text!r}:\n{self.text()}"
            assert time.monotonic() < deadline, f"no {text!r}:\n{self.text()}"
            self.read(0.05)

    def ended(self) -> int:
        """Wait for the end; the exit code."""
        deadline = time.monotonic() + WAIT
        while self._process.poll() is None:
            assert time.monotonic() < deadline, self.text()
            self.read(0.02)
        while self.read(0.0):
            pass
        return self._process.returncode

    def read(self, patience: float = 0.05) -> bool:
        """Take in what is printed within so many seconds; whether there was something."""
        if not select.select([self._own], [], [], patience)[0]:
            return False
        data = os.read(self._own, 65536)
        self.printed += data
        for stream in self._streams:
            stream.feed(data)
        return bool(data)

    def lines(self) -> list[str]:
        """The lines of the screen down to the last one that is not empty."""
        return _text(self._screens[0])

    def text(self) -> str:
        """The text of the screen."""
        return "\n".join(self.lines())

    def faults(self) -> list[str]:
        """What is wrong with the screen: escapes as text, lines too long or garbled, no cursor.

        A line may be too long because of one word, such as a path.
        """
        text, lines = self.text(), _text(self._screens[1])
        found = [f"escape {escape!r} as text" for escape in ESCAPES if escape in text]
        found += [
            f"too long: {line}"
            for line in lines
            if len(line) > self.columns and len(line.split()) > 1
        ]
        width = self.columns
        rows = [line[at : at + width] for line in lines for at in range(0, len(line) or 1, width)]
        if [row.rstrip() for row in rows] != self.lines():
            found.append("garbled")
        if self._screens[0].cursor.hidden:
            found.append("the cursor is hidden")
        if termios.tcgetattr(self._its) != self._modes:
            found.append("the modes of the terminal are changed")
        return found


def _text(screen: Any) -> list[str]:
    last, rows = max(screen.buffer, default=-1), screen.buffer
    texts = [
        "".join(rows[y][x].data for x in range(max(rows[y], default=-1) + 1))
        for y in range(last + 1)
    ]
    lines = [text.rstrip() for text in texts]
    while lines and not lines[-1]:
        lines.pop()
    return lines
