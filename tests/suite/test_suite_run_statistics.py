"""Intervals and tests compared with scipy; scores at points with known values."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from navfw.suite import barn_score, mcnemar_exact, sct, wilson


@given(st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_equals_scipy(counts: tuple[int, int]) -> None:
    successes, runs = counts
    expected = binomtest(successes, runs).proportion_ci(0.95, method="wilson")
    assert wilson(successes, runs) == pytest.approx((expected.low, expected.high), abs=1e-9)


def test_wilson_at_values_from_the_literature() -> None:
    # Newcombe 1998, Statistics in Medicine 17, table I: 81/263, 15/148, 0/20, 1/29
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=5e-5)


@given(st.integers(0, 300), st.integers(0, 300))
def test_mcnemar_equals_the_binomial_test_of_discordant_pairs(a: int, b: int) -> None:
    expected = binomtest(min(a, b), a + b).pvalue if a + b else 1.0
    assert mcnemar_exact(a, b) == pytest.approx(expected, rel=1e-9)
    assert mcnemar_exact(a, b) == mcnemar_exact(b, a)


def test_mcnemar_is_exact_for_many_pairs() -> None:
    assert 0.0 < mcnemar_exact(5000, 6000) < 1e-15


@pytest.mark.parametrize(
    ("time", "score"),
    [(5.0, 0.5), (10.0, 0.5), (20.0, 0.25), (40.0, 0.125), (90.0, 0.125)],
)
def test_barn_score_is_clipped_at_two_and_eight_times_the_optimum(
    time: float, score: float
) -> None:
    assert barn_score(True, time, path=10.0) == pytest.approx(score)  # OT is 5 s
    assert barn_score(False, time, path=10.0) == 0.0


@given(st.floats(0.0, 1e4), st.floats(0.0, 1e3), st.floats(0.05, 5.0), st.booleans())
def test_sct_is_a_share_and_1_only_at_top_speed(
    time: float, shortest: float, speed: float, good: bool
) -> None:
    value = sct(good, time, shortest, speed)
    assert 0.0 <= value <= float(good)
    if good and shortest > 0.0:
        assert (value == 1.0) == (time <= shortest / speed)
