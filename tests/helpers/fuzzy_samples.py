"""Random rule bases and inputs for the tests of ``navfw.fuzzy``."""

import json
from collections.abc import Iterator
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from navfw.config.document import parse_yaml
from navfw.fuzzy import RuleBase, parse_rule_base
from navfw.fuzzy.rulebase import And, Clause, Is, Not, Or, atoms

SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large]
BOUNDED = settings(max_examples=20, suppress_health_check=SLOW)
SMALL = parse_yaml("""
name: turn
inputs:
  distance:
    range: [0, 2]
    unit: m
    terms: {near: {trapezoid: [0, 0, 0.5, 1]}, far: {trapezoid: [0.5, 1, 2, 2]}}
  side:
    range: [-1, 1]
    terms: {left: {triangle: [-1, -1, 0]}, middle: {triangle: [-1, 0, 1]},
      right: {triangle: [0, 1, 1]}}
outputs:
  turn:
    range: [-1, 1]
    terms: {right: {triangle: [-1, -1, 0]}, none: {triangle: [-1, 0, 1]},
      left: {triangle: [0, 1, 1]}}
rules:
  - IF distance IS near AND side IS left THEN turn IS right
  - IF distance IS near AND NOT side IS left THEN turn IS left
  - IF distance IS far THEN turn IS none
""").data


def rule_base_of(data: dict[str, Any], source: str | None = None) -> RuleBase:
    """The rule base in ``data``, a mapping with the keys of the YAML file."""
    return parse_rule_base(json.dumps(data), source)


def small(**changes: Any) -> dict[str, Any]:
    """A valid rule base as a mapping, some keys changed; do not write into its parts."""
    return {**SMALL, **changes}


def with_default(default: float, rules: list[str]) -> dict[str, Any]:
    """The valid rule base with other rules, and a default of its output."""
    turn = {**small()["outputs"]["turn"], "default": default}
    return small(rules=rules, outputs={"turn": turn})


def _number(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers with three decimals, as in files."""
    return st.integers(round(low * 1000), round(high * 1000)).map(lambda k: k / 1000)


@st.composite
def shapes(draw: st.DrawFn, low: float, high: float) -> dict[str, list[float]]:
    """A shape above zero somewhere in the range, with corners in and outside it."""
    width = high - low
    kind = draw(st.sampled_from(["triangle", "trapezoid", "gauss", "sigmoid", "points"]))
    top = draw(_number(low, high) | st.sampled_from([low, high]))
    if kind == "gauss":
        return {kind: [top, draw(_number(0.02 * width + 0.001, width))]}
    if kind == "sigmoid":
        sign = draw(st.sampled_from([-1.0, 1.0]))
        return {kind: [top, sign * draw(_number(0.5, 60.0)) / width]}
    if kind == "points":
        places = sorted({top, *draw(st.lists(_number(low - width, high + width), min_size=2))})
        degrees = [draw(_number(0.0, 1.0)) if place != top else 1.0 for place in places]
        pairs = zip([*places, places[-1] + width], [*degrees, 0.0], strict=True)
        return {kind: [value for pair in pairs for value in pair]}
    reach = st.sampled_from([0.0, 0.1 * width]) | _number(0.0, 0.7 * width)
    before, after = draw(reach), draw(reach)
    if kind == "triangle":
        return {kind: [top - before, top, top + after]}
    end = top + draw(reach)
    return {kind: [top - before, top, end, end + after]}


@st.composite
def variables(draw: st.DrawFn, most_terms: int = 4) -> dict[str, Any]:
    low = draw(st.sampled_from([-2.0, -1.0, 0.0, 0.25]))
    high = low + draw(st.sampled_from([0.5, 1.0, 3.0, 40.0]))
    count = draw(st.integers(1, most_terms))
    return {
        "range": [low, high],
        "points": draw(st.sampled_from([3, 11, 101])),
        "terms": {f"t{k}": draw(shapes(low, high)) for k in range(count)},
    }


def clauses(literals: list[tuple[str, str]]) -> st.SearchStrategy[Clause]:
    hedges = st.sampled_from([(), (), (), ("very",), ("somewhat",), ("very", "very")])
    literal = st.builds(
        lambda pair, words: Is(pair[0], pair[1], words), st.sampled_from(literals), hedges
    )
    return st.recursive(
        literal,
        lambda inner: (
            st.builds(Not, inner) | st.builds(And, inner, inner) | st.builds(Or, inner, inner)
        ),
        max_leaves=4,
    )


@st.composite
def rule_bases(draw: st.DrawFn, /, **fixed: Any) -> RuleBase:
    """Any rule base with up to three inputs and two outputs; the outputs have defaults."""
    inputs = {f"in{k}": draw(variables()) for k in range(draw(st.integers(1, 3)))}
    outputs = {f"out{k}": draw(variables()) for k in range(draw(st.integers(1, 2)))}
    for output in outputs.values():
        output["default"] = output["range"][0]
    literals = [(name, term) for name, spec in inputs.items() for term in spec["terms"]]
    antecedents = draw(st.lists(clauses(literals), min_size=1, max_size=7))
    rules = []
    used: set[str] = set()
    concluded: set[str] = set()
    for antecedent in antecedents:
        chosen = draw(st.lists(st.sampled_from(sorted(outputs)), min_size=1, unique=True))
        terms = [draw(st.sampled_from(sorted(outputs[name]["terms"]))) for name in chosen]
        weight = draw(st.sampled_from(["", "", " WITH 0.8", " WITH 0.125 weight"]))
        then = ", ".join(f"{name} IS {term}" for name, term in zip(chosen, terms, strict=True))
        rules.append(f"IF {antecedent} THEN {then}{weight}")
        used.update(atom.variable for atom, _ in atoms(antecedent))
        concluded.update(chosen)
    spec = {
        "name": "random",
        "and": draw(st.sampled_from(["min", "prod"])),
        "implication": "min",
        "inputs": {name: inputs[name] for name in sorted(used)},
        "outputs": {name: outputs[name] for name in sorted(concluded)},
        "rules": rules,
    }
    return rule_base_of({**spec, **fixed})


def corner_values(rule_base: RuleBase) -> Iterator[tuple[str, list[float]]]:
    """For every input its bounds, the corners of its terms, and values 1e-6 beside these."""
    for name, variable in rule_base.inputs.items():
        found = [variable.low, variable.high]
        for shape in variable.terms.values():
            for corner in shape.corners:
                found += [corner, corner - 1e-6, corner + 1e-6]
        yield name, found


@st.composite
def samples(draw: st.DrawFn, rule_base: RuleBase) -> dict[str, float]:
    """One value for every input: anywhere in its range or a little outside, often at a corner."""
    values = {}
    for name, corners in corner_values(rule_base):
        variable = rule_base.inputs[name]
        width = variable.high - variable.low
        anywhere = st.floats(variable.low - 0.1 * width, variable.high + 0.1 * width)
        values[name] = draw(anywhere | st.sampled_from(corners))
    return values
