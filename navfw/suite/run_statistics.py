"""Statistics of an evaluation: confidence intervals, paired tests, scores of single runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

_BARN_SPEED = 2.0
"""The BARN challenge's reference speed [m/s]: OT is the path's length divided by it."""


MIN_RUNS = 5
"""Number of runs, or pairs, below which an interval is no use, and none is given."""


def wilson(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a proportion (Wilson 1927); (0, 1) without runs.

    Unlike the normal approximation it keeps its coverage for proportions near 0 and 1.

    >>> low, high = wilson(200, 200)
    >>> round(low, 4), high
    (0.9812, 1.0)
    """
    from scipy.stats import binomtest

    if runs == 0:
        return 0.0, 1.0
    interval = binomtest(successes, runs).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar_exact(only_a: int, only_b: int) -> float:
    """Two-sided exact p of McNemar's test: pairs in which only A, and only B, succeeded.

    Pairs in which both or neither succeeded do not enter the test.

    >>> mcnemar_exact(0, 5)
    0.0625
    """
    from scipy.stats import binomtest

    pairs = only_a + only_b
    return float(binomtest(min(only_a, only_b), pairs).pvalue) if pairs else 1.0


def mcnemar_pairs(difference: float, discordant: float, power: float = 0.8) -> int:
    """Number of pairs with which McNemar's test at 5 % finds a ``difference`` with ``power``.

    ``discordant`` is the share of pairs in which only one run succeeds, at least the ``difference``
    (Connor 1987). Of two independent runs of success p it is about 2 p (1 - p); those of one seed
    agree more often, so fewer pairs are enough.

    >>> mcnemar_pairs(0.02, 0.1)
    1960
    """
    share, effect = max(discordant, difference), abs(difference)
    sure, likely = NormalDist().inv_cdf(0.975), NormalDist().inv_cdf(power)
    half = sure * math.sqrt(share) + likely * math.sqrt(max(share - effect**2, 0.0))
    return math.ceil((half / effect) ** 2)


def paired_interval(
    only_a: int, only_b: int, pairs: int, confidence: float = 0.95
) -> tuple[float, float]:
    """Interval of the difference of two paired proportions, B minus A (Bonett and Price 2012).

    A success in only one run of a pair counts for ``only_a`` or ``only_b``. Wald's interval with
    one more of each and two more pairs: it keeps its coverage for few pairs.

    >>> low, high = paired_interval(0, 0, 98)
    >>> round(low, 3), round(high, 3)
    (-0.028, 0.028)
    """
    a, b = (only_a + 1) / (pairs + 2), (only_b + 1) / (pairs + 2)
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    half = z * math.sqrt((a + b - (b - a) ** 2) / (pairs + 2))
    return max(-1.0, b - a - half), min(1.0, b - a + half)


def median_interval(
    values: Sequence[float], confidence: float = 0.95
) -> tuple[float, float] | None:
    """Interval of the median by order statistics; None for too few values.

    It assumes no distribution: the number of values below the median is binomial.

    >>> median_interval(range(1, 11))
    (2, 9)
    """
    from scipy.stats import binom

    ordered, count = sorted(values), len(values)
    # the values below the interval, with its lower end, and as many above
    rank = int(binom.ppf(0.5 - 0.5 * confidence, count, 0.5)) if count else 0
    return (ordered[rank - 1], ordered[count - rank]) if rank else None


def sct(succeeded: bool, time: float, shortest: float, max_speed: float) -> float:
    """Success weighted by completion time (Yokoyama, Ha, Batra 2021, arXiv 2103.08022).

    S T / max(C, T) with C the ``time`` [s] taken and T the fastest time. T here is ``shortest``
    [m] at ``max_speed`` [m/s], a bound that no robot reaches, as it has to accelerate, turn and
    stop: the value is below the paper's, which plans T with the robot's dynamics.

    >>> sct(True, time=40.0, shortest=10.0, max_speed=0.5)
    0.5
    """
    fastest = shortest / max_speed
    longest = max(time, fastest)
    return fastest / longest if succeeded and longest > 0.0 else float(succeeded)


def barn_score(succeeded: bool, time: float, path: float) -> float:
    """The BARN challenge's score of a run: success x OT / clip(AT, 2 OT, 8 OT).

    OT is the time for the length [m] of the reference ``path`` at 2 m/s, AT the ``time`` [s] from
    the first 0.1 m to within 1 m of the goal (``run_metrics.traversal_time``). The best score is
    0.5; a robot of 0.5 m/s reaches at most 0.25.

    >>> barn_score(True, time=25.0, path=10.0)
    0.2
    """
    if not succeeded:
        return 0.0
    best = path / _BARN_SPEED
    return best / min(max(time, 2.0 * best), 8.0 * best) if best > 0.0 else 0.5
