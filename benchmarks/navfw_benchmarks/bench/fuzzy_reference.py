"""The reference evaluator: a rule base built and computed by scikit-fuzzy, slow.

``navfw.fuzzy.compiled_fis`` must agree with it. Peculiarities of scikit-fuzzy 0.5.0, and how both
evaluators handle them:

- The universe of an output is widened by the points where a term crosses its activation.
- Where no rule fires, the centroid raises inside (and the output is missing). Here: the output's
  default, or NaN, whenever no term is activated above ``FIRING_FLOOR``.
- The area is guarded by ``max(area, 2.2e-16)``, so the centroid of an almost empty conclusion
  moves toward zero, even out of the range. ``FIRING_FLOOR`` excludes such conclusions.
- Only terms that a rule concludes take part. ``NOT`` is 1 - degree; ``AND`` / ``OR`` are fmin /
  fmax, which ignore a NaN: inputs have to be numbers.
- Only clipping (min implication) exists; for ``implication: prod`` the activations come from the
  simulation, and the scaled terms are joined here and given to ``skfuzzy.defuzz``.
- Simulations keep every past result, and terms are never freed (class-level dictionaries keyed by
  instance): ``ReferenceFis`` is for tests and benchmarks, not for missions.

``compare`` measures the time of both, and their difference, on random inputs.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from navfw.fuzzy.compiled_fis import CompiledFis
from navfw.fuzzy.inference_kernels import FIRING_FLOOR
from navfw.fuzzy.rulebase import RuleBase
from navfw.fuzzy.skfuzzy_exchange import control_system_of, without_warnings
from navfw.numerics import Array

_RESET_EVERY = 500
"""Samples after which the past results of the simulation are dropped, to bound its memory."""


class ReferenceInference(NamedTuple):
    """``Inference`` of the compiled evaluator, for one sample: arrays of length 1."""

    outputs: dict[str, Array]
    firing: Array
    degrees: dict[str, dict[str, Array]]


class ReferenceFis:
    """A rule base as a ``skfuzzy.control.ControlSystemSimulation``."""

    def __init__(self, rule_base: RuleBase) -> None:
        with without_warnings():
            from skfuzzy import control, defuzz

            self._defuzz = defuzz
            self.rule_base = rule_base
            system = control_system_of(rule_base)
            self._outputs = {output.label: output for output in system.consequents}
            rules = {rule.label: rule for rule in system.rules}
            self._rules = [rules[f"rule {number}"] for number in range(len(rules))]
            self.simulation = control.ControlSystemSimulation(system, flush_after_run=10**9)
        self._runs = 0

    def evaluate(self, inputs: Mapping[str, float]) -> ReferenceInference:
        """Infer from one sample: a number for every input.

        Raises:
            ValueError: an input is missing or unknown (from scikit-fuzzy).

        """
        self.compute(inputs)
        return self.read()

    def compute(self, inputs: Mapping[str, float]) -> Mapping[str, float]:
        """Set the inputs and compute, as a user of scikit-fuzzy does; the crisp outputs."""
        self._runs += 1
        if self._runs % _RESET_EVERY == 0:
            self.simulation.reset()
        with without_warnings():
            self.simulation.inputs({name: float(value) for name, value in inputs.items()})
            self.simulation.compute()
        crisp: Mapping[str, float] = self.simulation.output
        return crisp

    def read(self) -> ReferenceInference:
        """The result of the last ``compute``."""
        sim = self.simulation
        firing = np.array(
            [
                [
                    float(built.aggregate_firing[sim]) * rule.weight
                    for built, rule in zip(self._rules, self.rule_base.rules, strict=True)
                ]
            ]
        )
        degrees: dict[str, dict[str, Array]] = {}
        outputs: dict[str, Array] = {}
        for name, consequent in self._outputs.items():
            cuts = {term: consequent[term].membership_value[sim] for term in consequent.terms}
            degrees[name] = {
                term: np.array([0.0 if cut is None else float(cut)]) for term, cut in cuts.items()
            }
            outputs[name] = np.array([self._crisp(name, degrees[name])])
        return ReferenceInference(outputs, firing, degrees)

    def _crisp(self, name: str, degrees: Mapping[str, Array]) -> float:
        variable = self.rule_base.outputs[name]
        if max(float(cut[0]) for cut in degrees.values()) <= FIRING_FLOOR:
            return np.nan if variable.default is None else variable.default
        if self.rule_base.implication == "prod":
            scaled = [float(cut[0]) * variable.sampled(term) for term, cut in degrees.items()]
            with without_warnings():
                crisp = self._defuzz(variable.universe, np.max(scaled, axis=0), "centroid")
        else:
            crisp = self.simulation.output[name]
        return float(np.clip(crisp, variable.low, variable.high))


_BATCH = 16
"""Samples in one call: about the number of regions in a frame."""


def random_inputs(rule_base: RuleBase, samples: int, rng: np.random.Generator) -> Array:
    """Rows (inputs, samples): half uniform in the ranges, half at or next to terms' corners."""
    rows = []
    for variable in rule_base.inputs.values():
        corners = [c for shape in variable.terms.values() for c in shape.corners]
        width = variable.high - variable.low
        beside = rng.choice(corners, samples) + rng.choice([0.0, -1e-6, 1e-6], samples) * width
        uniform = rng.uniform(variable.low, variable.high, samples)
        mixed = np.where(rng.random(samples) < 0.5, uniform, beside)
        rows.append(np.clip(mixed, variable.low, variable.high))
    return np.array(rows)


