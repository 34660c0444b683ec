"""Metrics of localisation: errors, time until localised, time spent confident and wrong.

Computed from the true poses after the run; the stack gets none of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.recording.run_log import RunLog

_CONFIDENT = 0.9
"""Confidence from which a belief counts as confident."""

_CORRECT = 1.0
"""Largest distance [m] of the estimate from the true position for a correct belief."""


@dataclass(frozen=True, slots=True)
class LocalizationMetrics:
    """Numbers of one run.

    Estimate errors [m] are percentiles over the ticks in which the belief was not lost.
    ``localized_after_s`` and ``localized_after_m`` are time and driven distance until the belief
    first was both confident and correct; None if it never was. ``confidently_wrong_s`` is the time
    in which it was confident and not correct, ``lost_s`` the time in which it was lost.
    """

    estimate_error_p50_m: float | None
    estimate_error_p95_m: float | None
    localized_after_s: float | None
    localized_after_m: float | None
    confidently_wrong_s: float
    lost_s: float
    landmark_updates: int


def measure_localization(log: RunLog, sampled: npt.NDArray[np.intp]) -> LocalizationMetrics:
    """The metrics of a run at the ticks ``sampled``."""
    if not log.ticks:
        return LocalizationMetrics(None, None, None, None, 0.0, 0.0, log.updates)
    time, true = log.time[sampled], log.true[sampled]
    error = np.hypot(*(log.estimate[sampled] - true)[:, :2].T)
    confidence = np.ones(len(time)) if log.confidence is None else log.confidence[sampled]
    known, confident = confidence > 0.0, confidence >= _CONFIDENT
    durations = np.diff(time, append=time[-1])
    driven = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))))
    first = np.flatnonzero(confident & (error <= _CORRECT))
    p50, p95 = (
        (float(np.percentile(error[known], p)) if known.any() else None) for p in (50.0, 95.0)
    )
    return LocalizationMetrics(
        estimate_error_p50_m=p50,
        estimate_error_p95_m=p95,
        localized_after_s=float(time[first[0]] - time[0]) if len(first) else None,
        localized_after_m=float(driven[first[0]]) if len(first) else None,
        confidently_wrong_s=float(durations[confident & (error > _CORRECT)].sum()),
        lost_s=float(durations[~known].sum()),
        landmark_updates=log.updates,
    )
