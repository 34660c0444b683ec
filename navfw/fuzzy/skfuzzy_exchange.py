"""Rules files as control systems of scikit-fuzzy, and control systems as rules files.

Both give the same outputs to 1e-6: scikit-fuzzy has no other implication than clipping, navfw no
other defuzzification than the centroid; what differs is refused. Where no rule fires, scikit-fuzzy
has no output, navfw the ``default``.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from operator import mul
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.yaml_text import write_yaml_text
from navfw.errors import MissingExtraError, RuleBaseError, UnknownNameError
from navfw.fuzzy.membership import HEDGES, Trapezoid
from navfw.fuzzy.rulebase import KEYWORDS, And, Clause, Is, Not, Or, RuleBase, atoms
from navfw.fuzzy.rulefile import load_rule_base, parse_rule_base
from navfw.numerics import Array
from navfw.process.atomic import write_text

_PAIRS = ((0.3, 0.8), (0.8, 0.3), (0.5, 0.5), (0.0, 1.0))  # chosen
"""Degrees at which a function of two degrees is compared with those that navfw has."""


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore scikit-fuzzy's warnings (deprecated calls, divisions by zero)."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def to_control_system(path: str | Path) -> Any:
    """Read the rules file as a ``skfuzzy.control.ControlSystem``; hedged terms are terms of it.

    Raises:
        RuleBaseError: the file is not valid, or its implication is ``prod``.
        MissingExtraError: scikit-fuzzy is not installed.

    """
    rule_base = load_rule_base(path)
    if rule_base.implication != "min":
        what = "scikit-fuzzy only clips conclusions: its outputs would differ; write min"
        raise RuleBaseError(what, file=rule_base.file, key="implication")
    return control_system_of(rule_base)


def control_system_of(rule_base: RuleBase) -> Any:
    """Return the ``ControlSystem`` of a rule base, whose conclusions are clipped in any case.

    Rule i has the label ``rule i``.
    """
    control = _control()
    with without_warnings():
        inputs = {n: control.Antecedent(v.universe, n) for n, v in rule_base.inputs.items()}
        outputs = {n: control.Consequent(v.universe, n) for n, v in rule_base.outputs.items()}
        for name, variable in {**rule_base.inputs, **rule_base.outputs}.items():
            for term in variable.terms:
                {**inputs, **outputs}[name][term] = variable.sampled(term)
        for rule in rule_base.rules:
            for atom, _ in atoms(rule.antecedent):
                degrees = rule_base.inputs[atom.variable].sampled(atom.term, atom.hedges)
                inputs[atom.variable][_label(atom)] = degrees

        def clause_of(clause: Clause) -> Any:
            match clause:
                case Is():
                    return inputs[clause.variable][_label(clause)]
                case Not(inner):
                    return ~clause_of(inner)
                case And(left, right):
                    return clause_of(left) & clause_of(right)
                case Or(left, right):
                    return clause_of(left) | clause_of(right)

        return control.ControlSystem(
            control.Rule(
                clause_of(rule.antecedent),
                [outputs[output][term] % float(rule.weight) for output, term in rule.conclusions],
                label=f"rule {number}",
                and_func=np.fmin if rule_base.conjunction == "min" else np.multiply,
            )
            for number, rule in enumerate(rule_base.rules)
        )


def _control() -> Any:
    with without_warnings():
        try:
            from skfuzzy import control
        except ImportError:
            raise MissingExtraError("skfuzzy", "scikit-fuzzy") from None
        return control


def _label(atom: Is) -> str:
    return " ".join((*atom.hedges, atom.term))


def from_control_system(
    system: Any, path: str | Path, defaults: Mapping[str, float] | None = None
) -> RuleBase:
    """Write a ``ControlSystem`` or its simulation as the rules file ``path``; its rule base.

    Characters that navfw's names cannot have become ``_``. Terms that are no triangle or trapezoid
    become ``points``. ``defaults`` are the values of outputs where no rule fires.

    Raises:
        RuleBaseError: the system has something that navfw computes differently or lacks, or the
            rules leave a region uncovered of an output that has no default.

    """
    path, system = Path(path), getattr(system, "ctrl", system)
    if not isinstance(system, _control().ControlSystem):
        raise RuleBaseError(f"expected a ControlSystem or its simulation, got {system!r:.60}")
    rules = [node for node in system.graph.nodes if isinstance(node, _control().Rule)]
    variables = {"inputs": list(system.antecedents), "outputs": list(system.consequents)}
    problems = list(_differences(rules, **variables))
    names = {variable: _name(variable.label) for both in variables.values() for variable in both}
    norms = {_norm(rule) for rule in rules} - {None}
    data: dict[str, Any] = {"name": path.stem, "and": next(iter(norms), "min")}
    for section, members in variables.items():
        data[section] = {}
        for variable in members:
            try:
                data[section][names[variable]] = _declaration(variable, section)
            except ValueError as error:
                problems.append(f"{variable.label}: {error}")
    if problems:
        raise RuleBaseError("the control system cannot be a rules file: " + "\n".join(problems))
    for output, value in (defaults or {}).items():
        if output not in data["outputs"]:
            raise UnknownNameError("output", output, data["outputs"])
        data["outputs"][output]["default"] = value
    sentences = [f"- {sentence}\n" for rule in rules for sentence in _sentences(rule, names)]
    text = f"{write_yaml_text(data)}rules:\n{''.join(sentences)}"
    rule_base = parse_rule_base(text, str(path))
    write_text(path, text, parents=True)
    return rule_base


def _equal(function: Callable[..., Any], reference: Callable[..., Any]) -> bool:
    return all(abs(function(*pair) - reference(*pair)) < 1e-12 for pair in _PAIRS)


def _kinds(term: Any) -> Iterator[str]:
    """Yield the operators in an antecedent: "and", "or", "not"."""
    if kind := getattr(term, "kind", None):
        yield from (kind, *_kinds(term.term1), *_kinds(term.term2))


def _norm(rule: Any) -> str | None:
    """The name of the AND of a rule, "" if navfw has none such; None of a rule without AND."""
    if "and" not in _kinds(rule.antecedent):
        return None
    return "min" if _equal(rule.and_func, min) else "prod" if _equal(rule.and_func, mul) else ""


def _differences(rules: list[Any], inputs: list[Any], outputs: list[Any]) -> Iterator[str]:
    """What navfw would compute differently, or cannot name."""
    for rule in rules:
        where = f"IF {rule.antecedent}"
        if _norm(rule) == "":
            yield f"{where}: and_func is neither the minimum nor the product"
        if "or" in _kinds(rule.antecedent) and not _equal(rule.or_func, max):
            yield f"{where}: or_func is not the maximum"
        terms = (t.full_label for t in rule.antecedent_terms if t.parent not in inputs)
        yield from (f"{where}: {term} is an output: make two systems of the two" for term in terms)
        weights = (one.weight for one in rule.consequent if not 0.0 < one.weight <= 1.0)
        yield from (f"{where}: expected a weight of 0 to 1, got {weight:g}" for weight in weights)
    if len({_norm(rule) for rule in rules} - {None}) > 1:
        yield "some rules have the minimum as and_func, others the product: use one"
    for output in outputs:
        if "centroid" not in (method := output.defuzzify_method.lower()):
            what = f"defuzzify_method {method!r}, navfw has only 'centroid': set it in the system"
            yield f"{output.label}: {what}"
        if not _equal(output.accumulation_method, max):
            yield f"{output.label}: its accumulation_method is not the maximum"
    known = [*inputs, *outputs]
    for labels in ([v.label for v in known], *(list(v.terms) for v in known)):
        if len({_name(label) for label in labels}) < len(labels):
            yield f"two of {labels} are one name in navfw: letters, digits and _"


def _name(label: object) -> str:
    name = re.sub(r"\W", "_", str(label), flags=re.ASCII)
    reserved = name.upper() in KEYWORDS or name in HEDGES or not name or name[0].isdigit()
    return f"_{name}" if reserved else name


def _declaration(variable: Any, section: str) -> dict[str, Any]:
    """Return a variable as in a rules file, an output with the same samples; else ValueError."""
    universe = np.asarray(variable.universe, dtype=np.float64).ravel()
    if universe.size < 2 or not (np.diff(universe) > 0).all():
        raise ValueError("expected a universe of at least two increasing numbers")
    low, high, count = float(universe[0]), float(universe[-1]), universe.size
    step = (high - low) / (count - 1)
    even = bool(np.allclose(universe, np.linspace(low, high, count), rtol=0, atol=1e-7 * step))
    terms: dict[str, dict[str, list[float]]] = {}
    for label, term in variable.terms.items():
        degrees = np.asarray(term.mf, dtype=np.float64)
        if degrees.shape != universe.shape or not ((degrees >= 0) & (degrees <= 1)).all():
            raise ValueError(f"expected degrees from 0 to 1 of {label!r}, one a sample")
        # uneven samples are those at the corners of a term: the first one keeps them all
        whole = section == "outputs" and not even and not terms
        terms[_name(label)] = _shape(universe, degrees, whole=whole)
    return {"range": [low, high], "points": count if even else 2, "terms": terms}


def _shape(universe: Array, degrees: Array, *, whole: bool) -> dict[str, list[float]]:
    """Return the shape whose degrees are linear between the samples."""
    ones, zeros = universe[degrees == 1.0], universe[degrees == 0.0]
    if ones.size and not whole:
        low = max(zeros[zeros < ones[0]], default=ones[0])
        high = min(zeros[zeros > ones[-1]], default=ones[-1])
        places = low, *dict.fromkeys((ones[0], ones[-1])), high
        if np.allclose(Trapezoid(places)(universe), degrees, rtol=0.0, atol=1e-9):
            kind = "triangle" if len(places) == 3 else "trapezoid"
            return {kind: [float(place) for place in places]}
    slopes = np.diff(degrees) / np.diff(universe)
    bend = np.abs(np.diff(slopes)) > 1e-9 * (np.abs(slopes[1:]) + np.abs(slopes[:-1]))
    kept = np.concatenate(([True], bend | whole, [True]))
    return {"points": np.stack([universe[kept], degrees[kept]], axis=1).ravel().tolist()}


def _sentences(rule: Any, names: Mapping[Any, str]) -> Iterator[str]:
    """A rule as sentences: several when its conclusions differ in weight, or are of one output."""

    def clause_of(term: Any) -> Clause:
        match getattr(term, "kind", None):
            case "not":
                return Not(clause_of(term.term1))
            case "and":
                return And(clause_of(term.term1), clause_of(term.term2))
            case "or":
                return Or(clause_of(term.term1), clause_of(term.term2))
        return Is(names[term.parent], _name(term.label))

    said = [(names[c.term.parent], _name(c.term.label), c.weight) for c in rule.consequent]
    outputs, _, weights = map(set, zip(*said, strict=True))
    for group in [said] if len(weights) == 1 and len(outputs) == len(said) else [[s] for s in said]:
        conclusions = ", ".join(f"{output} IS {term}" for output, term, _ in group)
        weight = "" if group[0][2] == 1.0 else f" WITH {float(group[0][2])!r}"
        yield f"IF {clause_of(rule.antecedent)} THEN {conclusions}{weight}"
