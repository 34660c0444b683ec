"""Fuzzy edge costs: how much longer than it is a passage counts, and by which rules.

cost = length * (1 + aversion * penalty), the penalty in [0, 1] inferred from danger, clearance,
doorness and uncertainty as a zero-order Sugeno system over the rules of ``rules/edge_cost.yaml``
(METHOD 4.2): the mean of the consequents' peaks, weighted by the rules' firing strengths. Unlike
the centroid of joined areas, this mean is exactly 0 for a faultless passage and exactly 1 for the
worst, and monotone in every input. Passages of high danger cost ``avoidance`` times their length
on top: they are taken only where nothing else leads there. No passage costs less than its length.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfw.fuzzy import CompiledFis, Inference, load_rule_base
from navfw.robot import RobotModel
from navfw.signals import Array, Mask
from navfw.topomap import Passage, TopoMap

__all__ = ["RULE_BASE", "CostParams", "EdgeCosts", "inputs_of"]

RULE_BASE = Path(__file__).parent / "rules" / "edge_cost.yaml"

AVOID_ABOVE = 0.5
"""A passage is avoided when the rules call its penalty 'extreme' to a higher degree than this."""


@dataclass(frozen=True, slots=True)
class CostParams:
    """What costs weigh.

    The worst passage counts as 1 + ``aversion`` times its length, one of high danger as
    ``avoidance`` times its length more.
    """

    aversion: float = 4.0
    avoidance: float = 1000.0


class EdgeCosts:
    """The costs of all passages of a map for one robot, worked out at once and kept.

    ``values`` (passages,), in the order of the map; infinite where the robot does not fit through
    and where a passage is closed. What is learnt of single passages on the way changes their costs
    alone.
    """

    def __init__(
        self, topo_map: TopoMap, robot: RobotModel, params: CostParams | None = None
    ) -> None:
        params = CostParams() if params is None else params
        passages = topo_map.passages
        self.robot_width = 2.0 * robot.radius
        self._index = {passage.ends: i for i, passage in enumerate(passages)}
        self._inputs = inputs_of(passages, robot)
        self._fis, peaks = _inference()
        self._result = self._fis.evaluate(self._inputs)
        self._peaks = peaks
        self._params = params
        self._penalties, self._avoided = _judged(self._result, peaks)
        self._revised: dict[int, Inference] = {}
        self._barriers: dict[int, float | None] = {}
        self._lengths = np.array([passage.length for passage in passages])
        self._fits = np.array([passage.width for passage in passages]) > self.robot_width
        self.values: Array = np.where(self._fits, self._lengths * self._factors(), math.inf)

    def of(self, passage: Passage) -> float:
        """The cost of a passage of the map; infinite if it is impassable."""
        return float(self.values[self._index[passage.ends]])

    def factor(self, passage: Passage) -> float:
        """How many times its length the passage costs: at least 1."""
        return self.of(passage) / passage.length

    def close(self, passage: Passage, barrier: float | None = None) -> None:
        """Make a passage impassable; ``barrier`` [m from its place ``a``] says where, if known."""
        index = self._index[passage.ends]
        self._barriers[index] = barrier
        self.values[index] = math.inf

    def reopen(self, passage: Passage) -> None:
        """Make a closed passage cost again what its rules say."""
        index = self._index[passage.ends]
        self._barriers.pop(index, None)
        self._reckon(index)

    def revise(self, passage: Passage, **inputs: float) -> None:
        """Give some inputs of the rules (``danger``, ``uncertainty``) other values than the map."""
        index = self._index[passage.ends]
        for name, value in inputs.items():
            self._inputs[name][index] = value
        now = self._fis.evaluate({name: values[index] for name, values in self._inputs.items()})
        penalty, avoided = _judged(now, self._peaks)
        self._revised[index] = now
        self._penalties[index], self._avoided[index] = penalty[0], avoided[0]
        self._reckon(index)

    def barrier(self, passage: Passage) -> float | None:
        """Where a closed passage is barred [m from its place ``a``], if that is known."""
        return self._barriers.get(self._index[passage.ends])

    def closed(self, passage: Passage) -> bool:
        """Whether the passage has been closed."""
        return self._index[passage.ends] in self._barriers

    def _reckon(self, index: int) -> None:
        open_ = index not in self._barriers and self._fits[index]
        self.values[index] = (
            self._lengths[index] * float(self._factors(index)) if open_ else math.inf
        )

    def _factors(self, index: int | slice = slice(None)) -> Array:
        p = self._params
        penalties, avoided = self._penalties[index], self._avoided[index]
        return np.asarray(1.0 + p.aversion * penalties + p.avoidance * avoided)

    def explain(self, passage: Passage) -> dict[str, Any]:
        """Why the passage costs what it costs, as plain data: the rules, strongest first."""
        index = self._index[passage.ends]
        cost = self.of(passage)
        return {
            "from": passage.a,
            "to": passage.b,
            "length": passage.length,
            "cost": cost if math.isfinite(cost) else None,
            "passable": math.isfinite(cost),
            "closed": index in self._barriers,
            "penalty": float(self._penalties[index]),
            "avoided": bool(self._avoided[index]),
            "inputs": {name: float(values[index]) for name, values in self._inputs.items()},
            "rules": (
                self._fis.explain(self._revised[index])
                if index in self._revised
                else self._fis.explain(self._result, index=index)
            ),
        }


def _judged(result: Inference, peaks: Array) -> tuple[Array, Mask]:
    """Penalty in [0, 1] and whether to avoid, (N,) each."""
    firing = result.firing
    penalties = np.clip(firing @ peaks / firing.sum(axis=1), 0.0, 1.0)
    return penalties, result.degrees["penalty"]["extreme"] > AVOID_ABOVE


def inputs_of(passages: Sequence[Passage], robot: RobotModel) -> dict[str, Array]:
    """The inputs of the rule base for each passage: arrays (passages,)."""
    widths = np.array([passage.width for passage in passages], dtype=np.float64)
    # a passage without a known width is wide open; what lies beyond the range makes no difference
    clearance = np.clip(0.5 * widths - robot.radius, 0.0, 100.0)
    return {
        "danger": np.array([passage.danger for passage in passages], dtype=np.float64),
        "clearance": clearance,
        "doorness": np.array([passage.doorness for passage in passages], dtype=np.float64),
        "uncertainty": np.array([passage.uncertainty for passage in passages], dtype=np.float64),
    }


@functools.cache
def _inference() -> tuple[CompiledFis, Array]:
    """The inference system, and for each rule the peak of the penalty term that it concludes."""
    rule_base = load_rule_base(RULE_BASE)
    penalty = rule_base.outputs["penalty"]
    peaks = {}
    for term in penalty.terms:
        degrees = penalty.sampled(term)
        peaks[term] = float(np.mean(penalty.universe[degrees == degrees.max()]))
    concluded = [peaks[dict(rule.conclusions)["penalty"]] for rule in rule_base.rules]
    return CompiledFis(rule_base), np.array(concluded)