def compare(rule_base: RuleBase, samples: int, rng: np.random.Generator) -> dict[str, Any]:
    """Evaluate ``samples`` random inputs by both evaluators; plain data.

    Keys: ``name``, ``samples``; medians [ms]: ``compiled_ms`` of one sample, ``compiled_batch_ms``
    of ``batch`` samples in one call, ``reference_ms`` of one sample; ``ratio`` of the reference's
    time to the compiled one's, ``batch_ratio`` the same per sample of a batch; ``max_abs_diff``
    over all crisp outputs and firing strengths; ``undecided``, the samples for which exactly one
    evaluator gives a number.

    Raises:
        ValueError: ``samples`` is not positive.

    """
    if samples < 1:
        raise ValueError(f"expected at least one sample, got {samples}")
    compiled = CompiledFis(rule_base)
    reference = ReferenceFis(rule_base)
    rows = random_inputs(rule_base, samples, rng)
    named = [dict(zip(rule_base.inputs, column, strict=True)) for column in rows.T.tolist()]
    result = compiled.evaluate_rows(rows)
    largest = 0.0
    undecided = 0
    seconds = []
    for index, inputs in enumerate(named):
        start = time.perf_counter()
        reference.compute(inputs)
        seconds.append(time.perf_counter() - start)
        expected = reference.read()
        ours = {name: float(values[index]) for name, values in result.outputs.items()}
        theirs = {name: float(values[0]) for name, values in expected.outputs.items()}
        largest = max(
            largest,
            float(np.abs(result.firing[index] - expected.firing[0]).max()),
            *(apart for name in ours if not np.isnan(apart := abs(ours[name] - theirs[name]))),
        )
        undecided += any(np.isnan(ours[name]) != np.isnan(theirs[name]) for name in ours)
    single = median_ms(lambda k: compiled.evaluate(named[k % samples]), max(samples, 200))
    batch = {name: np.resize(row, _BATCH) for name, row in zip(rule_base.inputs, rows, strict=True)}
    together = median_ms(lambda _: compiled.evaluate(batch), 200)
    one = statistics.median(seconds) * 1e3
    return {
        "name": rule_base.name,
        "samples": samples,
        "compiled_ms": single,
        "compiled_batch_ms": together,
        "batch": _BATCH,
        "reference_ms": one,
        "ratio": one / single,
        "batch_ratio": one * _BATCH / together,
        "max_abs_diff": largest,
        "undecided": undecided,
    }


def median_ms(call: Callable[[int], object], repeats: int) -> float:
    """The median time [ms] of ``call(0)`` to ``call(repeats - 1)``, after one that is not timed."""
    call(0)
    seconds = []
    for k in range(repeats):
        start = time.perf_counter()
        call(k)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds) * 1e3
