"""Compute the drawings of rules: terms, strengths, outputs, a surface, uncovered regions."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from navfw.config.yaml_text import KeyPath, scalar_spans
from navfw.errors import RuleBaseError
from navfw.fuzzy import Inference, Variable, parse_rule_base
from navfw.fuzzy.coverage import check_coverage
from navfw.fuzzy.inference_kernels import FIRING_FLOOR
from navfw.fuzzy.rulebase import Rule
from navfw.mofis.rules import BehaviorRules
from navfw.numerics import Array, Mask

_POINTS = 61
"""Number of points of a curve besides its corners."""
_CELLS = 41
"""Number of cells of the surface along each input."""
_LINE = re.compile(r"(?:^|\n)[^\n]*?:(\d+): ")
"""Finds the line numbers in the text of an error."""
_WEIGHT = re.compile(r"WITH\s+([+-]?[\d.]+(?:[eE][+-]?\d+)?)(?:\s+WEIGHT)?['\"]?$", re.I)

Places = Mapping[KeyPath, tuple[int, int]]
"""Begin and end of each scalar in the text, in UTF-16 units as scripts count, by key path."""


class ReadRules(NamedTuple):
    """Rules read from a text, None if it cannot be drawn; ``problem`` as ``navfw check`` says it.

    ``lines`` are those that the problem names. Rules that leave regions uncovered can be drawn.
    """

    rules: BehaviorRules | None
    problem: str = ""
    lines: Sequence[int] = ()


def read_rules(text: str, source: str) -> ReadRules:
    """Read the rules in ``text``, the content of the file ``source``, and their first problem."""
    rules = None
    try:
        rules = BehaviorRules(parse_rule_base(text, source, covered=False))
        check_coverage(rules.base)
    except RuleBaseError as error:
        lines = {error.line or 1, *map(int, _LINE.findall(str(error)))}
        return ReadRules(rules, str(error), sorted(lines))
    return ReadRules(rules)


def view_of(
    rules: BehaviorRules, text: str, values: Mapping[str, float], surface: Mapping[str, str]
) -> dict[str, Any]:
    """Return the drawing of the ``rules`` in ``text``, evaluated at the inputs' ``values``.

    An input without value is at the middle of its range. ``surface`` names its inputs ``x`` and
    ``y``, and the ``output``; by default the first ones.
    """
    base = rules.base
    at = {name: 0.5 * (one.low + one.high) for name, one in base.inputs.items()}
    at |= {name: value for name, value in values.items() if name in at and not np.isnan(value)}
    at = {name: float(np.clip(at[name], one.low, one.high)) for name, one in base.inputs.items()}
    result, spans = rules.fis.evaluate_one(at), scalar_spans(text)
    places = {path: (_units(text, a), _units(text, b)) for path, (a, b) in spans.items()}
    inputs, outputs = [], []
    for name, one in base.inputs.items():
        degrees = [float(np.interp(at[name], one.universe, one.sampled(t))) for t in one.terms]
        drawn = _variable("inputs", one, degrees, places)
        inputs.append(drawn | {"value": at[name], "bare": _bare_along(rules, at, one)})
    for name, one in base.outputs.items():
        cuts = result.activations(name)
        limit: Any = np.multiply if base.implication == "prod" else np.minimum
        limited = [limit(one.sampled(t), cut) for t, cut in zip(one.terms, cuts, strict=True)]
        drawn = _variable("outputs", one, cuts, places)
        drawn |= {"value": _number(result.crisp(name)[0]), "default": one.default}
        outputs.append(drawn | {"union": _curve(one.universe, np.max(limited, axis=0))})
    fired = zip(base.rules, result.firing[0].tolist(), strict=True)
    listed = [
        _rule(rule, strength, text[slice(*spans["rules", n])], places["rules", n])
        for n, (rule, strength) in enumerate(fired)
    ]
    drawn = {"inputs": inputs, "outputs": outputs, "rules": listed}
    return drawn | {"surface": _surface(rules, at, surface)}


def _units(text: str, place: int) -> int:
    return place if text.isascii() else len(text[:place].encode("utf-16-le")) // 2


def _variable(
    section: str, one: Variable, degrees: Sequence[float], places: Places
) -> dict[str, Any]:
    """Return the curves of the terms of ``one``, their degrees, and the numbers that shape them."""
    corners = [corner for shape in one.terms.values() for corner in shape.corners]
    low, high = min(one.low, *corners), max(one.high, *corners)
    terms = []
    for (term, shape), degree in zip(one.terms.items(), degrees, strict=True):
        numbers = [path for path in places if path[:-2] == (section, one.name, "terms", term)]
        xs = np.union1d(np.linspace(low, high, _POINTS), shape.corners)
        kind = numbers[0][-2]  # of points, which may be hundreds, none can be dragged
        spans = [] if kind == "points" else [places[p] for p in numbers]
        drawn = {"name": term, "kind": kind, "numbers": spans}
        terms.append(drawn | {"degree": degree, **_curve(xs, shape(xs))})
    about = {"name": one.name, "unit": one.unit_text, "terms": terms}
    return about | {"low": one.low, "high": one.high, "axis": [low, high]}


def _curve(xs: Array, ys: Array) -> dict[str, list[float]]:
    return {"x": np.round(xs, 5).tolist(), "y": np.round(ys, 5).tolist()}


def _rule(rule: Rule, strength: float, raw: str, place: tuple[int, int]) -> dict[str, Any]:
    """Return a rule, its strength, and ``at``, where in ``place`` its weight is or can be put."""
    raw = raw.rstrip()
    match = _WEIGHT.search(raw)
    begin, end = match.span(1) if match else [len(raw.rstrip("'\""))] * 2
    shown = {"text": rule.sentence, "strength": strength, "weight": rule.weight, "place": place}
    return shown | {"at": (place[0] + _units(raw, begin), place[0] + _units(raw, end))}


def _bare(result: Inference, output: str) -> Mask:
    """Return where no rule concludes about ``output``."""
    return np.asarray(np.max([*result.degrees[output].values()], axis=0) <= FIRING_FLOOR)


def _bare_along(rules: BehaviorRules, at: Mapping[str, float], one: Variable) -> list[list[float]]:
    """Return the intervals of an input in which, others fixed, an output has no rule or default."""
    result = rules.fis.evaluate({**at, one.name: one.universe})
    needed = [name for name, output in rules.base.outputs.items() if output.default is None]
    bare = np.any(
        [_bare(result, name) for name in needed] or [one.universe != one.universe], axis=0
    )
    edges = np.flatnonzero(np.diff([False, *bare, False])).reshape(-1, 2)
    return [one.universe[[a, b - 1]].tolist() for a, b in edges]


def _surface(
    rules: BehaviorRules, at: Mapping[str, float], wanted: Mapping[str, str]
) -> dict[str, Any]:
    """Compute an output over two inputs, row by row of y, with the other inputs fixed."""

    def chosen(what: str, names: Sequence[str]) -> str:
        return wanted[what] if wanted.get(what) in names else names[0]

    base, names = rules.base, [*rules.base.inputs]
    x = chosen("x", names)
    y = chosen("y", [name for name in names if name != x] or [x])
    output = chosen("output", [*base.outputs])
    one, two, target = base.inputs[x], base.inputs[y], base.outputs[output]
    xs = np.linspace(one.low, one.high, _CELLS)
    ys = np.linspace(two.low, two.high, _CELLS) if y != x else np.zeros(1)
    grid = {y: np.repeat(ys, xs.size), x: np.tile(xs, ys.size)}
    result = rules.fis.evaluate({**at, **grid})
    drawn = {"x": x, "y": y, "output": output, "rows": ys.size}
    drawn |= {"z": [_number(z) for z in np.round(result.crisp(output), 4)]}
    bare = np.flatnonzero(_bare(result, output)).tolist()
    return drawn | {"low": target.low, "high": target.high, "bare": bare}


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
