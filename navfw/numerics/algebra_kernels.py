"""Compiled linear algebra with sums in a fixed order, to be called from compiled functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba.core import cgutils, errors, types
from numba.extending import intrinsic

from navfw.numerics.arrays import Array

Vector = npt.NDArray[np.float32] | Array

LANES = 16  # derived
"""Number of partial sums of a scalar product: two of AVX2's registers of float32, four of float64.
So many additions have to be in progress for the loop to be limited only by memory."""


def _fused(builder: Any, kind: Any, name: str) -> Any:
    """LLVM's multiplication and addition with one rounding, of elements or vectors of ``kind``."""
    signature = ir.FunctionType(kind, [kind] * 3)
    insert: Any = cgutils.get_or_insert_function
    return insert(builder.module, signature, f"llvm.fma.{name}")


def _write_fma(context: Any, a: Any, b: Any, c: Any) -> tuple[Any, Callable[..., Any]]:
    """Return ``a * b + c`` of three floating point numbers of one type, with one rounding."""
    if not (isinstance(a, types.Float) and a == b == c):
        raise errors.TypingError("expected three floating point numbers of one type")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = _fused(builder, context.get_value_type(a), f"f{a.bitwidth}")
        return builder.call(function, arguments)

    return a(a, b, c), generate


fma: Any = intrinsic(_write_fma)
"""``a * b + c`` with one rounding. On some processors compilers fuse these operations; with AVX2 it
is as fast as a product on every processor."""


def _write_sum_of_blocks(
    context: Any, a: Any, b: Any, blocks: Any
) -> tuple[Any, Callable[..., Any]]:
    """Sum of the products of the first ``LANES * blocks`` elements of two contiguous vectors.

    One multiplication with addition of vectors of ``LANES`` elements per block, written out as
    such: the compiler may not reorder them, whatever registers the processor has.
    """
    if not (a.is_c_contig and b.is_c_contig and a.dtype == b.dtype and a.ndim == b.ndim == 1):
        raise errors.TypingError("expected two contiguous vectors of one type")
    element = a.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        lanes = ir.VectorType(context.get_data_type(element), LANES)
        pointers = [
            builder.bitcast(
                context.make_array(kind)(context, builder, value).data, lanes.as_pointer()
            )
            for kind, value in zip(signature.args[:2], arguments[:2], strict=True)
        ]
        fused = _fused(builder, lanes, f"v{LANES}f{element.bitwidth}")
        zeros = ir.Constant(lanes, [0.0] * LANES)
        total = cgutils.alloca_once_value(builder, zeros)  # type: ignore[no-untyped-call]
        with cgutils.for_range(builder, arguments[2]) as loop:
            x, y = (
                builder.load(builder.gep(pointer, [loop.index]), align=element.bitwidth // 8)
                for pointer in pointers
            )
            builder.store(builder.call(fused, [x, y, builder.load(total)]), total)
        partial, width = builder.load(total), LANES
        while width > 1:
            width //= 2
            places = ir.VectorType(ir.IntType(32), width)
            halves = (
                builder.shuffle_vector(
                    partial, partial, ir.Constant(places, list(range(i, i + width)))
                )
                for i in (0, width)
            )
            partial = builder.fadd(*halves)
        return builder.extract_element(partial, ir.Constant(ir.IntType(32), 0))

    return element(a, b, types.intp), generate


_sum_of_blocks: Any = intrinsic(_write_sum_of_blocks)


@numba.njit(cache=True, inline="always")
def dot(a: Vector, b: Vector) -> float:
    """Compute the scalar product of two contiguous vectors (n,) of one type, in that type.

    Element i belongs to the partial sum i modulo ``LANES``; these sums are added pairwise, then the
    last n modulo ``LANES`` products one by one. The function is inlined: passing the arguments of a
    call would take as long as the sum of a window's samples.
    """
    blocks = a.size // LANES
    total: float = _sum_of_blocks(a, b, blocks)
    for i in range(blocks * LANES, a.size):
        total = fma(a[i], b[i], total)
    return total


@numba.njit(cache=True)
def bilinear(a: Array, matrix: Array, b: Array) -> float:
    """Compute ``a @ matrix @ b`` for ``a`` (n,), ``matrix`` (n, m) and ``b`` (m,)."""
    total = 0.0
    for i in range(a.size):
        for j in range(b.size):
            total += a[i] * matrix[i, j] * b[j]
    return total


@numba.njit(cache=True)
def multiply(a: Array, b: Array) -> Array:
    """Compute the product (n, m) of the matrices ``a`` (n, k) and ``b`` (k, m)."""
    result = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            for k in range(a.shape[1]):
                result[i, j] += a[i, k] * b[k, j]
    return result


@numba.njit(cache=True)
def solve_system(matrix: Array, right: Array) -> Array:
    """Solve ``matrix`` (n, n) times x = ``right`` (n,); x is NaN if the matrix is singular."""
    solution = right.copy().reshape((right.size, 1))
    if solve_in_place(matrix.copy(), solution) == 0.0:
        solution[:] = np.nan
    return solution[:, 0].copy()


@numba.njit(cache=True, error_model="numpy")
def solve_in_place(matrix: Array, right: Array) -> float:
    """Solve ``matrix`` (n, n) times X = ``right`` (n, m) and return the determinant of ``matrix``.

    By Gaussian elimination with row pivoting. ``right`` becomes X, ``matrix`` is overwritten. If a
    pivot is 0, the determinant is 0 and ``right`` is undefined.
    """
    n, columns = right.shape
    determinant = 1.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if matrix[pivot, k] == 0.0:
            return 0.0
        if pivot != k:
            determinant = -determinant
            for j in range(k, n):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            for j in range(columns):
                right[k, j], right[pivot, j] = right[pivot, j], right[k, j]
        determinant *= matrix[k, k]
        for i in range(k + 1, n):
            share = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= share * matrix[k, j]
            for j in range(columns):
                right[i, j] -= share * right[k, j]
    for i in range(n - 1, -1, -1):
        for j in range(columns):
            total = right[i, j]
            for k in range(i + 1, n):
                total -= matrix[i, k] * right[k, j]
            right[i, j] = total / matrix[i, i]
    return determinant
