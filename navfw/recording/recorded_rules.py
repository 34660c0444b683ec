"""Record the rule bases of a run: their text, and the curves of their inputs."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.config.input_file import read_input_text
from navfw.errors import InputError
from navfw.fuzzy import Variable
from navfw.mofis.mofis import Mofis
from navfw.mofis.rules import BehaviorRules, RuledBehavior, RuledComposite
from navfw.recording import channel_list as topics

if TYPE_CHECKING:
    from navfw.recording.recorded_run import RecordedRun

_EDGE = 1e-9
"""Half the width of a vertical edge, as a share of the range."""


def rule_bases(mofis: Mofis) -> dict[str, Any]:
    """Return all rule bases of the behaviours and the composite, by the names of these plugins.

    Each has ``text``, empty if it is not from a file, and ``inputs``: name, unit, range, and the
    points (x, degree) of each term.
    """
    return {
        name: {"text": _text_of(rules), "inputs": [*map(_curves, rules.base.inputs.values())]}
        for name, rules in _ruled(mofis).items()
    }


def recorded_rule_bases(run: RecordedRun) -> Mapping[str, Any]:
    """Return the ``rule_bases`` recorded with ``run``; {} if it was recorded by an older navfw.

    Raises:
        ConfigError: the recording is damaged.

    """
    return next((message.content for message in run.messages(topics.RULE_BASES)), {})


def rule_differences(recorded: Mapping[str, Any], mofis: Mofis) -> list[str]:
    """List the lines (with - and +) in which the rules differ now from those recorded."""
    lines = []
    for name, rules in _ruled(mofis).items():
        before = recorded.get(name, {}).get("text", "").splitlines()
        now = _text_of(rules).splitlines()
        if before and before != now:
            changes = difflib.unified_diff(before, now, lineterm="", n=0)
            kept = [line for line in changes if line[:3] not in ("---", "+++") and line[0] != "@"]
            lines += [f"{name}: {line}" for line in kept]
    return lines


def _ruled(mofis: Mofis) -> dict[str, BehaviorRules]:
    plugins: dict[str, Any] = dict(mofis.behaviors)
    if mofis.composite is not None:
        plugins[mofis.composite.name] = mofis.composite
    return {
        name: plugin.rules
        for name, plugin in plugins.items()
        if isinstance(plugin, RuledBehavior | RuledComposite)
    }


def _text_of(rules: BehaviorRules) -> str:
    try:
        return "" if rules.base.file is None else read_input_text(Path(rules.base.file))
    except InputError:  # rules of a text have the name of what they came from
        return ""


def _curves(variable: Variable) -> dict[str, Any]:
    """Return the terms of ``variable`` as points between which they are straight, or nearly so."""
    low, high = variable.low, variable.high
    terms = {}
    for name, shape in variable.terms.items():
        edges = [x + side * _EDGE * (high - low) for x, _ in shape.jumps for side in (-1.0, 1.0)]
        points = np.unique(np.clip([low, high, *shape.corners, *shape.knots, *edges], low, high))
        terms[name] = np.column_stack([points, shape(points)]).tolist()
    unit = variable.unit_text
    return {"name": variable.name, "unit": unit, "low": low, "high": high, "terms": terms}
