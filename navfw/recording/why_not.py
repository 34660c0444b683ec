"""Why not: what was against another command, and the smallest change that would have given it.

The decision is made again, by the real behaviours and the real fusion, with one thing changed: an
input of one behaviour's rules (a sensed quantity), or the weight of one behaviour. Changes are
tried from small to large. One that turns the decision is narrowed down until half of it no longer
does. Everything else of the moment stays as it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any

from navfw.context import Context
from navfw.errors import InputError
from navfw.mofis.fusion import CUT, allowed_desire, joint_prohibition, mean_desire, shares
from navfw.mofis.mofis import explain_command
from navfw.numerics import Array
from navfw.recording.decision_moment import DecisionMoment, Shift
from navfw.signals import Command, Proposal, Twist

DIRECTIONS = ("left", "right", "faster", "slower", "stop")
"""Commands that are asked for by a word, beside V,W."""

_STEPS = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Changes that are tried, as shares of an input's range."""

_FACTORS = (
    (1 / 1.1, 1 / 1.25, 1 / 1.5, 1 / 2, 1 / 4, 1 / 8, 0.0),
    (1.1, 1.25, 1.5, 2.0, 4.0, 8.0, 16.0),
)
"""Factors on a weight that are tried, downward and upward."""

_BISECTIONS = 7
"""Halvings of the interval in which a change begins to suffice."""

_SHOWN, _PAIRED = 3, 12
"""Number of changes that are told, and of changes of which pairs are tried."""

_STOPPED = 0.02, 0.1
"""Speed [m/s] and rate [rad/s] up to which a robot stands."""


