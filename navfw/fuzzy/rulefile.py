"""Loading a rule base from YAML: schema, names, terms, sentences, and coverage are checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from navfw.config.document import YamlDocument, parse_mapping, parse_yaml
from navfw.config.input_file import read_input_text, shown_path
from navfw.config.overrides import Override, apply_overrides
from navfw.config.yaml_text import KeyPath
from navfw.config.yamlfile import FileProblem, check, config_error
from navfw.errors import ConfigError, RuleBaseError, did_you_mean
from navfw.fuzzy.coverage import check_coverage
from navfw.fuzzy.membership import SHAPES, Shape, make_shape
from navfw.fuzzy.rulebase import Rule, RuleBase, SentenceError, Variable, atoms, parse_rule
from navfw.fuzzy.rulespec import InputSpec, OutputSpec, RuleBaseSpec, check_name

_MAX_KEPT = 64  # chosen
"""Number of rule bases kept for the next stack."""

TermCorners = Mapping[str, Mapping[str, Sequence[float]]]
"""Corners of terms by variable and term: ``{"reserve": {"short": [0, 0, 0.9, 1.3]}}``."""


def load_rule_base(path: str | Path, terms: TermCorners | None = None) -> RuleBase:
    """Load the rule base in the YAML file ``path``, with the corners in ``terms`` for its inputs.

    Raises:
        RuleBaseError: the file cannot be read, breaks the schema, a sentence cannot be parsed, or
            no rule covers a region of the inputs. The message lists every problem with file, line
            and expected value.

    """
    try:
        text, name = read_input_text(path), shown_path(Path(path))
        if not terms:
            return _of_file(text, name)
        document = parse_mapping(text, name)
    except ConfigError as error:
        raise _as_rule_base_error(error) from None
    return _checked(_with_corners(document, terms))


@lru_cache(maxsize=_MAX_KEPT)
def _of_file(text: str, name: str) -> RuleBase:
    """Return the rule base in a file of this content: every stack reads the same ones."""
    return _checked(parse_mapping(text, name))


def _with_corners(document: YamlDocument, terms: TermCorners) -> YamlDocument:
    """Return ``document`` with other corners of terms of its inputs; each keeps its shape."""
    changes = []
    for name, corners in terms.items():
        inputs = document.at(("inputs",))
        terms_of = _member(document, inputs, name, "input").get("terms", {})
        for term, values in corners.items():
            kind = next(iter(_member(document, terms_of, term, f"term of {name}")), "")
            text = f"terms.{name}.{term}={list(values)}"
            changes.append(Override(("inputs", name, "terms", term, kind), list(values), text))
    return apply_overrides(document, changes)


def _member(document: YamlDocument, mapping: Any, name: str, what: str) -> dict[str, Any]:
    """Return the mapping called ``name`` in ``mapping``."""
    member = mapping.get(name) if isinstance(mapping, dict) else None
    if not isinstance(member, dict):
        names = mapping if isinstance(mapping, dict) else ()
        message = f"the rule base has no {what} called {name!r}: {did_you_mean(name, names)}"
        raise RuleBaseError(message, file=document.file, key=f"terms.{name}")
    return member


def parse_rule_base(text: str, source: str | None = None, *, covered: bool = True) -> RuleBase:
    """Parse the rule base in YAML ``text``; error messages name ``source`` as the file.

    Without ``covered``, one that leaves regions uncovered as well: for drawing, not for a robot.

    Raises:
        RuleBaseError: as ``load_rule_base``.

    """
    try:
        document = parse_yaml(text, source)
    except ConfigError as error:
        raise _as_rule_base_error(error) from None
    return _checked(document) if covered else _RuleBaseBuilder(document).build()


def _checked(document: YamlDocument) -> RuleBase:
    rule_base = _RuleBaseBuilder(document).build()
    check_coverage(rule_base)
    return rule_base


class _RuleBaseBuilder:
    """Turns a document into a rule base; collects problems, so that one error lists them all."""

    def __init__(self, document: YamlDocument) -> None:
        self._document = document
        self._problems: list[FileProblem] = []

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
            file=self._document.file,
        )

    def _problem(self, path: KeyPath, message: str) -> None:
        self._problems.append(FileProblem(path, message, self._document.origin_of(path)))

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
            points=spec.points,
            default=default,
            line=self._document.line_of(path),
        )
        for term in terms:
            if not variable.sampled(term).any():
                self._problem(
                    (*path, "terms", term),
                    f"expected a term above 0 somewhere in the range [{low:g}, {high:g}]: "
                    "it is 0 all over it",
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
            advice = _of_other_tools(kind, parameters) or did_you_mean(kind, SHAPES)
            self._problem((*path, kind), f"unknown shape {kind!r}: {advice}")
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
                parsed = parse_rule(sentence, known_inputs, known_outputs)
            except SentenceError as error:
                self._problem(("rules", index), str(error))
                continue
            line = self._document.line_of(("rules", index))
            rules.append(replace(parsed, line=line))
        return tuple(rules)

    def _check_use(
        self,
        rules: tuple[Rule, ...],
        inputs: Mapping[str, Variable],
        outputs: Mapping[str, Variable],
    ) -> None:
        used = {atom.variable for rule in rules for atom, _ in atoms(rule.antecedent)}
        concluded = {output for rule in rules for output, _ in rule.conclusions}
        for name in inputs.keys() - used:
            self._problem(("inputs", name), f"expected a rule with {name!r} in its IF part")
        for name in outputs.keys() - concluded:
            self._problem(("outputs", name), f"expected a rule with {name!r} in its THEN part")


_SAME = {
    "triangle": ("trimf", "trian", "triangular", "singleton", "sing", "spike"),
    "trapezoid": ("trapmf", "trape", "trapezoidal", "pimf", "rectangle", "rectangular"),
    "gauss": ("gaussmf", "gaussian"),
    "sigmoid": ("sigmf", "sigm"),
    "points": ("discrete", "piecewise", "linear", "linsmf", "smf", "ramp", "linzmf", "zmf"),
}
"""Names of shapes in scikit-fuzzy, MATLAB's FIS and FCL, by those here."""


