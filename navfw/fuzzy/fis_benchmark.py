"""Compare the compiled evaluator with scikit-fuzzy on random inputs: time and difference."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from typing import TypedDict

import numpy as np

from navfw.fuzzy.compiled_fis import CompiledFis
from navfw.fuzzy.reference_fis import ReferenceFis
from navfw.fuzzy.rulebase import RuleBase
from navfw.numerics import Array

_BATCH = 16
"""Samples in one call: about the number of regions in a frame."""


class FisComparison(TypedDict):
    """The result of ``compare``; times are medians [ms] on the present machine."""

    name: str
    samples: int
    compiled_ms: float  # one call with one sample
    compiled_batch_ms: float  # one call with ``batch`` samples
    batch: int
    reference_ms: float  # one set of inputs and compute() of scikit-fuzzy
    ratio: float  # reference_ms / compiled_ms, one sample each
    batch_ratio: float  # the same per sample of a batch
    max_abs_diff: float  # over all crisp outputs and firing strengths
    undecided: int  # samples for which exactly one evaluator gave a number


def random_inputs(rule_base: RuleBase, samples: int, rng: np.random.Generator) -> Array:
    """Rows (inputs, samples): half uniform in the ranges, half at or next to terms' corners."""
    rows = []
    for variable in rule_base.inputs.values():
        corners = [c for shape in variable.terms.values() for c in shape.corners]
        width = variable.high - variable.low
        beside = rng.choice(corners, samples) + rng.choice([0.0, -1e-6, 1e-6], samples) * width
        uniform = rng.uniform(variable.low, variable.high, samples)
        rows.append(np.where(rng.random(samples) < 0.5, uniform, beside))
    low = np.array([[variable.low] for variable in rule_base.inputs.values()])
    high = np.array([[variable.high] for variable in rule_base.inputs.values()])
    return np.asarray(np.clip(rows, low, high))


def compare(rule_base: RuleBase, samples: int, rng: np.random.Generator) -> FisComparison:
    """Evaluate ``samples`` random inputs by both evaluators; times and largest difference.

    The reference takes milliseconds per sample. A sample counts as ``undecided`` where exactly one
    of the evaluators gives NaN, as scikit-fuzzy's bisector does at times although rules fired.

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
            _largest_difference(ours, theirs),
        )
        undecided += any(np.isnan(ours[name]) != np.isnan(theirs[name]) for name in ours)
    single = _median_ms(lambda k: compiled.evaluate(named[k % samples]), max(samples, 200))
    batch = {name: np.resize(row, _BATCH) for name, row in zip(rule_base.inputs, rows, strict=True)}
    together = _median_ms(lambda _: compiled.evaluate(batch), 200)
    one = statistics.median(seconds) * 1e3
    return FisComparison(
        name=rule_base.name,
        samples=samples,
        compiled_ms=single,
        compiled_batch_ms=together,
        batch=_BATCH,
        reference_ms=one,
        ratio=one / single,
        batch_ratio=one * _BATCH / together,
        max_abs_diff=largest,
        undecided=undecided,
    )


def _largest_difference(ours: Mapping[str, float], theirs: Mapping[str, float]) -> float:
    differences = [abs(ours[name] - theirs[name]) for name in ours]
    return max((value for value in differences if not np.isnan(value)), default=0.0)


def _median_ms(call: Callable[[int], object], repeats: int) -> float:
    seconds = []
    for k in range(repeats):
        start = time.perf_counter()
        call(k)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds) * 1e3
