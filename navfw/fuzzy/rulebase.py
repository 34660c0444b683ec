"""Rule bases as plain data: linguistic variables with their terms, rules, and the rule base itself.

Spec of a rule base file: ``rulespec``. Check of its coverage: ``coverage``. Loading: ``rulefile``.
``CompiledFis`` evaluates a ``RuleBase``.

The grammar of rules: ``IF nearest IS very near AND NOT side IS left THEN turn IS left``.

    rule        = "IF" or "THEN" conclusions [ "WITH" number [ "WEIGHT" ] ]
    or          = and { "OR" and }
    and         = not { "AND" not }
    not         = "NOT" not | "(" or ")" | input "IS" [ "NOT" ] { hedge } term
    hedge       = "very" | "somewhat"
    conclusions = output "IS" term { ( "," | "AND" ) output "IS" term }

Keywords are case-insensitive, names are not. NOT binds before AND, AND before OR. The weight, above
0 and at most 1, scales the firing strength of the rule.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

from navfw.errors import did_you_mean
from navfw.fuzzy.membership import HEDGES, Shape, hedged, sample_universe
from navfw.numerics import Array

KEYWORDS = frozenset({"IF", "IS", "AND", "OR", "NOT", "THEN", "WITH", "WEIGHT"})
NAME_PATTERN = r"[A-Za-z_][A-Za-z0-9_]*"
_MAX_NESTING = 50  # derived
"""Largest depth of NOT and parentheses, below Python's limit of recursion."""

_TOKEN = re.compile(
    rf"\s*(?:(?P<name>{NAME_PATTERN})|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<mark>[(),])|(?P<other>\S))"
)


@dataclass(frozen=True, slots=True)
class Is:
    """The literal ``variable IS hedges term``."""

    variable: str
    term: str
    hedges: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.variable} IS {' '.join((*self.hedges, self.term))}"


@dataclass(frozen=True, slots=True)
class Not:
    """Negation: one minus the degree of ``clause``."""

    clause: Clause

    def __str__(self) -> str:
        return f"NOT {_grouped(self.clause)}"


@dataclass(frozen=True)
class _Joined:
    """Two clauses joined by the word that is the name of the subclass."""

    left: Clause
    right: Clause

    def __str__(self) -> str:
        kind = type(self)
        return f"{_grouped(self.left, kind)} {kind.__name__.upper()} {_grouped(self.right)}"


class And(_Joined):
    """Conjunction: the smaller degree, or the product (``and: prod``)."""


class Or(_Joined):
    """Disjunction: the larger degree."""


Clause = Is | Not | And | Or


def _grouped(clause: Clause, joined: type[_Joined] | None = None) -> str:
    bare = isinstance(clause, Is | Not) or (joined is not None and isinstance(clause, joined))
    return str(clause) if bare else f"({clause})"


def atoms(clause: Clause, depth: int = 0) -> Iterator[tuple[Is, int]]:
    """Yield the literals of ``clause``, left to right, each with the number of NOTs around it."""
    match clause:
        case Is():
            yield clause, depth
        case Not(inner):
            yield from atoms(inner, depth + 1)
        case And(left, right) | Or(left, right):
            yield from atoms(left, depth)
            yield from atoms(right, depth)


class SentenceError(ValueError):
    """A rule sentence cannot be parsed; ``column`` is 1-based, ``problem`` the reason."""

    def __init__(self, problem: str, sentence: str, column: int) -> None:
        self.problem = problem
        self.sentence = sentence
        self.column = column
        super().__init__(f"{problem} (column {column})\n    {sentence}\n    {' ' * (column - 1)}^")


class _Token(NamedTuple):
    kind: str  # name | number | mark | other | keyword | end
    text: str
    column: int

    def is_word(self, word: str) -> bool:
        return self.kind == "keyword" and self.text.upper() == word

    def __str__(self) -> str:
        return "the end of the sentence" if self.kind == "end" else repr(self.text)


