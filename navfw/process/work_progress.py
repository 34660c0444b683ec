"""Progress of long work: the present step, and how many of its items are done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from typing import Protocol, TypeVar

ItemT = TypeVar("ItemT")


class ProgressCallback(Protocol):
    """Called as work goes on (``navfw.cli.progress_bar.ProgressBar.show_part``)."""

    def __call__(self, step: str, done: int = 0, total: int = 0, /) -> object:
        """Report that ``done`` of ``total`` items of this ``step`` are done; 0 of 0: unknown."""


def silent(step: str, done: int = 0, total: int = 0, /) -> None:
    """A ``ProgressCallback`` that shows nothing."""


def with_progress(
    items: Iterable[ItemT], step: str, report: ProgressCallback, total: int | None = None
) -> Iterator[ItemT]:
    """Yield ``items``; call ``report`` with ``step`` before each, and at the end.

    ``total`` is the number of items if they have no length.

    >>> list(with_progress("ab", "letters", lambda *progress: print(*progress)))
    letters 0 2
    letters 1 2
    letters 2 2
    ['a', 'b']
    """
    count = len(items) if isinstance(items, Sized) else total or 0
    for done, item in enumerate(items):
        report(step, done, count)
        yield item
    report(step, count, count)
