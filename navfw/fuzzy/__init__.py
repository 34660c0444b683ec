"""Fuzzy inference: rule bases as data, a fast evaluator, scikit-fuzzy as its reference."""

from __future__ import annotations

from navfw.fuzzy.compiled import CompiledFis, Inference, compile_rule_base
from navfw.fuzzy.explain import FiredRule, explain
from navfw.fuzzy.reference import ReferenceFis
from navfw.fuzzy.rulebase import Rule, RuleBase, Variable

__all__ = [
    "CompiledFis",
    "FiredRule",
    "Inference",
    "ReferenceFis",
    "Rule",
    "RuleBase",
    "Variable",
    "compile_rule_base",
    "explain",
]
