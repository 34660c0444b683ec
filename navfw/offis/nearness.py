"""From derotated flow to nearness 1/Z with its uncertainty (METHOD 2.5, 2.9, 2.10).

With the camera displaced by ``s`` (CURRENT camera axes) since the past frame, a static point now
imaged at ``p`` with depth Z has the derotated vector ``d = e / (Z + s_z)``, where
``e = p s_z - f (s_x, s_y)`` points away from the focus of expansion (FOE). So
``k = d.e / e.e = 1 / (Z + s_z)`` and ``q = 1/Z = k / (1 - s_z k)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer, load_system
from navfw.offis.percept_kernels import triangulate_cells
from navfw.signals import FlowField

TERMS = ("near", "middle", "far")


@dataclass(frozen=True, slots=True)
class Distances:
    """``degrees`` (3, n) of near, middle, far for each region, and the strongest ``term`` (n,).

    An unknown region has degree 0 in all three.
    """

    degrees: Array
    term: np.ndarray
    evaluation: FuzzyEvaluation


def find_distances(nearness: Array, known: Array, speed: float) -> Distances:
    """Distance terms of regions with ``nearness`` (n,) [1/m] and a share ``known`` (n,) of cells.

    ``speed`` [m/s] is the forward speed. If it is not positive, only the distance counts, not the
    time to contact.
    """
    distance = 1.0 / np.maximum(nearness, 1e-3)
    contact = distance / speed if speed > 0.02 else np.full_like(distance, 1e3)
    evaluation = infer(load_system("distance"), {"distance": distance, "contact": contact})
    degrees = np.array([evaluation.degree("range", term) for term in TERMS])
    degrees *= np.minimum(known / 0.1, 1.0)
    return Distances(degrees, degrees.argmax(0), evaluation)


class Nearness(NamedTuple):
    """Nearness of every cell: three arrays (rows, cols).

    ``nearness`` [1/m] is not negative; ``sigma`` [1/m] is one standard deviation, limited to
    ``percept_kernels.SIGMA_LIMIT``, the value of unknown cells; ``confidence`` in [0, 1] is 0 where
    the vector is inconsistent with the motion or carries no information.
    """

    nearness: Array
    sigma: Array
    confidence: Array

    @property
    def flat(self) -> tuple[Array, Array, Array]:
        """The three arrays, each (rows * cols,)."""
        return self.nearness.reshape(-1), self.sigma.reshape(-1), self.confidence.reshape(-1)


def triangulate(
    flow: FlowField, focal: float, *, minimum_baseline: float = 0.005, rejection: float = 3.0
) -> Nearness:
    """Nearness 1/Z [1/m] at the current pixels of ``flow`` (derotated), METHOD 2.5.

    The sigma combines the flow's own sigma and the yaw error (``motion.yaw_sigma`` adds
    ``yaw_sigma * (f + x^2/f, x y/f)`` to a vector), both divided by ``|e|``, and the relative error
    of the translation. Near the FOE ``|e|`` vanishes: such cells keep their estimate with a large
    sigma and a low confidence (METHOD 2.10).

    A vector whose component across ``e`` exceeds ``rejection`` standard deviations, or whose
    nearness is negative by as many, comes from a moving object or a mismatch: its confidence is 0.
    For a baseline below ``minimum_baseline`` [m] all confidences are 0.

    Raises:
        ValueError: ``flow`` is not derotated.

    """
    if not flow.derotated:
        raise ValueError("nearness needs derotated flow (navfw.camera_geometry.rotations)")
    motion = flow.motion
    shape = flow.shape
    baseline = motion.baseline
    confidence = _flat(flow.confidence)
    if baseline < minimum_baseline:
        confidence = np.zeros_like(confidence)
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
    return Nearness(*(cell.reshape(shape) for cell in cells))


def _flat(values: Array) -> Array:
    """``values`` as a contiguous float64 array (n,), as the kernels need them."""
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)
