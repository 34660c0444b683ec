"""The summary of ``navfw reproduce`` in plain words, from the measured figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from navfw.bench.real_labels import SentenceVerdict
from navfw.reproduce.paper_tables import FAST

SIGNIFICANT = 0.05
"""Largest p of a difference that is taken for more than chance."""

_KINDS = tuple(product(("ideal", "block matching"), ("normalised", "raw means")))
"""Flow and mode of the sentences."""


def summary(result: Mapping[str, Any]) -> dict[str, list[str]]:
    """What came out of each experiment, as sentences by its title.

    ``result`` has ``table2``, ``table3``, ``real`` and ``metrics`` as plain data.
    """
    return {
        "Table 2": list(_table2(result["table2"])),
        "Table 3, rendered": list(_table3(result["table3"])),
        "Table 3, photographs": list(_real(result["real"])),
        "Section 4.3": list(_claims(result["metrics"]["claims"])),
    }


def _table2(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield f"All {len(rows)} places are judged."
    for flow, mode in _KINDS:
        counts = [
            f"{_counts(_chosen(rows, flow=flow, mode=mode, rotation=rotation))} with the rotation"
            f" {rotation}"
            for rotation in ("removed", "left in")
        ]
        yield f"{flow.capitalize()} flow, {mode}: {'; '.join(counts)}."
    fast = [row for row in rows if row["waypoint"] == FAST]
    verdicts = "; ".join(
        f"{reading['flow']} flow, rotation {reading['rotation']}: {reading['verdict']}"
        for reading in _chosen(fast, mode="normalised")
    )
    yield f"Waypoint {FAST}, where the paper's conclusion is false, normalised: {verdicts}."
    none = [str(row["waypoint"]) for row in rows if row["truth"]["no_situation"]]
    if none:
        yield (
            f"At {len(none)} places (waypoints {', '.join(none)}) the geometry forms none of Table"
            " 1's situations; the reason stands beside each."
        )


def _table3(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield f"All {len(rows)} situations are judged."
    for flow, mode in _KINDS:
        yield f"{flow.capitalize()} flow, {mode}: {_counts(_chosen(rows, flow=flow, mode=mode))}."


def _real(found: Mapping[str, Any] | None) -> Iterator[str]:
    if found is None:
        yield "Missing: no recordings were given (--data DIR)."
        return
    sequences = [row for row in found["recordings"] if not row["single"]]
    yield (
        f"{sum(found['total'].values())} labelled frames of {len(sequences)} recordings:"
        f" {_verdicts(found['total'])}."
    )
    yield from (
        f"{sum(row['verdicts'].values())} single photographs, about which nothing should be said:"
        f" {_verdicts(row['verdicts'])}."
        for row in found["recordings"]
        if row["single"]
    )


def _verdicts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)


def _claims(claims: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    held = [claim for claim in claims if claim["confirmed"]]
    missed = [claim for claim in claims if not claim["confirmed"]]
    yield (
        "The paper's claim, that two layers of means classify at least as well as one layer of"
        f" means and variances, is confirmed in {len(held)} of {len(claims)} comparisons: better by"
        f" more than chance (p < {SIGNIFICANT:g}) in {_significant(held)}, alike on every view in"
        f" {sum(claim['differ'] == 0 for claim in held)}. It is not confirmed in {len(missed)}:"
        f" worse by more than chance in {_significant(missed)}."
    )
    yield from (f"Not confirmed: {_claim_text(claim)}." for claim in missed)


def _significant(claims: Sequence[Mapping[str, Any]]) -> int:
    """How many of the ``claims`` rest on differences that are more than chance."""
    return sum(claim["p"] < SIGNIFICANT for claim in claims)


def _claim_text(claim: Mapping[str, Any]) -> str:
    """One comparison of section 4.3 with its figures."""
    question = {
        "quadrant": "nearest quadrant",
        "distance": "distance of the nearest object",
        "situation": "situation in front",
    }[claim["what"]]
    figures = f"{claim['two_layers_right']} against {claim['one_layer_right']} of {claim['views']}"
    chance = f"answers that differ: {claim['differ']}, p = {claim['p']:.2g}"
    return f"{question} by {claim['by']}, {claim['flow']} flow: {figures} right ({chance})"


def _counts(readings: Sequence[Mapping[str, Any]]) -> str:
    """How many of the ``readings`` have which verdict: "8 right, 2 partly"."""
    verdicts = [reading["verdict"] for reading in readings]
    return _verdicts({str(verdict): verdicts.count(verdict) for verdict in SentenceVerdict})


def _chosen(rows: Sequence[Mapping[str, Any]], **wanted: str) -> list[Mapping[str, Any]]:
    return [
        reading
        for row in rows
        for reading in row["readings"]
        if all(reading[key] == value for key, value in wanted.items())
    ]
