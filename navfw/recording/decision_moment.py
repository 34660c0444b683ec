"""A recorded decision that can be made again, by the real behaviours, with one thing changed."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from navfw.context import Context
from navfw.interfaces import Behavior, Composite
from navfw.mofis.mofis import Mofis
from navfw.mofis.rules import BehaviorRules, RuledBehavior, RuledComposite, Verdict
from navfw.numerics import Array
from navfw.signals import Command, Proposal


@dataclass(frozen=True, slots=True)
class Shift:
    """A change to try: ``amount`` is added to an input, or multiplies a weight."""

    behavior: str
    name: str = ""  # of an input; empty for the weight
    amount: float = 0.0


class _ShiftedRules(BehaviorRules):
    """Rules, one input of which is shifted; ``seen`` are the values before that."""

    def __init__(self, rules: BehaviorRules, shifts: Mapping[str, float]) -> None:
        vars(self).update(vars(rules))
        self._shifts = shifts
        self.seen: dict[str, Array] = {}

    def evaluate(self, **inputs: float) -> Verdict:
        shifted = self._shifted({name: np.asarray(value) for name, value in inputs.items()})
        return super().evaluate(**{name: float(value) for name, value in shifted.items()})

    def evaluate_all(self, **inputs: Array) -> Verdict:
        return super().evaluate_all(**self._shifted(inputs))

    def _shifted(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        result = {}
        for name, value in inputs.items():
            universe = self.base.inputs[name].universe
            self.seen[name] = within = np.clip(value, universe[0], universe[-1])
            result[name] = within + self._shifts.get(name, 0.0)
        return result


@dataclass
class DecisionMoment:
    """A decision that can be made again: the plugins as they were before it, and their context."""

    mofis: Mofis
    context: Context
    behaviors: Mapping[str, Behavior]
    composite: Composite | None
    _raw: dict[str, Proposal] = field(default_factory=dict)
    _weights: Mapping[str, float] = field(default_factory=dict)
    _values: dict[tuple[str, str], Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._weights = self._weigh({})
        for name in self.behaviors:
            self._raw[name] = self._propose(name, {})

    def decide(self, shifts: Sequence[Shift] = ()) -> tuple[Command, dict[str, Proposal]]:
        """Return the command, and the weighted proposals, with ``shifts`` applied."""
        weights, factors = self._weights, dict[str, float]()
        by_plugin: dict[str, dict[str, float]] = {}
        for shift in shifts:
            if shift.name:
                by_plugin.setdefault(shift.behavior, {})[shift.name] = shift.amount
            else:
                factors[shift.behavior] = shift.amount
        if self.composite is not None and self.composite.name in by_plugin:
            weights = self._weigh(by_plugin[self.composite.name])
        proposals = {}
        for name, raw in self._raw.items():
            moved = self._propose(name, by_plugin[name]) if name in by_plugin else raw
            degree = weights.get(name, 1.0) * factors.get(name, 1.0)
            proposals[name] = moved.weighted(degree)
        return self.mofis.fusion.fuse(self.context, proposals), proposals

    def inputs(self, cell: tuple[int, int]) -> Iterator[tuple[str, str, float, float]]:
        """Behaviour, input, its value for the command at ``cell``, and its range's length."""
        for (owner, name), values in self._values.items():
            plugin = self.behaviors.get(owner, self.composite)
            if isinstance(plugin, RuledBehavior | RuledComposite):
                universe = plugin.rules.base.inputs[name].universe
                value = (
                    values[cell] if values.shape == self.mofis.commands.shape else values.flat[0]
                )
                yield owner, name, float(value), float(universe[-1] - universe[0])

    def _propose(self, name: str, shifts: Mapping[str, float]) -> Proposal:
        plugin: Behavior = copy_of(self.behaviors[name])
        rules = _shift_rules(plugin, shifts)
        proposal = plugin.propose(self.context)
        if rules is not None and not shifts:
            self._values |= {(name, one): np.asarray(seen) for one, seen in rules.seen.items()}
        return proposal

    def _weigh(self, shifts: Mapping[str, float]) -> Mapping[str, float]:
        if self.composite is None:
            return {}
        plugin: Composite = copy_of(self.composite)
        rules = _shift_rules(plugin, shifts)
        weights = plugin.weigh(self.context)
        if rules is not None and not shifts:
            owner = self.composite.name
            self._values |= {(owner, one): np.asarray(seen) for one, seen in rules.seen.items()}
        return weights


def copy_of(plugin: Any) -> Any:
    """Return a copy of a plugin that shares its robot, parameters and rules."""
    shared = [plugin.robot, plugin.params, getattr(plugin, "rules", None)]
    return copy.deepcopy(plugin, {id(one): one for one in shared})


def _shift_rules(plugin: Any, shifts: Mapping[str, float]) -> _ShiftedRules | None:
    if not isinstance(plugin, RuledBehavior | RuledComposite):
        return None
    plugin.rules = rules = _ShiftedRules(plugin.rules, shifts)
    return rules
