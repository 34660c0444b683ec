"""Section 4.3 of the paper: two layers of means against one layer of means and variances.

Two comparisons on generated views with ground truth. *OFFIS* with either metric; and, since OFFIS
may compensate for a metric by other means, *the metrics alone*: a linear classifier infers
situation and nearest quadrant from nothing but the region metrics of the raw flow. The paper claims
that the two layers give "at least the same or even better classification results".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.offis.offis import Offis
from navfw.offis.pyramid import QUADRANTS, Channels, Pyramid
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import RobotModel
from navfw.signals import FlowField, Twist
from navfw.suite.paired_comparison import mcnemar_exact
from navfw_benchmarks.bench.perception_accuracy import check_percept
from navfw_benchmarks.bench.perception_samples import PerceptionSample, drawn_samples

_TWO_LAYERS, _ONE_LAYER = "L=2, means", "L=1, means and variances"
"""The two metrics of the paper's claim, as parameters of OFFIS and of the classifier."""

SETTINGS: dict[str, Offis.Params] = {
    _TWO_LAYERS: Offis.Params(mode="paper", layers=2, metric="mean"),
    _ONE_LAYER: Offis.Params(mode="paper", layers=1, metric="mean_variance"),
    "L=1, means": Offis.Params(mode="paper", layers=1, metric="mean"),
    f"normalised, {_TWO_LAYERS}": Offis.Params(mode="nearness", layers=2, metric="mean"),
    f"normalised, {_ONE_LAYER}": Offis.Params(mode="nearness", layers=1, metric="mean_variance"),
    "normalised, L=2, nearest eighth": Offis.Params(mode="nearness", layers=2),
}
"""The parameters of OFFIS compared: the paper's two come first, the normalised ones are navfw's."""

_FOLDS = 10
"""Folds of the cross-validation."""

_RIDGE = 0.3
"""Ridge added to the covariance of the standardised features."""


Answers = Mapping[str, Sequence[bool | None]]
"""Whether the answer for each view is right, by question; None where it is not judged."""


def compare_metrics(views: int, seed: int, report: ProgressCallback = silent) -> dict[str, Any]:
    """Both comparisons on ``views`` views of a ``seed``, with ideal flow and with block matching.

    Shares of correct results: ``offis[setting][flow]`` with ``quadrant``, ``distance`` and
    ``situation``; ``numbers[metric][flow]`` with ``quadrant`` and ``situation``, the classifier's
    by 10-fold cross-validation. ``claims`` has the paper's claim for each of them. ``report`` is
    called with each part.
    """
    drawn = islice(drawn_samples(seed), views)
    samples = list(with_progress(drawn, "section 4.3: rendering views", report, views))
    flows = {
        "ideal": [(s.ideal, s.view.twist) for s in samples],
        "block matching": [(s.flow, s.twist) for s in samples],
    }
    offis = {
        name: {kind: _perceived(SETTINGS[name], seen, samples) for kind, seen in flows.items()}
        for name in with_progress(SETTINGS, "section 4.3: settings of OFFIS", report)
    }
    numbers = {
        name: {
            kind: _classified([_features(flow, layers, variances) for flow, _ in seen], samples)
            for kind, seen in flows.items()
        }
        for name, layers, variances in (
            (_TWO_LAYERS, 2, False),
            (_ONE_LAYER, 1, True),
            ("L=1, means", 1, False),
        )
    }
    normalised = [offis[f"normalised, {name}"] for name in (_TWO_LAYERS, _ONE_LAYER)]
    return {
        "views": len(samples),
        "clear": sum(sample.truth.clear for sample in samples),
        "seed": seed,
        "offis": _shares(offis),
        "numbers": _shares(numbers),
        "claims": [
            *_claims("OFFIS, raw means", offis[_TWO_LAYERS], offis[_ONE_LAYER]),
            *_claims("OFFIS, normalised", *normalised),
            *_claims("the metrics alone", numbers[_TWO_LAYERS], numbers[_ONE_LAYER]),
        ],
    }


def _shares(answers_of: Mapping[str, Mapping[str, Answers]]) -> dict[str, Any]:
    """Shares of right answers instead of the answers; None of no answers."""
    return {
        name: {
            kind: {what: _share(answers[what]) for what in answers}
            for kind, answers in kinds.items()
        }
        for name, kinds in answers_of.items()
    }


def _share(answers: Sequence[bool | None]) -> float | None:
    judged = [answer for answer in answers if answer is not None]
    return sum(judged) / len(judged) if judged else None


