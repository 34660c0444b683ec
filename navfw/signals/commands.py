"""Proposals of behaviours, and the fused command."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from navfw.numerics.arrays import Array
from navfw.signals.geometry import Twist
from navfw.signals.immutability import freeze

Explain = Callable[[int, int], Sequence[Mapping[str, Any]]]
"""Returns the rules that fired for the command at (row, column) of the grid, strongest first."""


def _no_rules(row: int, column: int) -> Sequence[Mapping[str, Any]]:
    return ()


@dataclass(frozen=True, slots=True)
class Proposal:
    """The rating of all commands of the grid by one behaviour (METHOD 3.6).

    ``applicability`` in [0, 1]; ``desirability`` and ``prohibition`` are (n_v, n_w) in [0, 1];
    ``reason`` is one line for a person. ``explain`` gives the rules that fired, on request.
    """

    applicability: float
    desirability: Array
    prohibition: Array
    reason: str
    explain: Explain = _no_rules

    def __post_init__(self) -> None:
        freeze(self, "desirability", "prohibition")

    def weighted(self, weight: float) -> Proposal:
        """The same proposal with its applicability scaled by ``weight``."""
        if weight == 1.0:
            return self
        degree = weight * self.applicability
        return Proposal(degree, self.desirability, self.prohibition, self.reason, self.explain)


@dataclass(frozen=True, slots=True)
class Command:
    """The fused command: ``twist``, the leading behaviour, and its reason.

    ``emergency`` makes LOCOM brake fully. ``weights`` gives each behaviour's share.
    """

    time: float
    twist: Twist
    leader: str
    reason: str
    emergency: bool = False
    weights: Mapping[str, float] = field(default_factory=dict)
    explanation: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, "weights", "explanation")
