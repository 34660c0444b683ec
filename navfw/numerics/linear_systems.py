"""Equations, inverses and determinants of small matrices, by eliminations in a fixed order."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navfw.numerics.algebra_kernels import solve_in_place
from navfw.numerics.arrays import Array


def solve(matrix: npt.ArrayLike, right: npt.ArrayLike) -> Array:
    """Solve ``matrix`` (n, n) times X = ``right`` for X; both have the shape (n,) or (n, m).

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
    """Compute the inverse (n, n) of ``matrix`` (n, n).

    Raises:
        numpy.linalg.LinAlgError: the matrix is singular.

    """
    return solve(matrix, np.eye(len(np.asarray(matrix))))


def determinant(matrix: npt.ArrayLike) -> float:
    """Compute the determinant of ``matrix`` (n, n); 0 if it is singular."""
    factor = np.array(matrix, dtype=np.float64, order="C")
    return float(solve_in_place(factor, np.empty((len(factor), 0))))
