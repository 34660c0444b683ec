"""How well a run knew where it was: errors, when it first knew, how long it was surely wrong.

Everything here is computed from the truth after the run; the stack never sees any of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.recording.run_log import RunLog

__all__ = ["RIGHT", "SURE", "LocalizationMetrics", "measure_localization"]

SURE = 0.9
"""Confidence from which a belief counts as sure."""

RIGHT = 1.0
"""A belief is right when its pose is no farther than this [m] from the truth."""


@dataclass(frozen=True, slots=True)
class LocalizationMetrics:
    """Errors [m] are over the time in which the stack did not say that it was lost.

    ``localized_after_s`` and ``localized_after_m`` are time and way until the belief first was both
    sure and right; None if it never was. ``confidently_wrong_s`` is the time in which it was sure
    and not right, ``lost_s`` that in which it said that it did not know where it was.
    """

    estimate_error_p50_m: float | None
    estimate_error_p95_m: float | None
    localized_after_s: float | None
    localized_after_m: float | None
    confidently_wrong_s: float
    lost_s: float
    landmark_updates: int


def measure_localization(track: RunLog, sampled: npt.NDArray[np.intp]) -> LocalizationMetrics:
    """The numbers of a run, at the ticks ``sampled``."""
    if not track.ticks:
        return LocalizationMetrics(None, None, None, None, 0.0, 0.0, track.updates)
    time, true = track.time[sampled], track.true[sampled]
    error = np.hypot(*(track.estimate[sampled] - true)[:, :2].T)
    confidence = np.ones(len(time)) if track.confidence is None else track.confidence[sampled]
    known, sure = confidence > 0.0, confidence >= SURE
    lasting = np.diff(time, append=time[-1])
    driven = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))))
    first = np.flatnonzero(sure & (error <= RIGHT))
    half, most = (
        (float(np.percentile(error[known], p)) if known.any() else None) for p in (50.0, 95.0)
    )
    return LocalizationMetrics(
        estimate_error_p50_m=half,
        estimate_error_p95_m=most,
        localized_after_s=float(time[first[0]] - time[0]) if len(first) else None,
        localized_after_m=float(driven[first[0]]) if len(first) else None,
        confidently_wrong_s=float(lasting[sure & (error > RIGHT)].sum()),
        lost_s=float(lasting[~known].sum()),
        landmark_updates=track.updates,
    )
