"""Find the smallest change of a recorded decision that turns it into another one.

The decision is made again, by the real behaviours and the real fusion, with one thing changed: an
input of one behaviour's rules (a sensed quantity), the weight or a break point of one rule, or the
weight of one behaviour. Changes are tried from small to large. One that turns the decision is
narrowed down until half of it no longer does. The rest of the context stays as it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

from navfw.context import Context
from navfw.errors import RuleBaseError
from navfw.fuzzy.coverage import check_coverage
from navfw.fuzzy.membership import Trapezoid
from navfw.mofis.explanation_text import asks_for_nothing
from navfw.mofis.fusion import allowed_desire, joint_prohibition, mean_desire, shares
from navfw.numerics import Array
from navfw.recording.decision_moment import DecisionMoment, Shift, edited
from navfw.signals import Proposal, Twist

Predicate = Callable[[Twist], bool]
"""Returns whether a command is the wanted one."""


_STEPS = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Changes that are tried, as shares of an input's range."""

_CORNER_STEPS = (1 / 32, 1 / 8, 1 / 4)
"""Changes tried of break points, which are many, and mean something else when moved further."""

_FACTORS = (
    (1 / 1.1, 1 / 1.25, 1 / 1.5, 1 / 2, 1 / 4, 1 / 8, 0.0),
    (1.1, 1.25, 1.5, 2.0, 4.0, 8.0, 16.0),
)
"""Factors on a weight that are tried, downward and upward."""

_BISECTIONS = 7
"""Halvings of the interval in which a change begins to turn the decision."""

_TINY = 1e-12
"""Change down to which half of it is tried: if two commands are rated alike, hardly any does."""

_PAIRED = 12
"""Number of changes whose pairs are tried."""


@dataclass(frozen=True, slots=True)
class Change:
    """A change that turns the decision: ``name`` of ``behavior`` from ``before`` to ``after``.

    ``name`` is an input, the weight of the behaviour or of one of its rules, or a break point of a
    term; ``shift`` applies it. ``size`` compares changes: a share of the input's range, or for a
    weight the number of doublings divided by three.
    """

    behavior: str
    name: str
    before: float
    after: float
    size: float
    shift: Shift
    unit: str = ""

    def scaled(self, share: float) -> Change:
        """Return the change reduced to ``share`` of it."""
        after = self.before + share * (self.after - self.before)
        return replace(self, after=after, size=share * self.size, shift=self.shift.scaled(share))

    def __str__(self) -> str:
        unit = f" ({self.unit})" if self.unit else ""
        numbers = f"{self.after:.3g} instead of {self.before:.3g}{unit}"
        return f"{self.behavior}'s {self.name} {numbers}"


