"""Compiled Mamdani inference over many samples, with the operations of scikit-fuzzy 0.5.0."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from navfw.fuzzy.defuzzification_kernels import CENTROID, defuzzify, join
from navfw.fuzzy.interpolation_kernels import interpolate, interval_of
from navfw.numerics import Array
from navfw.numerics.arrays import Indices

# Opcodes of antecedents in postfix form; an opcode >= 0 pushes the degree of that literal.
AND_MIN, AND_PROD, OR_MAX, NOT = -1, -2, -3, -4

FIRING_FLOOR = 1e-9
"""Activation up to which a term counts as not concluded.

Below it, scikit-fuzzy's guard against division by zero falsifies the centroid.
"""

_REMEMBERED = 16
"""Samples whose results are kept for reuse: where inputs saturate, many samples are equal."""


@numba.njit(cache=True)
def fire(
    program: Indices, starts: Indices, weights: Array, literals: Array, stack: Array, firing: Array
) -> None:
    """Compute ``firing``, the weighted strengths (rules,), from the degrees of the literals."""
    for rule in range(weights.size):
        top = -1
        for k in range(starts[rule], starts[rule + 1]):
            op = program[k]
            if op >= 0:
                top += 1
                stack[top] = literals[op]
            elif op == NOT:
                stack[top] = 1.0 - stack[top]
            else:
                right = stack[top]
                top -= 1
                if op == AND_MIN:
                    stack[top] = min(stack[top], right)
                elif op == AND_PROD:
                    stack[top] = stack[top] * right
                else:
                    stack[top] = max(stack[top], right)
        firing[rule] = stack[0] * weights[rule]


@numba.njit(cache=True)
def _read(
    x: Array, xs: Array, starts: Indices, ys: Array, literal_starts: Indices, literals: Array
) -> bool:
    """Degrees of all literals for the inputs x (inputs,); returns False if an input is NaN."""
    for i in range(x.size):
        if math.isnan(x[i]):
            return False
        universe = xs[starts[i] : starts[i + 1]]
        value = min(max(x[i], universe[0]), universe[-1])
        at = interval_of(universe, value)
        for k in range(literal_starts[i], literal_starts[i + 1]):
            literals[k] = interpolate(universe, ys[k, : universe.size], at, value)
    return True


@numba.njit(cache=True)
def _find_equal(rows: Array, n: int, different: Indices, count: int) -> int:
    """A sample in ``different`` with the same row of ``rows`` as sample n, or -1."""
    for k in range(min(count, different.size)):
        m = different[k]
        same = True
        for column in range(rows.shape[1]):
            if rows[m, column] != rows[n, column]:
                same = False
                break
        if same:
            return int(m)
    return -1


@numba.njit(cache=True)
def part(packed: Any, number: int) -> Any:
    """Array ``number`` of a ``packed`` sequence of arrays (``inference_tables.pack``), flat."""
    return packed[int(packed[number]) : int(packed[number + 1])]


@numba.njit(cache=True)
def infer(x: Array, reals: Array, indices: Indices) -> Array:
    """Evaluate a rule base on x (inputs, N).

    ``reals`` and ``indices`` are those of ``inference_tables.InferenceTables.packed``: a call with
    three arrays costs a quarter of one with sixteen. Returns a table (N, rules + terms + outputs):
    firing strengths, activations of the concluding terms, crisp outputs.
    """
    input_xs, weights, output_xs = part(reals, 0), part(reals, 2), part(reals, 3)
    defaults = part(reals, 5)
    input_starts, literal_starts = part(indices, 0), part(indices, 1)
    program, program_starts = part(indices, 2), part(indices, 3)
    conclusions, support = part(indices, 4).reshape(-1, 2), part(indices, 7).reshape(-1, 2)
    output_starts, term_starts = part(indices, 5), part(indices, 6)
    literal_ys = part(reals, 1).reshape(literal_starts[-1], -1)
    term_ys = part(reals, 4).reshape(term_starts[-1], -1)
    method, scale, depth, workspace = part(indices, 8)
    samples, rules, terms = x.shape[1], weights.size, support.shape[0]
    table = np.zeros((samples, rules + terms + defaults.size))
    literals, stack = np.empty(literal_starts[-1]), np.empty(depth)
    px, py, extra = np.empty(workspace), np.empty(workspace), np.empty(workspace)
    inputs = x.T.copy()
    read, reads = np.empty(_REMEMBERED, np.int64), 0
    different, count = np.empty(_REMEMBERED, np.int64), 0
    for n in range(samples):
        equal = _find_equal(inputs, n, read, reads)
        if equal >= 0:
            table[n] = table[equal]
            continue
        read[reads % _REMEMBERED] = n
        reads += 1
        firing = table[n, :rules]
        cuts = table[n, rules : rules + terms]
        crisp = table[n, rules + terms :]
        crisp[:] = defaults
        if not _read(inputs[n], input_xs, input_starts, literal_ys, literal_starts, literals):
            continue
        fire(program, program_starts, weights, literals, stack, firing)
        for k in range(conclusions.shape[0]):
            term = conclusions[k, 1]
            cuts[term] = max(cuts[term], firing[conclusions[k, 0]])
        equal = _find_equal(table[:, rules : rules + terms], n, different, count)
        if equal >= 0:
            crisp[:] = table[equal, rules + terms :]
            continue
        different[count % _REMEMBERED] = n
        count += 1
        for o in range(defaults.size):
            first, last = term_starts[o], term_starts[o + 1]
            if cuts[first:last].max() <= FIRING_FLOOR:
                continue
            xs = output_xs[output_starts[o] : output_starts[o + 1]]
            ys = term_ys[first:last, : xs.size]
            lean = method == CENTROID
            size = join(
                xs, ys, support[first:last], cuts[first:last], scale == 1, lean, px, py, extra
            )
            crisp[o] = min(max(defuzzify(px, py, size, method), xs[0]), xs[-1])
    return table
