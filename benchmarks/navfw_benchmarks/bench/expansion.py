"""Time to contact from the divergence of the flow alone (METHOD 2.5, 2.10)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.signals import FlowField

_ITERATIONS = 10
#: Least number of vectors for a fit.
_MIN_VECTORS = 8
#: Least standard deviation of the residuals [px].
_RESIDUAL_FLOOR = 0.03
#: Number of vectors with a common error: neighbouring windows overlap.
_OVERLAP = 4.0


@dataclass(frozen=True, slots=True)
class Expansion:
    """Expansion of the image: each vector is ``rate`` times its point's offset from the focus.

    ``focus`` (2,) [px] is the focus of expansion. ``rate`` = 1 - (depth now / depth past) for a
    surface straight ahead, ``sigma`` its standard deviation, and ``support`` the share of the
    vectors that agree with the fit.
    """

    rate: float
    sigma: float
    focus: Array
    support: float

    def time_to_contact(self, dt: float) -> float:
        """Time to contact [s] for frames ``dt`` [s] apart; inf without expansion.

        Negative if the image shrinks: the time since a contact at constant velocity.
        """
        return dt * (1.0 / self.rate - 1.0) if self.rate != 0.0 else math.inf


def fit_expansion(flow: FlowField, least: float = 0.2) -> Expansion | None:
    """The expansion about a focus that fits ``flow`` (derotated) best.

    Weighted least squares for rate and focus, with Cauchy weights against mismatches and vectors of
    other surfaces. It requires neither speed nor focal length. Vectors of confidence ``least`` or
    more are used; None if there are too few.
    """
    chosen = (flow.confidence >= least) & np.isfinite(flow.vectors).all(axis=-1)
    if np.count_nonzero(chosen) < _MIN_VECTORS:
        return None
    points, vectors, sigma = flow.points[chosen], flow.vectors[chosen], flow.sigma[chosen]
    first = flow.confidence[chosen] / sigma**2
    weight, rate, spread = first, 0.0, 1.0
    centre = mean = np.zeros(2)
    off, away = np.zeros(len(points)), points
    for _ in range(_ITERATIONS):
        total = weight.sum()
        centre, mean = product(weight, points) / total, product(weight, vectors) / total
        away = points - centre
        spread = float(product(weight, (away**2).sum(axis=1)))
        if spread <= 0.0:
            return None
        rate = float(product(weight, (away * (vectors - mean)).sum(axis=1))) / spread
        off = np.linalg.norm(vectors - mean - rate * away, axis=1)
        scale = max(1.2 * float(np.median(off)), _RESIDUAL_FLOOR)
        weight = first / (1.0 + (off / (2.0 * scale)) ** 2)
    component = max(float(product(weight, off**2)) / (2.0 * weight.sum()), _RESIDUAL_FLOOR**2)
    variance = _OVERLAP * component * float(product(weight**2, (away**2).sum(axis=1))) / spread**2
    agree = off <= 3.0 * max(1.2 * float(np.median(off)), _RESIDUAL_FLOOR)
    focus = centre - mean / rate if rate != 0.0 else centre
    return Expansion(rate, math.sqrt(variance), focus, float(agree.mean()))


class ContactFilter:
    """Kalman filter of the time to contact: prediction by elapsed time, correction by expansions.

    ``change`` is the standard deviation of the relative change of the closing speed per second. A
    surface that does not approach resets the filter to a time to contact of inf.
    """

    def __init__(self, change: float = 0.3) -> None:
        self._change = change
        self.reset()

    def reset(self) -> None:
        """Set the time to contact to inf, with unknown variance."""
        self.time_to_contact = math.inf
        self._variance = math.inf

    def update(self, elapsed: float, expansion: Expansion | None, dt: float) -> float:
        """The time to contact [s] after ``elapsed`` [s] and a measurement over frames ``dt`` apart.

        Without a measurement (None) the value is only predicted.
        """
        if math.isfinite(self.time_to_contact):
            before = self.time_to_contact
            self.time_to_contact = max(before - elapsed, 0.0)
            self._variance += (self._change * before) ** 2 * elapsed
        if expansion is None:
            return self.time_to_contact
        if expansion.rate <= expansion.sigma:
            self.reset()
            return self.time_to_contact
        measured = expansion.time_to_contact(dt)
        noise = (dt * expansion.sigma / expansion.rate**2) ** 2
        if not math.isfinite(self._variance):
            self.time_to_contact, self._variance = measured, noise
        else:
            gain = self._variance / (self._variance + noise)
            self.time_to_contact += gain * (measured - self.time_to_contact)
            self._variance *= 1.0 - gain
        return self.time_to_contact
