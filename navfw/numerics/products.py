"""Products of matrices and vectors, and sums, with additions in a fixed order."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

_SUBSCRIPTS = {
    (False, False): "i,i->",
    (False, True): "i,ij->j",
    (True, False): "...i,i->...",
    (True, True): "...i,ij->...j",
}
"""Subscripts of ``einsum`` by whether each of the two factors has more than one dimension."""


def sum_in_order(values: Iterable[float]) -> float:
    """Return the sum, rounded after each addition: ``sum`` compensates errors from Python 3.12 on.

    >>> sum_in_order([1.0, 1e-16, 1e-16])
    1.0
    """
    total = 0.0
    for value in values:
        total += value
    return total


def product(first: npt.ArrayLike, second: npt.ArrayLike, *others: npt.ArrayLike) -> Any:
    """Compute ``first @ second @ ...`` from left to right; two vectors give a number.

    The first factor may have any number of dimensions, the others have one or two. ``einsum`` sums
    in numpy's own loops, which are compiled once for all processors.

    Raises:
        ValueError: the shapes do not fit.

    """
    result = first
    for factor in (second, *others):
        left, right = np.asarray(result), np.asarray(factor)
        result = np.einsum(_SUBSCRIPTS[left.ndim > 1, right.ndim > 1], left, right)
    return result
