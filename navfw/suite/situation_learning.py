"""Learn how often OFFIS infers each situation at each kind of place, and measure the benefit.

The benefit is the accuracy of the discrete localisation filter without landmarks, on the odometry
of the same drives: with a table learnt on the other entries of the suite (leave one entry out), and
without a table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfw.errors import InputError
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_model import LandmarkExistence
from navfw.localization.place_probabilities import SITUATIONS, SituationTable, learn_table
from navfw.missions.learning_drives import SituationDrive, record_situations
from navfw.plugins import Registry
from navfw.process.result_table import Column, ResultTable, named
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.suite.suite_plan import SuitePlan

EVERY = 10
"""The filter's accuracy is evaluated at one camera frame in this many."""

_PRIOR = 0.85
"""Prior existence probability of a landmark. The filter needs one; no landmark is observed here."""


@dataclass(frozen=True)
class LearntSituations:
    """A table learnt on ``drives`` drives, and by entry the accuracy with and without a table.

    The table behind ``accuracy`` was learnt on the other entries; see ``place_accuracy``.
    """

    table: SituationTable
    drives: int
    accuracy: Mapping[str, Mapping[str, float]]

    def as_data(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        rows = {
            kind: dict(zip(SITUATIONS, row.tolist(), strict=True))
            for kind, row in self.table.seen_at.items()
        }
        return {
            "drives": self.drives,
            "observations": dict(self.table.observations),
            "seen_at": rows,
            "accuracy": {entry: dict(numbers) for entry, numbers in self.accuracy.items()},
        }


def learn_situations(
    plan: SuitePlan, registry: Registry, report: ProgressCallback = silent
) -> LearntSituations:
    """Drive all runs of a suite and learn a table from them.

    ``report`` is called with each drive.

    Raises:
        InputError: OFFIS inferred no situation on any drive.

    """
    drives: dict[str, list[SituationDrive]] = {}
    for case in with_progress(plan.cases, "drives", report):
        drive = record_situations(case.session(registry))
        drives.setdefault(case.entry, []).append(drive)
    accuracy = {}
    if len(drives) > 1:
        for entry, own in drives.items():
            others = [drive for name, rest in drives.items() if name != entry for drive in rest]
            accuracy[entry] = _accuracy(own, _table(others))
    everything = [drive for of_entry in drives.values() for drive in of_entry]
    return LearntSituations(_table(everything), len(everything), accuracy)


def _table(drives: Sequence[SituationDrive]) -> SituationTable:
    try:
        return learn_table(sample for drive in drives for sample in drive.observations())
    except ValueError as error:
        raise InputError(f"{error} on {len(drives)} drives: there is nothing to learn") from None


def _accuracy(drives: Sequence[SituationDrive], table: SituationTable) -> dict[str, float]:
    accuracy = {"drives": float(len(drives))}
    for start, at_start in (("known", True), ("unknown", False)):
        for name, used in (("without", None), ("with", table)):
            pairs = [place_accuracy(drive, used, known_start=at_start) for drive in drives]
            right, probability = np.mean(pairs, axis=0).tolist()
            accuracy[f"{start}_right_{name}"] = right
            accuracy[f"{start}_probability_{name}"] = probability
    return accuracy


def place_accuracy(
    drive: SituationDrive, table: SituationTable | None, *, known_start: bool
) -> tuple[float, float]:
    """Accuracy of the discrete filter with odometry and ``table``, without landmarks.

    The share of time in which the most probable place is the true one, and the mean probability
    of the true place. With ``known_start`` the filter starts at the true place, else from a uniform
    distribution.
    """
    existence = LandmarkExistence(_PRIOR)
    belief = DiscreteFilter(drive.topo_map, DiscreteParams(), _PRIOR, existence, table)
    belief.initialize(drive.start if known_start else None, drive.samples[0].odometry)
    right, probability = [], []
    for number, sample in enumerate(drive.samples):
        belief.predict(sample.odometry)
        belief.observe_situations(sample.situations)
        if number % EVERY == 0:
            places = belief.place_probabilities
            true_place = drive.place_at(sample.true)
            right.append(int(places.argmax()) == true_place)
            probability.append(float(places[true_place]))
    return float(np.mean(right)), float(np.mean(probability))


def tables(learnt: LearntSituations) -> Iterator[ResultTable]:
    """The table of situations and the accuracies for printing."""
    data = learnt.as_data()
    shares = [
        {"place": place, "observations": data["observations"].get(place, 0.0), **row}
        for place, row in data["seen_at"].items()
    ]
    counts = [Column("place", "place"), Column("observations", "observations", ".0f")]
    situations = [Column(name, name, ".2f") for name in SITUATIONS]
    yield ResultTable("probability of each situation", [*counts, *situations], shares)
    if learnt.accuracy:
        title = "place without landmarks, by start; table learnt on the other entries"
        columns = [Column("entry", "name"), Column("drives", "drives", ".0f")]
        columns += [
            Column(f"{start} {what} {name}", f"{start}_{what}_{name}", ".2f")
            for start in ("known", "unknown")
            for what in ("right", "probability")
            for name in ("without", "with")
        ]
        yield ResultTable(title, columns, named(data["accuracy"]))