@dataclass(frozen=True, slots=True)
class Objection:
    """A behaviour that was against the wanted command: by how much, and by which rules.

    ``loss`` is its share of the difference in rating, ``prohibition`` in [0, 1] the command's.
    """

    behavior: str
    loss: float
    prohibition: float
    rules: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """What would have turned the decision: ``name`` of ``behavior`` from ``before`` to ``after``.

    ``size`` compares changes: a share of the input's range, or of three doublings of a weight.
    """

    behavior: str
    name: str
    before: float
    after: float
    size: float

    def __str__(self) -> str:
        return f"{self.behavior}'s {self.name} {self.after:.3g} instead of {self.before:.3g}"


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why ``wanted`` (v, w) was not commanded at ``time`` [s], but ``commanded``.

    ``ratings`` are those of the command and of the wanted one, out of the best of all.
    Each of ``changes``, smallest first, would have turned the decision; if there is none, ``pair``
    would have together.
    """

    time: float
    commanded: tuple[float, float]
    wanted: tuple[float, float]
    ratings: tuple[float, float]
    against: tuple[Objection, ...]
    changes: tuple[Change, ...]
    pair: tuple[Change, ...] = ()


def why_not(moment: DecisionMoment, wanted: str) -> WhyNot:
    """Say why ``wanted``, one of ``DIRECTIONS`` or "V,W", was not commanded.

    Raises:
        InputError: it is none of these, beyond what the robot can do, or what was commanded.

    """
    command, proposals = moment.decide()
    grid = moment.mofis.commands
    turned = _predicate(wanted, command.twist, moment)
    if turned(command.twist):
        was = f"{command.twist.v:+.2f} m/s, {command.twist.w:+.2f} rad/s"
        raise InputError(f"the command was that: {was}", key="--why-not")
    support = _support(moment.context, proposals)
    cells = [
        (row, column)
        for row, v in enumerate(grid.v.tolist())
        for column, w in enumerate(grid.w.tolist())
        if turned(Twist(v, w))
    ]
    if not cells:
        raise InputError("no command of the robot's is like that", key="--why-not")
    cell = max(cells, key=lambda one: (support[one], -_away(grid, one, command.twist)))
    given_cell = grid.nearest(command.twist)
    best = max(float(support.max()), 1e-9)
    changes, tried = _search(moment, turned, cell)
    return WhyNot(
        time=moment.context.time,
        commanded=(command.twist.v, command.twist.w),
        wanted=(float(grid.v[cell[0]]), float(grid.w[cell[1]])),
        ratings=(float(support[given_cell]) / best, float(support[cell]) / best),
        against=tuple(_objections(moment, proposals, command, given_cell, cell)),
        changes=tuple(sorted(changes, key=lambda one: one.size)[:_SHOWN]),
        pair=() if changes else _pair(moment, turned, tried, cell),
    )


Predicate = Callable[[Twist], bool]


def _predicate(wanted: str, given: Twist, moment: DecisionMoment) -> Predicate:
    """Return whether a twist is what was ``wanted`` instead of ``given``."""
    grid = moment.mofis.commands
    turn, speed = 1.5 * float(grid.w[1] - grid.w[0]), float(grid.v[-1] - grid.v[-2])
    if wanted == "left":
        return lambda t: t.w >= max(given.w + turn, turn)
    if wanted == "right":
        return lambda t: t.w <= min(given.w - turn, -turn)
    if wanted == "faster":
        return lambda t: t.v >= given.v + 0.9 * speed
    if wanted == "slower":
        return lambda t: t.v <= given.v - 0.9 * speed
    if wanted == "stop":
        return lambda t: abs(t.v) <= _STOPPED[0] and abs(t.w) <= _STOPPED[1]
    try:
        v, w = map(float, wanted.split(","))
    except ValueError:
        text = f"expected {', '.join(DIRECTIONS)} or V,W [m/s, rad/s]; got {wanted!r}"
        raise InputError(text, key="--why-not") from None
    if not (grid.v[0] - 1e-9 <= v <= grid.v[-1] + 1e-9 and abs(w) <= grid.max_w + 1e-9):
        speeds = f"{grid.v[0]:g} to {grid.v[-1]:g} m/s"
        text = f"expected {speeds} and at most {grid.max_w:g} rad/s; got {wanted}"
        raise InputError(text, key="--why-not")
    return lambda t: abs(t.v - v) <= speed and abs(t.w - w) <= turn


def _away(grid: Any, cell: tuple[int, int], twist: Twist) -> float:
    return math.hypot(grid.v[cell[0]] - twist.v, grid.w[cell[1]] - twist.w)


def _support(context: Context, proposals: Mapping[str, Proposal]) -> Array:
    """Return the rating (n_v, n_w) of all commands: the desires' mean, less what is prohibited."""
    return allowed_desire(mean_desire(context, proposals), joint_prohibition(context, proposals))


def _objections(
    moment: DecisionMoment,
    proposals: Mapping[str, Proposal],
    command: Command,
    given: tuple[int, int],
    wanted: tuple[int, int],
) -> Iterator[Objection]:
    """The behaviours against the ``wanted`` command, the strongest first."""
    grid = moment.mofis.commands
    twist = Twist(float(grid.v[wanted[0]]), float(grid.w[wanted[1]]))
    instead = Command(command.time, twist, command.leader, "", False, command.weights)
    told = explain_command(instead, proposals, moment.mofis)["behaviors"]
    objections = []
    for name, share in shares(proposals).items():
        proposal = proposals[name]
        loss = share * float(proposal.desirability[given] - proposal.desirability[wanted])
        prohibition = float(proposal.prohibition[wanted])
        if loss > 0.01 or prohibition > CUT:
            rules = tuple(f"{r['rule']} ({r['strength']:.2f})" for r in told[name]["rules"][:2])
            objections.append(Objection(name, loss, prohibition, rules))
    return iter(sorted(objections, key=lambda one: (one.prohibition <= CUT, -one.loss)))


