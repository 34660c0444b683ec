"""Statistics of suites: confidence intervals, tests, paired comparison of two tables of runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean, median
from typing import Any

from navfw.errors import InputError, UnknownNameError
from navfw.process.result_table import shown
from navfw.suite.run_row import RunKey, RunRow

MIN_RUNS = 5
"""Smallest number of runs, or pairs, for which a confidence interval is given."""


def wilson(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a proportion (Wilson 1927); (0, 1) without runs.

    Unlike the normal approximation it keeps its coverage for proportions near 0 and 1.

    >>> low, high = wilson(200, 200)
    >>> round(low, 4), high
    (0.9812, 1.0)
    """
    from scipy.stats import binomtest

    if runs == 0:
        return 0.0, 1.0
    interval = binomtest(successes, runs).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar_exact(only_a: int, only_b: int) -> float:
    """Two-sided exact p of McNemar's test from the numbers of pairs where only A, only B succeeded.

    Pairs in which both or neither succeeded do not enter the test.

    >>> mcnemar_exact(0, 5)
    0.0625
    """
    from scipy.stats import binomtest

    pairs = only_a + only_b
    return float(binomtest(min(only_a, only_b), pairs).pvalue) if pairs else 1.0


def mcnemar_pairs(difference: float, discordant: float, power: float = 0.8) -> int:
    """Number of pairs that McNemar's test at 5 % needs to find a ``difference`` with ``power``.

    ``difference`` is that of the success rates, ``discordant`` the share of pairs in which only one
    run succeeds, at least the ``difference`` (Connor 1987): about 2 p (1 - p) for two independent
    runs with success rate p; runs of one seed agree more often, so fewer pairs are enough.

    >>> mcnemar_pairs(0.02, 0.1)
    1960
    """
    share, effect = max(discordant, difference), abs(difference)
    sure, likely = NormalDist().inv_cdf(0.975), NormalDist().inv_cdf(power)
    half = sure * math.sqrt(share) + likely * math.sqrt(max(share - effect**2, 0.0))
    return math.ceil((half / effect) ** 2)


def paired_interval(only_a: int, only_b: int, pairs: int) -> tuple[float, float]:
    """95 % interval of the difference of paired proportions, B minus A (Bonett and Price 2012).

    ``only_a`` and ``only_b`` count the pairs in which only that run succeeded. It is Wald's
    interval with one added to each count and two to ``pairs``: it keeps its coverage for few pairs.

    >>> low, high = paired_interval(0, 0, 98)
    >>> round(low, 3), round(high, 3)
    (-0.028, 0.028)
    """
    a, b = (only_a + 1) / (pairs + 2), (only_b + 1) / (pairs + 2)
    z = NormalDist().inv_cdf(0.975)
    half = z * math.sqrt((a + b - (b - a) ** 2) / (pairs + 2))
    return max(-1.0, b - a - half), min(1.0, b - a + half)


def median_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """95 % interval of the median by order statistics; None for fewer than six values.

    It assumes no distribution: the number of values below the median is binomial.

    >>> median_interval(range(1, 11))
    (2.0, 9.0)
    """
    from scipy.stats import quantile_test

    interval = quantile_test(values or [0.0]).confidence_interval(0.95)
    return None if math.isnan(interval.low) else (float(interval.low), float(interval.high))


_SPL_CHANGE = 0.1
"""Change of SPL beyond which a run counts as worse, or better, although both runs succeeded."""

_OF_RUN = ("outcome", "cause", "spl", "picture")


@dataclass(frozen=True, slots=True)
class RunPair:
    """Two runs of the same entry, world, mission and seed, one from each table."""

    a: RunRow
    b: RunRow

    @property
    def spl_difference(self) -> float:
        """SPL of B minus that of A; a run without a result has SPL 0."""
        return (self.b.spl or 0.0) - (self.a.spl or 0.0)

    @property
    def configuration(self) -> str:
        """Variant of B, or its stack if it has none; "" if that of A differs."""
        return self.b.configuration if self.a.configuration == self.b.configuration else ""


