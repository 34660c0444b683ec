"""The trials of a study: each drives the training runs with other settings of the stack."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import fmean

import optuna
from optuna.trial import FrozenTrial, Trial, TrialState

from navfw.errors import RuleBaseError
from navfw.suite.case import Case
from navfw.suite.run_table import RunRow
from navfw.tune.objectives import Objectives
from navfw.tune.search_space import SearchSpace

Drive = Callable[[Sequence[Case]], Iterator[RunRow]]
"""Drives cases, and yields a row for each, in their order."""

SETTINGS = "settings"
"""User attribute of a trial: the values of the stack that it took, by path."""


def sampler_and_pruner(seed: int) -> tuple[optuna.samplers.BaseSampler, optuna.pruners.BasePruner]:
    """TPE over all coordinates together; Wilcoxon's test against the best trial, run by run."""
    with warnings.catch_warnings():  # of an interface that may change; the version is pinned
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True)
        pruner = optuna.pruners.WilcoxonPruner(p_threshold=0.1, n_startup_steps=4)
    return sampler, pruner


def finished(study: optuna.Study) -> list[FrozenTrial]:
    """The trials that count: complete, or pruned."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))


def best_of(study: optuna.Study) -> FrozenTrial | None:
    """The complete trial with the best score; None without any."""
    complete = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    return max(complete, key=lambda trial: trial.value or 0.0, default=None)


def run_trials(
    study: optuna.Study,
    space: SearchSpace,
    cases: Sequence[Case],
    objectives: Objectives,
    drive: Drive,
    trials: int,
    on_trial: Callable[[FrozenTrial], None] | None = None,
) -> None:
    """Add trials until ``trials`` are finished; the first one is the stack as it is.

    A trial whose runs are so far worse than the same runs of the best trial is pruned. A trial that
    an interruption leaves unfinished is not counted.

    Raises:
        KeyboardInterrupt: of the user; all finished trials are in the study.

    """
    for stale in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study.tell(stale.number, state=TrialState.FAIL)
    if not finished(study):
        study.enqueue_trial(space.start(), skip_if_exists=True)
    while len(finished(study)) < trials:
        trial = study.ask()
        _try(study, trial, space, cases, objectives, drive)
        if on_trial is not None:
            on_trial(study.trials[trial.number])


def _try(
    study: optuna.Study,
    trial: Trial,
    space: SearchSpace,
    cases: Sequence[Case],
    objectives: Objectives,
    drive: Drive,
) -> None:
    try:
        settings = space.settings(trial)
    except RuleBaseError as error:
        trial.set_user_attr("refused", str(error).splitlines()[0])
        study.tell(trial, state=TrialState.PRUNED)
        return
    trial.set_user_attr(SETTINGS, settings)
    rows: list[RunRow] = []
    for row in drive(with_settings(cases, space, settings)):
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


def with_settings(
    cases: Sequence[Case], space: SearchSpace, settings: Mapping[str, object]
) -> list[Case]:
    """``cases`` with these values of the stack, over those that the suite sets."""
    changes = space.overrides(settings)
    return [replace(case, overrides=(*case.overrides, *changes)) for case in cases]
