"""Make a recorded decision again, by the real behaviours, with some of their numbers changed."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from navfw.context import Context
from navfw.fuzzy import RuleBase, Variable
from navfw.fuzzy.membership import Shape, Trapezoid
from navfw.interfaces import Behavior, Composite
from navfw.mofis.mofis import Mofis
from navfw.mofis.rules import BehaviorRules, RuledBehavior, RuledComposite, Verdict
from navfw.numerics import Array
from navfw.signals import Command, Proposal


@dataclass(frozen=True, slots=True)
class Shift:
    """A change to try: ``amount`` is added to an input or break point, or multiplies a weight.

    It changes the input ``name`` of a behaviour's or composite's rules; the weight of its rule of
    index ``rule``; the break point ``corner`` (input, term, index) of a term; or, if none of these
    is given, the weight of the behaviour ``behavior`` itself.
    """

    behavior: str
    amount: float
    name: str = ""
    rule: int | None = None
    corner: tuple[str, str, int] | None = None

    @property
    def multiplies(self) -> bool:
        """Whether ``amount`` is a factor of a weight; else it is added."""
        return not self.name and self.corner is None

    def scaled(self, share: float) -> Shift:
        """Return the change reduced to ``share`` of it: 0 changes nothing, 1 is the whole."""
        if self.multiplies:
            return replace(self, amount=1.0 + share * (self.amount - 1.0))
        return replace(self, amount=share * self.amount)


def edited(base: RuleBase, shifts: Sequence[Shift]) -> RuleBase:
    """Return a changed copy of ``base``; ValueError if a break point would pass its neighbour."""
    rules, inputs = list(base.rules), dict(base.inputs)
    for shift in shifts:
        if shift.rule is not None:
            rule = rules[shift.rule]
            rules[shift.rule] = replace(rule, weight=min(1.0, rule.weight * shift.amount))
        elif shift.corner is not None:
            name, term, _ = shift.corner
            terms = {**inputs[name].terms, term: _moved(inputs[name].terms[term], shift)}
            inputs[name] = replace(inputs[name], terms=terms)
    return replace(base, rules=tuple(rules), inputs=inputs)


def _moved(shape: Shape, shift: Shift) -> Trapezoid:
    """Return a trapezoid with the break point of ``shift`` moved; ValueError if it passes one."""
    assert shift.corner is not None  # noqa: S101 - those alone are moved
    places = list(shape.corners)
    places[shift.corner[2]] += shift.amount
    return Trapezoid(tuple(places))


class _ShiftedRules(BehaviorRules):
    """Rules with changes applied; ``seen`` has the values of the inputs before them."""

    def __init__(self, rules: BehaviorRules, shifts: Sequence[Shift]) -> None:
        if any(not shift.name for shift in shifts):
            super().__init__(edited(rules.base, shifts))
        else:
            vars(self).update(vars(rules))
        self._shifts = {shift.name: shift.amount for shift in shifts}
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
    """A decision to make again: its context, and the plugins in their state before it."""

    mofis: Mofis
    context: Context
    behaviors: Mapping[str, Behavior]
    composite: Composite | None
    _raw: dict[str, Proposal] = field(default_factory=dict)
    _weights: Mapping[str, float] = field(default_factory=dict)
    _weighing: Sequence[Mapping[str, Any]] = ()
    _values: dict[tuple[str, str], Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._weights = self._weigh(())
        for name in self.behaviors:
            if (proposal := self._propose(name, ())) is not None:
                self._raw[name] = proposal

    def decide(self, shifts: Sequence[Shift] = ()) -> tuple[Command, dict[str, Proposal]]:
        """Return the command and the weighted proposals that result from ``shifts``.

        Raises:
            ValueError: a break point would pass another one.

        """
        weights, factors = self._weights, dict[str, float]()
        by_plugin: dict[str, list[Shift]] = {}
        for shift in shifts:
            if shift.multiplies and shift.rule is None:
                factors[shift.behavior] = shift.amount
            else:
                by_plugin.setdefault(shift.behavior, []).append(shift)
        if self.composite is not None and self.composite.name in by_plugin:
            weights = self._weigh(by_plugin[self.composite.name])
        proposals = {}
        for name, raw in self._raw.items():
            moved = self._propose(name, by_plugin[name]) if name in by_plugin else raw
            degree = weights.get(name, 1.0) * factors.get(name, 1.0)
            if moved is not None:
                proposals[name] = moved.weighted(degree)
        return self.mofis.fusion.fuse(self.context, proposals), proposals

    def inputs(self, cell: tuple[int, int]) -> Iterator[tuple[str, Variable, float]]:
        """Yield behaviour or composite, its input, and its value for the command at ``cell``."""
        for (owner, name), values in self._values.items():
            rules = self.rules_of(owner)
            if rules is not None:
                many = values.shape == self.mofis.commands.shape
                value = float(values[cell] if many else values.flat[0])
                yield owner, rules.base.inputs[name], value

    def fired(self, owner: str, cell: tuple[int, int]) -> Mapping[str, float]:
        """Return the strength of each rule of ``owner`` that fired for ``cell``, by its text."""
        proposal = self._raw.get(owner)
        rules = self._weighing if proposal is None else proposal.explain(*cell)
        return {rule["rule"]: rule["strength"] for rule in rules}

    def touches(self, shift: Shift) -> bool:
        """Whether moving a break point by ``shift`` changes the degree of any input value."""
        rules = self.rules_of(shift.behavior)
        if shift.corner is None or rules is None:
            return True
        name, term, _ = shift.corner
        values = self._values.get((shift.behavior, name), np.empty(0))
        shape = rules.base.inputs[name].terms[term]
        return not np.array_equal(_moved(shape, shift)(values), shape(values))

    def rules_of(self, owner: str) -> BehaviorRules | None:
        """Return the rules of the behaviour or composite ``owner``; None if it has none."""
        plugin = self.behaviors.get(owner, self.composite)
        return plugin.rules if isinstance(plugin, RuledBehavior | RuledComposite) else None

    def _propose(self, name: str, shifts: Sequence[Shift]) -> Proposal | None:
        plugin: Behavior = copy_of(self.behaviors[name])
        rules = _shift_rules(plugin, shifts)
        proposal = self.mofis.propose(name, plugin, self.context)
        if proposal is not None and rules is not None and not shifts:
            self._values |= {(name, one): np.asarray(seen) for one, seen in rules.seen.items()}
        return proposal

    def _weigh(self, shifts: Sequence[Shift]) -> Mapping[str, float]:
        if self.composite is None:
            return {}
        plugin: Composite = copy_of(self.composite)
        rules = _shift_rules(plugin, shifts)
        weights = self.mofis.weigh(plugin, self.context)
        if weights and rules is not None and not shifts:
            owner, self._weighing = self.composite.name, plugin.explain()
            self._values |= {(owner, one): np.asarray(seen) for one, seen in rules.seen.items()}
        return weights


def copy_of(plugin: Any) -> Any:
    """Return a deep copy of a plugin that shares the robot, parameters and rules."""
    shared = [plugin.robot, plugin.params, getattr(plugin, "rules", None)]
    return copy.deepcopy(plugin, {id(one): one for one in shared})


def _shift_rules(plugin: Any, shifts: Sequence[Shift]) -> _ShiftedRules | None:
    if not isinstance(plugin, RuledBehavior | RuledComposite):
        return None
    plugin.rules = rules = _ShiftedRules(plugin.rules, shifts)
    return rules