Vocabulary = Mapping[str, Collection[str]]
"""The terms of each variable, by its name."""


def parse_rule(sentence: str, inputs: Vocabulary, outputs: Vocabulary) -> Rule:
    """Parse one rule about the variables and terms of ``inputs`` and ``outputs``.

    Raises:
        SentenceError: names what was expected, what was found, the column, and the nearest name.

    """
    return _Parser(sentence, inputs, outputs).rule()


def _tokens(sentence: str) -> list[_Token]:
    tokens = []
    for match in _TOKEN.finditer(sentence):
        kind = str(match.lastgroup)
        text, column = match.group(kind), match.start(kind) + 1
        if kind == "name" and text.upper() in KEYWORDS:
            kind = "keyword"
        tokens.append(_Token(kind, text, column))
    tokens.append(_Token("end", "", len(sentence.rstrip()) + 1))
    return tokens


class _Parser:
    """Recursive descent over the tokens of one sentence."""

    def __init__(self, sentence: str, inputs: Vocabulary, outputs: Vocabulary) -> None:
        self._sentence = sentence
        self._inputs = inputs
        self._outputs = outputs
        self._tokens = _tokens(sentence)
        self._next = 0
        self._depth = 0

    @property
    def _token(self) -> _Token:
        return self._tokens[self._next]

    def _advance(self) -> _Token:
        token = self._token
        self._next += token.kind != "end"
        return token

    def _skipped(self, word: str) -> bool:
        """Whether the next token is the keyword ``word``, which is then skipped."""
        is_next = self._token.is_word(word)
        self._next += is_next
        return is_next

    def _error(self, problem: str, token: _Token | None = None) -> SentenceError:
        return SentenceError(problem, self._sentence, (token or self._token).column)

    def _expected(self, what: str) -> SentenceError:
        return self._error(f"expected {what}, got {self._token}")

    def _keyword(self, word: str, after: str = "") -> None:
        if not self._skipped(word):
            hint = ""
            if self._token.kind == "name":
                near = did_you_mean(self._token.text.upper(), [word])
                hint = f"; {near}" if near.startswith("did") else ""
            raise self._error(f"expected {word}{after}, got {self._token}{hint}")

    def rule(self) -> Rule:
        self._keyword("IF")
        antecedent = self._or()
        if self._token.kind == "mark" and self._token.text == ")":
            raise self._error("expected AND, OR or THEN, got ')' without its '('")
        if not self._skipped("THEN"):
            raise self._expected("AND, OR or THEN")
        conclusions = self._conclusions()
        weight = self._weight()
        if self._token.kind != "end":
            raise self._expected("',', WITH or the end of the sentence")
        return Rule(self._sentence, antecedent, conclusions, weight)

    def _or(self) -> Clause:
        clause = self._and()
        while self._skipped("OR"):
            clause = Or(clause, self._and())
        return clause

    def _and(self) -> Clause:
        clause = self._not()
        while self._skipped("AND"):
            clause = And(clause, self._not())
        return clause

    def _not(self) -> Clause:
        self._depth += 1
        if self._depth > _MAX_NESTING:
            raise self._error(f"expected at most {_MAX_NESTING} levels of NOT and parentheses")
        clause = self._primary()
        self._depth -= 1
        return clause

    def _primary(self) -> Clause:
        if self._skipped("NOT"):
            return Not(self._not())
        if self._token.text == "(":
            opening = self._advance()
            clause = self._or()
            if self._token.text != ")":
                raise self._expected(f"AND, OR or the ')' of the '(' in column {opening.column}")
            self._advance()
            return clause
        return self._literal()

    def _literal(self) -> Clause:
        variable = self._variable("input", self._inputs, self._outputs)
        self._keyword("IS", f" after {variable!r}")
        negated = self._skipped("NOT")
        terms = self._inputs[variable]
        hedges = []
        while self._token.text in HEDGES and self._token.text not in terms:
            hedges.append(self._advance().text)
        literal = Is(variable, self._term(variable, terms, HEDGES), tuple(hedges))
        return Not(literal) if negated else literal

    def _variable(self, role: str, vocabulary: Vocabulary, others: Vocabulary) -> str:
        token = self._token
        if token.kind != "name":
            raise self._expected(f"an {role}" + (", NOT or '('" if role == "input" else ""))
        if token.text not in vocabulary:
            if token.text in others:
                side = "THEN" if role == "input" else "IF"
                hint = f"it is used after {side}; known: {', '.join(sorted(vocabulary))}"
            else:
                hint = did_you_mean(token.text, vocabulary)
            raise self._error(f"expected an {role}, got {token}: {hint}")
        return self._advance().text

    def _term(self, variable: str, terms: Collection[str], words: Iterable[str] = ()) -> str:
        token = self._token
        if token.kind != "name":
            raise self._expected(f"a term of {variable!r} ({', '.join(terms)})")
        if token.text not in terms:
            if token.text in HEDGES:
                raise self._error(f"expected a term of {variable!r}: conclusions take no hedge")
            hint = did_you_mean(token.text, [*terms, *words])
            raise self._error(f"expected a term of {variable!r}, got {token}: {hint}")
        return self._advance().text

    def _conclusions(self) -> tuple[tuple[str, str], ...]:
        conclusions: dict[str, str] = {}
        while True:
            start = self._token
            output = self._variable("output", self._outputs, self._inputs)
            if output in conclusions:
                raise self._error(f"expected each output once, got {output!r} again", start)
            self._keyword("IS", f" after {output!r}")
            conclusions[output] = self._term(output, self._outputs[output])
            if self._token.text == ",":
                self._advance()
            elif not self._skipped("AND"):
                return tuple(conclusions.items())

    def _weight(self) -> float:
        if not self._skipped("WITH"):
            return 1.0
        token = self._token
        value = float(token.text) if token.kind == "number" else -1.0
        if not 0.0 < value <= 1.0:
            raise self._expected("a weight above 0 and at most 1")
        self._advance()
        self._skipped("WEIGHT")
        return value


