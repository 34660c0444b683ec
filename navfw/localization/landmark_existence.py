"""Existence probability of each landmark: that it stands where the map has it.

Each observation adds bounded log-odds. Misses weigh more than hits, so that a displaced landmark is
dropped soon; the total is bounded, so that no history outweighs a few new observations.
"""

from __future__ import annotations

import math
from collections.abc import Callable

_MAX_GAIN, _MAX_LOSS = 1.0, -1.5
"""Bounds on the log-odds that one observation adds."""

_MIN_LOG_ODDS, _MAX_LOG_ODDS = -5.0, 4.0
"""Bounds on the log-odds of a landmark: probabilities 0.007 and 0.98."""

_TINY = 1e-30


class LandmarkExistence:
    """Log-odds of each landmark by identity; all start at the ``prior`` probability, in (0, 1)."""

    def __init__(self, prior: float) -> None:
        self._prior = math.log(prior / (1.0 - prior))
        self._odds: dict[str, float] = {}

    def probability(self, identity: str) -> float:
        """The probability that the landmark stands where the map has it."""
        return 1.0 / (1.0 + math.exp(-self._odds.get(identity, self._prior)))

    def update(self, identity: str, likelihood_ratio: float, weight: float = 1.0) -> None:
        """Add an observation to the log-odds.

        ``likelihood_ratio`` is that of the observation with the landmark in its place, over that
        with it elsewhere; ``weight`` in (0, 1] scales its logarithm.
        """
        evidence = min(max(math.log(max(likelihood_ratio, _TINY)), _MAX_LOSS), _MAX_GAIN)
        odds = self._odds.get(identity, self._prior) + weight * evidence
        self._odds[identity] = min(max(odds, _MIN_LOG_ODDS), _MAX_LOG_ODDS)

    def reset(self, fits: Callable[[str], bool]) -> None:
        """Set landmarks below the prior back to it where ``fits``: the pose was wrong, not they."""
        for identity in [name for name, odds in self._odds.items() if odds < self._prior]:
            if fits(identity):
                del self._odds[identity]

    @property
    def likely_displaced(self) -> tuple[str, ...]:
        """Identities of the landmarks with an existence probability below 0.5."""
        return tuple(name for name, odds in self._odds.items() if odds < 0.0)
