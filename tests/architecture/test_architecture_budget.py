"""The check of the budgets of lines."""

from __future__ import annotations

from line_budget import exceeded, sizes


def test_a_folder_above_its_budget_and_one_without_are_named() -> None:
    counts = {"navfw/flow": 101, "navfw/new": 1, "navfw, files": 3, "tests": 7}
    budgets = {"navfw/flow": 100, "navfw, files": 3}
    assert exceeded(counts, budgets) == [
        "navfw/flow: 101, budget 100",
        "navfw/new: 1, budget missing",
    ]


def test_every_measure_counts_something() -> None:
    counts = sizes()
    assert min(counts.values()) > 0
    assert counts["navfw, all lines"] == sum(
        lines for name, lines in counts.items() if name == "navfw" or name.startswith("navfw/")
    )
    assert {"docs, words", "README.md, words", "navfw/flow", "navfw, entries"} < set(counts)
