"""Explanations of recorded decisions: whether the changes that are named are true, and the time."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from navfw.errors import InputError
from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.recording import RunFolder
from navfw.recording.decision_moment import DecisionMoment, Shift
from navfw.recording.explanations import explain_at
from navfw.recording.recorded_decisions import RecordedDecisions, moment_at
from navfw.recording.why_not import DIRECTIONS, WhyNot, turned_by, why_not

MISSIONS = (
    ("office", "lobby-to-lab"),
    ("lounge", "to-the-hall"),
    ("paper-room", "through-the-door"),
    ("hospital", "ward-3-to-ward-4"),
)
"""World and mission of the runs that are made where none is given."""

_TIMED = 3
"""Number of decisions of each run for which the whole answer is timed."""


def recorded_runs(folder: Path, seed: int, report: ProgressCallback = silent) -> list[Path]:
    """Drive and record ``MISSIONS`` into ``folder``, and return the run folders."""
    runs = []
    for world, mission in with_progress(MISSIONS, "drives", report):
        result = prepare(world, mission, seed=seed).run(record=True)
        with RunFolder(folder / world) as run:
            write_run(result, run)
        runs.append(folder / world)
    return runs


def bench_explain(
    runs: Sequence[Path], decisions: int = 200, seed: int = 0, report: ProgressCallback = silent
) -> dict[str, Any]:
    """Ask about ``decisions`` of recorded ``runs`` why each other direction was not taken.

    Each change that would have turned a decision is applied, and half of it. ``changes`` gives by
    kind how many there are, how many are ``true``, and of how many half is ``not_enough``.
    ``search_s`` is the time of a search, ``answer_s`` that with reading the recording, and
    ``explain_s`` that of the explanation of a moment.
    """
    rng = np.random.default_rng(seed)
    changes: dict[str, dict[str, int]] = {}
    spent: dict[str, list[float]] = {"search_s": [], "answer_s": [], "explain_s": []}
    counts = dict.fromkeys(("answers", "single", "pair", "none"), 0)
    share = -(-decisions // len(runs))
    asked = 0
    for run in with_progress(runs, "runs", report):
        recorded = RecordedDecisions(run)
        chosen = rng.permutation(len(recorded.times))[: min(share, decisions - asked)]
        asked += len(chosen)
        for place, index in enumerate(sorted(chosen.tolist())):
            moment = recorded.moment(index)
            for wanted in DIRECTIONS:
                began = time.perf_counter()
                try:
                    answer = why_not(moment, wanted)
                except InputError:  # that was commanded
                    continue
                spent["search_s"].append(time.perf_counter() - began)
                _count(answer, counts)
                _check(moment, wanted, answer, changes)
            if place < _TIMED:
                _time(run, float(recorded.times[index]), spent)
    return {
        "runs": len(runs),
        "decisions": asked,
        "seed": seed,
        **counts,
        "changes": changes,
        **{
            name: {"median": median(values), "max": max(values)}
            for name, values in spent.items()
            if values
        },
    }


def _count(answer: WhyNot, counts: dict[str, int]) -> None:
    counts["answers"] += 1
    counts["single" if answer.changes else "pair" if answer.pair else "none"] += 1


def _check(
    moment: DecisionMoment, wanted: str, answer: WhyNot, changes: dict[str, dict[str, int]]
) -> None:
    """Apply each change of an ``answer``, and half of it."""
    groups = [(_kind(change.shift), [change.shift]) for change in answer.changes]
    if answer.pair:
        groups.append(("pair of inputs", [change.shift for change in answer.pair]))
    for kind, shifts in groups:
        row = changes.setdefault(kind, {"named": 0, "true": 0, "half_not_enough": 0})
        row["named"] += 1
        row["true"] += turned_by(moment, wanted, shifts)
        row["half_not_enough"] += not turned_by(moment, wanted, [s.scaled(0.5) for s in shifts])


def _kind(shift: Shift) -> str:
    if shift.corner is not None:
        return "break point"
    if shift.rule is not None:
        return "weight of a rule"
    return "input" if shift.name else "weight of a behaviour"


def _time(run: Path, at: float, spent: dict[str, list[float]]) -> None:
    """Time the explanation of a moment, and a whole answer."""
    began = time.perf_counter()
    explain_at(run, at)
    spent["explain_s"].append(time.perf_counter() - began)
    for wanted in DIRECTIONS:
        began = time.perf_counter()
        try:
            why_not(moment_at(run, at), wanted)
        except InputError:
            continue
        spent["answer_s"].append(time.perf_counter() - began)
        return


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """The changes by kind, and the times."""
    rows = [{"kind": kind, **row} for kind, row in result["changes"].items()]
    columns = [
        Column("smallest change of", "kind"),
        Column("named", "named"),
        Column("true", "true"),
        Column("half not enough", "half_not_enough"),
    ]
    about = f"{result['answers']} answers about {result['decisions']} decisions"
    yield ResultTable(f"{about}, {result['none']} without any change", columns, rows)
    names = {"search_s": "search", "answer_s": "answer", "explain_s": "explanation"}
    times = [{"what": text, **result[key]} for key, text in names.items() if key in result]
    columns = [Column("", "what"), Column("median", "median", ".2f"), Column("most", "max", ".2f")]
    yield ResultTable("time [s]", columns, times)
