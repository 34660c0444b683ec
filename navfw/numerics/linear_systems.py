"""Equations, inverses and determinants of small matrices, by eliminations in a fixed order."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navfw.numerics.algebra_kernels import solve_in_place
from navfw.numerics.arrays import Array


def solve(matrix: npt.ArrayLike, right: npt.ArrayLike) -> Array:
    """X (n,) or (n, m) such that ``matrix`` (n, n) times X is ``right``, of the shape of X.

    Raises:
        numpy.linalg.LinAlgError: the matrix is singular.

    """
    factor = np.array(matrix, dtype=np.float64, order="C")
    solution = np.array(right, dtype=np.float64, order="C")
    columns = solution[:, None] if solution.ndim == 1 else solution
    if solve_in_place(factor, columns) == 0.0:
        raise np.linalg.LinAlgError("Singular matrix")
    return solution


def inverse(matrix: npt.ArrayLike) -> Array:
    """Inverse (n, n) of ``matrix``.

    Raises:
        numpy.linalg.LinAlgError: the matrix is singular.

    """
    return solve(matrix, np.eye(len(np.asarray(matrix))))


def determinant(matrix: npt.ArrayLike) -> float:
    """Determinant of ``matrix`` (n, n)."""
    factor = np.array(matrix, dtype=np.float64, order="C")
    return float(solve_in_place(factor, np.empty((len(factor), 0))))
