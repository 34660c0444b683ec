"""Probabilities of the places of a map, given an uncertain position or OFFIS' situations.

A table holds, for each kind of place, the probability of each situation that OFFIS reports (METHOD
4.4). The one that ships was learnt on simulated drives with known poses; ``navfw map
learn-situations`` learns others.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, InputError, UnknownNameError
from navfw.interfaces import Localizer
from navfw.numerics import Array
from navfw.numerics.functions import exp
from navfw.numerics.products import product
from navfw.signals import Percept, Pose, position_sigma
from navfw.topomap import PLACE_KINDS, TopoMap

_PLACE_RADIUS = 1.0  # chosen
"""Standard deviation [m] of the robot's position when it is at a place."""

COUNT = 8  # chosen
"""Number of places that a belief lists, likeliest first."""

REFRESH = 0.05  # chosen
"""Distance moved [m] after which the place posterior is computed again."""

_CONFIDENCE_RADIUS = 1.0  # chosen
"""A belief's confidence is the probability that its position error is below this [m]."""


def likeliest_places(
    topo_map: TopoMap,
    pose: Pose,
    covariance: Array,
    count: int = COUNT,
) -> Mapping[str, float]:
    """Compute the probabilities of the ``count`` likeliest places, likeliest first; their sum is 1.

    ``covariance`` (3, 3) is that of ``pose`` (x, y, yaw) in ``map``.
    """
    spread = _PLACE_RADIUS**2 + 0.5 * float(covariance[0, 0] + covariance[1, 1])
    squared = topo_map.place_distances(pose.x, pose.y) ** 2
    count = min(count, len(squared))
    likeliest = np.argsort(squared, kind="stable")[:count]
    # relative to the nearest place, so that the weights do not all underflow far from every place
    weights = exp(-0.5 * (squared[likeliest] - squared[likeliest[0]]) / spread)
    weights /= weights.sum()
    names = list(topo_map.places)
    return {names[i]: float(w) for i, w in zip(likeliest.tolist(), weights, strict=True)}


class PlacePosterior:
    """Computes the likeliest places of a moving pose, anew after each ``refresh`` [m] only."""

    def __init__(self, topo_map: TopoMap, count: int = COUNT, refresh: float = REFRESH) -> None:
        self._map = topo_map
        self._count, self._refresh = count, refresh
        self._computed_at = (math.inf, math.inf)
        self._places: Mapping[str, float] = {}

    def at(self, pose: Pose, covariance: Array) -> Mapping[str, float]:
        """Return ``likeliest_places`` of ``pose`` (map), or the last ones if it hardly moved."""
        if math.dist((pose.x, pose.y), self._computed_at) > self._refresh:
            self._places = likeliest_places(self._map, pose, covariance, self._count)
            self._computed_at = (pose.x, pose.y)
        return self._places


class PlaceLocalizer(Localizer):
    """Base class of localisers that derive place probabilities from their pose estimate.

    A subclass's ``start`` sets ``_posterior``; ``update`` lists its likeliest places in the belief.
    """

    _posterior: PlacePosterior | None = None

    def reset(self) -> None:
        """Return to the state before ``start``."""
        self._posterior = None

    @property
    def posterior(self) -> PlacePosterior:
        """The map's ``PlacePosterior``, set by ``start``; RuntimeError before."""
        if self._posterior is None:
            raise RuntimeError("start() comes before update()")
        return self._posterior


def known_start(pose: Pose | None, localizer: str, instead: str) -> Pose:
    """Check that the start ``pose`` is known, for a ``localizer`` that cannot search; return it.

    Raises:
        InputError: ``pose`` is None; the message recommends ``instead``.

    """
    if pose is None:
        raise InputError(
            f"the localizer {localizer!r} cannot find an unknown start; give the mission a start "
            f"pose, or the stack {instead}"
        )
    return pose


def probability_within(covariance: Array, radius: float = _CONFIDENCE_RADIUS) -> float:
    """Return a lower bound on the probability that the position error is at most ``radius`` [m]."""
    sigma = position_sigma(covariance)
    return 1.0 if sigma == 0.0 else -math.expm1(-0.5 * (radius / sigma) ** 2)


FLOOR = 0.05  # chosen
"""Least likelihood of a place: OFFIS' situations are too uncertain to exclude one."""

SITUATIONS = (
    "door",
    "corridor",
    "corner",
    "wall",
    "left wall",
    "right wall",
    "left slope wall",
    "right slope wall",
)
"""OFFIS' elementary situations that carry information: all but "unknown"."""

SMOOTHING = 20.0  # chosen
"""Pseudo-observations, distributed as the mean of all kinds, that are added to each kind."""

LEARNT, _NO_TABLE = "learnt", "none"
"""Names of the table that ships, and of none."""

_MIRRORED = (("left wall", "right wall"), ("left slope wall", "right slope wall"))
_SHIPPED = Path(__file__).with_name("situations.yaml")


class TableSpec(StrictModel):
    """The keys of a table's file."""

    description: str = Field("", description="origin of the table")
    observations: Mapping[str, Annotated[float, Field(ge=0.0)]] = Field(
        default_factory=dict, description="number of observations at places of each kind"
    )
    seen_at: Mapping[str, Mapping[str, Annotated[float, Field(ge=0.0, le=1.0)]]] = Field(
        min_length=1, description="kind of place: {situation: probability}"
    )


