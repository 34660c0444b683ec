"""Rule bases as plain data: linguistic variables with their terms, rules, and the rule base itself.

Spec of a rule base file: ``rulespec``. Check of its coverage: ``coverage``. Loading: ``rulefile``.
``CompiledFis`` and ``ReferenceFis`` evaluate the same ``RuleBase``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, TypeAlias

from navfw.fuzzy.grammar import Clause
from navfw.fuzzy.membership import Shape, hedged, sample_universe
from navfw.numerics import Array

Defuzzification: TypeAlias = Literal["centroid", "bisector", "mom", "som", "lom"]
"""Centroid, bisector, mean / smallest / largest of maximum."""

Norm: TypeAlias = Literal["min", "prod"]
"""A t-norm: minimum or product."""


@dataclass(frozen=True)
class Variable:
    """An input or output: its range, unit, and its terms in the order of the file.

    ``default`` (outputs only) is the crisp value where no rule fires; None means that the rules
    must cover all inputs. ``line`` is the 1-based line of the declaration in the file.
    """

    name: str
    low: float
    high: float
    terms: Mapping[str, Shape]
    unit: str = "1"
    description: str = ""
    points: int = 101
    default: float | None = None
    line: int | None = None

    @cached_property
    def universe(self) -> Array:
        """The samples of the range, (M,), increasing; terms are linear between them."""
        universe = sample_universe(self.low, self.high, self.points, self.terms.values())
        universe.flags.writeable = False
        return universe

    def sampled(self, term: str, hedges: tuple[str, ...] = ()) -> Array:
        """The degrees of ``term`` over the universe, (M,), with ``hedges`` applied."""
        return hedged(self.terms[term](self.universe), hedges)


@dataclass(frozen=True)
class Rule:
    """One parsed rule: antecedent, conclusions as (output, term), and weight in (0, 1].

    ``sentence`` is its text in the file, ``line`` the 1-based line.
    """

    sentence: str
    antecedent: Clause
    conclusions: tuple[tuple[str, str], ...]
    weight: float = 1.0
    line: int | None = None


@dataclass(frozen=True)
class RuleBase:
    """One Mamdani inference system: immutable, independent of any evaluator.

    ``conjunction`` is the t-norm of AND (OR is the maximum); ``implication`` clips (min) or scales
    (prod) a conclusion. ``file`` is where it was read from, for error messages.
    """

    name: str
    inputs: Mapping[str, Variable]
    outputs: Mapping[str, Variable]
    rules: tuple[Rule, ...]
    conjunction: Norm = "min"
    implication: Norm = "min"
    defuzzify: Defuzzification = "centroid"
    description: str = ""
    file: str | None = field(default=None, compare=False)
