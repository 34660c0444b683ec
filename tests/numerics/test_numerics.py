"""Linear algebra and functions that do not depend on the processor."""

import math
from fractions import Fraction
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
import pytest
from numba.core.errors import TypingError

from navfw.numerics.algebra_kernels import LANES, bilinear, dot, fma, multiply, solve_system
from navfw.numerics.functions import arccos, arctan2, exp, log, power
from navfw.numerics.linear_systems import determinant, inverse, solve
from navfw.numerics.products import product

Doubles = npt.NDArray[np.float64]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.mark.parametrize(
    "shapes",
    [
        ((3,), (3,)),
        ((3,), (3, 2)),
        ((4, 3), (3,)),
        ((4, 3), (3, 2)),
        ((5, 4, 3), (3, 3)),
        ((5, 4, 3), (3,)),
        ((2, 3), (3, 3), (3, 2)),
        ((3,), (3, 3), (3,)),
        ((0, 3), (3, 3)),
    ],
)
def test_products_are_those_of_the_operator(
    shapes: tuple[tuple[int, ...], ...], rng: np.random.Generator
) -> None:
    factors = [rng.normal(size=shape) for shape in shapes]
    expected = factors[0]
    for factor in factors[1:]:
        expected = expected @ factor
    np.testing.assert_allclose(product(*factors), expected, rtol=1e-12, atol=1e-12)


def test_a_product_of_shapes_that_do_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="3"):
        product(np.zeros((2, 3)), np.zeros((2, 2)))


@pytest.mark.parametrize("size", [1, 2, 3, 5, 8])
def test_systems_are_solved(size: int, rng: np.random.Generator) -> None:
    matrix, right = rng.normal(size=(size, size)), rng.normal(size=(size, 3))
    before = matrix.copy(), right.copy()
    np.testing.assert_allclose(solve(matrix, right), np.linalg.solve(matrix, right), rtol=1e-9)
    np.testing.assert_allclose(solve(matrix, right[:, 0]), np.linalg.solve(matrix, right[:, 0]))
    np.testing.assert_allclose(inverse(matrix) @ matrix, np.eye(size), atol=1e-9)
    np.testing.assert_allclose(determinant(matrix), np.linalg.det(matrix))
    np.testing.assert_allclose(solve_system(matrix, right[:, 1]), solve(matrix, right[:, 1]))
    assert np.array_equal(matrix, before[0])
    assert np.array_equal(right, before[1])


def test_rows_are_exchanged_for_a_pivot_of_zero() -> None:
    matrix = np.array([[0.0, 2.0], [3.0, 1.0]])
    assert solve(matrix, np.array([2.0, 4.0])).tolist() == [1.0, 1.0]
    assert determinant(matrix) == -6.0


def test_a_singular_matrix_has_no_solution() -> None:
    matrix = np.array([[1.0, 2.0], [2.0, 4.0]])
    with pytest.raises(np.linalg.LinAlgError, match="Singular"):
        inverse(matrix)
    assert np.isnan(solve_system(matrix, np.ones(2))).all()
    assert determinant(matrix) == 0.0


@pytest.mark.parametrize("element", [np.float32, np.float64])
@pytest.mark.parametrize("size", [0, 5, LANES, 5 * LANES + 3])
def test_a_scalar_product_is_the_sum_of_its_lanes_in_pairs(
    element: type[np.floating], size: int, rng: np.random.Generator
) -> None:
    a, b = (rng.normal(size=size).astype(element) for _ in range(2))
    blocks = size // LANES * LANES
    lanes = np.zeros(LANES, element)
    for i in range(blocks):
        lanes[i % LANES] = fused(a[i], b[i], lanes[i % LANES])
    while lanes.size > 1:
        lanes = lanes[: lanes.size // 2] + lanes[lanes.size // 2 :]
    expected = lanes[0]
    for i in range(blocks, size):
        expected = element(fused(a[i], b[i], expected))
    assert dot(a, b) == expected


def fused(a: np.floating, b: np.floating, c: np.floating) -> float:
    """``a * b + c``, rounded once."""
    return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))


def _fused_product(a: Doubles, b: Doubles, c: Doubles) -> Doubles:
    result = np.empty_like(a)
    for i in range(a.size):
        result[i] = fma(a[i], b[i], c[i])
    return result


fused_product: Any = numba.njit(_fused_product)


def test_a_product_is_added_with_one_rounding(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 50))
    c = -a * b  # what remains is the product's rounding
    result = fused_product(a, b, c)
    assert result.tolist() == [fused(*numbers) for numbers in zip(a, b, c, strict=True)]
    assert np.count_nonzero(result) > 20
    with pytest.raises(TypingError, match="one type"):
        fused_product(a, b, np.zeros(50, np.int64))


def test_vectors_that_are_not_contiguous_or_of_two_types_are_refused() -> None:
    with pytest.raises(TypingError, match="contiguous"):
        dot(np.zeros(8)[::2], np.zeros(4))
    with pytest.raises(TypingError, match="contiguous"):
        dot(np.zeros(4, np.float32), np.zeros(4))


def test_matrices_are_multiplied_within_compiled_functions(rng: np.random.Generator) -> None:
    a, b, x, y = (rng.normal(size=shape) for shape in ((4, 3), (3, 5), 4, 3))
    np.testing.assert_allclose(multiply(a, b), a @ b, rtol=1e-12)
    np.testing.assert_allclose(bilinear(x, a, y), x @ a @ y, rtol=1e-12)


def test_functions_are_those_of_the_c_library(rng: np.random.Generator) -> None:
    x, y = rng.normal(size=(2, 50, 4))
    above, share = np.abs(x) + 0.1, np.clip(x, -1.0, 1.0)
    assert exp(x).tolist() == [[math.exp(v) for v in row] for row in x]
    assert log(above).tolist() == [[math.log(v) for v in row] for row in above]
    assert arccos(share).tolist() == [[math.acos(v) for v in row] for row in share]
    pairs = zip(y.ravel().tolist(), x.ravel().tolist(), strict=True)
    assert arctan2(y, x).ravel().tolist() == [math.atan2(*pair) for pair in pairs]
    assert power(above, -1.3).ravel().tolist() == [math.pow(v, -1.3) for v in above.ravel()]
    assert arctan2(y[:, :1], x[:1]).shape == (50, 4)
    assert power(np.array([[np.inf]]), -2.0).tolist() == [[0.0]]
