"""Fuzzy inference: rule bases as data, a compiled evaluator, and scikit-fuzzy as its reference.

``rulebase`` is the plain data, ``rulespec`` the schema of its file, ``coverage`` the check that
rules cover all inputs, and ``rulefile`` loads. ``compiled_fis`` evaluates in missions;
``reference_fis`` evaluates the same rule base through scikit-fuzzy, in tests and benchmarks. Both
are imported on first access: to read and check a rule base neither is needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfw.fuzzy.compiled_fis import FiredRule, explain
from navfw.fuzzy.rulebase import Rule, RuleBase, Variable
from navfw.fuzzy.rulefile import (
    TermCorners,
    load_rule_base,
    parse_rule_base,
    rule_base_from_mapping,
)
from navfw.lazy_names import first_access

if TYPE_CHECKING:
    from navfw.fuzzy.compiled_fis import CompiledFis, Inference
    from navfw.fuzzy.reference_fis import ReferenceFis

__all__ = [
    "CompiledFis",
    "FiredRule",
    "Inference",
    "ReferenceFis",
    "Rule",
    "RuleBase",
    "TermCorners",
    "Variable",
    "explain",
    "load_rule_base",
    "parse_rule_base",
    "rule_base_from_mapping",
]

_HOMES = {
    "CompiledFis": "navfw.fuzzy.compiled_fis",
    "Inference": "navfw.fuzzy.compiled_fis",
    "ReferenceFis": "navfw.fuzzy.reference_fis",
}


def __getattr__(name: str) -> Any:
    return first_access(__name__, name, _HOMES)
