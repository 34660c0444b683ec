"""What a trial is judged by: a weighted mean of scores of its runs, each in [0, 1]."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from navfw.errors import InputError, UnknownNameError
from navfw.suite.run_table import RunRow

CLEAR = 0.5
"""Clearance [m] from which more of it counts no more."""

SCORES: Mapping[str, Callable[[RunRow], float]] = {
    "success": lambda row: float(row.succeeded),
    "spl": lambda row: row.spl or 0.0,
    "sct": lambda row: row.sct or 0.0,
    "clearance": lambda row: min(max(row.clearance_p05_m or 0.0, 0.0) / CLEAR, 1.0),
}
"""The scores of a run; ``clearance`` is its 5th percentile, in units of ``CLEAR``."""


@dataclass(frozen=True)
class Objectives:
    """Weights of the scores, summing to 1."""

    weights: dict[str, float]

    @classmethod
    def parse(cls, texts: Sequence[str]) -> Objectives:
        """From ``NAME`` or ``NAME=WEIGHT``.

        >>> Objectives.parse(["success=3", "spl"]).weights
        {'success': 0.75, 'spl': 0.25}

        Raises:
            InputError: there is no such score, or a weight is no positive number.

        """
        given: dict[str, float] = {}
        for text in texts:
            name, equals, number = text.partition("=")
            if name not in SCORES:
                raise UnknownNameError("objective", name, SCORES, key="--objective")
            try:
                weight = float(number) if equals else 1.0
            except ValueError:
                weight = 0.0
            if not 0.0 < weight < 1e6:
                what = f"expected NAME=WEIGHT with a positive weight, got {text!r}"
                raise InputError(what, key="--objective")
            given[name] = weight
        total = sum(given.values())
        return cls({name: weight / total for name, weight in given.items()})

    def score(self, row: RunRow) -> float:
        """The score of a run, in [0, 1]."""
        return sum(weight * SCORES[name](row) for name, weight in self.weights.items())

    def parts(self, rows: Sequence[RunRow]) -> dict[str, float]:
        """The mean of each score over runs."""
        return {name: sum(SCORES[name](row) for row in rows) / len(rows) for name in self.weights}
