"""Rule bases as data: variables, terms and rules, read from YAML and checked.

A rule base says everything about one inference system. ``CompiledFis`` evaluates it fast,
``ReferenceFis`` evaluates it through scikit-fuzzy; both from this same object.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from navfw.config.document import KeyPath, YamlDocument, load_yaml, parse_yaml
from navfw.config.problems import Problem, config_error
from navfw.config.yamlfile import check
from navfw.errors import ConfigError, RuleBaseError, did_you_mean
from navfw.fuzzy.coverage import check_coverage
from navfw.fuzzy.grammar import Clause, ParsedRule, SentenceError, atoms, parse_rule
from navfw.fuzzy.membership import SHAPES, Shape, hedged, make_shape, sample_universe
from navfw.fuzzy.rulefile import InputSpec, OutputSpec, RuleBaseSpec, check_name
from navfw.signals import Array

__all__ = ["Rule", "RuleBase", "Variable"]

Defuzzification = Literal["centroid", "bisector", "mom", "som", "lom"]


@dataclass(frozen=True)
class Variable:
    """An input or output: its range, unit, and its terms in the order of the file.

    ``default`` (outputs only) is the crisp value where no rule fires; None if that is an error.
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
        """The samples of the range, (M,), increasing; terms are straight between them."""
        universe = sample_universe(self.low, self.high, self.points, self.terms.values())
        universe.flags.writeable = False
        return universe

    def sampled(self, term: str, hedges: tuple[str, ...] = ()) -> Array:
        """The degrees of ``term`` over the universe, (M,), with ``hedges`` applied."""
        return hedged(self.terms[term](self.universe), hedges)


@dataclass(frozen=True)
class Rule:
    """One sentence, read: condition, conclusions as (output, term), and weight in (0, 1]."""

    sentence: str
    antecedent: Clause
    conclusions: tuple[tuple[str, str], ...]
    weight: float = 1.0
    line: int | None = None


@dataclass(frozen=True)
class RuleBase:
    """One fuzzy inference system (Mamdani): immutable, checked, independent of any evaluator."""

    name: str
    inputs: Mapping[str, Variable]
    outputs: Mapping[str, Variable]
    rules: tuple[Rule, ...]
    conjunction: Literal["min", "prod"] = "min"
    implication: Literal["min", "prod"] = "min"
    defuzzify: Defuzzification = "centroid"
    description: str = ""
    file: str | None = field(default=None, compare=False)

    @classmethod
    def load(cls, path: str | Path) -> RuleBase:
        """The rule base in the YAML file ``path``.

        Raises:
            RuleBaseError: the file cannot be read, breaks the schema, a sentence cannot be read, or
                a region of the inputs is covered by no rule. The message lists every problem with
                file, line and what was expected.

        """
        try:
            document = load_yaml(path)
        except ConfigError as error:
            raise _as_rule_base_error(error) from None
        return cls.from_document(document)

    @classmethod
    def parse(cls, text: str, source: str | None = None) -> RuleBase:
        """The rule base in YAML ``text``; ``source`` is the file that errors name.

        Raises:
            RuleBaseError: as ``load``.

        """
        try:
            document = parse_yaml(text, source)
        except ConfigError as error:
            raise _as_rule_base_error(error) from None
        return cls.from_document(document)

    @classmethod
    def from_mapping(cls, data: Mapping[str, Any], source: str | None = None) -> RuleBase:
        """The rule base that ``data`` describes, with the keys of the YAML form.

        Raises:
            RuleBaseError: as ``load``.

        """
        return cls.from_document(YamlDocument(source, dict(data)))

    @classmethod
    def from_document(cls, document: YamlDocument) -> RuleBase:
        """The rule base in a document read before.

        Raises:
            RuleBaseError: as ``load``.

        """
        rule_base = _Builder(document).build()
        check_coverage(rule_base)
        return rule_base


