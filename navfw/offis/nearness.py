"""From derotated flow to nearness 1/Z with its uncertainty (METHOD 2.5, 2.9, 2.10).

With the camera displaced by ``s`` (CURRENT camera axes) since the past frame, a static point now
imaged at ``p`` with depth Z has the derotated vector ``d = e / (Z + s_z)``, where
``e = p s_z - f (s_x, s_y)`` points away from the focus of expansion (FOE). So
``k = d.e / e.e = 1 / (Z + s_z)`` and ``q = 1/Z = k / (1 - s_z k)``.

The nearest objects are searched layer by layer by zooming into the pyramid (paper sec 4.5, Fig. 8,
METHOD R7). Which neighbouring regions show one plane is inferred (paper sec 5.2 a, METHOD R8).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer, infer_rows, load_system
from navfw.offis.percept_kernels import compare_pairs, triangulate_cells
from navfw.offis.pyramid import NEIGHBOURS, Pyramid, RegionStatistics, position
from navfw.signals import FlowField

TERMS = ("near", "middle", "far")

MINIMUM_BASELINE = 0.005  # chosen
"""Least translation for depth to be known [m]."""
_REJECTION = 3.0  # chosen
"""Largest residual of a consistent vector [sigma]."""


@dataclass(frozen=True, slots=True)
class Distances:
    """Degrees of the distance terms: ``degrees`` (3, n) of near, middle, far for each of n regions.

    ``term`` (n,) is the index of the strongest. An unknown region has degree 0 in all three.
    """

    degrees: Array
    term: np.ndarray
    evaluation: FuzzyEvaluation


def find_distances(nearness: Array, known: Array, speed: float) -> Distances:
    """Infer distance terms of regions from their ``nearness`` (n,) [1/m] and time to contact.

    ``known`` (n,) is the share of their cells that are known; ``speed`` [m/s] is the forward speed:
    up to 0.02 m/s only the distance counts.
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
        """The three arrays, each of shape (rows * cols,)."""
        return self.nearness.reshape(-1), self.sigma.reshape(-1), self.confidence.reshape(-1)


def triangulate(flow: FlowField, focal: float) -> Nearness:
    """Compute nearness 1/Z [1/m] at the current pixels of the derotated ``flow`` (METHOD 2.5).

    The sigma combines the flow's own sigma and the yaw error (``motion.yaw_sigma`` adds ``yaw_sigma
    * (f + x^2/f, x y/f)`` to a vector), both divided by ``|e|``, and the relative error of the
    translation. Near the FOE ``|e|`` vanishes: such cells keep their estimate with a large sigma
    and a low confidence (METHOD 2.10).

    A vector whose component across ``e`` exceeds 3 standard deviations, or whose nearness is
    negative by as many, comes from a moving object or a mismatch: its confidence is 0. For a
    baseline below ``MINIMUM_BASELINE`` [m] all confidences are 0.

    Raises:
        ValueError: ``flow`` is not derotated.

    """
    if not flow.derotated:
        raise ValueError("nearness needs derotated flow (navfw.camera_geometry.rotations)")
    motion = flow.motion
    shape = flow.shape
    baseline = motion.baseline
    confidence = _flat(flow.confidence)
    if baseline < MINIMUM_BASELINE:
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
        _REJECTION,
    )
    return Nearness(*(cell.reshape(shape) for cell in cells))


def _flat(values: Array) -> Array:
    """Return ``values`` as a contiguous float64 array (n,), as the kernels need them."""
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


_ALIKE = 0.7  # chosen
"""Least size of a region that joins the nearest object, relative to the biggest region.

The rule base compares direct neighbours only; this limit also holds along a chain of neighbours."""


@dataclass(frozen=True, slots=True)
class Planes:
    """Plane property of all pairs of neighbouring sibling regions, arrays (n_pairs,).

    ``pairs`` (n_pairs, 2) are region indices, four pairs per family in ``pyramid.families`` order;
    ``plane`` is the degree to which both regions show one plane, ``same`` the degree to which both
    also belong to the same nearest object.
    """

    pairs: np.ndarray
    plane: Array
    same: Array
    evaluation: FuzzyEvaluation


def pairs_of(pyramid: Pyramid) -> np.ndarray:
    """Return the indices (n_pairs, 2) of all pairs of neighbouring siblings in the pyramid."""
    return np.array([(f + i, f + j) for f in pyramid.families for i, j in NEIGHBOURS])


def find_planes(pairs: np.ndarray, regions: RegionStatistics, size: Array) -> Planes:
    """Infer which ``pairs`` show one plane; ``size`` (n_regions,) is the size of each region."""
    rows, present = compare_pairs(pairs, regions.mu_u, regions.mu_v, size, regions.objects)
    evaluation = infer_rows(load_system("plane"), rows)
    return Planes(
        pairs,
        present * evaluation.degree("plane", "common"),
        present * evaluation.degree("object", "same"),
        evaluation,
    )


def nearest_objects(
    pyramid: Pyramid, size: Array, present: np.ndarray, planes: Planes, distances: Distances
) -> Mapping[str, Mapping[str, str]]:
    """Find the regions of the nearest object in each layer, with their distance terms.

    ``{"layer1": {"P2": "middle"}, "layer2": {"sP23": "middle"}}``. Of four siblings the biggest (by
    ``size``) belongs to the nearest object. Neighbours of about the same size that share its plane
    belong to it too, and so on along the neighbours. The next layer zooms into these regions.
    Regions without an object (not ``present``) are left out, so a layer may be empty.
    """
    sizes, shown, same = size.tolist(), present.tolist(), planes.same.tolist()
    terms = distances.term.tolist()
    obstacles: dict[str, dict[str, str]] = {}
    families = [0]
    for layer in range(1, pyramid.layers + 1):
        chosen = [r for first in families for r in _biggest(first, sizes, shown, same)]
        obstacles[f"layer{layer}"] = {pyramid.names[r]: TERMS[terms[r]] for r in sorted(chosen)}
        families = [child for r in chosen if (child := pyramid.first_child(r)) is not None]
    return obstacles


def common_regions(
    obstacles: Mapping[str, Mapping[str, str]], others: Sequence[Mapping[str, Mapping[str, str]]]
) -> Mapping[str, Mapping[str, str]]:
    """Keep of ``obstacles`` the regions in quadrants that layer 1 of all ``others`` names, too."""
    places = {
        position(region)
        for region in obstacles["layer1"]
        if all(region in other["layer1"] for other in others)
    }
    return {
        layer: {region: term for region, term in regions.items() if position(region) in places}
        for layer, regions in obstacles.items()
    }


def _biggest(first: int, size: list[float], shown: list[bool], same: list[float]) -> list[int]:
    """Return the biggest of the four siblings from index ``first`` on, and those that belong to it.

    ``same`` has the order of ``planes.pairs_of``: four pairs per family, as in ``NEIGHBOURS``.
    """
    members = [r for r in range(first, first + 4) if shown[r]]
    if not members:
        return []
    biggest = max(members, key=size.__getitem__)
    least = _ALIKE * size[biggest]
    chosen = {biggest}
    # siblings form a ring: three rounds reach the end of every chain
    for k, (i, j) in enumerate(NEIGHBOURS * 3):
        one, other = first + i, first + j
        if same[first + k % 4] >= 0.5 and (one in chosen) != (other in chosen):
            new = other if one in chosen else one
            if shown[new] and size[new] >= least:
                chosen.add(new)
    return list(chosen)
