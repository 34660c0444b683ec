"""Compiled Mamdani inference over many samples, with the operations of scikit-fuzzy 0.5.0.

Sampled membership functions are evaluated by ``np.interp``'s operations. scikit-fuzzy adds to an
output's universe the points where a term crosses its activation, samples every clipped term there
by linear interpolation, joins them by maximum, and takes the centroid of the area below. The
expressions below keep numpy's order of operations (no fastmath).
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from navfw.numerics import Array
from navfw.numerics.arrays import Indices

# Opcodes of antecedents in postfix form; an opcode >= 0 pushes the degree of that literal.
AND_MIN, AND_PROD, OR_MAX, NOT = -1, -2, -3, -4  # defined

FIRING_FLOOR = 1e-9  # derived
"""Activation up to which a term counts as not concluded.

Below it, scikit-fuzzy's guard against division by zero falsifies the centroid.
"""

_REMEMBERED = 16  # chosen
"""Samples whose results are kept for reuse: where inputs saturate, many samples are equal."""


@numba.njit(cache=True)
def _interval_of(xs: Array, x: float) -> int:
    """Return the index i with xs[i] <= x < xs[i + 1] (xs increasing, x within them)."""
    low, high = 0, xs.size - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if xs[middle] <= x:
            low = middle
        else:
            high = middle
    return high if x >= xs[high] else low


@numba.njit(cache=True)
def _interpolate(xs: Array, ys: Array, i: int, x: float) -> float:
    """Return ``np.interp`` of x with xs[i] <= x < xs[i + 1], to the last bit."""
    if xs[i] == x or i == xs.size - 1:
        return float(ys[i])
    return float((ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i]) * (x - xs[i]) + ys[i])


@numba.njit(cache=True)
def _join(
    xs: Array,
    terms: Array,
    support: Indices,
    cuts: Array,
    scale: bool,
    px: Array,
    py: Array,
    extra: Array,
) -> int:
    """Return the union of the conclusions of one output as a polyline (px, py); returns its size.

    ``terms`` (T, M) over ``xs`` (M,), zero outside their ``support`` (T, 2), are clipped (``scale``
    False) or scaled by their activations ``cuts`` (T,). ``extra`` is workspace for the crossings.
    """
    size = xs.size
    py[:size] = 0.0
    count = 0
    for t in range(cuts.size):
        cut = cuts[t]
        term = terms[t]
        first, last = support[t, 0], support[t, 1]
        if not cut > 0.0:
            continue
        if scale:
            for i in range(first, last + 1):
                py[i] = max(py[i], cut * term[i])
        else:
            for i in range(first, last + 1):
                py[i] = max(py[i], min(cut, term[i]))
            count = _add_crossings(xs, term, max(first - 1, 0), last, cut, extra, count)
    if count == 0:
        px[:size] = xs
        return size
    return _merge(xs, terms, cuts, px, py, extra, count)


@numba.njit(cache=True)
def _add_crossings(
    xs: Array, term: Array, first: int, last: int, cut: float, extra: Array, count: int
) -> int:
    """Insert the crossings of ``term`` and ``cut`` into increasing ``extra``; returns its size."""
    was_above = term[first] >= cut
    for i in range(first, min(last + 1, xs.size - 1)):
        is_above = term[i + 1] >= cut
        if is_above == was_above:
            continue
        was_above = is_above
        x = xs[i] + (cut - term[i]) * (xs[i + 1] - xs[i]) / (term[i + 1] - term[i])
        count = _insert(extra, count, x)
    return count


@numba.njit(cache=True)
def _insert(extra: Array, count: int, x: float) -> int:
    """Insert x into the ``count`` increasing values of ``extra``, unless it is one of them."""
    place = count
    while place > 0 and extra[place - 1] > x:
        place -= 1
    if place > 0 and extra[place - 1] == x:
        return count
    for k in range(count, place, -1):
        extra[k] = extra[k - 1]
    extra[place] = x
    return count + 1


@numba.njit(cache=True)
def _merge(
    xs: Array, terms: Array, cuts: Array, px: Array, py: Array, extra: Array, count: int
) -> int:
    """Merge the crossings into the universe, from the right so that ``py`` grows in place."""
    size = xs.size
    fresh = 0
    for k in range(count):
        i = _interval_of(xs, min(max(extra[k], xs[0]), xs[-1]))
        if xs[i] != extra[k]:
            extra[fresh] = extra[k]
            fresh += 1
    i, k = size - 1, fresh - 1
    at = size + fresh - 1
    while at >= 0:
        if k >= 0 and (i < 0 or extra[k] > xs[i]):
            px[at] = extra[k]
            # The samples right of i have moved already, so interpolate from the terms instead.
            y = 0.0
            if 0 <= i < size - 1:
                for t in range(cuts.size):
                    if cuts[t] > 0.0:
                        y = max(y, min(cuts[t], _interpolate(xs, terms[t], i, extra[k])))
            py[at] = y
            k -= 1
        else:
            px[at] = xs[i]
            py[at] = py[i]
            i -= 1
        at -= 1
    return size + fresh


@numba.njit(cache=True)
def _centroid(px: Array, py: Array, size: int) -> float:
    """Abscissa of the centroid of the area under the polyline."""
    area = 0.0
    moment = 0.0
    for i in range(size - 1):
        width = px[i + 1] - px[i]
        left, right = py[i], py[i + 1]
        area_below = 0.5 * width * (left + right)
        area += area_below
        moment += area_below * px[i] + width * width * (left + 2.0 * right) / 6.0
    return moment / area


@numba.njit(cache=True)
def _fire(
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
        at = _interval_of(universe, value)
        for k in range(literal_starts[i], literal_starts[i + 1]):
            literals[k] = _interpolate(universe, ys[k, : universe.size], at, value)
    return True


@numba.njit(cache=True)
def _find_equal(rows: Array, n: int, different: Indices, count: int) -> int:
    """Return a sample in ``different`` with the same row of ``rows`` as sample n, or -1."""
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
def _part(packed: Any, number: int) -> Any:
    """Array ``number`` of a ``packed`` sequence of arrays (``compiled_fis._pack``), flat."""
    return packed[int(packed[number]) : int(packed[number + 1])]


@numba.njit(cache=True)
def infer(x: Array, reals: Array, indices: Indices) -> Array:
    """Evaluate a rule base on x (inputs, N).

    ``reals`` and ``indices`` are those of ``compiled_fis``: a call with three arrays costs a
    quarter of one with sixteen. Returns a table (N, rules + terms + outputs): firing
    strengths, activations of the concluding terms, crisp outputs.
    """
    input_xs, weights, output_xs = _part(reals, 0), _part(reals, 2), _part(reals, 3)
    defaults = _part(reals, 5)
    input_starts, literal_starts = _part(indices, 0), _part(indices, 1)
    program, program_starts = _part(indices, 2), _part(indices, 3)
    conclusions, support = _part(indices, 4).reshape(-1, 2), _part(indices, 7).reshape(-1, 2)
    output_starts, term_starts = _part(indices, 5), _part(indices, 6)
    literal_ys = _part(reals, 1).reshape(literal_starts[-1], -1)
    term_ys = _part(reals, 4).reshape(term_starts[-1], -1)
    scale, depth, workspace = _part(indices, 8)
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
        _fire(program, program_starts, weights, literals, stack, firing)
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
            cut, reached = cuts[first:last], support[first:last]
            size = _join(xs, ys, reached, cut, scale == 1, px, py, extra)
            crisp[o] = min(max(_centroid(px, py, size), xs[0]), xs[-1])
    return table
