"""Coverage: wherever the inputs are within their ranges, some rule must speak about each output.

A rule fires (strength above zero) or not depending only on whether each of its literals has degree
0, 1, or something between. Along one input these classes change only at samples of its universe, so
the input falls into finitely many cells (samples, and the open intervals between them), and the
search over all combinations of cells is exact. Cells in which less can fire than in others decide.

An output with an explicit ``default: <value>`` in its declaration is not checked: where no rule
fires, it takes that value.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from navfw.errors import RuleBaseError
from navfw.fuzzy.grammar import And, Clause, Is, Not, Or
from navfw.fuzzy.inference_kernels import FIRING_FLOOR

if TYPE_CHECKING:
    from navfw.fuzzy.rulebase import RuleBase, Variable

__all__ = ["Interval", "check_coverage", "uncovered_region"]

Classes = npt.NDArray[np.int8]
# Degrees by class: zero, between, one. Ordered, so AND is min, OR is max, NOT is 2 - class.
_ZERO, _BETWEEN, _ONE = 0, 1, 2
# More combinations of cells than this would take seconds to search.
MAX_COMBINATIONS = 4_000_000


@dataclass(frozen=True, slots=True)
class Interval:
    """A stretch of one input: its ends, whether they belong to it, the terms that hold on it."""

    variable: Variable
    low: float
    high: float
    closed_low: bool
    closed_high: bool
    terms: tuple[str, ...]

    def __str__(self) -> str:
        unit = "" if self.variable.unit == "1" else f" {self.variable.unit}"
        if self.low == self.high:
            where = f"is exactly {self.low:g}{unit}"
        else:
            brackets = "[" if self.closed_low else "(", "]" if self.closed_high else ")"
            where = f"is in {brackets[0]}{self.low:g}, {self.high:g}{brackets[1]}{unit}"
        words = " or ".join(self.terms) if self.terms else "none of its terms"
        return f"{self.variable.name} {where} ({words})"


def check_coverage(rule_base: RuleBase) -> None:
    """Make sure that every output without a ``default`` is concluded for all inputs.

    Raises:
        RuleBaseError: names, for each such output, a region in which no rule fires for it.

    """
    problems = []
    for output in rule_base.outputs.values():
        if output.default is not None:
            continue
        region = uncovered_region(rule_base, output.name)
        if region is not None:
            where = " and ".join(map(str, region)) or "the inputs are anything"
            problems.append((output, f"no rule concludes about {output.name!r} where {where}"))
    if problems:
        first = problems[0][0]
        advice = "add a rule or widen a term, or give the output a 'default: <value>'"
        message = "\n".join(text for _, text in problems) + f"\n{advice}"
        raise RuleBaseError(
            message, file=rule_base.file, line=first.line, key=f"outputs.{first.name}"
        )


def uncovered_region(rule_base: RuleBase, output: str) -> tuple[Interval, ...] | None:
    """A region in which no rule for ``output`` fires, or None if there is none.

    It is given by the inputs that bound it; over the whole range of the others nothing fires.

    Raises:
        RuleBaseError: the rules combine too many inputs and terms to be searched.

    """
    clauses = [
        rule.antecedent
        for rule in rule_base.rules
        if any(concluded == output for concluded, _ in rule.conclusions)
    ]
    axes = _axes(rule_base, clauses)
    minimal = [axis.extreme_cells(range(axis.cells), most=False) for axis in axes]
    combinations = math.prod(len(cells) for cells in minimal)
    if combinations > MAX_COMBINATIONS:
        raise RuleBaseError(
            f"the rules about {output!r} combine too many inputs and terms to check that they "
            f"cover everything ({combinations} cases); split the rule base, or give the output a "
            "'default: <value>'",
            file=rule_base.file,
            line=rule_base.outputs[output].line,
            key=f"outputs.{output}",
        )
    silent = _silent(clauses, axes, minimal)
    if not silent.any():
        return None
    first = np.unravel_index(int(np.argmax(silent)), silent.shape)
    seed = [int(cells[k]) for cells, k in zip(minimal, first, strict=True)]
    box = _grown(clauses, axes, seed)
    return tuple(
        axis.interval(cells[0], cells[-1])
        for axis, cells in zip(axes, box, strict=True)
        if len(cells) < axis.cells
    )


class _Axis:
    """One input cut into cells: cell 2i is sample i, cell 2i + 1 the open interval after it."""

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
        """Of ``cells``, one (the widest) of each kind than which in no other more (less) fires."""
        chosen = np.asarray(cells)
        kinds, kind_of = np.unique(self._oriented[chosen], axis=0, return_inverse=True)
        kind_of = kind_of.reshape(-1)
        beside = kinds if most else -kinds
        beaten = np.asarray((beside[:, None, :] <= beside[None, :, :]).all(axis=2))
        np.fill_diagonal(beaten, False)
        width = np.zeros(self.cells)
        width[1::2] = np.diff(self.variable.universe)
        return [
            int(chosen[np.argmax(np.where(kind_of == kind, width[chosen], -1.0))])
            for kind in np.flatnonzero(~beaten.any(axis=1))
        ]

    def interval(self, first: int, last: int) -> Interval:
        """The cells ``first`` to ``last`` as numbers and words."""
        xs = self.variable.universe
        terms = [
            term
            for term in self.variable.terms
            if _cell_classes(self.variable.sampled(term))[first : last + 1].any()
        ]
        return Interval(
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
        for literal, depth in _negations(clause):
            depths.setdefault(literal.variable, {}).setdefault(literal, set()).add(depth)
    return [
        _Axis(variable, depths[name])
        for name, variable in rule_base.inputs.items()
        if name in depths
    ]


def _negations(clause: Clause, depth: int = 0) -> Iterator[tuple[Is, int]]:
    """Every literal with the number of NOTs around it."""
    match clause:
        case Is():
            yield clause, depth
        case Not(inner):
            yield from _negations(inner, depth + 1)
        case And(left, right) | Or(left, right):
            yield from _negations(left, depth)
            yield from _negations(right, depth)


def _cell_classes(degrees: npt.NDArray[np.float64]) -> Classes:
    """Classes of a sampled term over the cells of its universe."""
    points = np.full(degrees.size, _BETWEEN, dtype=np.int8)
    points[degrees <= FIRING_FLOOR] = _ZERO
    points[degrees >= 1.0 - FIRING_FLOOR] = _ONE
    cells = np.empty(2 * degrees.size - 1, dtype=np.int8)
    cells[::2] = points
    # Straight between samples: zero or one only where it is so at both ends.
    cells[1::2] = np.where(points[:-1] == points[1:], points[1:], _BETWEEN)
    return cells


def _collapse(classes: Classes, depths: set[int]) -> Classes:
    """Forget distinctions that cannot matter: fewer kinds of cells remain to be combined."""
    if depths == {0}:  # only zero or not
        return np.minimum(classes, _BETWEEN)
    if depths == {1}:  # only one or not
        return np.maximum(classes, _BETWEEN)
    return classes


def _silent(
    clauses: Sequence[Clause], axes: Sequence[_Axis], cells: Sequence[Sequence[int]]
) -> npt.NDArray[np.bool_]:
    """Where in the product of the given cells (one list an axis) no clause is above zero."""
    table: dict[Is, Classes] = {}
    for number, (axis, chosen) in enumerate(zip(axes, cells, strict=True)):
        shape = [1] * len(axes)
        shape[number] = len(chosen)
        for literal, classes in axis.literals.items():
            table[literal] = classes[list(chosen)].reshape(shape)
    silent = np.ones([len(chosen) for chosen in cells], dtype=np.bool_)
    for clause in clauses:
        silent &= _class_of(clause, table) == _ZERO
    return silent


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


def _grown(
    clauses: Sequence[Clause], axes: Sequence[_Axis], seed: Sequence[int]
) -> list[list[int]]:
    """The silent combination ``seed`` widened, one input after the other, as far as it goes."""
    box = [[cell] for cell in seed]
    # Inputs that do not matter there come first, so that they do not appear as bounds.
    reach = [
        len(_span(clauses, axes, box, number)) / axis.cells for number, axis in enumerate(axes)
    ]
    for number in sorted(range(len(axes)), key=lambda number: -reach[number]):
        box[number] = _span(clauses, axes, box, number)
    return box


def _span(
    clauses: Sequence[Clause], axes: Sequence[_Axis], box: Sequence[Sequence[int]], number: int
) -> list[int]:
    """The longest run of cells of one input, around its cell in ``box``, that stays silent."""
    # The box is silent if it is so where most fires; that spares its product of cells.
    trial = [axis.extreme_cells(cells, most=True) for axis, cells in zip(axes, box, strict=True)]
    trial[number] = list(range(axes[number].cells))
    silent = _silent(clauses, axes, trial)
    free = np.asarray(silent.all(axis=tuple(k for k in range(len(axes)) if k != number)))
    first = last = box[number][0]
    while first > 0 and free[first - 1]:
        first -= 1
    while last < free.size - 1 and free[last + 1]:
        last += 1
    return list(range(first, last + 1))