@dataclass(frozen=True)
class SituationTable:
    """The probability of each of SITUATIONS (in that order) at places of each kind.

    ``seen_at`` has arrays (8,) by kind, ``observations`` the number of observations behind each. A
    kind without a row takes the mean of all.
    """

    seen_at: Mapping[str, Array]
    observations: Mapping[str, float]

    def likelihoods(self, topo_map: TopoMap, situations: Mapping[str, float]) -> Array | None:
        """Compute the likelihood (places,) of ``situations`` at each place, in [FLOOR, 1].

        ``situations`` are degrees by name. Returns None if they carry no information.
        """
        shares, certainty = situation_shares(situations)
        if certainty <= 0.0:
            return None
        kinds = {place.kind for place in topo_map.places.values()}
        mean = np.mean(list(self.seen_at.values()), axis=0)
        of_kind = {kind: float(product(shares, self.seen_at.get(kind, mean))) for kind in kinds}
        best = max(of_kind.values())
        if best <= 0.0:
            return None
        scaled = {kind: 1.0 - certainty * (1.0 - value / best) for kind, value in of_kind.items()}
        return np.array([max(FLOOR, scaled[place.kind]) for place in topo_map.places.values()])

    def text(self, description: str) -> str:
        """Return the text of a file with this table."""
        counts = ", ".join(f"{kind}: {count:.0f}" for kind, count in self.observations.items())
        lines = [
            f"description: {json.dumps(description)}",
            f"observations: {{{counts}}}",
            "seen_at:",
        ]
        for kind, row in self.seen_at.items():
            shares = [f"{name}: {p:.4f}" for name, p in zip(SITUATIONS, row, strict=True)]
            lines.append(f"  {kind}: {{{', '.join(shares)}}}")
        return "\n".join(lines) + "\n"


def observed_situations(percept: Percept | None) -> Mapping[str, float] | None:
    """Return the degrees of the situations in a percept with depth, else None."""
    return percept.situations if percept is not None and percept.sees_depth else None


def situation_shares(situations: Mapping[str, float]) -> tuple[Array, float]:
    """Normalise the degrees of SITUATIONS (8,) to sum 1; also return their certainty in [0, 1]."""
    degrees = np.array([max(situations.get(name, 0.0), 0.0) for name in SITUATIONS])
    total = float(degrees.sum())
    if total < 1e-6:
        return degrees, 0.0
    return degrees / total, min(1.0, total)


def learn_table(observations: Iterable[tuple[str, Mapping[str, float]]]) -> SituationTable:
    """Learn a table from ``observations``, each a kind of place and OFFIS' degrees there.

    Left and right situations are averaged; kinds with few observations are drawn to the mean of all
    kinds.

    Raises:
        ValueError: no observation carries information.

    """
    sums: dict[str, Array] = {kind: np.zeros(len(SITUATIONS)) for kind in PLACE_KINDS}
    for kind, situations in observations:
        shares, certainty = situation_shares(situations)
        sums[kind] += certainty * shares
    for row in sums.values():
        for pair in _MIRRORED:
            both = [SITUATIONS.index(name) for name in pair]
            row[both] = row[both].mean()
    # the mean over kinds, not over observations: independent of how often each kind was passed
    mean = np.sum([row / (row.sum() + SMOOTHING) for row in sums.values()], axis=0)
    if mean.sum() <= 0.0:
        raise ValueError("OFFIS reported no situation")
    mean /= mean.sum()
    smooth = {kind: row + SMOOTHING * mean for kind, row in sums.items()}
    return SituationTable(
        {kind: row / row.sum() for kind, row in smooth.items()},
        {kind: float(row.sum()) for kind, row in sums.items()},
    )


def situation_table(name: str) -> SituationTable | None:
    """Return the table ``name``: ``learnt`` (the one that ships), ``none`` (None), or a file's.

    Raises:
        ConfigError: there is no such file, or it is not a table.

    """
    if name == _NO_TABLE:
        return None
    return _shipped() if name == LEARNT else load_table(name)


@lru_cache(maxsize=1)
def _shipped() -> SituationTable:
    return load_table(_SHIPPED)


def load_table(file: str | Path) -> SituationTable:
    """Load the table in a file.

    Raises:
        ConfigError: it breaks the schema, or its probabilities do not add up to 1.
        UnknownNameError: it has an unknown kind of place or situation.

    """
    document = load_yaml(file)
    spec = validate(document, TableSpec)
    rows = {}
    for kind, shares in spec.seen_at.items():
        _check_name(document, "kind of place", kind, PLACE_KINDS, ("seen_at", kind))
        for name in shares:
            _check_name(document, "situation", name, SITUATIONS, ("seen_at", kind, name))
        row = np.array([shares.get(name, 0.0) for name in SITUATIONS])
        if abs(row.sum() - 1.0) > 0.01:
            with document.locating(("seen_at", kind)):
                raise ConfigError(f"expected probabilities that add up to 1, got {row.sum():.3g}")
        rows[kind] = row / row.sum()
    return SituationTable(rows, dict(spec.observations))


def _check_name(
    document: YamlDocument, what: str, name: str, allowed: tuple[str, ...], path: tuple[str, ...]
) -> None:
    if name not in allowed:
        with document.locating(path):
            raise UnknownNameError(what, name, allowed)
