"""Compiled union and defuzzification of an output's conclusions, as scikit-fuzzy 0.5.0 does it.

scikit-fuzzy adds to an output's universe the points where a term crosses its activation, samples
every clipped term there by linear interpolation, joins them by maximum, and defuzzifies. The mean
of maximum averages the samples that equal the maximum exactly, and so depends on the last bit of
an interpolated degree: the expressions below keep numpy's order of operations (no fastmath).
"""

from __future__ import annotations

import math

import numba

from navfw.fuzzy.interpolation_kernels import interpolate, interval_of
from navfw.numerics import Array
from navfw.numerics.arrays import Indices

CENTROID, BISECTOR, MOM, SOM, LOM = 0, 1, 2, 3, 4

_MIN_POSITIVE = 5e-324
"""The smallest positive number."""


@numba.njit(cache=True)
def join(
    xs: Array,
    terms: Array,
    support: Indices,
    cuts: Array,
    scale: bool,
    lean: bool,
    px: Array,
    py: Array,
    extra: Array,
) -> int:
    """The union of the conclusions of one output as a polyline (px, py); returns its size.

    ``terms`` (T, M) over ``xs`` (M,), zero outside their ``support`` (T, 2), are clipped (``scale``
    False) or scaled by their activations ``cuts`` (T,). ``extra`` is workspace for the crossings.
    ``lean`` leaves out the crossings of terms with activation 0: these repeat samples up to
    rounding, which does not change the centroid.
    """
    size = xs.size
    py[:size] = 0.0
    count = 0
    for t in range(cuts.size):
        cut = cuts[t]
        term = terms[t]
        first, last = support[t, 0], support[t, 1]
        if cut > 0.0:
            if scale:
                for i in range(first, last + 1):
                    py[i] = max(py[i], cut * term[i])
            else:
                for i in range(first, last + 1):
                    py[i] = max(py[i], min(cut, term[i]))
        if not scale and (cut > 0.0 or not lean):
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
    level = cut if cut > 0.0 else _MIN_POSITIVE  # for activation 0: where the term leaves zero
    was_above = term[first] >= level
    for i in range(first, min(last + 1, xs.size - 1)):
        is_above = term[i + 1] >= level
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
        i = interval_of(xs, min(max(extra[k], xs[0]), xs[-1]))
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
                        y = max(y, min(cuts[t], interpolate(xs, terms[t], i, extra[k])))
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
        part = 0.5 * width * (left + right)
        area += part
        moment += part * px[i] + width * width * (left + 2.0 * right) / 6.0
    return moment / area


@numba.njit(cache=True)
def _bisector(px: Array, py: Array, size: int) -> float:
    """Abscissa that halves the area under the polyline, by scikit-fuzzy's formulae."""
    total = 0.0
    for i in range(size - 1):
        total += _area(px, py, i)
    half = total / 2.0
    before = 0.0
    i = 0
    while i < size - 2:
        part = before + _area(px, py, i)
        if part >= half:
            break
        before = part
        i += 1
    x1, x2, y1, y2 = px[i], px[i + 1], py[i], py[i + 1]
    rest = half - before
    width = x2 - x1
    if y1 == y2:
        return float(rest / y1 + x1)
    if y1 == 0.0:
        return float(x1 + math.sqrt(2.0 * rest * width / y2))
    if y2 == 0.0:
        return float(x2 - math.sqrt(max(0.0, width * width - (2.0 * rest * width / y1))))
    slope = (y2 - y1) / width
    return float(x1 - (y1 - math.sqrt(max(0.0, y1 * y1 + 2.0 * slope * rest))) / slope)


@numba.njit(cache=True)
def _area(px: Array, py: Array, i: int) -> float:
    if py[i] == py[i + 1]:
        return float((px[i + 1] - px[i]) * py[i])
    return float(0.5 * (px[i + 1] - px[i]) * (py[i] + py[i + 1]))


@numba.njit(cache=True)
def _of_maximum(px: Array, py: Array, size: int, method: int) -> float:
    """Mean, smallest or largest abscissa of the samples at the maximum."""
    top = py[0]
    for i in range(1, size):
        top = max(top, py[i])
    total = 0.0
    count = 0
    smallest = math.nan
    largest = math.nan
    for i in range(size):
        if py[i] == top:
            if count == 0:
                smallest = px[i]
            largest = px[i]
            total += px[i]
            count += 1
    if method == MOM:
        return total / count
    return smallest if method == SOM else largest


@numba.njit(cache=True)
def defuzzify(px: Array, py: Array, size: int, method: int) -> float:
    """The crisp value of a union of conclusions (not empty)."""
    if method == CENTROID:
        return _centroid(px, py, size)
    if method == BISECTOR:
        return _bisector(px, py, size)
    return _of_maximum(px, py, size, method)
