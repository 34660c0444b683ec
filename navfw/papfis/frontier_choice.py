"""The choice of the next frontier by fuzzy rules: merit by gain, path, turn, clearance and time.

The merit in [0, 1] is inferred as a zero-order Sugeno system, like the penalties of ``edge_costs``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfw.errors import RuleBaseError
from navfw.fuzzy import CompiledFis, load_rule_base
from navfw.numerics import Array
from navfw.papfis.edge_costs import concluded_peaks, mean_conclusions
from navfw.papfis.known_ground import Frontier
from navfw.signals import Pose, wrap_angle

RULE_BASE = Path(__file__).parent / "rules" / "frontier.yaml"

INPUTS = ("gain", "path", "turn", "clearance", "reserve")  # defined
"""Inputs of the rules: of the file that ships, and of any in its place."""
OUTPUT = "merit"  # defined


@dataclass(frozen=True, slots=True)
class ChosenFrontier:
    """The frontier chosen at ``time`` [s], with the inputs of the rules and its ``merit``.

    ``others`` are the other candidates, best first, as (frontier, merit).
    """

    time: float
    frontier: Frontier
    inputs: dict[str, float]
    merit: float
    others: tuple[tuple[Frontier, float], ...]


class FrontierRules:
    """The rules of a file, which rate frontiers.

    Raises:
        RuleBaseError: the file is no valid rule base, or has other inputs or another output.

    """

    def __init__(self, file: Path = RULE_BASE) -> None:
        base = load_rule_base(file)
        for what, names, expected in (
            ("inputs", base.inputs, INPUTS),
            ("outputs", base.outputs, (OUTPUT,)),
        ):
            if set(names) != set(expected):
                raise RuleBaseError(
                    f"expected the {what} {', '.join(expected)}, got {', '.join(names)}; begin"
                    f" with a copy of {RULE_BASE.name} of navfw/papfis/rules",
                    file=base.file,
                )
        self._fis = CompiledFis(base)
        self._peaks = concluded_peaks(base, OUTPUT)

    def merits(self, inputs: dict[str, Array]) -> Array:
        """Infer the merits (n,) in [0, 1] from ``inputs``, (n,) each, by name."""
        return mean_conclusions(self._fis.evaluate(inputs).firing, self._peaks)

    def explain(self, inputs: dict[str, float]) -> list[dict[str, Any]]:
        """Return the rules that fire for one frontier, strongest first."""
        return [dict(rule) for rule in self._fis.explain(self._fis.evaluate_one(inputs))]


def inputs_of(frontiers: Sequence[Frontier], pose: Pose, reserves: Sequence[float]) -> Array:
    """Compute the inputs (len(INPUTS), n) of the rules for a robot at ``pose`` (map).

    ``reserves`` [s] are the times left after each frontier and the way home.
    """
    rows = [
        (frontier.gain, frontier.length, _turn(pose, frontier), frontier.clearance, reserve)
        for frontier, reserve in zip(frontiers, reserves, strict=True)
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, len(INPUTS)).T


def _turn(pose: Pose, frontier: Frontier) -> float:
    """Return the angle [deg] of the robot's heading to the begin of the path to ``frontier``."""
    x, y = frontier.first
    if math.dist((x, y), (pose.x, pose.y)) < 0.05:
        x, y = frontier.x, frontier.y
    bearing = math.atan2(y - pose.y, x - pose.x)
    return abs(math.degrees(wrap_angle(bearing - pose.yaw)))
