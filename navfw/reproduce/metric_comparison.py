"""Section 4.3 again: two layers of means against one layer of means and variances.

Two comparisons on generated views whose truth is known. *OFFIS itself*, set to either metric. And,
since OFFIS may make up for a metric by other means, *the numbers alone*: a plain linear classifier
is given nothing but the region metrics of the raw flow, and has to tell the situation and the
nearest quadrant.
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
from navfw.reproduce.rendered_views import judge
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
"""OFFIS as compared: the paper's two first; the normalised ones are this package's."""

_FOLDS = 10
_RIDGE = 0.3


def compare_metrics(views: int, seed: int) -> dict[str, Any]:
    """Both comparisons on ``views`` views of a ``seed``, with ideal flow and with block matching.

    Shares of right answers: ``offis[setting][flow]`` with ``quadrant``, ``distance`` and
    ``situation``; ``numbers[metric][flow]`` with ``quadrant`` and ``situation`` (10-fold).
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
    right: int = 0
    asked: int = 0

    def add(self, right: bool | None) -> None:
        if right is not None:
            self.right += right
            self.asked += 1

    @property
    def value(self) -> float | None:
        return self.right / self.asked if self.asked else None


def _scores(
    params: Offis.Params,
    seen: Sequence[tuple[FlowField, Twist]],
    samples: Sequence[PerceptionSample],
) -> dict[str, float | None]:
    offis = Offis(RobotModel(), params)
    shares = {name: _Share() for name in ("quadrant", "distance", "situation")}
    for (flow, twist), sample in zip(seen, samples, strict=True):
        found = judge(offis.perceive(flow, twist), sample.truth)
        for share, right in zip(shares.values(), found, strict=True):
            share.add(right)
    return {name: share.value for name, share in shares.items()}


def _features(flow: FlowField, layers: int, variances: bool) -> Array:
    """The deepest layer's means of |u| and |v| [px], and their standard deviations if asked."""
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
    # logarithms: what counts are ratios between regions, as in the paper's rules
    return np.asarray(np.log(np.concatenate(columns) + 0.05))


def _classified(
    features: Sequence[Array], samples: Sequence[PerceptionSample]
) -> dict[str, float | None]:
    """Share of right answers of the classifier for nearest quadrant and situation."""
    table = np.stack(features)
    quadrant = [QUADRANTS[int(np.argmax(sample.truth.nearness))] for sample in samples]
    possible = [sample.truth.possible for sample in samples]
    clear = np.array([sample.truth.clear for sample in samples])
    situation = [sample.truth.situations for sample in samples]
    said = _cross_validated(table, quadrant)
    right = [name in names for name, names in zip(said, possible, strict=True)]
    front = [names[0] for names, use in zip(situation, clear, strict=True) if use]
    told = _cross_validated(table[clear], front)
    true = [names for names, use in zip(situation, clear, strict=True) if use]
    hits = [name in names for name, names in zip(told, true, strict=True)]
    return {
        "quadrant": float(np.mean(right)) if right else None,
        "situation": float(np.mean(hits)) if hits else None,
    }


def _cross_validated(table: Array, labels: Sequence[str]) -> list[str]:
    """Answers of a linear discriminant for each row, learnt from the other folds' rows."""
    answers = [""] * len(labels)
    fold = np.arange(len(labels)) % _FOLDS
    for k in range(_FOLDS):
        learn, ask = fold != k, fold == k
        if not ask.any() or not learn.any():
            continue
        known = [label for label, use in zip(labels, learn, strict=True) if use]
        found = _discriminate(table[learn], known, table[ask])
        for index, answer in zip(np.flatnonzero(ask), found, strict=True):
            answers[index] = answer
    return answers


def _discriminate(learn: Array, labels: Sequence[str], ask: Array) -> list[str]:
    """Linear discriminant analysis with a pooled, ridged covariance."""
    classes = sorted(set(labels))
    which: npt.NDArray[np.int64] = np.array([classes.index(label) for label in labels])
    centre, spread = learn.mean(axis=0), learn.std(axis=0) + 1e-9
    x, y = (learn - centre) / spread, (ask - centre) / spread
    means = np.stack([x[which == c].mean(axis=0) for c in range(len(classes))])
    within = x - means[which]
    covariance = within.T @ within / len(x) + _RIDGE * np.eye(x.shape[1])
    weights = np.linalg.solve(covariance, means.T)
    prior = np.log(np.bincount(which, minlength=len(classes)) / len(x))
    scores = y @ weights - 0.5 * (means * weights.T).sum(axis=1) + prior
    return [classes[int(best)] for best in scores.argmax(axis=1)]
