"""Progress of long work on stderr: a bar on a terminal, otherwise a line now and then."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any, Self

import typer

__all__ = ["ProgressBar"]

LINE_PERIOD = 5.0
"""Interval between two lines where stderr is not a terminal [s]."""


class ProgressBar:
    """Shows ``update``; nothing before the first one, and nothing with ``quiet``.

    ``work`` says what is done, ``unit`` what is counted. Rate and time left are means since the
    first update; no time left is given before something is done. There is no thread.
    """

    def __init__(self, work: str, unit: str, *, quiet: bool = False) -> None:
        self._work = work
        self._unit = unit
        self._quiet = quiet
        self._began: float | None = None
        self._first = 0
        self._next_line = 0.0
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, done: int, total: int, now: str = "") -> None:
        """Show that ``done`` of ``total`` are done; ``now`` names what is in progress."""
        if self._quiet:
            return
        clock = time.monotonic()
        if self._began is None:
            self._began, self._first = clock, done
            if sys.stderr.isatty():
                self._start()
        pace = self._pace(done, total, clock - self._began)
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, pace=pace, now=now)
            self._bar.refresh()
        elif clock >= self._next_line or done == total:
            self._next_line = clock + LINE_PERIOD
            text = f"{self._work}: {done} of {total} {self._unit}{pace}"
            typer.echo(f"{text}: {now}" if now else text, err=True)

    def _pace(self, done: int, total: int, elapsed: float) -> str:
        """Rate and time left, as far as known."""
        new = done - self._first
        if new <= 0 or elapsed <= 0.0:
            return ""
        left = "" if done == total else f", {(total - done) * elapsed / new:.0f} s left"
        return f", {new / elapsed:.1f}/s{left}"

    def _start(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn
        from rich.table import Column

        now = Column(no_wrap=True, overflow="ellipsis")
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(20),
            TextColumn(
                f"{{task.completed}} of {{task.total}} {self._unit}{{task.fields[pace]}}",
                markup=False,
            ),
            TextColumn("{task.fields[now]}", markup=False, table_column=now),
            console=Console(stderr=True),
            auto_refresh=False,
            transient=True,
        )
        self._task = self._bar.add_task(self._work, pace="", now="")
        self._bar.start()
