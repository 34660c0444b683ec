"""The folder of a study: Optuna's SQLite file, and what is written from it."""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import optuna
from ruamel.yaml import YAML
from sqlalchemy.exc import SQLAlchemyError

from navfw.config.input_file import is_file
from navfw.errors import ConfigError, InputError
from navfw.process.atomic import atomic_file, write_text
from navfw.stack.stackfile import StackConfig
from navfw.tune.trials import SETTINGS, finished, sampler_and_pruner

_NAME = "navfw"
_IDENTITY = "identity"


@dataclass(frozen=True)
class StudyFolder:
    """``study.db``, ``trials.csv``, ``stack.yaml``, ``importance.png``, ``validation.json``."""

    path: Path

    @property
    def database(self) -> Path:
        """Optuna's SQLite file."""
        return self.path / "study.db"

    @property
    def stack(self) -> Path:
        """The stack file with the best parameters."""
        return self.path / "stack.yaml"

    def created(self) -> Path:
        """The folder, made if there is none.

        Raises:
            InputError: it cannot be made.

        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=self.path) from None
        return self.path

    def open(self, identity: Mapping[str, Any], *, resume: bool, seed: int) -> optuna.Study:
        """A new study, or the one in the folder.

        ``identity`` has what its scores depend on, by name: suite, seeds, stack and so on.

        Raises:
            InputError: there is a study already, or none to resume, or one of other runs, or the
                folder cannot be written.
            ConfigError: the file is no study.

        """
        exists = is_file(self.database)
        if exists and not resume:
            what = "there is a study in it; --resume goes on with it, or choose another --out"
            raise InputError(what, file=self.path)
        if resume and not exists:
            raise InputError("there is no study to resume; leave out --resume", file=self.path)
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        sampler, pruner = sampler_and_pruner(seed)
        self.created()
        try:
            study = optuna.create_study(
                storage=f"sqlite:///{self.database.absolute()}",
                study_name=_NAME,
                direction="maximize",
                sampler=sampler,
                pruner=pruner,
                load_if_exists=True,
            )
        except (SQLAlchemyError, RuntimeError) as error:
            what = f"expected a study of navfw tune: {str(error).splitlines()[0]}"
            raise ConfigError(what, file=self.database) from None
        if exists:
            self._check(study.user_attrs.get(_IDENTITY, {}), identity)
        else:
            study.set_user_attr(_IDENTITY, dict(identity))
        return study

    def _check(self, stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
        other = [name for name in wanted if stored.get(name) != wanted[name]]
        if other:
            name = other[0]
            what = f"the study in it has another {name}: {_short(stored.get(name))}, not"
            what += f" {_short(wanted[name])}; give the same options, or another --out"
            raise InputError(what, file=self.path)

    def write_trials(self, study: optuna.Study) -> None:
        """The table of trials: state, score, its parts, and the value of each coordinate."""
        trials = finished(study)
        names = sorted({name for trial in trials for name in trial.params})
        parts = sorted({name for t in trials for name in t.user_attrs.get("scores", {})})
        table = [["trial", "state", "runs", "score", *parts, *names]]
        for trial in trials:
            scores = trial.user_attrs.get("scores", {})
            head = [trial.number, trial.state.name.lower(), trial.user_attrs.get("runs", 0)]
            values = [trial.params.get(name, "") for name in names]
            score = "" if trial.value is None else trial.value
            row = [*head, score, *(scores.get(part, "") for part in parts), *values]
            table.append([str(value) for value in row])
        write_text(self.path / "trials.csv", table)

    def write_stack(self, config: StackConfig, description: str) -> None:
        """A stack file with all values of ``config``."""
        text = io.StringIO()
        yaml = YAML()
        yaml.default_flow_style = None
        yaml.width = 100
        yaml.dump({"description": description, **config.as_data()}, text)
        write_text(self.stack, text.getvalue())

    def write_importance(self, study: optuna.Study) -> bool:
        """A bar for each coordinate's importance; False with too few trials to tell."""
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
        with atomic_file(self.path / "importance.png") as stream:
            figure.savefig(stream, format="png", dpi=120)
        plt.close(figure)
        return True

    def write_validation(self, validation: Mapping[str, Any]) -> None:
        """The comparison on validation seeds."""
        write_text(self.path / "validation.json", json.dumps(dict(validation), indent=2) + "\n")

    def settings_of(self, trial: optuna.trial.FrozenTrial) -> dict[str, object]:
        """The values of the stack that a trial took, by path."""
        return dict(trial.user_attrs[SETTINGS])


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