def paired_changes(pairs: Sequence[RunPair]) -> dict[str, list[RunPair]]:
    """Group the pairs that differ, those with new collisions or the largest change of SPL first.

    In ``lost`` only A succeeded, in ``gained`` only B. In ``worse`` and ``better`` both succeeded,
    and the SPL of B is lower, or higher, by more than 0.1.
    """
    changes: dict[str, list[RunPair]] = {"lost": [], "worse": [], "gained": [], "better": []}
    for pair in pairs:
        if pair.a.succeeded != pair.b.succeeded:
            changes["lost" if pair.a.succeeded else "gained"].append(pair)
        elif pair.a.succeeded and abs(pair.spl_difference) > _SPL_CHANGE:
            changes["worse" if pair.spl_difference < 0.0 else "better"].append(pair)
    for name, changed in changes.items():
        changed.sort(
            key=lambda pair: (
                not (pair.b.collisions and not pair.a.collisions),
                pair.spl_difference,
            ),
            reverse=name in {"gained", "better"},
        )
    return changes


def of_variant(rows: Sequence[RunRow], name: str | None) -> Sequence[RunRow]:
    """Return the rows of the variant ``name``; all rows if it is None.

    Raises:
        UnknownNameError: the table has no such variant.

    """
    if name is None:
        return rows
    chosen = [row for row in rows if row.variant == name]
    if not chosen:
        raise UnknownNameError("variant", name, {row.variant for row in rows} - {""})
    return chosen


def pair_up(first: Sequence[RunRow], second: Sequence[RunRow]) -> list[RunPair]:
    """Pair the runs that are in both tables, in the order of the first table.

    If every run was made with one stack only, the names of the stacks need not agree; if each table
    has one variant only, nor need those of the variants. Cancelled runs are left out.

    Raises:
        InputError: no run is in both tables.

    """
    by_variant = any(len({row.variant for row in rows}) > 1 for rows in (first, second))

    def bare(row: RunRow) -> RunKey:
        kept = row.key._replace(stack="")
        return kept if by_variant else kept._replace(variant="")

    # the stack is part of the key only where a mission was run with several stacks
    by_stack = any(len({bare(row) for row in rows}) < len(rows) for rows in (first, second))

    def key(row: RunRow) -> RunKey:
        return bare(row)._replace(stack=row.stack) if by_stack else bare(row)

    others = {key(row): row for row in second if row.outcome != "cancelled"}
    pairs = [
        RunPair(row, others[key(row)])
        for row in first
        if row.outcome != "cancelled" and key(row) in others
    ]
    if not pairs:
        what = "entry, world, mission, seed" + (", stack" if by_stack else "")
        what += ", variant" if by_variant else ""
        chosen = "; --variant-a and --variant-b choose one of each" if by_variant else ""
        raise InputError(f"the tables have no run in common (same {what}){chosen}")
    return pairs


def compare_tables(first: Sequence[RunRow], second: Sequence[RunRow]) -> dict[str, Any]:
    """Compare two tables run by run, B (``second``) minus A (``first``); returns plain data.

    ``p`` is that of McNemar's exact test on success. ``spl_a``, ``spl_b`` and ``spl_difference``
    are medians over all pairs, ``mean_spl_a`` and ``mean_spl_b`` means; ``time_difference_s`` and
    ``time_ratio`` (B over A) are medians over the pairs in which both runs succeeded. Differences
    of success and of medians have a 95 % interval, None for too few pairs. ``lost``, ``worse``,
    ``gained`` and ``better`` list the runs of ``paired_changes``. With several variants in both
    tables, or several stacks, ``by_configuration`` has the same comparison for each of them.

    Raises:
        InputError: no run is in both tables.

    """
    pairs = pair_up(first, second)
    compared = {**_numbers(pairs), "unpaired": len(first) + len(second) - 2 * len(pairs)}
    names = dict.fromkeys(pair.configuration for pair in pairs)
    if len(names) > 1 and "" not in names:
        compared["by_configuration"] = {
            name: _numbers([pair for pair in pairs if pair.configuration == name]) for name in names
        }
    return compared


