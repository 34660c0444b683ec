"""Simulated drives that teach landmark positions, or the OFFIS situations at kinds of places.

What a situation table is worth is measured as the accuracy of the discrete localisation filter
without landmarks, on the odometry of the same drives: with a table learnt on the other entries of
the suite (leave one entry out), and without a table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfw.errors import InputError, MapError
from navfw.features.landmark_appearance import landmark_kind
from navfw.features.recognizers import Aruco
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_model import LandmarkExistence
from navfw.localization.place_probabilities import (
    SITUATIONS,
    SituationTable,
    learn_table,
    observed_situations,
)
from navfw.mapping.landmark_mapping import LandmarkEstimate, LandmarkMapper, with_landmarks
from navfw.missions import MissionLoop
from navfw.missions.pilot import TickView
from navfw.missions.session import Session
from navfw.plugins import Registry
from navfw.process.result_table import Column, ResultTable, named
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.signals import Odometry, Percept, Pose
from navfw.suite.suite_plan import SuitePlan
from navfw.topomap import TopoMap

SPACING = 0.25
"""Distance [m] driven between observations: nearer frames show the same surroundings."""


@dataclass(frozen=True, slots=True)
class SituationSample:
    """At one camera frame: odometry, OFFIS situation degrees (None: no new percept), true pose."""

    odometry: Odometry
    situations: Mapping[str, float] | None
    true: Pose


@dataclass(frozen=True)
class SituationDrive:
    """A drive in the world of a map, one sample per camera frame."""

    topo_map: TopoMap
    start: Pose
    samples: tuple[SituationSample, ...]

    def observations(self) -> Iterator[tuple[str, Mapping[str, float]]]:
        """Yield (kind of the true place, situation degrees) of samples at least SPACING apart."""
        kinds = [place.kind for place in self.topo_map.places.values()]
        driven = 0.0
        last = self.start
        for sample in self.samples:
            driven += math.hypot(sample.true.x - last.x, sample.true.y - last.y)
            last = sample.true
            if sample.situations is not None and driven >= SPACING:
                driven = 0.0
                yield kinds[self.place_at(sample.true)], sample.situations

    def place_at(self, pose: Pose) -> int:
        """Return the index of the place nearest to ``pose`` (``map`` frame)."""
        places = self.topo_map.places.values()
        return int(np.argmin([place.distance(pose.x, pose.y) for place in places]))


def record_situations(session: Session) -> SituationDrive:
    """Drive the session's mission, without its events, and record the OFFIS situations.

    Raises:
        InputError: the stack refuses the mission before the robot has moved.

    """
    samples: list[SituationSample] = []
    percept: Percept | None = None

    def sample(tick: TickView) -> None:
        nonlocal percept
        if tick.image is None or tick.state.odometry is None:
            return
        new = tick.percept if tick.percept is not percept else None
        percept = tick.percept
        true = Pose(*tick.true_pose.tolist())
        samples.append(SituationSample(tick.state.odometry, observed_situations(new), true))

    with session.simulation() as simulator:
        MissionLoop(session.task, session.stack, simulator, sample).run()
    return SituationDrive(session.mission.topo_map, session.mission.start, tuple(samples))


def learn_landmarks(session: Session, least: int = 3) -> tuple[TopoMap, dict[str, Any]]:
    """Drive the session's mission and add landmarks detected at least ``least`` times to its map.

    Returns the new map, and the run and its landmarks as plain data; ``error_m`` is the distance
    [m] from the true position in the world. If the stack's feature recognition takes no landmark
    frames, it is replaced in the session by ``aruco``.

    Raises:
        MapError: the start is unknown, or no landmark was detected often enough.

    """
    stack = session.stack
    if not session.task.start_known:
        raise MapError(
            "learning landmarks needs a known start; choose a mission without start: unknown",
            file=session.mission.file,
        )
    if not stack.features.plugin.landmark_frames:
        stack.features.plugin = Aruco(stack.robot)
    mapper = LandmarkMapper(session.mission.start)
    last = -math.inf

    def integrate(tick: TickView) -> None:
        nonlocal last
        state = tick.state
        if state.landmark_detections and state.time > last:
            last = state.time
            taken = state.landmark_detections[0].time  # the image may be older than the decision
            mapper.integrate(stack.history.at(taken).pose, state.landmark_detections)

    with session.simulation() as simulator:
        run = MissionLoop(session.task, stack, simulator, integrate).run()
    learnt = mapper.estimate(least)
    if not learnt:
        raise MapError(
            f"no landmark was detected {least} times (the mission ended {run.verdict.outcome});"
            " check that the world has landmarks along the path",
            file=session.mission.file,
        )
    learnt_map = with_landmarks(
        stack.topo_map, learnt, lambda kind: landmark_kind(kind).default_size
    )
    return learnt_map, {
        "outcome": str(run.verdict.outcome),
        "reason": run.verdict.reason,
        "world": session.world_name,
        "mission": session.mission_name,
        "seed": session.seed,
        "learnt": len(learnt),
        "landmarks": [_row(mark, session) for mark in learnt],
    }


def _row(mark: LandmarkEstimate, session: Session) -> dict[str, Any]:
    true = {f"{marker.kind}-{marker.id}": marker.at for marker in session.world.landmarks}
    at = true.get(mark.identity)
    return {
        "identity": mark.identity,
        "x": mark.x,
        "y": mark.y,
        "sigma_m": mark.sigma,
        "observations": mark.observations,
        "error_m": None if at is None else math.dist((mark.x, mark.y), at),
    }


EVERY = 10
"""The filter's accuracy is evaluated at every tenth camera frame."""

_PRIOR = 0.85
"""Prior existence probability of a landmark. The filter needs one; no landmark is observed here."""


def learn_situations(
    plan: SuitePlan, registry: Registry, report: ProgressCallback = silent
) -> tuple[SituationTable, dict[str, Any]]:
    """Drive all runs of a suite and learn a situation table from them.

    Returns the table, and the numbers of ``--json``: how many drives and observations, the table,
    and for each entry (if there are several) ``place_accuracy`` with a table learnt on the other
    entries, and without one. ``report`` is called before each drive.

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
    table = _table(everything)
    return table, {
        "drives": len(everything),
        "observations": dict(table.observations),
        "seen_at": {
            kind: dict(zip(SITUATIONS, row.tolist(), strict=True))
            for kind, row in table.seen_at.items()
        },
        "accuracy": accuracy,
    }


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
    """Measure the accuracy of the discrete filter with odometry and ``table``, without landmarks.

    Returns the share of frames at which the most probable place is the true one, and the mean
    probability of the true place. With ``known_start`` the filter starts at the true pose, else
    from a uniform distribution.
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


def tables(data: Mapping[str, Any]) -> Iterator[ResultTable]:
    """Yield the tables to print from the data of ``learn_situations``."""
    shares = [
        {"place": place, "observations": data["observations"].get(place, 0.0), **row}
        for place, row in data["seen_at"].items()
    ]
    counts = [Column("place", "place"), Column("observations", "observations", ".0f")]
    situations = [Column(name, name, ".2f") for name in SITUATIONS]
    yield ResultTable("probability of each situation", [*counts, *situations], shares)
    if data["accuracy"]:
        title = "place without landmarks, by start; table learnt on the other entries"
        columns = [Column("entry", "name"), Column("drives", "drives", ".0f")]
        columns += [
            Column(f"{start} {what} {name}", f"{start}_{what}_{name}", ".2f")
            for start in ("known", "unknown")
            for what in ("right", "probability")
            for name in ("without", "with")
        ]
        yield ResultTable(title, columns, named(data["accuracy"]))
