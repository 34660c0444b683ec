"""Section 4.3 of the paper: two layers of means against one layer of means and variances.

Two comparisons on generated views with ground truth. *OFFIS* with either metric; and, since OFFIS
may compensate for a metric by other means, *the metrics alone*: a linear classifier infers
situation and nearest quadrant from nothing but the region metrics of the raw flow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.bench.perception_samples import PerceptionSample, samples_of_world
from navfw.offis.offis import Offis
from navfw.offis.pyramid import QUADRANTS, Channels, Pyramid
from navfw.reproduce.rendered_views import check_percept
from navfw.robot import RobotModel
from navfw.signals import Array, FlowField, Twist

__all__ = ["SETTINGS", "compare_metrics"]

SETTINGS: dict[str, Offis.Params] = {
    "L=2, means": Offis.Params(mode="paper", layers=2, metric="mean"),
    "L=1, means and variances": Offis.Params(mode="paper", layers=1, metric="mean_variance"),
    "L=1, means": Offis.Params(mode="paper", layers=1, metric="mean"),
    "normalised, L=2, means": Offis.Params(mode="nearness", layers=2, metric="mean"),
    "normalised, L=1, means and variances": Offis.Params(
        mode="nearness", layers=1, metric="mean_variance"
    ),
    "normalised, L=2, nearest eighth": Offis.Params(mode="nearness", layers=2),
}
"""The parameters of OFFIS compared: the paper's two come first, the normalised ones are navfw's."""

_FOLDS = 10
"""Folds of the cross-validation."""

_RIDGE = 0.3
"""Ridge added to the covariance of the standardised features."""


def compare_metrics(views: int, seed: int) -> dict[str, Any]:
    """Both comparisons on ``views`` views of a ``seed``, with ideal flow and with block matching.

    Shares of correct results: ``offis[setting][flow]`` with ``quadrant``, ``distance`` and
    ``situation``; ``numbers[metric][flow]`` with ``quadrant`` and ``situation``, the classifier's
    by 10-fold cross-validation.
    """
    samples = list(islice(_samples(seed), views))
    flows = {
        "ideal": [(s.ideal, s.view.twist) for s in samples],
        "block matching": [(s.flow, s.twist) for s in samples],
    }
    offis = {
        name: {kind: _scores(params, seen, samples) for kind, seen in flows.items()}
        for name, params in SETTINGS.items()
    }
    numbers = {
        name: {
            kind: _classified([_features(flow, layers, variances) for flow, _ in seen], samples)
            for kind, seen in flows.items()
        }
        for name, layers, variances in (
            ("L=2, means", 2, False),
            ("L=1, means and variances", 1, True),
            ("L=1, means", 1, False),
        )
    }
    clear = sum(sample.truth.clear for sample in samples)
    return {"views": len(samples), "clear": clear, "seed": seed, "offis": offis, "numbers": numbers}


def _samples(seed: int) -> Any:
    number = 0
    while True:
        yield from samples_of_world(seed, number)
        number += 1


@dataclass(slots=True)
class _Share:
    """A share of correct results; None counts for nothing."""

    right: int = 0
    count: int = 0

    def add(self, right: bool | None) -> None:
        if right is not None:
            self.right += right
            self.count += 1

    @property
    def value(self) -> float | None:
        return self.right / self.count if self.count else None


def _scores(
    params: Offis.Params,
    seen: Sequence[tuple[FlowField, Twist]],
    samples: Sequence[PerceptionSample],
) -> dict[str, float | None]:
    offis = Offis(RobotModel(), params)
    shares = {name: _Share() for name in ("quadrant", "distance", "situation")}
    for (flow, twist), sample in zip(seen, samples, strict=True):
        found = check_percept(offis.perceive(flow, twist), sample.truth)
        for share, right in zip(shares.values(), found, strict=True):
            share.add(right)
    return {name: share.value for name, share in shares.items()}


def _features(flow: FlowField, layers: int, variances: bool) -> Array:
    """Logarithms of the deepest layer's means of |u| and |v| [px], as features.

    With ``variances`` the standard deviations [px] come after the means.
    """
    pyramid = Pyramid(flow.shape, layers)
    known = (flow.confidence > 0.0).astype(np.float64)
    size = np.where(known[..., None] > 0.0, np.abs(flow.vectors), 0.0)
    values = np.stack([size[..., 0], size[..., 0], size[..., 1]])
    regions = pyramid.statistics(Channels(values, np.stack([known] * 3), known))
    first, count = (4, 16) if layers == 2 else (0, 4)  # of the deepest layer
    part = slice(first, first + count)
    columns = [regions.mu_u[part], regions.mu_v[part]]
    if variances:
        columns += [np.sqrt(regions.var_u[part]), np.sqrt(regions.var_v[part])]
    # logarithms turn the ratios between regions, which the paper's rules use, into differences
    return np.asarray(np.log(np.concatenate(columns) + 0.05))


def _classified(
    features: Sequence[Array], samples: Sequence[PerceptionSample]
) -> dict[str, float | None]:
    """Share of correct results of the classifier for nearest quadrant and situation."""
    table = np.stack(features)
    quadrant = [QUADRANTS[int(np.argmax(sample.truth.nearness))] for sample in samples]
    possible = [sample.truth.possible for sample in samples]
    clear = np.array([sample.truth.clear for sample in samples])
    situation = [sample.truth.situations for sample in samples]
    quadrants = _cross_validated(table, quadrant)
    right = [name in names for name, names in zip(quadrants, possible, strict=True)]
    front = [names[0] for names, use in zip(situation, clear, strict=True) if use]
    fronts = _cross_validated(table[clear], front)
    true = [names for names, use in zip(situation, clear, strict=True) if use]
    hits = [name in names for name, names in zip(fronts, true, strict=True)]
    return {
        "quadrant": float(np.mean(right)) if right else None,
        "situation": float(np.mean(hits)) if hits else None,
    }


def _cross_validated(table: Array, labels: Sequence[str]) -> list[str]:
    """The label of each row by a linear discriminant trained on the other folds."""
    found = [""] * len(labels)
    fold = np.arange(len(labels)) % _FOLDS
    for k in range(_FOLDS):
        training, test = fold != k, fold == k
        if not test.any() or not training.any():
            continue
        known = [label for label, use in zip(labels, training, strict=True) if use]
        inferred = _discriminate(table[training], known, table[test])
        for index, label in zip(np.flatnonzero(test), inferred, strict=True):
            found[index] = label
    return found


def _discriminate(training: Array, labels: Sequence[str], test: Array) -> list[str]:
    """The labels of ``test`` rows by linear discriminant analysis with a ridged covariance."""
    classes = sorted(set(labels))
    which: npt.NDArray[np.int64] = np.array([classes.index(label) for label in labels])
    centre, spread = training.mean(axis=0), training.std(axis=0) + 1e-9
    x, y = (training - centre) / spread, (test - centre) / spread
    means = np.stack([x[which == c].mean(axis=0) for c in range(len(classes))])
    within = x - means[which]
    covariance = within.T @ within / len(x) + _RIDGE * np.eye(x.shape[1])
    weights = np.linalg.solve(covariance, means.T)
    prior = np.log(np.bincount(which, minlength=len(classes)) / len(x))
    scores = y @ weights - 0.5 * (means * weights.T).sum(axis=1) + prior
    return [classes[int(best)] for best in scores.argmax(axis=1)]
