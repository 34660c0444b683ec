"""How often OFFIS is right: a thousand and more random views against their geometry.

``run`` renders the views (``scenes``, ``samples``), lets OFFIS interpret the block matching's flow
and, beside it, ideal flow, and compares with the truth (``truth``, which defines it). What counts:

- *nearest quadrant*: right when every quadrant that OFFIS names for the nearest object is possible
  and one of them is certain;
- *distance*: the term of the nearest named quadrant against the true term. "far" for "near" is the
  dangerous error; terms that are farther than the truth by one are counted, too;
- *situation contains truth*: the strongest of Table 1's alternatives names a true situation;
- *top situation*: the strongest elementary situation is a true one.

Views whose truth is "mixed" or "hidden" count for quadrant and distance, not for situations.
"""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from navfw.bench.samples import VIEWS_PER_WORLD, Sample, samples_of_world
from navfw.bench.truth import Truth
from navfw.kinds import Perception
from navfw.offis.distances import TERMS
from navfw.offis.offis import Offis
from navfw.offis.pyramid import QUADRANTS
from navfw.offis.situations import ELEMENTARY, TABLE
from navfw.robot import RobotModel
from navfw.signals import FlowField, Percept, Twist

__all__ = ["HELD_OUT_SEED", "TUNING_SEEDS", "Answer", "markdown", "run", "score"]

TUNING_SEEDS = (1, 2, 3, 4)
"""Seeds that the rule bases were tuned on: report none of them."""

HELD_OUT_SEED = 101
"""The seed of the figures that are reported."""

NONE = "none"
_BOUNDARY = 0.1  # a true distance within this share of a term's boundary is "at a boundary"


@dataclass(frozen=True, slots=True)
class Answer:
    """What OFFIS said of one view, and what of it was right (situations: None when unclear)."""

    quadrants: frozenset[str]
    term: str
    table: str
    elementary: str
    quadrant_right: bool
    distance_right: bool
    table_right: bool | None
    elementary_right: bool | None
    causes: tuple[str, ...]


def run(
    poses: int = 1000,
    seed: int = HELD_OUT_SEED,
    workers: int = 1,
    params: Offis.Params | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[str, Any]:
    """Accuracy over ``poses`` random views of a ``seed``, as plain data.

    Keys: ``poses``, ``seed``; ``nearest_quadrant_accuracy``, ``nearest_quadrant_exact`` (the named
    quadrants are all certain ones and no others), ``distance_accuracy``, ``far_for_near`` and
    ``one_term_too_far`` (shares of all views), ``situation_contains_truth``, ``situation_top1``,
    ``situations`` (number of views with a clear one); ``confusion``: ``quadrant`` (true nearest ->
    named first -> count), ``distance``, ``table`` and ``situation`` (truth -> answer -> count);
    ``causes``: count of each cause of error. ``ideal`` holds the same of ideal flow.

    The result does not depend on ``workers`` (processes). ``progress`` is told the number of views
    seen so far.
    """
    robot = RobotModel()
    offis, ideal = Offis(robot, params), Offis(robot, params)
    samples, measured, perfect = [], [], []
    for sample in islice(_samples(seed, workers), poses):
        samples.append(sample.truth)
        measured.append(answer(offis, sample.flow, sample.twist, sample.truth))
        perfect.append(answer(ideal, sample.ideal, sample.view.twist, sample.truth))
        if progress is not None:
            progress(len(samples))
    return {
        "poses": len(samples),
        "seed": seed,
        **score(samples, measured),
        "ideal": score(samples, perfect),
    }


def _samples(seed: int, workers: int) -> Iterable[Sample]:
    """Samples world by world, without end, in the same order for any number of workers."""
    if workers <= 1:
        number = 0
        while True:
            yield from samples_of_world(seed, number)
            number += 1
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        number = 0
        while True:
            jobs = [(seed, number + i) for i in range(2 * workers)]
            for samples in pool.imap(_world, jobs):
                yield from samples
            number += len(jobs)


def _world(job: tuple[int, int]) -> list[Sample]:
    return list(samples_of_world(*job, views=VIEWS_PER_WORLD))


def answer(offis: Perception, flow: FlowField, twist: Twist, truth: Truth) -> Answer:
    """Let ``offis`` interpret one flow field, and compare with the truth."""
    offis.reset()
    percept = offis.perceive(flow, twist)
    named = percept.obstacles["layer1"]
    quadrants = frozenset(named)
    term = min(named.values(), key=TERMS.index) if named else NONE
    table = _strongest(percept, TABLE)
    elementary = _strongest(percept, ELEMENTARY)
    quadrant_right = bool(quadrants & truth.certain) and quadrants <= truth.possible
    distance_right = term == truth.term or (term == NONE and truth.term == "far")
    table_right = elementary_right = None
    if truth.clear:
        table_right = any(name in truth.situations for name in table.split(" or "))
        elementary_right = elementary in truth.situations
    return Answer(
        quadrants=quadrants,
        term=term,
        table=table,
        elementary=elementary,
        quadrant_right=quadrant_right,
        distance_right=distance_right,
        table_right=table_right,
        elementary_right=elementary_right,
        causes=(),
    )


def _strongest(percept: Percept, names: Sequence[str]) -> str:
    return max(names, key=percept.situations.__getitem__)


def score(truths: Sequence[Truth], answers: Sequence[Answer]) -> dict[str, Any]:
    """The figures of ``run`` from truths and answers."""
    both = list(zip(truths, answers, strict=True))
    clear = [(t, a) for t, a in both if t.clear]
    farther = [TERMS.index(a.term) - TERMS.index(t.term) for t, a in both if a.term != NONE]
    exact = [a.quadrants >= t.certain and a.quadrants <= t.possible for t, a in both]
    return {
        "nearest_quadrant_accuracy": _share(a.quadrant_right for _, a in both),
        "nearest_quadrant_exact": _share(exact),
        "distance_accuracy": _share(a.distance_right for _, a in both),
        "far_for_near": sum(step == 2 for step in farther) / max(len(both), 1),
        "one_term_too_far": sum(step == 1 for step in farther) / max(len(both), 1),
        "situation_contains_truth": _share(bool(a.table_right) for _, a in clear),
        "situation_top1": _share(bool(a.elementary_right) for _, a in clear),
        "situations": len(clear),
        "confusion": {
            "quadrant": _confusion((_names(t.certain), _names(a.quadrants)) for t, a in both),
            "distance": _confusion((t.term, a.term) for t, a in both),
            "table": _confusion((" + ".join(t.situations), a.table) for t, a in both),
            "situation": _confusion((" + ".join(t.situations), a.elementary) for t, a in both),
        },
        "causes": dict(Counter(cause for a in answers for cause in a.causes).most_common()),
    }


def _names(quadrants: frozenset[str]) -> str:
    return " ".join(q for q in QUADRANTS if q in quadrants) or NONE


def _share(right: Iterable[bool]) -> float:
    values = np.array(list(right))
    return float(values.mean()) if values.size else float("nan")


def _confusion(pairs: Iterable[tuple[str, str]]) -> dict[str, dict[str, int]]:
    table: dict[str, Counter[str]] = {}
    for truth, said in pairs:
        table.setdefault(truth, Counter())[said] += 1
    return {truth: dict(table[truth].most_common()) for truth in sorted(table)}


def markdown(result: Mapping[str, Any]) -> str:
    return str(result)
