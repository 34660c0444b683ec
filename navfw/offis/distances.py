"""Distance inference: near, middle or far, from distance and ego speed (paper sec 4.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer, load_system
from navfw.signals import Array

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
