"""What OFFIS says where, learnt on drives, and what it is worth to who has nothing else.

Its worth is measured without landmarks, by the discrete filter on the odometry of the same drives:
with a table that was learnt on the other entries of the suite, and with none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.errors import InputError
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_existence import LandmarkExistence
from navfw.localization.situation_model import SITUATIONS, SituationTable, learn_table
from navfw.missions.situation_samples import SituationDrive, record_situations

if TYPE_CHECKING:
    from navfw.plugins import Registry
    from navfw.suite.suite_plan import SuitePlan

__all__ = ["LearntSituations", "learn_situations", "place_accuracy", "tables"]

EVERY = 10
"""Of so many camera frames one is looked at."""

_PRIOR = 0.85


@dataclass(frozen=True)
class LearntSituations:
    """A table, and what such tables are worth in each entry's drives."""

    table: SituationTable
    drives: int
    worth: Mapping[str, Mapping[str, float]]

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
            "worth": {entry: dict(numbers) for entry, numbers in self.worth.items()},
        }


def learn_situations(
    plan: SuitePlan, registry: Registry, say: Callable[[str], None]
) -> LearntSituations:
    """Drive all runs of a suite, and learn from them.

    Raises:
        InputError: OFFIS had nothing to say on any of them.

    """
    drives: dict[str, list[SituationDrive]] = {}
    for case in plan.cases:
        drive = record_situations(case.session(registry))
        drives.setdefault(case.entry, []).append(drive)
        where = f"{case.world_name} {case.mission_name} {case.seed}"
        say(f"{case.index + 1} of {len(plan.cases)}: {where}: {drive.outcome}")
    worth = {}
    if len(drives) > 1:
        for entry, own in drives.items():
            others = [drive for name, rest in drives.items() if name != entry for drive in rest]
            worth[entry] = _worth(own, _table(others))
    everything = [drive for part in drives.values() for drive in part]
    return LearntSituations(_table(everything), len(everything), worth)


def _table(drives: Sequence[SituationDrive]) -> SituationTable:
    try:
        return learn_table(sample for drive in drives for sample in drive.observations())
    except ValueError as error:
        raise InputError(f"{error} on {len(drives)} drives: there is nothing to learn") from None


def _worth(drives: Sequence[SituationDrive], table: SituationTable) -> dict[str, float]:
    found = {"drives": float(len(drives))}
    for start, known in (("known", True), ("unknown", False)):
        for name, heard in (("without", None), ("with", table)):
            pairs = [place_accuracy(drive, heard, known) for drive in drives]
            right, probability = np.mean(pairs, axis=0).tolist()
            found[f"{start}_right_{name}"] = right
            found[f"{start}_probability_{name}"] = probability
    return found


def place_accuracy(
    drive: SituationDrive, table: SituationTable | None, known: bool
) -> tuple[float, float]:
    """How well the discrete filter knows its place by odometry and ``table``, without landmarks.

    The share of time in which the likeliest place is the right one, and the mean probability of the
    right one. It is told the start if that is ``known``.
    """
    existence = LandmarkExistence(_PRIOR)
    belief = DiscreteFilter(drive.topo_map, DiscreteParams(), _PRIOR, existence, table)
    belief.initialize(drive.start if known else None, drive.samples[0].odometry)
    right, probability = [], []
    for number, sample in enumerate(drive.samples):
        belief.predict(sample.odometry)
        belief.observe_situations(sample.situations)
        if number % EVERY == 0:
            places = belief.place_probabilities
            there = drive.place_at(sample.true)
            right.append(int(places.argmax()) == there)
            probability.append(float(places[there]))
    return float(np.mean(right)), float(np.mean(probability))


def tables(learnt: LearntSituations) -> list[tuple[str, list[str], list[list[str]]]]:
    """The table, and its worth, as tables for people: title, columns, rows."""
    said = [
        [kind, f"{learnt.table.observations.get(kind, 0.0):.0f}", *(f"{p:.2f}" for p in row)]
        for kind, row in learnt.table.seen_at.items()
    ]
    found = [
        ("what OFFIS says, by the kind of place", ["place", "observations", *SITUATIONS], said)
    ]
    keys = [
        f"{start}_{what}_{name}"
        for start in ("known", "unknown")
        for what in ("right", "probability")
        for name in ("without", "with")
    ]
    worth = [
        [entry, f"{numbers['drives']:.0f}", *(f"{numbers[key]:.2f}" for key in keys)]
        for entry, numbers in learnt.worth.items()
    ]
    columns = ["entry", "drives", *(key.replace("_", " ") for key in keys)]
    title = "without landmarks, by a table of the other entries: start, place right or probability"
    return [*found, (title, columns, worth)] if worth else found
