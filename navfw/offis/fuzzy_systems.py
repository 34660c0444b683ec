"""The fuzzy inference systems of OFFIS, loaded from ``navfw/offis/rules``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from navfw.fuzzy import CompiledFis, load_rule_base
from navfw.fuzzy import Inference as Result
from navfw.numerics import Array

RULES = Path(__file__).parent / "rules"
"""Folder of the rule bases, one YAML file per inference system."""


@cache
def load_system(name: str) -> CompiledFis:
    """Load and compile the inference system ``navfw/offis/rules/<name>.yaml``; cached.

    Raises:
        RuleBaseError: the file is malformed.

    """
    return CompiledFis(load_rule_base(RULES / f"{name}.yaml"))


@dataclass(frozen=True, slots=True)
class FuzzyEvaluation:
    """One evaluation of an inference system: inputs ``rows`` (inputs, N) and their ``result``."""

    system: CompiledFis
    rows: Array
    result: Result

    @property
    def inputs(self) -> dict[str, Array]:
        """Samples (N,) of every input by its name."""
        return dict(zip(self.system.input_names, self.rows, strict=True))

    def degree(self, output: str, term: str) -> Array:
        """Return the degree (N,) to which the rules conclude ``output IS term``."""
        return self.result.degree(output, term)

    def explain(self, index: int) -> dict[str, Any]:
        """Return inputs and fired rules, strongest first, of the sample ``index`` as plain data."""
        return {
            "inputs": {name: round(float(x[index]), 4) for name, x in self.inputs.items()},
            "rules": self.system.explain(self.result, index=index),
        }


def infer(system: CompiledFis, inputs: Mapping[str, Array | float]) -> FuzzyEvaluation:
    """Evaluate ``system`` on (N,) samples of every input, or on one number of each."""
    rows = np.array([inputs[name] for name in system.input_names])
    return infer_rows(system, rows.reshape(len(rows), -1))


def infer_rows(system: CompiledFis, rows: Array) -> FuzzyEvaluation:
    """Evaluate ``system`` on ``rows`` (inputs, N), in the order of its rule base."""
    return FuzzyEvaluation(system, rows, system.evaluate_rows(rows))
