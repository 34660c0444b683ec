"""Coverage: wherever the inputs are within their ranges, some rule must speak about each output."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navfw.fuzzy.rulebase import RuleBase

__all__ = ["check_coverage"]


def check_coverage(rule_base: RuleBase) -> None:
    """Find uncovered regions."""
