"""A rule base as arrays, packed into two for the compiled inference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from navfw.fuzzy import defuzzification_kernels, inference_kernels
from navfw.fuzzy.grammar import And, Clause, Is, Not, Or, atoms
from navfw.fuzzy.rulebase import RuleBase, Variable
from navfw.signals import Array

Indices = npt.NDArray[np.int64]

_METHODS = {
    "centroid": defuzzification_kernels.CENTROID,
    "bisector": defuzzification_kernels.BISECTOR,
    "mom": defuzzification_kernels.MOM,
    "som": defuzzification_kernels.SOM,
    "lom": defuzzification_kernels.LOM,
}


class InferenceTables(NamedTuple):
    """A rule base as arrays; ``packed`` are the arguments of ``inference_kernels.infer`` after x.

    The kernel knows the arrays by their order here: those of numbers, then those of indices.
    """

    input_xs: Array  # universes of all inputs, one after the other
    literal_ys: Array  # (literals, longest universe) degree of "input IS hedges term"
    weights: Array  # (rules,)
    output_xs: Array  # universes of all outputs, one after the other
    term_ys: Array  # (terms, longest universe) of the terms that rules conclude
    defaults: Array  # (outputs,) NaN where none
    input_starts: Indices  # (inputs + 1,) where each begins
    literal_starts: Indices  # (inputs + 1,) literals are grouped by input
    program: Indices  # antecedents in postfix form, one after the other
    program_starts: Indices  # (rules + 1,)
    conclusions: Indices  # (conclusions, 2) rule, term
    output_starts: Indices  # (outputs + 1,)
    term_starts: Indices  # (outputs + 1,) terms are grouped by output
    support: Indices  # (terms, 2) first and last sample above zero
    modes: Indices  # defuzzification, implication is prod, depth of stack, size of workspace

    @property
    def packed(self) -> tuple[Array, Indices]:
        """All arrays of numbers and all of indices, each as one (``pack``)."""
        return pack(self[:6], np.float64), pack(self[6:], np.int64)


def pack(arrays: Sequence[npt.NDArray[Any]], dtype: type[Any]) -> npt.NDArray[Any]:
    """``arrays`` one after the other in one, flat, preceded by where each begins and the end.

    ``inference_kernels.part`` reads them.
    """
    starts = accumulate((array.size for array in arrays), initial=len(arrays) + 1)
    return np.concatenate([[*starts], *(array.ravel() for array in arrays)], dtype=dtype)


def concluded_terms(rule_base: RuleBase) -> list[list[str]]:
    """For each output the terms that a rule concludes, in the order of their declaration."""
    outputs = list(rule_base.outputs.values())
    concluded = _group(outputs, (pair for rule in rule_base.rules for pair in rule.conclusions))
    return [
        [name for name in output.terms if name in group]
        for output, group in zip(outputs, concluded, strict=True)
    ]


def tables_of(rule_base: RuleBase) -> InferenceTables:
    """``rule_base`` as arrays."""
    terms = concluded_terms(rule_base)
    inputs, outputs = list(rule_base.inputs.values()), list(rule_base.outputs.values())
    literals = _group(
        inputs,
        ((atom.variable, atom) for rule in rule_base.rules for atom in atoms(rule.antecedent)),
    )
    literal_index = {atom: k for k, atom in enumerate(a for group in literals for a in group)}
    pairs = [(output, term) for output, names in zip(outputs, terms, strict=True) for term in names]
    term_index = {(output.name, term): k for k, (output, term) in enumerate(pairs)}
    programs = [
        _postfix(rule.antecedent, literal_index, rule_base.conjunction) for rule in rule_base.rules
    ]
    conclusions = [
        (number, term_index[pair])
        for number, rule in enumerate(rule_base.rules)
        for pair in rule.conclusions
    ]
    literal_ys = [
        rule_base.inputs[atom.variable].sampled(atom.term, atom.hedges) for atom in literal_index
    ]
    term_ys = _padded([output.sampled(term) for output, term in pairs])
    longest = max(output.universe.size for output in outputs)
    modes = (
        _METHODS[rule_base.defuzzify],
        rule_base.implication == "prod",
        max(len(program) for program in programs),
        longest * (1 + max(len(names) for names in terms)),
    )
    return InferenceTables(
        input_xs=np.concatenate([variable.universe for variable in inputs]),
        input_starts=_starts([variable.universe.size for variable in inputs]),
        literal_ys=_padded(literal_ys),
        literal_starts=_starts([len(group) for group in literals]),
        program=np.array([op for program in programs for op in program], dtype=np.int64),
        program_starts=_starts([len(program) for program in programs]),
        weights=np.array([rule.weight for rule in rule_base.rules]),
        conclusions=np.array(conclusions, dtype=np.int64),
        output_xs=np.concatenate([variable.universe for variable in outputs]),
        output_starts=_starts([variable.universe.size for variable in outputs]),
        term_ys=term_ys,
        term_starts=_starts([len(names) for names in terms]),
        support=np.array([(row.nonzero()[0][0], row.nonzero()[0][-1]) for row in term_ys]),
        defaults=np.array([np.nan if v.default is None else v.default for v in outputs]),
        modes=np.array(modes, dtype=np.int64),
    )


def _group(variables: Sequence[Variable], items: Any) -> list[list[Any]]:
    """The distinct values of ``items`` (variable name, value), grouped by variable."""
    groups: dict[str, dict[Any, None]] = {variable.name: {} for variable in variables}
    for name, item in items:
        groups[name][item] = None
    return [list(group) for group in groups.values()]


def _postfix(clause: Clause, index: Mapping[Is, int], conjunction: str) -> list[int]:
    match clause:
        case Is():
            return [index[clause]]
        case Not(inner):
            return [*_postfix(inner, index, conjunction), inference_kernels.NOT]
        case And(left, right):
            op = inference_kernels.AND_MIN if conjunction == "min" else inference_kernels.AND_PROD
        case Or(left, right):
            op = inference_kernels.OR_MAX
    return [*_postfix(left, index, conjunction), *_postfix(right, index, conjunction), op]


def _starts(lengths: Sequence[int]) -> Indices:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _padded(rows: Sequence[Array]) -> Array:
    """Rows of different length as one array, the shorter ones padded with zeros."""
    table = np.zeros((len(rows), max(row.size for row in rows)))
    for target, row in zip(table, rows, strict=True):
        target[: row.size] = row
    return table
