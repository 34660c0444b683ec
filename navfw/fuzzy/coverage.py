"""Coverage check: for all inputs within their ranges, some rule must conclude about each output.

Whether a rule fires (strength above zero) depends only on whether each of its literals has degree
0, 1, or something between. Along one input these classes change only at samples of its universe.
Each input therefore divides into finitely many cells (the samples, and the open intervals between
them), and the search over all combinations of cells is exact. Of the cells of an input, only those
in which the least can fire need to be searched.

An output with an explicit ``default: <value>`` in its declaration is not checked: where no rule
fires, it takes that value.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.errors import RuleBaseError
from navfw.fuzzy.inference_kernels import FIRING_FLOOR
from navfw.fuzzy.rulebase import And, Clause, Is, Not, Or, RuleBase, Variable, atoms

Classes = npt.NDArray[np.int8]
# Classes of degrees. They are ordered, so AND is min, OR is max, and NOT is 2 - class.
_ZERO, _BETWEEN, _ONE = 0, 1, 2  # defined
_MAX_COMBINATIONS = 4_000_000  # chosen
"""Largest number of combinations of cells to search; more would take seconds."""


@dataclass(frozen=True, slots=True)
class InputInterval:
    """An interval of one input: bounds [its unit], whether they belong to it, terms above zero."""

    variable: Variable
    low: float
    high: float
    closed_low: bool
    closed_high: bool
    terms: tuple[str, ...]

    def __str__(self) -> str:
        unit = f" {self.variable.unit_text}" if self.variable.unit_text else ""
        if self.low == self.high:
            where = f"is exactly {self.low:g}{unit}"
        else:
            brackets = "[" if self.closed_low else "(", "]" if self.closed_high else ")"
            where = f"is in {brackets[0]}{self.low:g}, {self.high:g}{brackets[1]}{unit}"
        words = " or ".join(self.terms) if self.terms else "none of its terms"
        return f"{self.variable.name} {where} ({words})"


def check_coverage(rule_base: RuleBase) -> None:
    """Check that for all inputs a rule fires for each output that has no ``default``.

    Raises:
        RuleBaseError: names, for each uncovered output, a region in which no rule fires.

    """
    problems = []
    for output in rule_base.outputs.values():
        if output.default is not None:
            continue
        region = uncovered_region(rule_base, output.name)
        if region is not None:
            where = " and ".join(map(str, region)) or "the inputs have any value"
            problems.append((output, f"no rule concludes about {output.name!r} where {where}"))
    if problems:
        first = problems[0][0]
        advice = "add a rule or widen a term, or give the output a 'default: <value>'"
        message = "\n".join(text for _, text in problems) + f"\n{advice}"
        raise RuleBaseError(
            message, file=rule_base.file, line=first.line, key=f"outputs.{first.name}"
        )


def uncovered_region(rule_base: RuleBase, output: str) -> tuple[InputInterval, ...] | None:
    """Find a region of the inputs in which no rule for ``output`` fires; None if there is none.

    The region is an interval of each input that bounds it; the other inputs may have any value.

    Raises:
        RuleBaseError: the inputs and terms have more than 4,000,000 combinations.

    """
    clauses = [
        rule.antecedent
        for rule in rule_base.rules
        if any(concluded == output for concluded, _ in rule.conclusions)
    ]
    axes = _axes(rule_base, clauses)
    minimal = [axis.extreme_cells(range(axis.cells), most=False) for axis in axes]
    combinations = math.prod(len(cells) for cells in minimal)
    if combinations > _MAX_COMBINATIONS:
        raise RuleBaseError(
            f"the rules about {output!r} combine too many inputs and terms for the coverage check "
            f"({combinations} cases, at most {_MAX_COMBINATIONS}); split the rule base, or give "
            "the output a 'default: <value>'",
            file=rule_base.file,
            line=rule_base.outputs[output].line,
            key=f"outputs.{output}",
        )
    uncovered = _uncovered(clauses, axes, minimal)
    if not uncovered.any():
        return None
    first = np.unravel_index(int(np.argmax(uncovered)), uncovered.shape)
    seed = [int(cells[k]) for cells, k in zip(minimal, first, strict=True)]
    box = _widened(clauses, axes, seed)
    return tuple(
        axis.interval(cells[0], cells[-1])
        for axis, cells in zip(axes, box, strict=True)
        if len(cells) < axis.cells
    )


class _Axis:
    """The cells of one input: cell 2i is sample i, cell 2i + 1 the open interval after it.

    ``depths`` are the numbers of NOTs around each literal about this input.
    """

    def __init__(self, variable: Variable, depths: Mapping[Is, set[int]]) -> None:
        self.variable = variable
        self.literals = {
            literal: _collapse(_cell_classes(variable.sampled(literal.term, literal.hedges)), depth)
            for literal, depth in depths.items()
        }
        self.cells = 2 * variable.universe.size - 1
        self._oriented = np.array(
            [
                classes if even else _ONE - classes
                for literal, classes in self.literals.items()
                for even in {depth % 2 == 0 for depth in depths[literal]}
            ]
        ).T

    def extreme_cells(self, cells: Sequence[int], most: bool) -> list[int]:
        """The cells of ``cells`` in which the most (least) can fire: one, the widest, of each kind.

        Cells are of one kind when all literals have the same classes in them. A kind counts unless
        another one has classes at least (at most) as high for every literal.
        """
        chosen = np.asarray(cells)
        kinds, kind_of = np.unique(self._oriented[chosen], axis=0, return_inverse=True)
        kind_of = kind_of.reshape(-1)
        signed = kinds if most else -kinds
        dominated = np.asarray((signed[:, None, :] <= signed[None, :, :]).all(axis=2))
        np.fill_diagonal(dominated, False)
        width = np.zeros(self.cells)
        width[1::2] = np.diff(self.variable.universe)
        return [
            int(chosen[np.argmax(np.where(kind_of == kind, width[chosen], -1.0))])
            for kind in np.flatnonzero(~dominated.any(axis=1))
        ]

    def interval(self, first: int, last: int) -> InputInterval:
        """Return the interval that the cells ``first`` to ``last`` (inclusive) make up."""
        xs = self.variable.universe
        terms = [
            term
            for term in self.variable.terms
            if _cell_classes(self.variable.sampled(term))[first : last + 1].any()
        ]
        return InputInterval(
            self.variable,
            low=float(xs[first // 2]),
            high=float(xs[(last + 1) // 2]),
            closed_low=first % 2 == 0,
            closed_high=last % 2 == 0,
            terms=tuple(terms),
        )


def _axes(rule_base: RuleBase, clauses: Iterable[Clause]) -> list[_Axis]:
    depths: dict[str, dict[Is, set[int]]] = {}
    for clause in clauses:
        for literal, depth in atoms(clause):
            depths.setdefault(literal.variable, {}).setdefault(literal, set()).add(depth)
    return [
        _Axis(variable, depths[name])
        for name, variable in rule_base.inputs.items()
        if name in depths
    ]


def _cell_classes(degrees: npt.NDArray[np.float64]) -> Classes:
    """Classes of a sampled term, (M,) degrees, over the cells of its universe, (2M - 1,)."""
    points = np.full(degrees.size, _BETWEEN, dtype=np.int8)
    points[degrees <= FIRING_FLOOR] = _ZERO
    points[degrees >= 1.0 - FIRING_FLOOR] = _ONE
    cells = np.empty(2 * degrees.size - 1, dtype=np.int8)
    cells[::2] = points
    # Linear between samples: zero or one only where both ends are.
    cells[1::2] = np.where(points[:-1] == points[1:], points[1:], _BETWEEN)
    return cells


def _collapse(classes: Classes, depths: set[int]) -> Classes:
    """Merge classes that make no difference, so that fewer kinds of cells have to be combined."""
    if depths == {0}:  # never negated: only zero differs
        return np.minimum(classes, _BETWEEN)
    if depths == {1}:  # always negated: only one differs
        return np.maximum(classes, _BETWEEN)
    return classes


def _uncovered(
    clauses: Sequence[Clause], axes: Sequence[_Axis], cells: Sequence[Sequence[int]]
) -> npt.NDArray[np.bool_]:
    """Whether no clause is above zero, over the product of the given cells (one list per axis)."""
    table: dict[Is, Classes] = {}
    for number, (axis, chosen) in enumerate(zip(axes, cells, strict=True)):
        shape = [1] * len(axes)
        shape[number] = len(chosen)
        for literal, classes in axis.literals.items():
            table[literal] = classes[list(chosen)].reshape(shape)
    uncovered = np.ones([len(chosen) for chosen in cells], dtype=np.bool_)
    for clause in clauses:
        uncovered &= _class_of(clause, table) == _ZERO
    return uncovered


def _class_of(clause: Clause, table: Mapping[Is, Classes]) -> Classes:
    match clause:
        case Is():
            return table[clause]
        case Not(inner):
            return np.asarray(_ONE - _class_of(inner, table), dtype=np.int8)
        case And(left, right):
            return np.minimum(_class_of(left, table), _class_of(right, table))
        case Or(left, right):
            return np.maximum(_class_of(left, table), _class_of(right, table))


def _widened(
    clauses: Sequence[Clause], axes: Sequence[_Axis], seed: Sequence[int]
) -> list[list[int]]:
    """Return the uncovered cell ``seed`` widened to a box, one input after the other."""
    box = [[cell] for cell in seed]
    # Inputs that make no difference there come first, so that they do not bound the box.
    share = [
        len(_span(clauses, axes, box, number)) / axis.cells for number, axis in enumerate(axes)
    ]
    for number in sorted(range(len(axes)), key=lambda number: -share[number]):
        box[number] = _span(clauses, axes, box, number)
    return box


def _span(
    clauses: Sequence[Clause], axes: Sequence[_Axis], box: Sequence[Sequence[int]], number: int
) -> list[int]:
    """The longest run of cells of input ``number``, around its cell in ``box``, all uncovered."""
    # The box is uncovered if the cells in which the most can fire are: no need to search all of it.
    trial = [axis.extreme_cells(cells, most=True) for axis, cells in zip(axes, box, strict=True)]
    trial[number] = list(range(axes[number].cells))
    uncovered = _uncovered(clauses, axes, trial)
    free = np.asarray(uncovered.all(axis=tuple(k for k in range(len(axes)) if k != number)))
    first = last = box[number][0]
    while first > 0 and free[first - 1]:
        first -= 1
    while last < free.size - 1 and free[last + 1]:
        last += 1
    return list(range(first, last + 1))