def _numbers(pairs: Sequence[RunPair]) -> dict[str, Any]:
    """Return the comparison of ``pairs``, at least one."""
    changes = paired_changes(pairs)
    lost, gained, count = len(changes["lost"]), len(changes["gained"]), len(pairs)
    both = [pair for pair in pairs if pair.a.succeeded and pair.b.succeeded]
    times = [(p.a.sim_time_s, p.b.sim_time_s) for p in both if p.a.sim_time_s and p.b.sim_time_s]
    longer = [b - a for a, b in times]
    differences = [pair.spl_difference for pair in pairs]
    sides: dict[str, Any] = {}
    for side, rows in (("a", [pair.a for pair in pairs]), ("b", [pair.b for pair in pairs])):
        spl = [row.spl or 0.0 for row in rows]
        sides[f"success_{side}"] = sum(row.succeeded for row in rows) / count
        sides[f"mean_spl_{side}"], sides[f"spl_{side}"] = fmean(spl), median(spl)
        sides[f"time_{side}_s"] = (
            median(time["ab".index(side)] for time in times) if times else None
        )
        sides[f"collisions_{side}"] = sum(row.collisions or 0 for row in rows)
    return {
        "pairs": count,
        **sides,
        "success_difference": sides["success_b"] - sides["success_a"],
        "success_interval": paired_interval(lost, gained, count) if count >= MIN_RUNS else None,
        "p": mcnemar_exact(lost, gained),
        "spl_difference": median(differences),
        "spl_interval": median_interval(differences),
        "both_reached": len(times),
        "time_difference_s": median(longer) if times else None,
        "time_interval_s": median_interval(longer),
        "time_ratio": median(b / a for a, b in times) if times else None,
        "same_commands": sum(pair.a.command_hash == pair.b.command_hash != "" for pair in pairs),
        **{
            name: [_named(pair.a if name == "gained" else pair.b) for pair in changed]
            for name, changed in changes.items()
        },
    }


def _named(row: RunRow) -> dict[str, Any]:
    """One run of a pair, with its outcome, cause, SPL and picture."""
    return {**row.key._asdict(), **{name: getattr(row, name) for name in _OF_RUN}}


# --- for printing --------------------------------------------------------------------------------


def comparison_rows(compared: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Rows to print of a ``compare_tables``: name, value of A, value of B, difference, as text.

    Success and SPL of each variant, or stack, come last.
    """
    rows = _pair_rows(compared)
    for name, configuration in compared.get("by_configuration", {}).items():
        rows += [(f"{name}: {what}", a, b, by) for what, a, b, by in _pair_rows(configuration)[:2]]
    return rows


def _pair_rows(compared: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Success, SPL, time where there are some, and collisions of pairs; of equal runs one line."""
    if compared["same_commands"] == compared["pairs"]:
        count = str(compared["pairs"])
        return [("runs", count, count, "the same commands in all of them")]

    def line(name: str, key: str, form: str, by: str, unit: str = "") -> tuple[str, str, str, str]:
        a, b = (shown(compared[key.format(side)], form, unit) for side in "ab")
        return name, a, b, by

    success = _difference(
        compared["success_difference"], compared["success_interval"], 100.0, 1, " %"
    )
    only = f"only B {len(compared['gained'])}, only A {len(compared['lost'])}"
    mean = f"{compared['mean_spl_b'] - compared['mean_spl_a']:+.3f}"
    spl = _difference(compared["spl_difference"], compared["spl_interval"], 1.0, 3)
    chance = f"McNemar exact p = {compared['p']:.3g}"
    rows = [
        line("success", "success_{}", ".1%", f"{success}; {only}; {chance}"),
        line("mean SPL", "mean_spl_{}", ".3f", mean),
        line("median SPL", "spl_{}", ".3f", f"median {spl}"),
    ]
    if count := compared["both_reached"]:
        time = _difference(compared["time_difference_s"], compared["time_interval_s"], 1.0, 1, " s")
        note = f"median {time} in {count} pairs of successes"
        rows.append(line("median time", "time_{}_s", ".1f", note, "s"))
    return [*rows, line("collisions", "collisions_{}", "", "")]


def _difference(
    value: float, ends: tuple[float, float] | None, factor: float, digits: int, unit: str = ""
) -> str:
    """Return a difference with its interval, if it has one."""
    text = f"{factor * value:+.{digits}f}{unit}"
    if ends is None:
        return text
    low, high = (f"{factor * end:+.{digits}f}" for end in ends)
    return f"{text} [{low}, {high}]"
