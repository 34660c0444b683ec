"""The compiled evaluator: a rule base as arrays, evaluated for many samples by one kernel.

A call costs some 10 microseconds plus about one per sample; scikit-fuzzy needs milliseconds per
sample. Results equal those of scikit-fuzzy to 1e-6, as tests and ``navfw bench perception`` show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple, TypedDict

import numpy as np
import numpy.typing as npt

from navfw.errors import RuleBaseError, UnknownNameError
from navfw.fuzzy import inference_kernels
from navfw.fuzzy.inference_kernels import infer
from navfw.fuzzy.rulebase import And, Clause, Is, Not, Or, RuleBase, Variable, atoms
from navfw.numerics import Array
from navfw.numerics.arrays import Indices


class FiredRule(TypedDict):
    """A rule's sentence as in its file, and its strength in [0, 1], weight included."""

    rule: str
    strength: float


def _pack(arrays: Sequence[npt.NDArray[Any]], dtype: type[Any]) -> npt.NDArray[Any]:
    """``arrays`` one after the other in one, flat, preceded by where each begins and the end.

    ``inference_kernels.part`` reads them.
    """
    starts = accumulate((array.size for array in arrays), initial=len(arrays) + 1)
    return np.concatenate([[*starts], *(array.ravel() for array in arrays)], dtype=dtype)


def _concluded_terms(rule_base: RuleBase) -> list[list[str]]:
    """For each output the terms that a rule concludes, in the order of their declaration."""
    outputs = list(rule_base.outputs.values())
    concluded = _group(outputs, (pair for rule in rule_base.rules for pair in rule.conclusions))
    return [
        [name for name in output.terms if name in group]
        for output, group in zip(outputs, concluded, strict=True)
    ]


def _tables_of(rule_base: RuleBase) -> tuple[Array, Indices]:
    """``rule_base`` as the arguments of ``inference_kernels.infer`` after x: numbers, and indices.

    Arrays of each are packed as one: the kernel knows them by their order here.
    """
    terms = _concluded_terms(rule_base)
    inputs, outputs = list(rule_base.inputs.values()), list(rule_base.outputs.values())
    literals = _group(
        inputs,
        ((atom.variable, atom) for rule in rule_base.rules for atom, _ in atoms(rule.antecedent)),
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
        rule_base.implication == "prod",
        max(len(program) for program in programs),
        longest * (1 + max(len(names) for names in terms)),
    )
    reals = [
        np.concatenate([variable.universe for variable in inputs]),
        _padded(literal_ys),  # (literals, longest universe) degree of "input IS hedges term"
        np.array([rule.weight for rule in rule_base.rules]),
        np.concatenate([variable.universe for variable in outputs]),
        term_ys,  # (terms, longest universe) of the terms that rules conclude
        np.array([np.nan if v.default is None else v.default for v in outputs]),
    ]
    indices = [
        _starts([variable.universe.size for variable in inputs]),
        _starts([len(group) for group in literals]),  # literals are grouped by input
        np.array([op for program in programs for op in program]),  # antecedents in postfix form
        _starts([len(program) for program in programs]),
        np.array(conclusions),  # (conclusions, 2) rule, term
        _starts([variable.universe.size for variable in outputs]),
        _starts([len(names) for names in terms]),  # terms are grouped by output
        np.array([(row.nonzero()[0][0], row.nonzero()[0][-1]) for row in term_ys]),  # above zero
        np.array(modes),  # implication is prod, depth of stack, workspace
    ]
    return _pack(reals, np.float64), _pack(indices, np.int64)


def _group(variables: Sequence[Variable], items: Any) -> list[list[Any]]:
    """Return the distinct values of ``items`` (variable name, value), grouped by variable."""
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


class ResultLayout(NamedTuple):
    """The columns of a result table; shared by all results of one evaluator."""

    rules: int  # number of rules; their strengths are the first columns
    terms: Mapping[str, Mapping[str, int | None]]  # activations; None: no rule concludes the term
    outputs: Mapping[str, int]  # crisp values


class Inference:
    """The results for N samples; arrays are views of one table (N, columns).

    A crisp output is the output's ``default``, or NaN without one, if an input is NaN or no rule
    concludes about the output (all its terms at or below ``inference_kernels.FIRING_FLOOR``).
    """

    def __init__(self, table: Array, layout: ResultLayout) -> None:
        self._table = table
        self._layout = layout

    @property
    def firing(self) -> Array:
        """Strengths (N, rules) of the rules, weight included, in the order of the rule base."""
        return self._table[:, : self._layout.rules]

    @cached_property
    def outputs(self) -> dict[str, Array]:
        """Crisp values (N,) of every output by name, in the output's unit."""
        return {name: self._table[:, column] for name, column in self._layout.outputs.items()}

    @cached_property
    def degrees(self) -> dict[str, dict[str, Array]]:
        """Activations (N,) by output and term: the largest strength of the term's rules."""
        return {
            output: {term: self._column(column) for term, column in columns.items()}
            for output, columns in self._layout.terms.items()
        }

    def degree(self, output: str, term: str) -> Array:
        """Return ``degrees[output][term]`` (N,), without building the other ones."""
        return self._column(self._layout.terms[output][term])

    def first(self, output: str) -> dict[str, float]:
        """Return the activations of all terms of ``output`` for the first sample, by term."""
        return dict(zip(self._layout.terms[output], self.activations(output), strict=True))

    def activations(self, output: str) -> list[float]:
        """Return the activations of ``output`` for the first sample, in the order of its terms."""
        row: list[float] = self._table[0].tolist()
        columns = self._layout.terms[output].values()
        return [0.0 if column is None else row[column] for column in columns]

    def crisp(self, output: str) -> Array:
        """Return ``outputs[output]`` (N,), without building the other ones."""
        return self._table[:, self._layout.outputs[output]]

    def _column(self, column: int | None) -> Array:
        return np.zeros(self._table.shape[0]) if column is None else self._table[:, column]

    def __len__(self) -> int:
        return int(self._table.shape[0])


