"""Membership functions and the compiled evaluator agree with scikit-fuzzy."""

import warnings

import numpy as np
import pytest
from fuzzy_samples import (
    BOUNDED,
    corner_values,
    rule_base_of,
    rule_bases,
    samples,
    shapes,
    small,
    with_default,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from navfw_benchmarks.bench.fuzzy_reference import ReferenceFis, compare

from navfw.fuzzy import CompiledFis, RuleBase
from navfw.fuzzy.membership import SHAPES, hedged, make_shape, sample_universe

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import skfuzzy

GENERATORS = {
    "triangle": skfuzzy.trimf,
    "trapezoid": skfuzzy.trapmf,
    "gauss": lambda x, p: skfuzzy.gaussmf(x, *p),
    "sigmoid": lambda x, p: skfuzzy.sigmf(x, *p),
    "points": lambda x, p: skfuzzy.interp_membership(p[::2], p[1::2], x, zero_outside_x=False),
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
def test_samples_keep_corners_and_edges(forms: list[dict[str, list[float]]], points: int) -> None:
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
        tolerance = 1e-6 if kind in {"triangle", "trapezoid", "points"} else 0.01
        np.testing.assert_allclose(sampled[clear], shape(x)[clear], atol=tolerance)


@pytest.mark.parametrize("width", [0.01, 1.0, 200.0])
@pytest.mark.parametrize(("beside", "samples"), [(5e-7, 11), (-5e-7, 11), (2e-6, 12), (-2e-6, 12)])
def test_even_samples_by_a_corner_are_left_out(width: float, beside: float, samples: int) -> None:
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
        ("gauss", [0.0, float("inf")], "at most 1e[+]12, got"),
        ("triangle", [0.0, float("nan"), 1.0], "at most 1e[+]12, got"),
        ("triangle", [0.0, 1.0, 1e308], "at most 1e[+]12, got"),
        ("points", [0.0, 1.0, 0.0, 0.0], "x, which increase"),
        ("points", [0.0, 1.0, 1.0], "pairs of x"),
        ("points", [0.0, 1.0, 1.0, 1.1], "a degree from 0 to 1, got"),
    ],
)
def test_impossible_shapes_are_refused(kind: str, parameters: list[float], expected: str) -> None:
    assert kind in SHAPES
    with pytest.raises(ValueError, match=expected):
        make_shape(kind, parameters)


TOLERANCE = 1e-6


def assert_same(rule_base: RuleBase, reference: ReferenceFis, inputs: dict[str, float]) -> None:
    ours = CompiledFis(rule_base).evaluate(inputs)
    theirs = reference.evaluate(inputs)
    np.testing.assert_allclose(ours.firing, theirs.firing, rtol=0, atol=TOLERANCE)
    for name, variable in rule_base.outputs.items():
        for term in variable.terms:
            expected = theirs.degrees[name][term]
            np.testing.assert_allclose(ours.degrees[name][term], expected, atol=TOLERANCE)
        scale = variable.high - variable.low
        crisp, expected = ours.outputs[name][0], theirs.outputs[name][0]
        assert abs(crisp - expected) <= TOLERANCE * max(1.0, scale), (name, inputs)


@pytest.mark.parametrize("implication", ["min", "prod"])
@settings(BOUNDED, max_examples=40)
@given(data=st.data())
def test_equals_scikit_fuzzy_on_random_rule_bases(implication: str, data: st.DataObject) -> None:
    rule_base = data.draw(rule_bases(implication=implication))
    reference = ReferenceFis(rule_base)
    for inputs in data.draw(st.lists(samples(rule_base), min_size=1, max_size=4)):
        assert_same(rule_base, reference, inputs)


@pytest.mark.parametrize("conjunction", ["min", "prod"])
def test_equals_scikit_fuzzy_at_the_corners(conjunction: str) -> None:
    rule_base = rule_base_of(small(**{"and": conjunction}))
    reference = ReferenceFis(rule_base)
    corners = dict(corner_values(rule_base))
    for distance in corners["distance"][::2]:
        for side in corners["side"][::3]:
            assert_same(rule_base, reference, {"distance": distance, "side": side})


def test_a_nan_input_and_no_firing_rule_both_give_the_default() -> None:
    rules = ["IF distance IS near AND side IS very left THEN turn IS right"]
    rule_base = rule_base_of(with_default(0.25, rules))
    reference, compiled = ReferenceFis(rule_base), CompiledFis(rule_base)
    for inputs in ({"distance": 2.0, "side": 0.5}, {"distance": np.nan, "side": -1.0}):
        ours = compiled.evaluate(inputs)
        assert ours.outputs["turn"][0] == 0.25
        assert not ours.firing.any()
    theirs = reference.evaluate({"distance": 2.0, "side": 0.5})
    assert theirs.outputs["turn"][0] == 0.25
    assert not theirs.firing.any()


def test_compare_measures_both_and_finds_them_equal() -> None:
    rng = np.random.default_rng(5)
    comparison = compare(rule_base_of(small()), 20, rng)
    assert comparison["max_abs_diff"] <= TOLERANCE
    assert comparison["undecided"] == 0
    assert comparison["reference_ms"] > comparison["compiled_ms"] > 0.0
    with pytest.raises(ValueError, match="at least one sample"):
        compare(rule_base_of(small()), 0, rng)
