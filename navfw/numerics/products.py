"""Products of matrices and vectors with sums in a fixed order."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

_SUBSCRIPTS = {
    (False, False): "i,i->",
    (False, True): "i,ij->j",
    (True, False): "...i,i->...",
    (True, True): "...i,ij->...j",
}
"""Of a product, by whether each of its factors has more than one dimension."""


def product(first: npt.ArrayLike, second: npt.ArrayLike, *others: npt.ArrayLike) -> Any:
    """``first @ second @ ...``, from left to right: an array, or a number of two vectors.

    The first factor may have any number of dimensions, the others have one or two. ``einsum`` sums
    in loops of numpy's own, which are compiled once for all processors.

    Raises:
        ValueError: the shapes do not fit.

    """
    result = first
    for factor in (second, *others):
        left, right = np.asarray(result), np.asarray(factor)
        result = np.einsum(_SUBSCRIPTS[left.ndim > 1, right.ndim > 1], left, right)
    return result
