"""The rules that fired for a result, with their strengths."""

from __future__ import annotations

from typing import TypedDict

from navfw.fuzzy.rulebase import RuleBase
from navfw.signals import Array


class FiredRule(TypedDict):
    """A rule's sentence as in its file, and its strength in [0, 1], weight included."""

    rule: str
    strength: float


def explain(rule_base: RuleBase, firing: Array, minimum: float = 0.05) -> list[FiredRule]:
    """The rules with a strength of at least ``minimum`` in ``firing`` (rules,), strongest first.

    Rules of equal strength keep the order of the rule base. A rule of strength 0 is never listed.
    """
    found = [
        FiredRule(rule=rule.sentence, strength=float(strength))
        for rule, strength in zip(rule_base.rules, firing, strict=True)
        if strength > 0.0 and strength >= minimum
    ]
    return sorted(found, key=lambda fired: -fired["strength"])
