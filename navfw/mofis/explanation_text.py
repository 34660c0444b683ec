"""Explanations as text, only from plain data: a recorded one is shown without a run."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

_NOTHING = re.compile(r"THEN \w+ IS (no|none)(, \w+ IS (no|none))*$")  # defined
"""Consequences that are nothing."""


def asks_for_nothing(rule: str) -> bool:
    """Return whether a rule's consequences are all "no" or "none", so that it is no reason.

    >>> asks_for_nothing("IF reserve IS ample THEN prohibit IS no, desire IS none")
    True
    """
    return _NOTHING.search(rule) is not None


_MIN_CHANGE = 0.005  # chosen
"""Least change of a rule's strength, or of a weight, that counts."""


@dataclass(frozen=True, slots=True)
class RuleChange:
    """A rule whose strength, or a behaviour whose weight, has changed from ``was`` to ``now``."""

    what: str
    was: float
    now: float

    def __str__(self) -> str:
        return f"{self.what} ({self.was:.2f} -> {self.now:.2f})"


def rule_changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[RuleChange]:
    """Return what differs between two explanations of a decision, the largest change first."""
    changes: list[RuleChange] = []
    for name in {**before.get("behaviors", {}), **now.get("behaviors", {})}:
        pair = [one.get("behaviors", {}).get(name, {}) for one in (before, now)]
        old, new = ({r["rule"]: r["strength"] for r in one.get("rules", ())} for one in pair)
        for rule in {**old, **new}:
            if not asks_for_nothing(rule):
                change = RuleChange(f"{name}: {rule}", old.get(rule, 0.0), new.get(rule, 0.0))
                changes.append(change)
        changes.append(RuleChange(f"{name}: weight", *(one.get("weight", 0.0) for one in pair)))
    counted = [one for one in changes if abs(one.now - one.was) >= _MIN_CHANGE]
    return sorted(counted, key=lambda one: -abs(one.now - one.was))


_OTHERS = 3  # chosen
"""Number of other places to head for that an explanation lists."""


def explanation_lines(explanation: dict[str, Any]) -> list[str]:
    """Format an explanation as lines: command, what was perceived, weights, reasons and rules.

    ``explanation`` is the result of ``Stack.explain``. Behaviours are ordered by weight.
    """
    perceived = explanation.get("perception", {}).get("sentence", "")
    lines = [
        f"at {explanation['time']:.1f} s: v {explanation['v']:+.2f} m/s, "
        f"w {explanation['w']:+.2f} rad/s, led by {explanation['leader']}",
        f"  perceived  {perceived or 'nothing yet'}",
    ]
    lines += [f"  odometry   {text}" for key, text in explanation.items() if key == "odometry"]
    lines += _plan_lines(explanation.get("plan", {}))
    composite = explanation.get("composite", {"rules": ()})
    if composite["rules"]:
        weights = ", ".join(f"{name} {weight:.2f}" for name, weight in composite["weights"].items())
        lines.append(f"  {composite['name']} weights {weights}")
        lines += [
            f"      {rule['strength']:.2f}  {with_inputs(rule)}" for rule in composite["rules"]
        ]
    ordered = sorted(explanation["behaviors"].items(), key=lambda item: -item[1]["weight"])
    for name, rating in ordered:
        lines.append(
            f"  {name}: weight {rating['weight']:.2f}, desirability {rating['desirability']:.2f}, "
            f"prohibition {rating['prohibition']:.2f} - {rating['reason']}"
        )
        lines += [f"      {rule['strength']:.2f}  {with_inputs(rule)}" for rule in rating["rules"]]
    return lines


def with_inputs(rule: Mapping[str, Any]) -> str:
    """Return a fired rule with the values of its inputs, if they are known.

    >>> with_inputs({"rule": "IF a IS b THEN c IS d", "inputs": {"a": 0.314}})
    'IF a IS b THEN c IS d [a 0.31]'
    """
    values = ", ".join(
        f"{name} {value:.2f}"
        for name, value in rule.get("inputs", {}).items()
        if value is not None and math.isfinite(value)
    )
    return f"{rule['rule']} [{values}]" if values else str(rule["rule"])


def _plan_lines(plan: Mapping[str, Any]) -> list[str]:
    """Format why an exploring planner heads for where it does; no lines without such a planner."""
    if not plan:
        return []
    where = f" at ({plan['x']:.1f}, {plan['y']:.1f})" if "x" in plan else ""
    inputs = ", ".join(f"{name} {value:.2f}" for name, value in plan.get("inputs", {}).items())
    merit = f": merit {plan['merit']:.2f} of {inputs}" if inputs else ""
    lines = [f"  heads for {plan['heads_for']}{where}{merit}"]
    lines += [
        f"      {rule['strength']:.2f}  {with_inputs(rule)}" for rule in plan.get("rules", ())
    ]
    lines += [
        f"      {other['merit']:.2f}  instead ({other['x']:.1f}, {other['y']:.1f}), "
        f"gain {other['gain']:.1f} m2, path {other['path']:.1f} m"
        for other in plan.get("others", ())[:_OTHERS]
    ]
    for left in plan.get("given_up", ()):
        lines.append(f"      given up ({left['x']:.1f}, {left['y']:.1f}): {left['why']}")
    return lines
