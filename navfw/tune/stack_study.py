"""A tuning from names to files: the study of a suite with a stack, its folder, its validation."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import optuna
from optuna.exceptions import StorageInternalError
from optuna.trial import FrozenTrial
from sqlalchemy.exc import SQLAlchemyError

from navfw.config.input_file import is_file
from navfw.config.lookup import find
from navfw.config.overrides import override_texts
from navfw.config.yaml_text import write_yaml_text
from navfw.errors import ConfigError, InputError
from navfw.plugins import Registry
from navfw.process.atomic import atomic_file, write_text, writing
from navfw.recording.provenance import fingerprint
from navfw.robot import RobotModel
from navfw.stack.stackfile import StackConfig, load_stack
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.suite_plan import plan_runs
from navfw.suite.suitefile import Suite, parse_seeds
from navfw.tune.search_spaces import SearchSpace, TunedVariant, search_space
from navfw.tune.trials import (
    SETTINGS,
    Drive,
    Objectives,
    finished,
    run_trials,
    sampler_and_pruner,
    with_settings,
)

_IDENTITY = "identity"


def open_study(
    folder: Path, identity: Mapping[str, Any], *, resume: bool, seed: int
) -> optuna.Study:
    """Create a study in ``folder``, or open the existing one to resume it (``study.db``).

    ``identity`` has everything its scores depend on, by name: suite, seeds, stack and so on.

    Raises:
        InputError: there is a study already, or none to resume, or one of other runs, or the
            folder cannot be written.
        ConfigError: the file is not a study.

    """
    database = folder / "study.db"
    exists = is_file(database)
    if exists and not resume:
        what = "there is a study in it; --resume goes on with it, or choose another --out"
        raise InputError(what, file=folder)
    if resume and not exists:
        raise InputError("there is no study to resume; leave out --resume", file=folder)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler, pruner = sampler_and_pruner(seed)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    try:
        study = optuna.create_study(
            storage=f"sqlite:///{database.absolute()}",
            study_name="navfw",
            direction="maximize",
            sampler=sampler,
            pruner=pruner,
            load_if_exists=True,
        )
        if _IDENTITY not in study.user_attrs:  # new, or killed before it had one
            study.set_user_attr(_IDENTITY, dict(identity))
    except (SQLAlchemyError, StorageInternalError, RuntimeError) as error:
        what = f"expected a study of navfw tune: {str(error).splitlines()[0]}"
        raise ConfigError(what, file=database) from None
    stored = study.user_attrs[_IDENTITY]
    for name, value in identity.items():
        if stored.get(name) != value:
            what = f"the study in it has another {name}: {_short(stored.get(name))}, not"
            what += f" {_short(value)}; give the same options, or another --out"
            raise InputError(what, file=folder)
    return study


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _write_trials(file: Path, study: optuna.Study) -> None:
    """The table of trials: state, score, its parts, and the value of each coordinate."""
    trials = finished(study)
    names = sorted({name for trial in trials for name in trial.params})
    scored = sorted({name for t in trials for name in t.user_attrs.get("scores", {})})
    table = [["trial", "state", "runs", "score", *scored, *names]]
    for trial in trials:
        scores = trial.user_attrs.get("scores", {})
        head = [trial.number, trial.state.name.lower(), trial.user_attrs.get("runs", 0)]
        values = [trial.params.get(name, "") for name in names]
        score = "" if trial.value is None else trial.value
        row = [*head, score, *(scores.get(name, "") for name in scored), *values]
        table.append([str(value) for value in row])
    write_text(file, table)


def _write_importance(file: Path, study: optuna.Study) -> bool:
    """Return a bar for each coordinate's importance; False with too few trials to tell."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # one says that there are too few trials
            shares = optuna.importance.get_param_importances(study)
    except (UserWarning, ValueError, RuntimeError):
        return False
    figure, axes = plt.subplots(figsize=(7.0, 1.0 + 0.3 * len(shares)), layout="constrained")
    names = list(shares)[::-1]
    axes.barh(names, [shares[name] for name in names])
    axes.set_xlabel("share of the score's variation (PED-ANOVA)")
    with atomic_file(file) as stream:
        figure.savefig(stream, format="png", dpi=120)
    plt.close(figure)
    return True


_RESAMPLES = 9999
"""Number of bootstrap samples."""


def validated_difference(
    before: Sequence[RunRow], after: Sequence[RunRow], objectives: Objectives
) -> dict[str, Any]:
    """Mean difference of the score, tuned minus untuned, over the same runs in the same order.

    ``interval`` is its 95 % bootstrap interval over runs (percentiles). ``better`` is whether the
    whole interval is above 0.
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
    """What a study searches, and its runs: ``training`` and ``validation`` share no seed."""

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
        variants: tuple[str, ...] = (),
    ) -> StackStudy:
        """Check everything before the first trial.

        Without ``parameters``, ``rules`` and ``variants`` all bounded numbers of the stack's
        behaviours are tuned.

        Raises:
            InputError: a name, a range of seeds or an objective is wrong, or the seeds overlap.

        """
        first, second = parse_seeds(seeds), parse_seeds(validate)
        if set(first) & set(second):
            what = f"{validate} has seeds of the training, {seeds}; choose others"
            raise InputError(what, key="--validate")
        scores = Objectives.parse(objectives)
        config = load_stack(find("stack", stack), registry)
        wanted = parameters if parameters or rules or variants else tuple(config.behaviors)
        space = search_space(config, wanted, rules, RobotModel(), variants)
        for variant in (c for c in space.coordinates if isinstance(c, TunedVariant)):
            for text in variant.texts:
                load_stack(find("stack", stack), registry, [f"{variant.path}={text}"])
        training = plan_runs(suite, first, registry, stacks=[stack])
        identity = {
            "suite": suite.name,
            "content": fingerprint(dict(training.content)),
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
        folder: Path,
        drive: Drive,
        trials: int,
        *,
        resume: bool = False,
        seed: int = 0,
        on_trial: Callable[[FrozenTrial], None] | None = None,
        minutes: float = math.inf,
    ) -> dict[str, Any]:
        """Tune up to ``trials`` trials or ``minutes``, validate the best one, write all files.

        Returns the content of ``validation.json``.

        Raises:
            InputError: the folder has a study of other runs, or cannot be written.
            KeyboardInterrupt: the user interrupted; ``resume`` continues from the finished trials.

        """
        study = open_study(folder, self.identity, resume=resume, seed=seed)
        runs = (self.training, self.objectives, drive)
        run_trials(study, self.space, *runs, trials, on_trial=on_trial, minutes=minutes)
        _write_trials(folder / "trials.csv", study)
        try:
            best = study.best_trial
        except ValueError:
            what = "no trial has been completed; give more --trials"
            raise InputError(what, file=folder) from None
        settings = dict(best.user_attrs[SETTINGS])
        changes, stack = override_texts(settings), folder / "stack.yaml"
        tuned = load_stack(find("stack", self.stack), self.registry, changes)
        about = f"tuned on the suite {self.identity['suite']} in {len(finished(study))} trials"
        described = {"description": f"{self.stack}, {about}", **tuned.as_data()}
        write_text(stack, write_yaml_text(described))
        drawn = _write_importance(folder / "importance.png", study)
        before = list(drive(self.validation))
        after = list(drive(with_settings(self.validation, settings)))
        validation = {
            **validated_difference(before, after, self.objectives),
            "trial": best.number,
            "training_score": best.value,
            "settings": settings,
            "stack": str(stack),
            "importance": drawn,
        }
        write_text(folder / "validation.json", json.dumps(validation, indent=2) + "\n")
        return validation