def _of_other_tools(kind: str, parameters: Sequence[float]) -> str:
    """What to write for a shape called ``kind`` elsewhere; "" for other words."""
    word, numbers = kind.lower(), [float(value) for value in parameters]
    shape = next((shape for shape, words in _SAME.items() if word in words), "")
    match shape, numbers:
        case "triangle", [a] | [a, _]:
            numbers = [a, a, a]
        case "trapezoid", [a, b]:
            numbers = [a, a, b, b]
        case "points", [a, b]:
            rises = (a < b) != ("z" in word)
            numbers = [min(a, b), float(not rises), max(a, b), float(rises)]
    if word.startswith(("gbell", "bell")) and len(numbers) == 3 and numbers[1] > 0.0:
        # the degree is 0.5, and the slope that of the bell, at c - a and c + a
        a, b, c = numbers
        shape, top, foot = "trapezoid", max(a - a / b, 0.0), max(a + a / b, 0.0)
        numbers = [c - foot, c - top, c + top, c + foot]
    if not shape:
        return ""
    advice = f"write {shape}: [{', '.join(f'{value:.6g}' for value in numbers)}]"
    if word in {"gaussmf", "sigmf"} and len(numbers) == 2:
        order = "[sigma, mean]" if word == "gaussmf" else "[slope, centre]"
        turned = ", ".join(f"{value:.6g}" for value in reversed(numbers))
        return f"{advice}, or, if they are {order} as in MATLAB, {shape}: [{turned}]"
    curved = word in {"pimf", "smf", "zmf"} or word.startswith(("gbell", "bell"))
    return advice + (", the nearest that there is" if curved else "")


def _as_rule_base_error(error: ConfigError) -> RuleBaseError:
    """Return ``error`` as a RuleBaseError; its message begins with file, line and key already."""
    converted = RuleBaseError(str(error))
    converted.file, converted.line, converted.key = error.file, error.line, error.key
    return converted
