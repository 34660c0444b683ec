"""Wall time by stage, for reports; no decision depends on it."""

from __future__ import annotations

import time


class timed:  # noqa: N801 - reads as a statement: with timed(account, "flow")
    """A context manager that adds the wall time [s] spent inside it to ``account[stage]``.

    A class, because a generator-based context manager takes three times as long, and stages are
    many and short.
    """

    __slots__ = ("_account", "_began", "_stage")

    def __init__(self, account: dict[str, float], stage: str) -> None:
        self._account = account
        self._stage = stage

    def __enter__(self) -> None:
        self._began = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._account[self._stage] += time.perf_counter() - self._began