class _Builder:
    """Turns a document into a rule base; collects problems, to tell as many as possible at once."""

    def __init__(self, document: YamlDocument) -> None:
        self._document = document
        self._problems: list[Problem] = []

    def build(self) -> RuleBase:
        spec, problems = check(self._document, RuleBaseSpec)
        self._problems += problems
        if spec is None:
            raise self._error()
        inputs = self._variables("inputs", spec.inputs)
        outputs = self._variables("outputs", spec.outputs)
        for name in inputs.keys() & outputs.keys():
            self._problem(("outputs", name), "expected a name that no input has")
        if self._problems:
            raise self._error()
        rules = self._rules(spec.rules, inputs, outputs)
        if not self._problems:
            self._check_use(rules, inputs, outputs)
        if self._problems:
            raise self._error()
        return RuleBase(
            name=spec.name,
            inputs=inputs,
            outputs=outputs,
            rules=rules,
            conjunction=spec.and_,
            implication=spec.implication,
            defuzzify=spec.defuzzify,
            description=spec.description,
            file=self._document.file,
        )

    def _problem(self, path: KeyPath, message: str) -> None:
        self._problems.append(Problem(path, message, self._document.origin_of(path)))

    def _error(self) -> RuleBaseError:
        return _as_rule_base_error(config_error(self._problems))

    def _variables(
        self, section: str, specs: Mapping[str, InputSpec | OutputSpec]
    ) -> dict[str, Variable]:
        return {name: self._variable((section, name), name, spec) for name, spec in specs.items()}

    def _variable(self, path: KeyPath, name: str, spec: InputSpec | OutputSpec) -> Variable:
        self._check_name(path, name)
        low, high = spec.range
        default = spec.default if isinstance(spec, OutputSpec) else None
        if default is not None and not low <= default <= high:
            self._problem(
                (*path, "default"),
                f"expected a value within the range [{low:g}, {high:g}], got {default:g}",
            )
        terms: dict[str, Shape] = {}
        for term, form in spec.terms.items():
            shape = self._shape((*path, "terms", term), term, form)
            if shape is not None:
                terms[term] = shape
        variable = Variable(
            name=name,
            low=low,
            high=high,
            terms=terms,
            unit=spec.unit,
            description=spec.description,
            points=spec.points,
            default=default,
            line=self._document.line_of(path),
        )
        for term in terms:
            if not variable.sampled(term).any():
                self._problem(
                    (*path, "terms", term),
                    f"expected a term within the range [{low:g}, {high:g}]: it is 0 all over it",
                )
        return variable

    def _check_name(self, path: KeyPath, name: str) -> None:
        try:
            check_name(name)
        except ValueError as error:
            self._problem(path, str(error))

    def _shape(self, path: KeyPath, term: str, form: Mapping[str, list[float]]) -> Shape | None:
        self._check_name(path, term)
        if len(form) != 1:
            self._problem(path, f"expected one shape ({', '.join(SHAPES)}), got {len(form)}")
            return None
        ((kind, parameters),) = form.items()
        if kind not in SHAPES:
            self._problem((*path, kind), f"unknown shape {kind!r}: {did_you_mean(kind, SHAPES)}")
            return None
        try:
            return make_shape(kind, parameters)
        except ValueError as error:
            self._problem((*path, kind), str(error))
            return None

    def _rules(
        self,
        sentences: list[str],
        inputs: Mapping[str, Variable],
        outputs: Mapping[str, Variable],
    ) -> tuple[Rule, ...]:
        known_inputs = {name: tuple(variable.terms) for name, variable in inputs.items()}
        known_outputs = {name: tuple(variable.terms) for name, variable in outputs.items()}
        rules: list[Rule] = []
        for index, text in enumerate(sentences):
            sentence = " ".join(text.split())
            try:
                parsed: ParsedRule = parse_rule(sentence, known_inputs, known_outputs)
            except SentenceError as error:
                self._problem(("rules", index), str(error))
                continue
            line = self._document.line_of(("rules", index))
            rules.append(Rule(sentence, *parsed, line=line))
        return tuple(rules)

    def _check_use(
        self,
        rules: tuple[Rule, ...],
        inputs: Mapping[str, Variable],
        outputs: Mapping[str, Variable],
    ) -> None:
        asked = {atom.variable for rule in rules for atom in atoms(rule.antecedent)}
        concluded = {output for rule in rules for output, _ in rule.conclusions}
        for name in inputs.keys() - asked:
            self._problem(("inputs", name), f"expected a rule that asks for {name!r}: none does")
        for name in outputs.keys() - concluded:
            self._problem(
                ("outputs", name), f"expected a rule that concludes about {name!r}: none does"
            )


def _as_rule_base_error(error: ConfigError) -> RuleBaseError:
    """The same error (its message opens with the place already) as one about a rule base."""
    converted = RuleBaseError(str(error))
    converted.file, converted.line, converted.key = error.file, error.line, error.key
    return converted