Norm: TypeAlias = Literal["min", "prod"]
"""A t-norm: minimum or product."""


@dataclass(frozen=True)
class Variable:
    """An input or output: its range, unit, and its terms in the order of the file.

    ``default`` (outputs only) is the crisp value if no rule fires; None means that the rules must
    cover all inputs. ``line`` is the 1-based line of the declaration in the file.
    """

    name: str
    low: float
    high: float
    terms: Mapping[str, Shape]
    unit: str = "1"
    points: int = 101
    default: float | None = None
    line: int | None = None

    @property
    def unit_text(self) -> str:
        """The unit as it is printed: empty for a mere number."""
        return "" if self.unit == "1" else self.unit

    @cached_property
    def _sampled(self) -> dict[tuple[str, tuple[str, ...]], Array]:
        return {}

    @cached_property
    def universe(self) -> Array:
        """Samples (M,) of the range, increasing; terms are linear between them."""
        universe = sample_universe(self.low, self.high, self.points, self.terms.values())
        universe.flags.writeable = False
        return universe

    def sampled(self, term: str, hedges: tuple[str, ...] = ()) -> Array:
        """Compute the degrees (M,) of ``term`` over the universe, with ``hedges`` applied."""
        if (term, hedges) not in self._sampled:
            degrees = hedged(self.terms[term](self.universe), hedges)
            degrees.flags.writeable = False
            self._sampled[term, hedges] = degrees
        return self._sampled[term, hedges]


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
    (prod) a conclusion. ``file`` is the file that it was read from, for error messages.
    """

    name: str
    inputs: Mapping[str, Variable]
    outputs: Mapping[str, Variable]
    rules: tuple[Rule, ...]
    conjunction: Norm = "min"
    implication: Norm = "min"
    file: str | None = field(default=None, compare=False)
