"""Compiled least squares of a pose graph: a chain of poses with further relations between them.

The normal equations are solved by conjugate gradients. Their preconditioner is the chain, which is
block tridiagonal and solved exactly: only the relations that close loops need iterations. All sums
have a fixed order.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics import Array
from navfw.numerics.algebra_kernels import dot, multiply, solve_in_place
from navfw.numerics.arrays import Indices

_ANCHOR = 1e8  # chosen
"""Information that fixes the first pose."""

_TOLERANCE = 1e-9  # chosen
"""Share of the initial residual at which the iterations end."""


@numba.njit(cache=True)
def _wrapped(angle: float) -> float:
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@numba.njit(cache=True)
def residuals(poses: Array, first: Indices, second: Indices, measured: Array) -> Array:
    """Compute the differences (m, 3) of relative poses from the ``measured`` ones (m, 3)."""
    result = np.empty((first.size, 3))
    for e in range(first.size):
        a, b = poses[first[e]], poses[second[e]]
        c, s = math.cos(a[2]), math.sin(a[2])
        dx, dy = b[0] - a[0], b[1] - a[1]
        result[e, 0] = c * dx + s * dy - measured[e, 0]
        result[e, 1] = -s * dx + c * dy - measured[e, 1]
        result[e, 2] = _wrapped(b[2] - a[2] - measured[e, 2])
    return result


@numba.njit(cache=True)
def _add_product(block: Array, vector: Array, factor: float, result: Array) -> None:
    """Add ``factor`` times the product of ``block`` (3, 3) and ``vector`` (3,) to ``result``."""
    for a in range(3):
        for b in range(3):
            result[a] += factor * block[a, b] * vector[b]


@numba.njit(cache=True)
def _inverse(block: Array) -> Array:
    result = np.eye(3)
    solve_in_place(block.copy(), result)
    return result


@numba.njit(cache=True)
def _chain_solver(diagonal: Array, chain: Array) -> tuple[Array, Array]:
    """Factor the block tridiagonal matrix: inverses (n, 3, 3) of its pivots, and factors."""
    n = diagonal.shape[0]
    inverses, factors = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    inverses[0] = _inverse(diagonal[0])
    for i in range(1, n):
        factors[i] = multiply(chain[i - 1].T.copy(), inverses[i - 1])
        inverses[i] = _inverse(diagonal[i] - multiply(factors[i], chain[i - 1]))
    return inverses, factors


@numba.njit(cache=True)
def _solve_chain(inverses: Array, factors: Array, chain: Array, right: Array) -> Array:
    n = right.shape[0]
    x = right.copy()
    for i in range(1, n):
        _add_product(factors[i], x[i - 1], -1.0, x[i])
    for i in range(n - 1, -1, -1):
        reduced = x[i].copy()
        if i + 1 < n:
            _add_product(chain[i], x[i + 1], -1.0, reduced)
        x[i] = 0.0
        _add_product(inverses[i], reduced, 1.0, x[i])
    return x


@numba.njit(cache=True)
def _apply(diagonal: Array, across: Array, first: Indices, second: Indices, vector: Array) -> Array:
    """Multiply the matrix of all relations with ``vector`` (n, 3)."""
    result = np.zeros_like(vector)
    for i in range(vector.shape[0]):
        _add_product(diagonal[i], vector[i], 1.0, result[i])
    for e in range(first.size):
        i, j = first[e], second[e]
        _add_product(across[e], vector[j], 1.0, result[i])
        _add_product(across[e].T, vector[i], 1.0, result[j])
    return result


@numba.njit(cache=True)
def normal_equations(
    poses: Array,
    first: Indices,
    second: Indices,
    measured: Array,
    information: Array,
) -> tuple[Array, Array, Array]:
    """Compute the normal equations of a Gauss-Newton step of ``poses``.

    They are the blocks (n, 3, 3) on the diagonal, those (m, 3, 3) of relations, and the right (n,
    3).

    Args:
        poses: (n, 3) x, y [m], yaw [rad].
        first: (m,) the poses at which relations begin; the first n - 1 are those of the chain,
            from each pose to the next.
        second: (m,) the poses at which they end.
        measured: (m, 3) the relative poses.
        information: (m, 3, 3) of the measurements, weights included.

    """
    n = poses.shape[0]
    off = residuals(poses, first, second, measured)
    diagonal, across = np.zeros((n, 3, 3)), np.zeros((first.size, 3, 3))
    right = np.zeros((n, 3))
    of_a, of_b = np.zeros((3, 3)), np.zeros((3, 3))
    for e in range(first.size):
        i, j = first[e], second[e]
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        dx, dy = poses[j, 0] - poses[i, 0], poses[j, 1] - poses[i, 1]
        of_b[0, 0], of_b[0, 1], of_b[1, 0], of_b[1, 1], of_b[2, 2] = c, s, -s, c, 1.0
        of_a[:] = -of_b
        of_a[0, 2], of_a[1, 2] = -s * dx + c * dy, -c * dx - s * dy
        weighted_a = multiply(of_a.T.copy(), information[e])
        weighted_b = multiply(of_b.T.copy(), information[e])
        diagonal[i] += multiply(weighted_a, of_a)
        diagonal[j] += multiply(weighted_b, of_b)
        across[e] = multiply(weighted_a, of_b)
        _add_product(weighted_a, off[e], -1.0, right[i])
        _add_product(weighted_b, off[e], -1.0, right[j])
    for a in range(3):
        diagonal[0, a, a] += _ANCHOR
    return diagonal, across, right


@numba.njit(cache=True)
def solved(diagonal: Array, across: Array, first: Indices, second: Indices, right: Array) -> Array:
    """Solve ``normal_equations`` for (n, 3)."""
    n = right.shape[0]
    chain = across[: n - 1]
    inverses, factors = _chain_solver(diagonal, chain)
    solution = np.zeros((n, 3))
    rest = right.copy()
    ahead = _solve_chain(inverses, factors, chain, rest)
    direction = ahead.copy()
    product = dot(rest.ravel(), ahead.ravel())
    enough = _TOLERANCE * _TOLERANCE * product
    for _ in range(3 * n):
        if not product > enough:
            break
        image = _apply(diagonal, across, first, second, direction)
        length = product / dot(direction.ravel(), image.ravel())
        solution += length * direction
        rest -= length * image
        ahead = _solve_chain(inverses, factors, chain, rest)
        new = dot(rest.ravel(), ahead.ravel())
        direction = ahead + new / product * direction
        product = new
    return solution
