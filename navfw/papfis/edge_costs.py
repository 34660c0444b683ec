"""Fuzzy edge costs: a passage's length, weighted by rules on danger, clearance and the like.

cost = length * (1 + aversion * penalty), the penalty in [0, 1] inferred from danger, clearance,
doorness and uncertainty as a zero-order Sugeno system over the rules of ``rules/edge_cost.yaml``
(METHOD 4.2): the mean of the consequents' peaks, weighted by the rules' firing strengths. Unlike
the centroid of joined areas, this mean is exactly 0 for a passage without drawbacks, exactly 1 for
the worst, and monotone in every input. Passages of high danger cost ``avoidance`` times their
length on top, so that they are used only where there is no other route. No passage costs less than
its length, which keeps the straight-line heuristic of the search admissible.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from navfw.fuzzy import CompiledFis, Inference, RuleBase, load_rule_base
from navfw.numerics import Array, Mask
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.topomap import Passage, TopoMap

RULE_BASE = Path(__file__).parent / "rules" / "edge_cost.yaml"

_AVOID_ABOVE = 0.5  # chosen
"""A passage is avoided when the degree of the term 'extreme' of its penalty exceeds this."""

_NOTHING_FIRED = 1e-9  # chosen
"""Sum of firing strengths below which a mean is 0."""


@dataclass(frozen=True, slots=True)
class CostParams:
    """Weights of the costs of passages.

    The worst passage costs (1 + ``aversion``) times its length, one of high danger ``avoidance``
    times its length more.
    """

    aversion: float = 4.0
    avoidance: float = 1000.0


class EdgeCosts:
    """The costs [m] of all passages of a map for one robot, inferred once from the rules.

    ``values`` (passages,) are in the order of the map; infinite where the robot does not fit
    through and where a passage is closed. ``close``, ``reopen`` and ``revise`` change the cost of
    one passage.
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
        self.params = params
        self._penalties, self._avoided = _penalties(self._result, peaks)
        self._revised: dict[int, Inference] = {}
        self._barriers: dict[int, float | None] = {}
        self._lengths = np.array([passage.length for passage in passages])
        self._fits = np.array([passage.width for passage in passages]) > self.robot_width
        self.values: Array = np.where(self._fits, self._lengths * self._factors(), math.inf)

    def of(self, passage: Passage) -> float:
        """Return the cost [m] of a passage of the map; infinite if it is impassable."""
        return float(self.values[self._index[passage.ends]])

    def factor(self, passage: Passage) -> float:
        """Return the passage's cost divided by its length: at least 1."""
        return self.of(passage) / passage.length

    def narrowness(self, clearance: Array) -> Array:
        """Return to which degree ``clearance`` [m] is "narrow" in the rules; of its shape."""
        return np.asarray(_rules().inputs["clearance"].terms["narrow"](clearance))

    def close(self, passage: Passage, barrier: float | None = None) -> None:
        """Make a passage impassable, at ``barrier`` [m from its place ``a``] if that is known."""
        index = self._index[passage.ends]
        self._barriers[index] = barrier
        self.values[index] = math.inf

    def reopen(self, passage: Passage) -> None:
        """Set the cost of a closed passage to that of the rules again."""
        index = self._index[passage.ends]
        self._barriers.pop(index, None)
        self._update_cost(index)

    def revise(self, passage: Passage, **inputs: float) -> None:
        """Infer a passage's cost again, with these ``inputs`` (``danger``, ``uncertainty``)."""
        index = self._index[passage.ends]
        for name, value in inputs.items():
            self._inputs[name][index] = value
        now = self._fis.evaluate({name: values[index] for name, values in self._inputs.items()})
        penalty, avoided = _penalties(now, self._peaks)
        self._revised[index] = now
        self._penalties[index], self._avoided[index] = penalty[0], avoided[0]
        self._update_cost(index)

    def as_revised(self, passage: Passage) -> Passage:
        """Return ``passage`` with the inputs that were revised."""
        index = self._index[passage.ends]
        danger, uncertainty = (float(self._inputs[k][index]) for k in ("danger", "uncertainty"))
        return replace(passage, danger=danger, uncertainty=uncertainty)

    def barrier(self, passage: Passage) -> float | None:
        """Return where a closed passage is blocked [m from its place ``a``]; None if unknown."""
        return self._barriers.get(self._index[passage.ends])

    def is_closed(self, passage: Passage) -> bool:
        """Return whether the passage is closed at present."""
        return self._index[passage.ends] in self._barriers

    def _update_cost(self, index: int) -> None:
        open_ = index not in self._barriers and self._fits[index]
        self.values[index] = (
            self._lengths[index] * float(self._factors(index)) if open_ else math.inf
        )

    def _factors(self, index: int | slice = slice(None)) -> Array:
        p = self.params
        penalties, avoided = self._penalties[index], self._avoided[index]
        return np.asarray(1.0 + p.aversion * penalties + p.avoidance * avoided)

    def explain(self, passage: Passage) -> dict[str, Any]:
        """Return the passage's cost, inputs and fired rules, strongest first, as plain data."""
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


def _penalties(result: Inference, peaks: Array) -> tuple[Array, Mask]:
    """Compute the penalty in [0, 1], and whether to avoid the passage, (N,) each."""
    penalties = mean_conclusions(result.firing, peaks)
    return penalties, result.degrees["penalty"]["extreme"] > _AVOID_ABOVE


def inputs_of(passages: Sequence[Passage], robot: RobotModel) -> dict[str, Array]:
    """Compute the inputs of the rule base for all passages, by name: arrays (passages,)."""
    widths = np.array([passage.width for passage in passages], dtype=np.float64)
    # an unknown width counts as unlimited; clearance saturates at the end of the input's range
    clearance = np.clip(0.5 * widths - robot.radius, 0.0, 100.0)
    return {
        "danger": np.array([passage.danger for passage in passages], dtype=np.float64),
        "clearance": clearance,
        "doorness": np.array([passage.doorness for passage in passages], dtype=np.float64),
        "uncertainty": np.array([passage.uncertainty for passage in passages], dtype=np.float64),
    }


@functools.cache
def _rules() -> RuleBase:
    return load_rule_base(RULE_BASE)


@functools.cache
def _inference() -> tuple[CompiledFis, Array]:
    """Build the inference system; return it and the peak of each rule's penalty term (rules,)."""
    return CompiledFis(_rules()), concluded_peaks(_rules(), "penalty")


def mean_conclusions(firing: Array, peaks: Array) -> Array:
    """Return the means (n,) of ``peaks`` (rules,) by ``firing`` (n, rules); 0 if nothing fires."""
    total = np.maximum(firing.sum(axis=1), _NOTHING_FIRED)
    return np.asarray(np.clip(product(firing, peaks) / total, 0.0, 1.0))


def concluded_peaks(rule_base: RuleBase, output: str) -> Array:
    """Return the peaks (rules,) of the terms of ``output`` that the rules conclude."""
    variable = rule_base.outputs[output]
    peaks = {}
    for term in variable.terms:
        degrees = variable.sampled(term)
        peaks[term] = float(np.mean(variable.universe[degrees == degrees.max()]))
    return np.array([peaks[dict(rule.conclusions)[output]] for rule in rule_base.rules])