def _claims(
    by: str, two_layers: Mapping[str, Answers], one_layer: Mapping[str, Answers]
) -> list[dict[str, Any]]:
    """The paper's claim, judged on each question with each flow on the same views.

    ``confirmed``: with two layers of means at least as many answers are right. ``p`` is that of
    McNemar's exact test: how likely so large a difference is by chance.
    """
    claims = []
    for kind, answers in two_layers.items():
        for what in answers:
            pairs = zip(answers[what], one_layer[kind][what], strict=True)
            both = [(two, one) for two, one in pairs if two is not None and one is not None]
            only_two = sum(two and not one for two, one in both)
            only_one = sum(one and not two for two, one in both)
            claims.append(
                {
                    "by": by,
                    "flow": kind,
                    "what": what,
                    "views": len(both),
                    "two_layers_right": sum(two for two, _ in both),
                    "one_layer_right": sum(one for _, one in both),
                    "differ": only_two + only_one,
                    "p": round(mcnemar_exact(only_two, only_one), 4),
                    "confirmed": only_two >= only_one,
                }
            )
    return claims


def _perceived(
    params: Offis.Params,
    seen: Sequence[tuple[FlowField, Twist]],
    samples: Sequence[PerceptionSample],
) -> Answers:
    offis = Offis(RobotModel(), params)
    checked = [
        check_percept(offis.perceive(flow, twist), sample.truth)
        for (flow, twist), sample in zip(seen, samples, strict=True)
    ]
    names = ("quadrant", "distance", "situation")
    return {name: [answer[k] for answer in checked] for k, name in enumerate(names)}


def _features(flow: FlowField, layers: int, variances: bool) -> Array:
    """Logarithms of the deepest layer's means of |u| and |v| [px], as features.

    With ``variances`` the standard deviations [px] come after the means.
    """
    pyramid = Pyramid(flow.shape, layers)
    measured = (flow.confidence > 0.0).astype(np.float64)
    size = np.where(measured[..., None] > 0.0, np.abs(flow.vectors), 0.0)
    values = np.stack([size[..., 0], size[..., 0], size[..., 1]])
    regions = pyramid.statistics(Channels(values, np.stack([measured] * 3), measured))
    first, count = (4, 16) if layers == 2 else (0, 4)  # of the deepest layer
    deepest = slice(first, first + count)
    columns = [regions.mu_u[deepest], regions.mu_v[deepest]]
    if variances:
        columns += [np.sqrt(regions.var_u[deepest]), np.sqrt(regions.var_v[deepest])]
    # logarithms turn the ratios between regions, which the paper's rules use, into differences
    return np.asarray(np.log(np.concatenate(columns) + 0.05))


def _classified(features: Sequence[Array], samples: Sequence[PerceptionSample]) -> Answers:
    """The classifier's answers for nearest quadrant and, where it is clear, situation."""
    table = np.stack(features)
    quadrant = [QUADRANTS[int(np.argmax(sample.truth.nearness))] for sample in samples]
    quadrants = _cross_validated(table, quadrant)
    clear = [sample for sample in samples if sample.truth.clear]
    chosen = np.array([sample.truth.clear for sample in samples])
    fronts = _cross_validated(table[chosen], [sample.truth.situations[0] for sample in clear])
    return {
        "quadrant": [
            name in sample.truth.possible for name, sample in zip(quadrants, samples, strict=True)
        ],
        "situation": [
            name in sample.truth.situations for name, sample in zip(fronts, clear, strict=True)
        ],
    }


def _cross_validated(table: Array, labels: Sequence[str]) -> list[str]:
    """The label of each row by a linear discriminant trained on the other folds."""
    names = np.array(labels, np.str_)
    inferred, fold = np.full_like(names, ""), np.arange(len(names)) % _FOLDS
    for k in range(min(_FOLDS, len(names))):
        test = fold == k
        if not test.all():
            inferred[test] = _discriminate(table[~test], names[~test], table[test])
    return [str(label) for label in inferred]


def _discriminate(training: Array, labels: npt.ArrayLike, test: Array) -> npt.NDArray[np.str_]:
    """The labels of ``test`` rows by linear discriminant analysis with a ridged covariance."""
    classes, which = np.unique(np.asarray(labels, np.str_), return_inverse=True)
    centre, spread = training.mean(axis=0), training.std(axis=0) + 1e-9
    x, y = (training - centre) / spread, (test - centre) / spread
    means = np.stack([x[which == c].mean(axis=0) for c in range(len(classes))])
    within = x - means[which]
    covariance = within.T @ within / len(x) + _RIDGE * np.eye(x.shape[1])
    weights = np.linalg.solve(covariance, means.T)
    prior = np.log(np.bincount(which, minlength=len(classes)) / len(x))
    scores = y @ weights - 0.5 * (means * weights.T).sum(axis=1) + prior
    return np.asarray(classes[scores.argmax(axis=1)])