class CompiledFis:
    """Evaluates one rule base; stateless, so that one instance can be shared.

    >>> fis = CompiledFis(load_rule_base("slope.yaml"))  # doctest: +SKIP
    >>> fis.evaluate({"ratio": np.array([0.5, -0.5])}).outputs["slope"]  # doctest: +SKIP
    """

    def __init__(self, rule_base: RuleBase) -> None:
        self.rule_base = rule_base
        self._tables = _tables_of(rule_base)
        self._layout = _layout(rule_base)
        self._row_of = {name: row for row, name in enumerate(rule_base.inputs)}

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of the rows of ``evaluate_rows``."""
        return tuple(self._row_of)

    def evaluate(self, inputs: Mapping[str, npt.ArrayLike]) -> Inference:
        """Evaluate the rules on inputs by name: scalars or arrays (N,), clipped to their ranges.

        Raises:
            UnknownNameError: the rule base has no such input.
            RuleBaseError: an input is missing.
            ValueError: the arrays differ in length, or are not one-dimensional.

        """
        row_of = self._row_of
        if inputs.keys() != row_of.keys():
            raise self._names_error(inputs)
        sizes = [np.size(value) for value in inputs.values()]
        samples = 0 if 0 in sizes else max(sizes, default=1)
        rows = np.empty((len(row_of), samples))
        for name, value in inputs.items():
            try:
                rows[row_of[name]] = value
            except ValueError:
                raise ValueError(
                    f"input {name!r} of rule base {self.rule_base.name!r}: expected a scalar or "
                    f"{samples} numbers like the others, got shape {np.shape(value)}"
                ) from None
        return self.evaluate_rows(rows)

    def evaluate_one(self, inputs: Mapping[str, float]) -> Inference:
        """Evaluate the rules on one number per input; faster than ``evaluate``.

        Raises:
            UnknownNameError: the rule base has no such input.
            RuleBaseError: an input is missing.

        """
        if inputs.keys() != self._row_of.keys():
            raise self._names_error(inputs)
        sample = [[inputs[name]] for name in self._row_of]
        return Inference(infer(np.array(sample, dtype=np.float64), *self._tables), self._layout)

    def evaluate_rows(self, rows: Array) -> Inference:
        """Evaluate the rules on ``rows`` (inputs, N), one row per input as in ``input_names``.

        Raises:
            ValueError: the number of rows is not the number of inputs.

        """
        # For another type or memory layout numba would compile the kernel again, for seconds.
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[0] != len(self._row_of):
            raise ValueError(
                f"rule base {self.rule_base.name!r}: expected an array of shape "
                f"({len(self._row_of)}, N), got {rows.shape}"
            )
        return Inference(infer(rows, *self._tables), self._layout)

    def explain(self, result: Inference, index: int = 0, minimum: float = 0.05) -> list[FiredRule]:
        """List the rules that fired for sample ``index`` with ``minimum`` or more, strongest first.

        Rules of equal strength keep the order of the rule base. One of strength 0 is never listed.
        """
        listed = [
            FiredRule(rule=rule.sentence, strength=strength)
            for rule, strength in zip(
                self.rule_base.rules, result.firing[index].tolist(), strict=True
            )
            if strength > 0.0 and strength >= minimum
        ]
        return sorted(listed, key=lambda fired: -fired["strength"])

    def _names_error(self, inputs: Mapping[str, Any]) -> RuleBaseError | UnknownNameError:
        rule_base = self.rule_base
        for name in inputs:
            if name not in self._row_of:
                what = f"input of rule base {rule_base.name!r}"
                return UnknownNameError(what, name, self._row_of, file=rule_base.file)
        missing = ", ".join(repr(name) for name in self._row_of if name not in inputs)
        return RuleBaseError(
            f"rule base {rule_base.name!r}: expected a value for every input, missing {missing}",
            file=rule_base.file,
        )


def _layout(rule_base: RuleBase) -> ResultLayout:
    """Columns: strengths of the rules, activations of the concluded terms, crisp outputs."""
    columns: dict[str, dict[str, int | None]] = {}
    column = len(rule_base.rules)
    terms = _concluded_terms(rule_base)
    for output, names in zip(rule_base.outputs.values(), terms, strict=True):
        columns[output.name] = dict.fromkeys(output.terms)
        for name in names:
            columns[output.name][name] = column
            column += 1
    crisp = {name: column + k for k, name in enumerate(rule_base.outputs)}
    return ResultLayout(len(rule_base.rules), columns, crisp)
