"""Why not: find who opposed another command, by which rules, and what would have given it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.errors import InputError
from navfw.mofis.fusion import CUT, shares
from navfw.mofis.mofis import explain_command
from navfw.recording.decision_moment import DecisionMoment, Shift
from navfw.recording.smallest_change import (
    Change,
    Predicate,
    rating,
    smallest_changes,
    smallest_pair,
)
from navfw.signals import Command, Proposal, Twist

DIRECTIONS = ("left", "right", "faster", "slower", "stop")
"""Words for the command that ``why_not`` asks about, besides "V,W"."""

_STOPPED = 0.02, 0.1
"""Speed [m/s] and rate [rad/s] up to which a robot counts as standing."""


@dataclass(frozen=True, slots=True)
class Objection:
    """A behaviour that opposed the wanted command: by how much, and by which rules.

    ``loss`` is its share of the difference in rating, ``prohibition`` in [0, 1] its prohibition of
    the wanted command.
    """

    behavior: str
    loss: float
    prohibition: float
    rules: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why ``wanted`` (v [m/s], w [rad/s]) was not commanded at ``time`` [s], but ``commanded``.

    ``ratings`` are those of the command and of the wanted one, divided by the best of all. Each of
    ``changes``, smallest first, would have turned the decision: one of an input, of a part of a
    rule, and of a behaviour's weight. If there is none, the two of ``pair`` would have together.
    """

    time: float
    commanded: tuple[float, float]
    wanted: tuple[float, float]
    ratings: tuple[float, float]
    against: tuple[Objection, ...]
    changes: tuple[Change, ...]
    pair: tuple[Change, ...] = ()


def why_not(moment: DecisionMoment, wanted: str) -> WhyNot:
    """Find why ``wanted``, one of ``DIRECTIONS`` or "V,W", was not commanded.

    Raises:
        InputError: it is none of these, beyond what the robot can do, or what was commanded.

    """
    command, proposals = moment.decide()
    grid = moment.mofis.commands
    turned = _predicate(wanted, command.twist, moment)
    if turned(command.twist):
        was = f"{command.twist.v:+.2f} m/s, {command.twist.w:+.2f} rad/s"
        raise InputError(f"the command was that: {was}", key="--why-not")
    support = rating(moment.context, proposals)
    cells = [
        (row, column)
        for row, v in enumerate(grid.v.tolist())
        for column, w in enumerate(grid.w.tolist())
        if turned(Twist(v, w))
    ]
    if not cells:
        limit = "the robot has no command like that: this was the most that it can do"
        raise InputError(limit, key="--why-not")
    twist = command.twist
    away = np.hypot.outer(grid.v - twist.v, grid.w - twist.w)
    cell = max(cells, key=lambda one: (support[one], -away[one]))
    given_cell = grid.nearest(twist)
    best = max(float(support.max()), 1e-9)
    changes, largest = smallest_changes(moment, turned, (cell, given_cell))
    return WhyNot(
        time=moment.context.time,
        commanded=(command.twist.v, command.twist.w),
        wanted=(float(grid.v[cell[0]]), float(grid.w[cell[1]])),
        ratings=(float(support[given_cell]) / best, float(support[cell]) / best),
        against=tuple(_objections(moment, proposals, command, given_cell, cell)),
        changes=tuple(changes),
        pair=() if changes else smallest_pair(moment, turned, largest, cell),
    )


def turned_by(moment: DecisionMoment, wanted: str, shifts: Sequence[Shift]) -> bool:
    """Return whether ``shifts`` turn the decision into ``wanted``; raises like ``why_not``."""
    return _predicate(wanted, moment.decide()[0].twist, moment)(moment.decide(shifts)[0].twist)


def _predicate(wanted: str, given: Twist, moment: DecisionMoment) -> Predicate:
    """Return a function that says whether a command is the one ``wanted`` instead of ``given``."""
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


def _objections(
    moment: DecisionMoment,
    proposals: Mapping[str, Proposal],
    command: Command,
    given: tuple[int, int],
    wanted: tuple[int, int],
) -> Iterator[Objection]:
    """Yield the behaviours against the ``wanted`` command, the strongest first."""
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
