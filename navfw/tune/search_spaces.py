"""The search space: bounded numbers of plugins, and break points of rule bases.

Each is a coordinate: it suggests a value to a trial, and returns the settings of the stack for it.
Break points keep their order: the search varies factors by which the gaps between them change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import annotated_types
import numpy as np

from navfw.config.overrides import parse_override
from navfw.errors import ConfigError, UnknownNameError
from navfw.fuzzy import RuleBase, Variable
from navfw.fuzzy.coverage import check_coverage
from navfw.fuzzy.membership import Shape, Trapezoid
from navfw.mofis.rules import RuledBehavior, RuledComposite
from navfw.robot import RobotModel
from navfw.stack.stackfile import Choice, StackConfig

if TYPE_CHECKING:
    from optuna.trial import BaseTrial

_GAP_FACTOR = 2.0
"""Largest factor by which a gap between two break points changes relative to the others."""


@dataclass(frozen=True)
class TunedNumber:
    """A number of a plugin with both bounds, at ``path``; ``now`` is its value in the stack."""

    path: str
    low: float
    high: float
    whole: bool
    now: float

    def start(self) -> dict[str, float]:
        """Return the number's present value in the stack, by the name of Optuna's parameter."""
        return {self.path: self.now}

    def suggest(self, trial: BaseTrial) -> float:
        """Let ``trial`` choose a number within the bounds."""
        if self.whole:
            return trial.suggest_int(self.path, round(self.low), round(self.high))
        return trial.suggest_float(self.path, self.low, self.high)


@dataclass(frozen=True)
class BreakPoints:
    """The break points of an input of a rule base that lie within its range.

    Terms that share a break point continue to share it, so that adjacent terms stay adjacent.
    """

    path: str
    base: RuleBase
    variable: Variable

    @property
    def points(self) -> list[float]:
        """The break points, ascending, without those at the ends of the range and beyond."""
        low, high = self.variable.low, self.variable.high
        corners = {c for shape in self._shapes().values() for c in shape.corners}
        return sorted(c for c in corners if low < c < high)

    def _shapes(self) -> dict[str, Shape]:
        terms = self.variable.terms.items()
        return {name: shape for name, shape in terms if isinstance(shape, Trapezoid)}

    def _names(self) -> list[str]:
        return [f"{self.path}[{index}]" for index in range(len(self.points) + 1)]

    def start(self) -> dict[str, float]:
        """Factors of 1 for all gaps: the rule base as it is."""
        return dict.fromkeys(self._names(), 1.0)

    def suggest(self, trial: BaseTrial) -> dict[str, list[float]]:
        """Let ``trial`` choose the gaps; return the corners of each term."""
        low, high = 1.0 / _GAP_FACTOR, _GAP_FACTOR
        return self.moved([trial.suggest_float(n, low, high, log=True) for n in self._names()])

    def moved(self, factors: Sequence[float]) -> dict[str, list[float]]:
        """Multiply each gap by its factor, scaled to fill the range; return each term's corners.

        Raises:
            RuleBaseError: the rules would not cover their inputs.

        """
        low, high = self.variable.low, self.variable.high
        old = [low, *self.points, high]
        gaps = np.array([b - a for a, b in pairwise(old)]) * factors
        new = low + (high - low) * np.cumsum(gaps) / gaps.sum()
        places = dict(zip(old[1:-1], (round(float(x), 9) for x in new[:-1]), strict=True))
        terms = {
            name: [places.get(corner, corner) for corner in shape.corners]
            for name, shape in self._shapes().items()
        }
        shapes = {name: Trapezoid(tuple(corners)) for name, corners in terms.items()}
        changed = replace(self.variable, terms={**self.variable.terms, **shapes})
        inputs = {**self.base.inputs, self.variable.name: changed}
        check_coverage(replace(self.base, inputs=inputs))
        return terms


@dataclass(frozen=True)
class TunedVariant:
    """Several values at ``path``, each as the text of ``--set``; a search starts with the first."""

    path: str
    texts: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> TunedVariant:
        """Parse ``PATH=A|B``.

        Raises:
            ConfigError: there are not at least two values, or they are malformed.

        """
        path, _, values = text.partition("=")
        texts = tuple(value.strip() for value in values.split("|"))
        if len(set(texts)) < 2:
            what = f"expected PATH=A|B with two values or more, got {text!r}"
            raise ConfigError(what, key="--variant")
        for value in texts:
            parse_override(f"{path}={value}")
        return cls(path, texts)

    def start(self) -> dict[str, str]:
        """Return the first value."""
        return {self.path: self.texts[0]}

    def suggest(self, trial: BaseTrial) -> object:
        """Let ``trial`` choose one of the values."""
        chosen = trial.suggest_categorical(self.path, self.texts)
        return parse_override(f"{self.path}={chosen}").value


Coordinate = TunedNumber | BreakPoints | TunedVariant


@dataclass(frozen=True)
class SearchSpace:
    """All coordinates, in the order in which they were requested."""

    coordinates: tuple[Coordinate, ...]

    def start(self) -> dict[str, float | str]:
        """Return the stack as it is, with the first of each variant, as parameters of a trial."""
        return {k: v for coordinate in self.coordinates for k, v in coordinate.start().items()}

    def settings(self, trial: BaseTrial) -> dict[str, object]:
        """Let ``trial`` choose all values; return them by path, as for ``--set``."""
        return {c.path: c.suggest(trial) for c in self.coordinates}


def search_space(
    config: StackConfig,
    parameters: Sequence[str],
    rules: Sequence[str],
    robot: RobotModel,
    variants: Sequence[str] = (),
) -> SearchSpace:
    """Find the coordinates of the ``parameters``, ``rules`` and ``variants`` of a stack.

    A parameter is ``PLUGIN.NAME``, or ``PLUGIN`` for all its bounded numbers; rules are ``PLUGIN``
    or ``PLUGIN.INPUT``; a variant is ``PATH=A|B``.

    Raises:
        UnknownNameError: the stack has no such plugin, parameter or input.
        ConfigError: a parameter is not a number with both bounds, or a plugin has no rule base.

    """
    plugins = {choice.name: choice for choice in config.stages.values()} | dict(config.behaviors)
    coordinates: dict[str, Coordinate] = {}
    for text in parameters:
        name, _, parameter = text.partition(".")
        numbers = _numbers(name, _plugin(plugins, name, "--param"))
        if parameter and text not in numbers:
            fields = plugins[name].plugin.Params.model_fields
            if parameter not in fields:
                raise UnknownNameError(f"parameter of {name}", parameter, fields, key="--param")
            tunable = ", ".join(numbers) or "none"
            what = f"{text} is no number with both bounds; those of {name}: {tunable}"
            raise ConfigError(what, key="--param")
        coordinates |= {p: n for p, n in numbers.items() if not parameter or p == text}
    for text in rules:
        name, _, wanted = text.partition(".")
        inputs = _break_points(name, _plugin(plugins, name, "--rules"), robot)
        if wanted and wanted not in inputs:
            raise UnknownNameError(f"input of {name}", wanted, inputs, key="--rules")
        coordinates |= {c.path: c for key, c in inputs.items() if not wanted or key == wanted}
    coordinates |= {c.path: c for c in map(TunedVariant.parse, variants)}
    if not coordinates:
        raise ConfigError("nothing to tune: name a plugin with bounded numbers", key="--param")
    return SearchSpace(tuple(coordinates.values()))


def _plugin(plugins: Mapping[str, Choice], name: str, key: str) -> Choice:
    if name not in plugins:
        raise UnknownNameError("plugin of this stack", name, plugins, key=key)
    return plugins[name]


def _numbers(name: str, choice: Choice) -> dict[str, Coordinate]:
    """Return the numbers of a plugin's parameters that have both bounds, by path."""
    numbers: dict[str, Coordinate] = {}
    for field, info in choice.plugin.Params.model_fields.items():
        if info.annotation not in (int, float):
            continue
        low = high = None
        for item in info.metadata:
            match item:
                case annotated_types.Ge(ge=bound) | annotated_types.Gt(gt=bound):
                    low = float(bound)  # type: ignore[arg-type]
                case annotated_types.Le(le=bound) | annotated_types.Lt(lt=bound):
                    high = float(bound)  # type: ignore[arg-type]
        if low is None or high is None:
            continue
        inset = 1e-3 * (high - low) * (info.annotation is float)  # bounds may be excluded
        now = float(getattr(choice.params, field))
        ends = min(low + inset, now), max(high - inset, now)
        numbers[f"{name}.{field}"] = TunedNumber(
            f"{name}.{field}", *ends, info.annotation is int, now
        )
    return numbers


def _break_points(name: str, choice: Choice, robot: RobotModel) -> dict[str, BreakPoints]:
    """Return the inputs of a plugin's rule base that have break points, by name."""
    made = choice.plugin(robot, choice.params)
    if not isinstance(made, RuledBehavior | RuledComposite):
        raise ConfigError(f"{name} has no rule base of its own", key="--rules")
    base = made.rules.base
    inputs = {
        variable.name: BreakPoints(f"{name}.terms.{variable.name}", base, variable)
        for variable in base.inputs.values()
    }
    return {key: points for key, points in inputs.items() if points.points}
