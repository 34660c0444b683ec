"""From derotated flow to nearness 1/Z with its uncertainty (METHOD 2.5, 2.9, 2.10).

With the camera displaced by ``s`` (CURRENT camera axes) since the past frame, a static point now
imaged at ``p`` with depth Z has the derotated vector ``d = e / (Z + s_z)``, where
``e = p s_z - f (s_x, s_y)`` points away from the focus of expansion (FOE). So
``k = d.e / e.e = 1 / (Z + s_z)`` and ``q = 1/Z = k / (1 - s_z k)``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from navfw.offis.kernels import DOUBT, SIGMA_LIMIT, triangulate_cells
from navfw.signals import Array, FlowField

__all__ = ["Nearness", "triangulate"]


class Nearness(NamedTuple):
    """Nearness of every cell: four arrays (rows, cols).

    ``nearness`` [1/m] is never negative; ``sigma`` [1/m] is one standard deviation (at most
    ``kernels.SIGMA_LIMIT``, which says "nothing known"); ``confidence`` in [0, 1] is 0 where the
    vector contradicts the motion or says nothing; ``contradiction`` in [0, 1] is the confidence of
    those that do contradict it.
    """

    nearness: Array
    sigma: Array
    confidence: Array
    contradiction: Array


def triangulate(
    flow: FlowField, focal: float, *, minimum_baseline: float = 0.005, rejection: float = 3.0
) -> Nearness:
    """Nearness 1/Z [1/m] at the current pixels of ``flow`` (derotated), METHOD 2.5.

    The sigma adds the flow's own sigma and the yaw error (``motion.yaw_sigma`` adds
    ``yaw_sigma * (f + x^2/f, x y/f)`` to a vector), both divided by ``|e|``, and the relative error
    of the translation. Near the FOE ``|e|`` vanishes: such cells keep their best value with a large
    sigma and a low confidence (METHOD 2.10); they are never dropped silently.

    A vector whose part across ``e`` exceeds ``rejection`` standard deviations, or whose nearness is
    negative by as many, comes from a moving object or a mismatch: confidence 0. Below
    ``minimum_baseline`` [m] no nearness is known: all confidences are 0, and what is not at rest in
    the derotated image contradicts.

    Raises ValueError when ``flow`` still contains rotation.
    """
    if not flow.derotated:
        raise ValueError("nearness needs derotated flow (navfw.flow.derotation.derotate)")
    motion = flow.motion
    shape = flow.shape
    baseline = motion.baseline
    confidence = _flat(flow.confidence)
    if baseline < minimum_baseline:
        return _standing(flow, focal, rejection)
    cells = triangulate_cells(
        _flat(flow.points).reshape(-1, 2),
        _flat(flow.vectors).reshape(-1, 2),
        confidence,
        _flat(flow.sigma),
        float(focal),
        _flat(motion.translation),
        float(motion.yaw_sigma),
        float(motion.translation_sigma / baseline) if baseline > 0.0 else 0.0,
        float(rejection),
    )
    nearness, sigma, trust, against = (cell.reshape(shape) for cell in cells)
    if flow.contradiction is not None:
        against = np.maximum(against, flow.contradiction)
    return Nearness(nearness, sigma, trust, against)


def _standing(flow: FlowField, focal: float, rejection: float) -> Nearness:
    """From a camera that has not moved: what is at rest shows no flow at all."""
    nothing = np.zeros(flow.shape)
    turning = flow.motion.yaw_sigma * (focal + flow.points[..., 0] ** 2 / focal)
    error = np.sqrt(flow.sigma**2 + turning**2 + DOUBT**2)
    still = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1]) <= rejection * error
    against = np.where(still | ~np.isfinite(flow.vectors).all(axis=-1), 0.0, flow.confidence)
    return Nearness(nothing, np.full(flow.shape, SIGMA_LIMIT), nothing, against)


def _flat(values: Array) -> Array:
    """``values`` as contiguous float64 of one dimension, as the kernels want them."""
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)