def _search(
    moment: DecisionMoment, turned: Predicate, cell: tuple[int, int]
) -> tuple[list[Change], list[tuple[Shift, float, float]]]:
    """Return the single changes that turn the decision, and all that were tried, at their largest.

    With each of the latter go its value before, and the scale of its size.
    """
    changes: list[Change] = []
    tried: list[tuple[Shift, float, float]] = []

    def turns(owner: str, name: str, amount: float) -> bool:
        return turned(moment.decide([Shift(owner, name, amount)])[0].twist)

    for owner, name, value, span in moment.inputs(cell):
        for sign in (1.0, -1.0):
            steps = [sign * share * span for share in _STEPS]
            amount = _least(partial(turns, owner, name), steps)
            if amount is not None:
                changes.append(Change(owner, name, value, value + amount, abs(amount) / span))
            tried.append((Shift(owner, name, sign * span), value, span))
    for owner, share in shares(moment.decide()[1]).items():
        for factors in _FACTORS if share > 0.0 else ():
            factor = _least(partial(turns, owner, ""), factors, 1.0)
            if factor is not None:
                size = abs(math.log2(max(factor, 1 / 16))) / 3.0
                changes.append(Change(owner, "weight", share, share * factor, size))
    return changes, tried


def _least(
    turns: Callable[[float], bool], amounts: Sequence[float], nothing: float = 0.0
) -> float | None:
    """Return about the amount nearest to ``nothing`` that turns the decision; None if none does.

    Half of it, from ``nothing`` on, does not.
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
    while turns(0.5 * (nothing + amount)) and abs(amount - nothing) > 1e-6:
        amount = 0.5 * (nothing + amount)  # not all that is more turns it
    return amount


def _pair(
    moment: DecisionMoment,
    turned: Predicate,
    tried: Sequence[tuple[Shift, float, float]],
    cell: tuple[int, int],
) -> tuple[Change, ...]:
    """Return the smallest two changes of inputs that turn the decision together; () if none do."""

    def rating(shift: Shift) -> float:
        return float(_support(moment.context, moment.decide([shift])[1])[cell])

    def turns(first: Shift, second: Shift, share: float) -> bool:
        shifts = [replace(shift, amount=share * shift.amount) for shift in (first, second)]
        return turned(moment.decide(shifts)[0].twist)

    best = sorted(tried, key=lambda one: -rating(one[0]))[:_PAIRED]
    pairs: list[tuple[float, tuple[Change, ...]]] = []
    for one, other in combinations(best, 2):
        if (one[0].behavior, one[0].name) == (other[0].behavior, other[0].name):
            continue

        share = _least(partial(turns, one[0], other[0]), _STEPS)
        if share is not None:
            changes = tuple(
                Change(s.behavior, s.name, value, value + share * s.amount, share)
                for s, value, _ in (one, other)
            )
            pairs.append((share, changes))
    return min(pairs, key=lambda one: one[0])[1] if pairs else ()


def why_not_lines(result: WhyNot) -> list[str]:
    """Format ``result`` as lines of text."""
    (v, w), (wanted_v, wanted_w) = result.commanded, result.wanted
    lines = [
        f"at {result.time:.1f} s: not {wanted_v:+.2f} m/s, {wanted_w:+.2f} rad/s, but {v:+.2f} m/s,"
        f" {w:+.2f} rad/s",
        f"  rated {result.ratings[1]:.2f} of the best, the command {result.ratings[0]:.2f}",
    ]
    for one in result.against:
        how = (
            f"prohibits it ({one.prohibition:.2f})"
            if one.prohibition > CUT
            else f"loss {one.loss:.2f}"
        )
        lines.append(f"  {one.behavior} was against it: {how}")
        lines += [f"      {rule}" for rule in one.rules]
    if result.changes:
        lines.append("  it would have been commanded, had there been only")
        lines += [f"      {change}" for change in result.changes]
    elif result.pair:
        lines.append("  no single change would have given it; both of these would")
        lines += [f"      {change}" for change in result.pair]
    else:
        lines.append("  no change of one or two inputs, or of one weight, would have given it")
    return lines
