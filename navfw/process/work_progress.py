"""How long work tells its progress: part by part, each with what is done and how much there is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from typing import Protocol, TypeVar

ItemT = TypeVar("ItemT")


class PartReport(Protocol):
    """Called as work goes on (``navfw.cli.progress_bar.ProgressBar.show_part``)."""

    def __call__(self, part: str, done: int = 0, total: int = 0, /) -> object:
        """``done`` of ``total`` things of this ``part`` are done; 0 of 0: nothing is counted."""


def untold(part: str, done: int = 0, total: int = 0, /) -> None:
    """A ``PartReport`` that shows nothing."""


def told(
    items: Iterable[ItemT], part: str, report: PartReport, total: int | None = None
) -> Iterator[ItemT]:
    """The ``items`` of a part; ``report`` is called before each, and at the end.

    ``total`` is the number of items where they have no length.

    >>> list(told("ab", "letters", lambda *told: print(*told)))
    letters 0 2
    letters 1 2
    letters 2 2
    ['a', 'b']
    """
    count = len(items) if isinstance(items, Sized) else total or 0
    for done, item in enumerate(items):
        report(part, done, count)
        yield item
    report(part, count, count)
