"""Progress of long work on stderr: a bar on a terminal, otherwise a line now and then."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Annotated, Any, Self

import typer

__all__ = ["ProgressBar", "Quiet"]

LINE_PERIOD = 10.0
"""Interval between two lines where stderr is not a terminal [s]."""

REFRESH_PERIOD = 0.1
"""Shortest interval between two pictures of the bar [s]: drawing it takes milliseconds."""

Quiet = Annotated[bool, typer.Option("--quiet", help="Print no progress.")]
"""The option ``--quiet`` of commands with long work."""


class ProgressBar:
    """Shows ``update`` or ``show_part``; nothing before the first one, and nothing with ``quiet``.

    ``work`` says what is done, ``unit`` what ``update`` counts. Rate and time left are means since
    the first update; no time left is given before something is done. There is no thread. Where
    stdout is the same terminal, what is printed there while the bar is shown appears above it.
    """

    def __init__(self, work: str, unit: str = "", *, quiet: bool = False) -> None:
        self._work = work
        self._unit = unit
        self._quiet = quiet
        self._part = ""
        self._began: float | None = None
        self._first = 0
        self._next_line = 0.0
        self._next_picture = 0.0
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
        """Show that ``done`` of ``total`` are done; ``now`` names what is in progress.

        A ``total`` of 0 is unknown.
        """
        if self._quiet:
            return
        clock = time.monotonic()
        if self._began is None:
            self._began, self._first = clock, done
            if self._bar is None and sys.stderr.isatty():
                self._start()
        count = self._count(done, total, clock - self._began)
        if self._bar is not None:
            if clock < self._next_picture and not done == total > 0:
                return
            self._next_picture = clock + REFRESH_PERIOD
            shown = {"count": count, "now": now or self._part}
            self._bar.update(self._task, completed=done, total=total or None, **shown)
            self._bar.refresh()
        elif clock >= self._next_line or done == total > 0:
            self._next_line = clock + LINE_PERIOD
            parts = (part for part in (self._part, count, now) if part)
            typer.echo(f"{self._work}: {': '.join(parts)}", err=True)

    def show_part(self, part: str, done: int = 0, total: int = 0) -> None:
        """``update`` of one part of work whose parts differ: each has its own rate and time left.

        A part with a ``total`` of 0 has nothing to count.
        """
        if part != self._part:
            self._part, self._began, self._next_line, self._next_picture = part, None, 0.0, 0.0
        self.update(done, total)

    def _count(self, done: int, total: int, elapsed: float) -> str:
        """What is done, with rate and time left as far as known."""
        if not total and not done:
            return ""
        unit = "" if self._part else f" {self._unit}"
        text = f"{done} of {total}{unit}" if total else f"{done}{unit}"
        new = done - self._first
        if new <= 0 or elapsed <= 0.0:
            return text
        rate = new / elapsed
        text += f", {rate:.1f}/s" if rate >= 0.1 else f", {60.0 * rate:.2g}/min"
        return f"{text}, {_duration((total - done) / rate)} left" if done < total else text

    def _start(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn
        from rich.table import Column

        now = Column(no_wrap=True, overflow="ellipsis")
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(20),
            TextColumn("{task.fields[count]}", markup=False),
            TextColumn("{task.fields[now]}", markup=False, table_column=now),
            console=Console(stderr=True),
            auto_refresh=False,
            transient=True,
            redirect_stdout=sys.stdout.isatty(),  # a file gets its lines, not the terminal
        )
        self._task = self._bar.add_task(self._work, count="", now="")
        self._bar.start()


def _duration(seconds: float) -> str:
    """A time in its two largest units.

    >>> _duration(42.3), _duration(1000.0), _duration(7300.0)
    ('42 s', '17 min', '2 h 2 min')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"
