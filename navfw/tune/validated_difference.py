"""Whether the tuned stack is better on runs that the tuning has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import Any

import numpy as np

from navfw.suite.run_table import RunRow
from navfw.tune.objectives import Objectives

_RESAMPLES = 9999
"""Number of bootstrap samples."""


def validated_difference(
    before: Sequence[RunRow], after: Sequence[RunRow], objectives: Objectives
) -> dict[str, Any]:
    """The mean difference of the score, tuned minus untuned, over the same runs in the same order.

    ``interval`` is its 95 % bootstrap interval over runs (percentiles). ``better`` is whether all
    of it is above 0.
    """
    from scipy.stats import bootstrap

    scores = [[objectives.score(row) for row in rows] for rows in (before, after)]
    differences = np.subtract(scores[1], scores[0])
    low = high = float(differences.mean())
    if np.ptp(differences) > 0.0:
        found = bootstrap(
            (differences,),
            np.mean,
            n_resamples=_RESAMPLES,
            method="percentile",
            rng=np.random.default_rng(0),
        ).confidence_interval
        low, high = float(found.low), float(found.high)
    return {
        "runs": len(differences),
        "score_before": fmean(scores[0]),
        "score_after": fmean(scores[1]),
        "difference": float(differences.mean()),
        "interval": [low, high],
        "better": low > 0.0,
        "before": objectives.parts(before),
        "after": objectives.parts(after),
    }
