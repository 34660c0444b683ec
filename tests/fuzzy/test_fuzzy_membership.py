"""Membership functions against scikit-fuzzy's generators, and their sampled form."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from fuzzy_samples import shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.fuzzy import SHAPES, hedged, make_shape, sample_universe

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import skfuzzy

GENERATORS = {
    "triangle": skfuzzy.trimf,
    "trapezoid": skfuzzy.trapmf,
    "gauss": lambda x, p: skfuzzy.gaussmf(x, *p),
    "sigmoid": lambda x, p: skfuzzy.sigmf(x, *p),
}


@settings(max_examples=150, derandomize=True)
@given(shapes(-1.0, 1.0))
def test_equal_to_scikit_fuzzys_generators(form: dict[str, list[float]]) -> None:
    ((kind, parameters),) = form.items()
    shape = make_shape(kind, parameters)
    x = np.union1d(np.linspace(-1.5, 1.5, 301), shape.corners)
    np.testing.assert_allclose(shape(x), GENERATORS[kind](x, parameters), atol=1e-12)


@settings(max_examples=100, derandomize=True)
@given(st.lists(shapes(-1.0, 1.0), min_size=1, max_size=4), st.sampled_from([3, 11, 101]))
def test_sampled_form_keeps_corners_and_edges(
    forms: list[dict[str, list[float]]], points: int
) -> None:
    made = [(kind, make_shape(kind, p)) for form in forms for kind, p in form.items()]
    universe = sample_universe(-1.0, 1.0, points, [shape for _, shape in made])
    assert universe[0] == -1.0
    assert universe[-1] == 1.0
    assert (np.diff(universe) > 0).all()
    x = np.linspace(-1.0, 1.0, 1001)
    for kind, shape in made:
        sampled = np.interp(x, universe, shape(universe))
        # beside an edge the sampled form is a ramp, 2e-9 wide here
        beside = [np.abs(x - place) < 1e-8 for place, _ in shape.jumps]
        clear = ~np.any(beside, axis=0) if beside else np.ones_like(x, dtype=bool)
        tolerance = 1e-6 if kind in {"triangle", "trapezoid"} else 0.01
        np.testing.assert_allclose(sampled[clear], shape(x)[clear], atol=tolerance)


@pytest.mark.parametrize("width", [0.01, 1.0, 200.0])
@pytest.mark.parametrize(("beside", "samples"), [(5e-7, 11), (-5e-7, 11), (2e-6, 12), (-2e-6, 12)])
def test_even_samples_next_to_a_corner_are_left_out(
    width: float, beside: float, samples: int
) -> None:
    # an even sample at 0.3 of the range, and a corner a millionth or so beside it
    corner = (0.3 + beside) * width
    triangle = make_shape("triangle", [0.0, corner, width])
    universe = sample_universe(0.0, width, 11, [triangle])
    assert universe.size == samples
    assert corner in universe


def test_hedges_act_from_the_term_outwards() -> None:
    degree = np.array([0.0, 0.25, 1.0])
    np.testing.assert_allclose(hedged(degree, ("very",)), [0.0, 0.0625, 1.0])
    np.testing.assert_allclose(hedged(degree, ("somewhat", "very")), degree)
    np.testing.assert_allclose(hedged(degree, ()), degree)


@pytest.mark.parametrize(
    ("kind", "parameters", "expected"),
    [
        ("triangle", [0.0, 1.0], r"expected 3 numbers \[a, b, c\], got 2"),
        ("triangle", [0.0, 2.0, 1.0], r"a <= b <= c, got \[0.0, 2.0, 1.0\]"),
        ("trapezoid", [0.0, 2.0, 1.0, 3.0], "a <= b <= c <= d"),
        ("gauss", [0.0, 0.0], "sigma > 0"),
        ("sigmoid", [0.0, 0.0], "slope not 0"),
        ("gauss", [0.0, float("inf")], "finite"),
    ],
)
def test_impossible_shapes_are_refused(kind: str, parameters: list[float], expected: str) -> None:
    assert kind in SHAPES
    with pytest.raises(ValueError, match=expected):
        make_shape(kind, parameters)
