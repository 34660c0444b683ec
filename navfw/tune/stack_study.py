"""One tuning from names to files: the study of a suite with a stack, and its validation."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from navfw.config.lookup import find
from navfw.errors import InputError
from navfw.plugins import Registry
from navfw.robot import RobotModel
from navfw.stack.stackfile import StackConfig, load_stack
from navfw.suite.case import Case
from navfw.suite.run_table import RunRow
from navfw.suite.suite_plan import SuitePlan, plan_runs
from navfw.suite.suitefile import Suite, parse_seeds
from navfw.tune.search_spaces import SearchSpace, search_space
from navfw.tune.study_folder import StudyFolder
from navfw.tune.trials import Drive, Objectives, best_of, run_trials, with_settings

_RESAMPLES = 9999
"""Number of bootstrap samples."""


def validated_difference(
    before: Sequence[RunRow], after: Sequence[RunRow], objectives: Objectives
) -> dict[str, Any]:
    """The mean difference of the score, tuned minus untuned, over the same runs in the same order.

    ``interval`` is its 95 % bootstrap interval over runs (percentiles). ``better`` is whether all
    of it is above 0.
    """
    from scipy.stats import bootstrap

    scores = [[objectives.score(row) for row in rows] for rows in (before, after)]
    differences = np.subtract(scores[1], scores[0])
    low = high = float(differences.mean())
    if np.ptp(differences) > 0.0:
        interval = bootstrap(
            (differences,),
            np.mean,
            n_resamples=_RESAMPLES,
            method="percentile",
            rng=np.random.default_rng(0),
        ).confidence_interval
        low, high = float(interval.low), float(interval.high)
    return {
        "runs": len(differences),
        "score_before": fmean(scores[0]),
        "score_after": fmean(scores[1]),
        "difference": float(differences.mean()),
        "interval": [low, high],
        "better": low > 0.0,
        "before": objectives.parts(before),
        "after": objectives.parts(after),
    }


@dataclass(frozen=True)
class StackStudy:
    """What a study searches, and on which runs: ``training`` and ``validation`` share no seed."""

    stack: str
    config: StackConfig
    space: SearchSpace
    objectives: Objectives
    training: tuple[Case, ...]
    validation: tuple[Case, ...]
    identity: dict[str, Any]
    registry: Registry

    @classmethod
    def plan(
        cls,
        suite: Suite,
        stack: str,
        registry: Registry,
        *,
        seeds: str,
        validate: str,
        parameters: tuple[str, ...],
        rules: tuple[str, ...],
        objectives: tuple[str, ...],
    ) -> StackStudy:
        """Check everything before the first trial.

        Without ``parameters`` and ``rules`` all bounded numbers of the stack's behaviours are
        tuned.

        Raises:
            InputError: a name, a range of seeds or an objective is wrong, or the seeds overlap.

        """
        first, second = parse_seeds(seeds), parse_seeds(validate)
        if set(first) & set(second):
            what = f"{validate} has seeds of the training, {seeds}; choose others"
            raise InputError(what, key="--validate")
        scores = Objectives.parse(objectives)
        config = load_stack(find("stack", stack), registry)
        wanted = parameters if parameters or rules else tuple(config.behaviors)
        space = search_space(config, wanted, rules, RobotModel())
        training = plan_runs(suite, first, registry, stacks=[stack])
        identity = {
            "suite": suite.name,
            "content": _fingerprint(training),
            "stack": stack,
            "seeds": seeds,
            "objective": scores.weights,
            "parameters": [coordinate.path for coordinate in space.coordinates],
        }
        validation = plan_runs(suite, second, registry, stacks=[stack])
        runs = training.cases, validation.cases
        return cls(stack, config, space, scores, *runs, identity, registry)

    @property
    def cases(self) -> tuple[Case, ...]:
        """The runs of training and validation, with the stack as it is."""
        return self.training + self.validation

    def run(
        self,
        folder: StudyFolder,
        drive: Drive,
        trials: int,
        *,
        resume: bool = False,
        seed: int = 0,
        on_trial: Callable[[FrozenTrial], None] | None = None,
    ) -> dict[str, Any]:
        """Tune up to ``trials`` trials, validate the best one, write all files; the validation.

        Raises:
            InputError: the folder has a study of other runs, or cannot be written.
            KeyboardInterrupt: of the user; ``resume`` goes on with the finished trials.

        """
        study = folder.open(self.identity, resume=resume, seed=seed)
        run_trials(
            study, self.space, self.training, self.objectives, drive, trials, on_trial=on_trial
        )
        folder.write_trials(study)
        best = best_of(study)
        if best is None:
            raise InputError("no trial has been completed; give more --trials", file=folder.path)
        settings = folder.settings_of(best)
        changes = self.space.overrides(settings)
        tuned = load_stack(find("stack", self.stack), self.registry, changes)
        folder.write_stack(
            tuned, f"{self.stack}, tuned on the suite {self.identity['suite']} in {trials} trials"
        )
        drawn = folder.write_importance(study)
        before = list(drive(self.validation))
        after = list(drive(with_settings(self.validation, self.space, settings)))
        validation = {
            **validated_difference(before, after, self.objectives),
            "trial": best.number,
            "training_score": best.value,
            "settings": settings,
            "stack": str(folder.stack),
            "importance": drawn,
        }
        folder.write_validation(validation)
        return validation


def _fingerprint(plan: SuitePlan) -> str:
    """A hash of all that the runs of a suite depend on, but for seeds."""
    return hashlib.sha256(json.dumps(dict(plan.content), sort_keys=True).encode()).hexdigest()
