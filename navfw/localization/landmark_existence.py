"""How far each landmark is trusted to stand where the map says.

Every look at a landmark is evidence for or against. What speaks against it counts more, and what
speaks for it has a limit, so that a landmark which somebody has moved is doubted soon.
"""

from __future__ import annotations

import math
from collections.abc import Callable

__all__ = ["LandmarkExistence"]

FOR, AGAINST = 1.0, -1.5
"""The most that one look adds to the log-odds of a landmark, and the most that it takes away."""

LEAST, MOST = -5.0, 4.0
"""Log-odds that no number of looks exceeds."""

_TINY = 1e-30


class LandmarkExistence:
    """Log-odds of each landmark by identity; all begin with the same ``prior`` probability."""

    def __init__(self, prior: float) -> None:
        self._prior = math.log(prior / (1.0 - prior))
        self._odds: dict[str, float] = {}

    def of(self, identity: str) -> float:
        """The probability that the landmark stands where the map says."""
        return 1.0 / (1.0 + math.exp(-self._odds.get(identity, self._prior)))

    def hear(self, identity: str, likelihood: float, weight: float = 1.0) -> None:
        """Take note of a look: how much likelier it is with the landmark in its place."""
        evidence = min(max(math.log(max(likelihood, _TINY)), AGAINST), FOR)
        odds = self._odds.get(identity, self._prior) + weight * evidence
        self._odds[identity] = min(max(odds, LEAST), MOST)

    def pardon(self, fits: Callable[[str], bool]) -> None:
        """Forget what speaks against landmarks that fit after all: the robot was elsewhere."""
        for identity in [name for name, odds in self._odds.items() if odds < self._prior]:
            if fits(identity):
                del self._odds[identity]

    @property
    def doubted(self) -> tuple[str, ...]:
        """The landmarks that are more likely elsewhere, by identity."""
        return tuple(name for name, odds in self._odds.items() if odds < 0.0)
