"""Summaries, scores, intervals and paired comparisons, with known results."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest
from suite_samples import row

from navfw.errors import InputError
from navfw.suite.paired_comparison import (
    compare_tables,
    mcnemar_exact,
    mcnemar_pairs,
    median_interval,
    paired_interval,
    wilson,
)
from navfw.suite.run_row import barn_score, sct
from navfw.suite.suite_summary import summarize


def test_a_summary_counts_every_run() -> None:
    rows = [
        row(0, spl=0.8, sim_time_s=10.0, min_clearance_m=0.3, barn_score=0.25),
        row(1, spl=1.0, sim_time_s=30.0, min_clearance_m=0.1, barn_score=0.15),
        row(2, "collided", cause="mover", collision_cause="mover", min_clearance_m=-0.01),
        row(3, "collided", cause="drove_into", entry="maze", stack="paper"),
        row(4, "fault", cause="exception", spl=None, collisions=None, sim_time_s=None),
    ]
    found = summarize(rows)
    assert (found["missions"], found["reached"], found["success"]) == (5, 2, 0.4)
    expected = binomtest(2, 5).proportion_ci(method="wilson")
    assert found["success_low"] == pytest.approx(expected.low)
    assert found["success_high"] == pytest.approx(expected.high)
    assert (found["collisions"], found["collision_rate"]) == (2, 0.4)
    assert found["collisions_by_robot"] == 1
    assert found["spl"] == pytest.approx(1.8 / 5)
    assert found["barn_score"] == pytest.approx(0.4 / 5)
    assert found["mean_time_s"] == pytest.approx(20.0)
    assert found["min_clearance_m"] == -0.01
    assert found["outcomes"] == {"collided": 2, "reached": 2, "fault": 1}
    causes = ("collided: drove_into", "collided: mover", "fault: exception")
    assert found["causes"] == dict.fromkeys(causes, 1)
    assert found["by_entry"]["rooms"]["missions"] == 4
    assert found["by_entry"]["maze"]["success"] == 0.0
    assert found["by_stack"]["paper"]["missions"] == 1


def test_the_summary_of_no_runs_has_no_numbers() -> None:
    found = summarize([])
    assert (found["missions"], found["success"], found["spl"]) == (0, None, None)
    assert (found["success_low"], found["success_high"]) == (0.0, 1.0)


def test_a_comparison_pairs_by_seed() -> None:
    a = [row(seed, "reached" if seed < 4 else "stuck", stack="paper") for seed in range(10)]
    b = [row(s, "stuck" if s == 0 else "reached", sim_time_s=15.0) for s in range(9, -1, -1)]
    found = compare_tables(a, [*b, row(77)])
    assert (found["pairs"], found["unpaired"]) == (10, 1)
    assert found["success_a"] == pytest.approx(0.4)
    assert found["success_difference"] == pytest.approx(0.5)
    assert found["p"] == pytest.approx(binomtest(1, 7).pvalue)
    assert [run["seed"] for run in found["gained"]] == [4, 5, 6, 7, 8, 9]
    assert [run["seed"] for run in found["lost"]] == [0]
    assert found["both_reached"] == 3
    assert found["time_difference_s"] == pytest.approx(-5.0)
    assert found["time_ratio"] == pytest.approx(0.75)
    assert found["spl_difference"] == pytest.approx(0.9)


def test_the_interval_of_a_difference_covers_it() -> None:
    generator = np.random.default_rng(3)
    covered = 0
    for _ in range(400):
        kinds = generator.multinomial(60, [0.05, 0.15, 0.8])  # only A, only B, both or neither
        low, high = paired_interval(int(kinds[0]), int(kinds[1]), 60)
        covered += low <= 0.1 <= high
    assert 0.92 <= covered / 400 <= 1.0


def test_the_interval_of_a_median_needs_six_values() -> None:
    assert median_interval([*range(6)]) == (0.0, 5.0)
    assert median_interval([1.0] * 5) is median_interval([]) is None


def test_the_worst_regressions_come_first() -> None:
    a = [row(seed, spl=0.9) for seed in range(5)]
    lost = [row(0, "timeout", spl=0.0), row(1, "collided", spl=0.0)]
    b = [*lost, row(2, spl=0.5), row(3, spl=0.3), row(4, spl=0.85)]
    found = compare_tables(a, b)
    assert [run["seed"] for run in found["lost"]] == [1, 0]
    assert [run["seed"] for run in found["worse"]] == [3, 2]


def test_tables_of_several_stacks_are_paired_by_stack() -> None:
    both = [row(1, stack="default"), row(1, "stuck", stack="paper")]
    found = compare_tables(both, both)
    assert (found["pairs"], found["success_difference"], found["p"]) == (2, 0.0, 1.0)


def test_missions_with_different_stacks_are_paired_with_those_of_one_stack() -> None:
    own = [row(1, mission="near", stack="default"), row(1, mission="far", stack="landmarks")]
    one = [row(1, mission="near", stack="paper"), row(1, "lost", mission="far", stack="paper")]
    found = compare_tables(own, one)
    assert (found["pairs"], found["unpaired"]) == (2, 0)
    assert [run["mission"] for run in found["lost"]] == ["far"]


def test_cancelled_runs_are_left_out_and_tables_without_a_common_run_are_refused() -> None:
    found = compare_tables([row(1, "cancelled"), row(2)], [row(1), row(2)])
    assert found["pairs"] == 1
    with pytest.raises(InputError, match="no run in common"):
        compare_tables([row(1)], [row(2)])


def test_wilson_at_values_from_the_literature() -> None:
    # Newcombe 1998, Statistics in Medicine 17, table I: 81/263, 15/148, 0/20, 1/29
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=5e-5)


@given(st.integers(0, 300), st.integers(0, 300))
def test_mcnemar_counts_the_tails_of_discordant_pairs(a: int, b: int) -> None:
    tail = sum(math.comb(a + b, k) for k in range(min(a, b) + 1)) / 2 ** (a + b)
    assert mcnemar_exact(a, b) == pytest.approx(min(1.0, 2.0 * tail), rel=1e-9)
    assert mcnemar_exact(a, b) == mcnemar_exact(b, a)
    assert 0.0 < mcnemar_exact(5000, 6000) < 1e-15


def test_barn_score_is_clipped_at_two_and_eight_times_the_optimum() -> None:
    for time, score in ((5.0, 0.5), (10.0, 0.5), (20.0, 0.25), (40.0, 0.125), (90.0, 0.125)):
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


@pytest.mark.parametrize(("difference", "discordant"), [(0.05, 0.15), (0.1, 0.3), (0.2, 0.2)])
def test_so_many_pairs_find_the_difference_in_four_of_five_comparisons(
    difference: float, discordant: float
) -> None:
    pairs, rng = mcnemar_pairs(difference, discordant), np.random.default_rng(0)
    only_b = 0.5 * (discordant + difference)
    shares = [discordant - only_b, only_b, 1.0 - discordant]
    drawn = rng.multinomial(pairs, shares, size=2000)[:, :2].tolist()
    share = np.mean([mcnemar_exact(a, b) < 0.05 for a, b in drawn])
    assert 0.7 < share < 0.9  # the exact test is more careful than its approximation


def test_runs_as_a_table_of_pandas_are_compared_and_printed() -> None:
    pandas = pytest.importorskip("pandas", reason="needs the extra pandas")
    from navfw.suite.suite_frame import SuiteFrame

    first = [row(n, spl=0.5 + 0.1 * n) for n in range(4)] + [row(4, "collided", spl=0.0)]
    second = [row(n, spl=0.6 + 0.1 * n) for n in range(4)] + [row(4, spl=None)]
    frame, other = SuiteFrame.of(first), SuiteFrame.of(second)
    assert frame.rows == first
    assert other.rows == second
    assert frame["spl"].dtype == "Float64"
    assert frame["seed"].dtype == "Int64"
    assert isinstance(frame[frame.succeeded], SuiteFrame)
    assert other["spl"].isna().tolist() == [False] * 4 + [True]
    compared = frame.compare(other)
    assert compared.attrs == compare_tables(first, second)
    assert isinstance(compared, pandas.DataFrame)
    assert compared.loc["success", "A"] == "80.0 %"
    assert frame.plot_pairs(other).get_ylabel() == "spl of B"
    assert frame.plot_families("spl").get_ylabel() == "spl"
    assert frame.summary_markdown().count("\n") == 3
    latex = frame.summary_latex()
    assert "80 \\% [38, 96]" in latex
    assert latex.endswith("\\end{tabular}\n")
