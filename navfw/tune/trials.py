"""Drives the runs of a trial with an engine, a few at a time, so that the trial can be pruned."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import optuna
from optuna.trial import FrozenTrial, TrialState

from navfw.config.overrides import override_texts
from navfw.errors import InputError, RuleBaseError, UnknownNameError
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.suite_run import Engine, answered_row
from navfw.tune.search_spaces import SearchSpace

CLEAR = 0.5
"""Clearance [m] above which the score does not increase."""

SCORES: Mapping[str, Callable[[RunRow], float]] = {
    "success": lambda row: float(row.succeeded),
    "spl": lambda row: row.spl or 0.0,
    "sct": lambda row: row.sct or 0.0,
    "clearance": lambda row: min(max(row.clearance_p05_m or 0.0, 0.0) / CLEAR, 1.0),
}
"""The scores of a run, in [0, 1]; ``clearance`` is its 5th percentile, in units of ``CLEAR``."""


@dataclass(frozen=True)
class Objectives:
    """Weights of the scores, summing to 1."""

    weights: dict[str, float]

    @classmethod
    def parse(cls, texts: Sequence[str]) -> Objectives:
        """Parse ``NAME`` or ``NAME=WEIGHT``.

        >>> Objectives.parse(["success=3", "spl"]).weights
        {'success': 0.75, 'spl': 0.25}

        Raises:
            InputError: there is no such score, or a weight is not a positive number.

        """
        weights: dict[str, float] = {}
        for text in texts:
            name, equals, number = text.partition("=")
            if name not in SCORES:
                raise UnknownNameError("objective", name, SCORES, key="--objective")
            try:
                weight = float(number) if equals else 1.0
            except ValueError:
                weight = 0.0
            if not 0.0 < weight < 1e6:
                what = f"expected NAME=WEIGHT with a positive weight, got {text!r}"
                raise InputError(what, key="--objective")
            weights[name] = weight
        total = sum(weights.values())
        return cls({name: weight / total for name, weight in weights.items()})

    def score(self, row: RunRow) -> float:
        """Return the score of a run, in [0, 1]."""
        return sum(weight * SCORES[name](row) for name, weight in self.weights.items())

    def parts(self, rows: Sequence[RunRow]) -> dict[str, float]:
        """Return the mean of each score over ``rows``."""
        return {name: sum(SCORES[name](row) for row in rows) / len(rows) for name in self.weights}


Drive = Callable[[Sequence[Case]], Iterator[RunRow]]
"""A function that drives cases, and yields a row for each, in their order."""

SETTINGS = "settings"
"""User attribute of a trial: the values of the stack that it chose, by path."""


def sampler_and_pruner(seed: int) -> tuple[optuna.samplers.BaseSampler, optuna.pruners.BasePruner]:
    """TPE over all coordinates jointly; Wilcoxon's test against the best trial, run by run."""
    with warnings.catch_warnings():  # of an interface that may change; the version is pinned
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True)
        pruner = optuna.pruners.WilcoxonPruner(p_threshold=0.1, n_startup_steps=4)
    return sampler, pruner


def finished(study: optuna.Study) -> list[FrozenTrial]:
    """Return the trials that count: complete or pruned ones."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def run_trials(
    study: optuna.Study,
    space: SearchSpace,
    cases: Sequence[Case],
    objectives: Objectives,
    drive: Drive,
    trials: int,
    on_trial: Callable[[FrozenTrial], None] | None = None,
    minutes: float = math.inf,
) -> None:
    """Add trials until ``trials`` are finished; the first one is the stack as it is.

    After ``minutes`` of wall-clock time no further trial is begun, except the first. A trial whose
    runs so far are worse than the same runs of the best trial is pruned. A trial that an
    interruption leaves unfinished is not counted.

    Raises:
        KeyboardInterrupt: the user interrupted; all finished trials are in the study.

    """
    for stale in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study.tell(stale.number, state=TrialState.FAIL)
    if not finished(study):
        study.enqueue_trial(space.start(), skip_if_exists=True)
    end = time.monotonic() + 60.0 * minutes
    while (done := len(finished(study))) < trials and (done == 0 or time.monotonic() < end):
        trial = study.ask()
        try:
            settings = space.settings(trial)
        except RuleBaseError as error:
            trial.set_user_attr("refused", str(error).splitlines()[0])
            study.tell(trial, state=TrialState.PRUNED)
        else:
            trial.set_user_attr(SETTINGS, settings)
            rows: list[RunRow] = []
            for row in drive(with_settings(cases, settings)):
                trial.report(objectives.score(row), len(rows))
                rows.append(row)
                if len(rows) < len(cases) and trial.should_prune():
                    break
            trial.set_user_attr("runs", len(rows))
            trial.set_user_attr("scores", objectives.parts(rows))
            if len(rows) < len(cases):
                study.tell(trial, state=TrialState.PRUNED)
            else:
                study.tell(trial, fmean(objectives.score(row) for row in rows))
        if on_trial is not None:
            on_trial(study.trials[trial.number])


def with_settings(cases: Sequence[Case], settings: Mapping[str, object]) -> list[Case]:
    """Return ``cases`` with these settings of the stack, which override those of the suite."""
    changes = override_texts(settings)
    return [replace(case, overrides=(*case.overrides, *changes)) for case in cases]


def driver(engine: Engine) -> Drive:
    """Make a ``Drive`` from ``engine``, with as many runs at the same time as its capacity.

    A run whose process died is driven again, once; then it counts as a fault.
    """

    def drive(cases: Sequence[Case]) -> Iterator[RunRow]:
        first = 0
        while first < len(cases):
            batch = cases[first : first + engine.capacity]
            first += len(batch)
            rows = _rows(engine, batch)
            rows |= _rows(engine, [case for case in batch if rows[case.index].repeatable])
            yield from (rows[case.index] for case in batch)

    return drive


def _rows(engine: Engine, cases: Sequence[Case]) -> dict[int, RunRow]:
    return {case.index: answered_row(case, result) for case, result in engine.run(cases)}