def rating(context: Context, proposals: Mapping[str, Proposal]) -> Array:
    """Return the rating (n_v, n_w) of all commands: their mean desire, less their prohibition."""
    return allowed_desire(mean_desire(context, proposals), joint_prohibition(context, proposals))


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A number that may be changed, with its present ``value``.

    ``scale`` is the length of its range, 0 for a weight; ``begin`` is the shift that changes it,
    with any amount.
    """

    name: str
    value: float
    scale: float
    begin: Shift
    unit: str = ""

    def amounts(self) -> tuple[tuple[float, ...], ...]:
        """Return amounts to try in either direction, from small to large."""
        if self.scale:
            steps = _STEPS if self.begin.corner is None else _CORNER_STEPS
            return tuple(tuple(sign * one * self.scale for one in steps) for sign in (1.0, -1.0))
        weaker, stronger = _FACTORS
        if self.begin.rule is None:
            return weaker, stronger
        allowed = tuple(factor for factor in stronger if self.value * factor <= 1.0)
        return tuple(factor for factor in weaker if factor), allowed  # a rule's weight is not 0

    def change(self, amount: float) -> Change:
        """Return the change by ``amount``."""
        if self.scale:
            after, size = self.value + amount, abs(amount) / self.scale
        else:
            after = self.value * amount
            size = abs(math.log2(max(amount, 1 / 16))) / 3.0
        shift = replace(self.begin, amount=amount)
        return Change(self.begin.behavior, self.name, self.value, after, size, shift, self.unit)


def smallest_changes(
    moment: DecisionMoment, turned: Predicate, cells: Sequence[tuple[int, int]]
) -> tuple[list[Change], list[Change]]:
    """Find the smallest single change of each kind that turns the decision, smallest first.

    The kinds are inputs, parts of rules, and behaviours' weights. The second value is all changes
    of inputs that were tried, at their largest. ``cells`` are the wanted and the given command.
    """
    rated = moment.decide()[1]
    inputs = [
        _Candidate(one.name, value, one.high - one.low, Shift(owner, 0.0, one.name), one.unit_text)
        for owner, one, value in moment.inputs(cells[0])
    ]
    weights = [
        _Candidate("weight", share, 0.0, Shift(name, 1.0))
        for name, share in shares(rated).items()
        if share > 0.0
    ]
    changes = []
    for kind in (inputs, list(_of_rules(moment, rated, cells)), weights):
        smallest: Change | None = None
        for candidate, amounts in ((one, part) for one in kind for part in one.amounts()):
            limit = math.inf if smallest is None else 0.99 * smallest.size
            tried = [one for one in amounts if candidate.change(one).size < limit]
            nothing = 1.0 if candidate.begin.multiplies else 0.0
            amount = _least(partial(_turns, moment, turned, candidate.begin), tried, nothing)
            change = None if amount is None else candidate.change(amount)
            if change is not None and _covered(moment, change.shift):
                smallest = change
        if smallest is not None:
            changes.append(smallest)
    largest = [one.change(part[-1]) for one in inputs for part in one.amounts()]
    return sorted(changes, key=lambda change: change.size), largest


def _turns(moment: DecisionMoment, turned: Predicate, shift: Shift, amount: float) -> bool:
    shift = replace(shift, amount=amount)
    try:
        return moment.touches(shift) and turned(moment.decide([shift])[0].twist)
    except ValueError:  # a break point would pass another one
        return False


def _covered(moment: DecisionMoment, shift: Shift) -> bool:
    """Return whether a moved break point leaves no input without a rule, as a rule file must."""
    rules = None if shift.corner is None else moment.rules_of(shift.behavior)
    try:
        if rules is not None:
            check_coverage(edited(rules.base, [shift]))
    except RuleBaseError:
        return False
    return True


def _of_rules(
    moment: DecisionMoment, rated: Mapping[str, Proposal], cells: Sequence[tuple[int, int]]
) -> Iterator[_Candidate]:
    """Yield the weights of the rules that fired, and the break points of all inputs' terms."""
    composite = moment.composite
    owners = [name for name, proposal in rated.items() if _matters(proposal, cells)]
    owners += [composite.name] if composite is not None else []
    for owner in owners:
        rules = moment.rules_of(owner)
        if rules is None:
            continue
        fired = set().union(*(moment.fired(owner, cell) for cell in cells))
        for number, rule in enumerate(rules.base.rules):
            if rule.sentence in fired and not asks_for_nothing(rule.sentence):
                name = f"weight of {rule.sentence}"
                yield _Candidate(name, rule.weight, 0.0, Shift(owner, 1.0, rule=number))
        for name, variable in rules.base.inputs.items():
            scale, unit = variable.high - variable.low, variable.unit_text
            for term, shape in variable.terms.items():
                if not isinstance(shape, Trapezoid):
                    continue
                for number, place in enumerate(shape.places):
                    text = f"break point {number + 1} of {name} IS {term}"
                    shift = Shift(owner, 0.0, corner=(name, term, number))
                    yield _Candidate(text, place, scale, shift, unit)


def _matters(proposal: Proposal, cells: Sequence[tuple[int, int]]) -> bool:
    """Return whether a behaviour influences which of two commands is chosen."""
    one, other = (proposal.applicability * proposal.desirability[cell] for cell in cells)
    barred = max(float(proposal.prohibition[cell]) for cell in cells)
    return abs(one - other) > 0.0 or barred > 0.0


def _least(
    turns: Callable[[float], bool], amounts: Sequence[float], nothing: float = 0.0
) -> float | None:
    """Return about the amount nearest to ``nothing`` that turns the decision; None if none does.

    Half of it, counted from ``nothing``, does not.
    """
    below = nothing
    for amount in amounts:
        if turns(amount):
            break
        below = amount
    else:
        return None
    for _ in range(_BISECTIONS):
        middle = 0.5 * (below + amount)
        if turns(middle):
            amount = middle
        else:
            below = middle
    while turns(0.5 * (nothing + amount)) and abs(amount - nothing) > _TINY:
        amount = 0.5 * (nothing + amount)  # not all that is more turns it
    return amount


def smallest_pair(
    moment: DecisionMoment,
    turned: Predicate,
    largest: Sequence[Change],
    cell: tuple[int, int],
) -> tuple[Change, ...]:
    """Find the smallest two changes of inputs that turn the decision together; () if none do."""

    def supported(change: Change) -> float:
        return float(rating(moment.context, moment.decide([change.shift])[1])[cell])

    def turns(first: Change, second: Change, share: float) -> bool:
        shifts = [change.shift.scaled(share) for change in (first, second)]
        return turned(moment.decide(shifts)[0].twist)

    best = sorted(largest, key=lambda one: -supported(one))[:_PAIRED]
    pairs: list[tuple[float, tuple[Change, ...]]] = []
    for one, other in combinations(best, 2):
        if (one.behavior, one.name) == (other.behavior, other.name):
            continue
        share = _least(partial(turns, one, other), _STEPS)
        if share is not None:
            pairs.append((share, (one.scaled(share), other.scaled(share))))
    return min(pairs, key=lambda one: one[0])[1] if pairs else ()
