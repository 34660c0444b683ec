"""Progress of long work on stderr: a bar on a terminal, otherwise a line at intervals."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from navfw.cli.output import above, console, echo
from navfw.process.interruption import deferred
from navfw.process.printable_text import printable_data

LINE_PERIOD = 10.0
"""Interval between two lines if stderr is not a terminal [s]."""

LINE_WIDTH = 200
"""Largest length of such a line of ``show_line`` [characters]."""

REFRESH_PERIOD = 0.1
"""Shortest interval between two drawings of the bar [s]: each takes milliseconds."""

MOVES_PER_SECOND = 2.0
"""Drawings of a moving bar between updates [1/s]: no second of its clock is left out."""

Quiet = Annotated[bool, typer.Option("--quiet", help="Print no progress.")]
"""The option ``--quiet`` of commands with long work."""


class ProgressBar(contextlib.ExitStack):
    """Shows progress on stderr from the first update on; a context manager.

    ``work`` names the work, ``unit`` what ``update`` counts. Rate and time left are means since the
    first update; no time left is shown before something is done. If stdout is the same terminal,
    what is printed there meanwhile appears above the bar. Without a terminal, a line is printed
    every 10 s. With ``quiet`` nothing is shown.

    A ``moving`` bar also shows the elapsed time between updates, drawn by a thread. It is for work
    of other processes, which the drawing does not disturb.
    """

    def __init__(
        self,
        work: str = "",
        unit: str = "",
        *,
        quiet: bool = False,
        moving: bool = False,
    ) -> None:
        super().__init__()
        self._work = work
        self._unit = unit
        self._quiet = quiet
        self._moving = moving
        self._part = ""
        self._count: _Count | None = None
        self._next_line = 0.0
        self._next_picture = 0.0
        self._bar: Any = None
        self._task: Any = None

    def update(self, done: int, total: int, now: str = "") -> None:
        """Show that ``done`` of ``total`` are done (0: unknown); ``now`` is in progress."""
        if self._quiet:
            return
        clock = time.monotonic()
        if self._count is None:
            unit = "" if self._part else f" {self._unit}"
            self._count = _Count(unit, done, clock)
        count = self._count.text(done, total, clock)
        line = f"{self._work}: {': '.join(part for part in (self._part, count, now) if part)}"
        work = f"{self._work}: {self._part}" if self._part else self._work
        shown: dict[str, Any] = {"description": work, "count": count, "now": now}
        shown |= {"completed": done, "total": total or None}
        self._show(clock, line, shown, last=done == total > 0)

    def show_part(self, part: str, done: int = 0, total: int = 0) -> None:
        """Like ``update``, for one part of work whose parts differ in rate and time left.

        A part with a ``total`` of 0 has nothing to count.
        """
        if part != self._part:
            self._part, self._count, self._next_line, self._next_picture = part, None, 0.0, 0.0
        self.update(done, total)

    def show_share(self, share: float, text: str) -> None:
        """Show that a ``share`` (0 to 1) of the work is done, with a ``text``."""
        if not self._quiet:
            shown = {"count": text, "completed": share, "total": 1.0}
            self._show(time.monotonic(), f"{self._work}: {text}", shown, last=share == 1.0)

    def show_line(self, text: str) -> None:
        """Show a line of text instead of a bar; without a terminal it is cut."""
        if not self._quiet:
            self._show(time.monotonic(), text[:LINE_WIDTH], {"now": text}, last=False)

    @property
    def width(self) -> int:
        """Largest length of a line [characters]."""
        if not sys.stderr.isatty():
            return LINE_WIDTH
        return shutil.get_terminal_size().columns

    def _show(self, clock: float, line: str, shown: dict[str, Any], *, last: bool) -> None:
        """Show on a terminal the fields ``shown``, elsewhere the ``line``, unless too soon."""
        # a terminal that cannot move its cursor gets lines, as a file does
        if self._bar is None and sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
            self._start(counting="completed" in shown)
        if self._bar is not None:
            texts = {key: printable_data(value) for key, value in shown.items()}
            self._bar.update(self._task, **texts)
            if clock >= self._next_picture or last:
                self._next_picture = clock + REFRESH_PERIOD
                self._bar.refresh()
        elif clock >= self._next_line or last:
            self._next_line = clock + LINE_PERIOD
            echo(line, err=True)

    def _start(self, *, counting: bool) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Column

        columns = [
            TextColumn("{task.description}", markup=False),
            BarColumn(20),
            *([TimeElapsedColumn()] if self._moving else []),
            TextColumn("{task.fields[count]}", markup=False),
        ]
        now = Column(no_wrap=True, overflow="ellipsis")
        self._bar = Progress(
            *(columns if counting else []),
            TextColumn("{task.fields[now]}", markup=False, table_column=now),
            console=console(stderr=True),
            auto_refresh=self._moving,
            refresh_per_second=MOVES_PER_SECOND,
            transient=True,
            redirect_stdout=False,  # a file gets its lines, and ``echo`` prints above the bar
        )
        self._task = self._bar.add_task(self._work, count="", now="")
        with deferred():  # Ctrl-C between the two would leave the cursor hidden
            self._bar.start()
            self.callback(deferred()(self._bar.stop))
        self.enter_context(above(self._bar.console))


@dataclass(frozen=True)
class _Count:
    """How much was done at the first update, and its time [s]: for rate and time left."""

    unit: str
    first: int
    began: float

    def text(self, done: int, total: int, clock: float) -> str:
        """What is done, with rate and time left at ``clock`` [s] as far as known."""
        if not total and not done:
            return ""
        text = f"{done} of {total}{self.unit}" if total else f"{done}{self.unit}"
        new, spent = done - self.first, clock - self.began
        if new <= 0 or spent <= 0.0:
            return text
        rate = new / spent
        text += f", {rate:.1f}/s" if rate >= 0.1 else f", {60.0 * rate:.2g}/min"
        return f"{text}, {_duration((total - done) / rate)} left" if done < total else text


def _duration(seconds: float) -> str:
    """Return a time in its two largest units.

    >>> _duration(42.3), _duration(1000.0), _duration(7300.0)
    ('42 s', '17 min', '2 h 2 min')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"
