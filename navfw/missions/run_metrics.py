"""The result of a run, with its metrics: path length, clearance, estimation errors.

Its fields have the names of ``navfw run --json``: the JSON, the row of a suite, the page and the
lines of the terminal are views of it. Metrics are computed from the true poses after the run; the
stack gets none of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from navfw.assumption import Assumption
from navfw.errors import WorldError
from navfw.mapping import MapChange
from navfw.missions.mission_events import EventRecord
from navfw.missions.outcome import Outcome
from navfw.numerics import Array
from navfw.recording.run_observers import Contact, RunLog
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.world_changes import ChangeTrack, WalkerTrack

Point = tuple[float, float]

SAMPLING = 0.1
"""Sampling period [s] of the path; a shorter one would count vibration of the wheels as path."""

_ROOM = 0.15
"""Distance [m] beside the body that a driver who knows the building would keep."""

_SET_OUT = 0.1
"""Distance from the start [m] at which the BARN challenge starts its clock."""

_DEBOUNCE = 1.0
"""Contacts less than this time [s] apart count as one collision."""

_CONFIDENT = 0.9
"""Smallest confidence at which a belief counts as confident."""

_CORRECT = 1.0
"""Largest distance [m] of the estimate from the true position for a correct belief."""


@dataclass(frozen=True, kw_only=True)
class RunMetrics:
    """The metrics of one run; lengths in metres, times in seconds.

    Percentiles of the position error are over the ticks in which the belief was not lost.
    ``localized_after_s`` and ``localized_after_m`` are time and driven distance until the belief
    first was both confident and correct; None if it never was. ``confidently_wrong_s`` is the time
    in which it was confident and not correct, ``lost_s`` the time in which it was lost.

    ``shortest_path_m`` is the shortest path through all goals, ``shortest_with_room_m`` the
    shortest that leaves 0.15 m beside the body where it can. ``spl`` is success times shortest over
    driven length (Anderson et al. 2018). ``traversal_s`` is the time from the first 0.1 m to the
    neighbourhood of the last goal. Clearances are from the robot's body to the nearest object.
    ``distance_to_goal_m`` is from the true position, ``estimate_error_m`` the position error of the
    stack's belief, both at the end. ``stage_ms`` is computing time per camera frame; only this
    varies between runs of the same seed. ``why_slower`` gives the share of time of each reason that
    kept the robot below top speed, largest first.
    """

    estimate_error_p50_m: float | None
    estimate_error_p95_m: float | None
    localized_after_s: float | None
    localized_after_m: float | None
    confidently_wrong_s: float
    lost_s: float
    landmark_updates: int
    path_length_m: float
    shortest_path_m: float
    shortest_with_room_m: float
    spl: float
    traversal_s: float
    collisions: int
    min_clearance_m: float
    clearance_p05_m: float
    distance_to_goal_m: float
    estimate_error_m: float
    estimate_error_max_m: float
    mean_speed_m_s: float
    emergencies: int
    route_changes: int
    why_slower: Mapping[str, float] = field(default_factory=dict)
    stage_ms: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class UnexploredRegion:
    """A region of floor that was not observed: a point x, y [m, ``map``] in it, ``area`` [m^2]."""

    x: float
    y: float
    area: float
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationResult:
    """The outcome of an exploration, over the ``reachable_m2`` of floor that the robot can cover.

    ``observed_share`` is the share of that floor that was observed, ``tour_m`` the length of the
    nearest-frontier tour on the true map (``TrueTour``), ``path_over_tour`` the driven length
    divided by it. ``returned``: the robot truly stands at its start. ``unexplored`` is sorted by
    area, largest first.
    """

    observed_share: float
    reachable_m2: float
    returned: bool
    tour_m: float
    path_over_tour: float
    unexplored: tuple[UnexploredRegion, ...] = field(default=())


@dataclass(frozen=True, kw_only=True)
class RunResult(RunMetrics):
    """Outcome and metrics of a run, as plain data.

    ``cause`` is the cause of a failure (``navfw.missions.outcome.Cause``), ``cause_seen`` describes
    it in words; both are empty without a failure. ``collision_cause`` is "mover" when a mover ran
    into a robot that was not driving towards it, "robot" for any other collision, None without one;
    ``contacts`` has the first contact of each. ``oracle_plugins`` names the plugins that use the
    simulator's truth, declared or by their source. ``faults`` are the errors of plugins,
    ``objections`` name the plugins that failed in more than a tenth of their calls, except where
    the mission's events made them. ``notes`` and ``map_changes`` say how the building differed from
    the map. ``exploration`` is None for other missions. ``assumed`` lists assumed properties of
    robot and map.
    """

    outcome: Outcome
    reason: str
    world: str
    mission: str
    seed: int
    behavior: str
    tick: int
    sim_time_s: float
    wall_time_s: float
    real_time_factor: float
    collision_cause: str | None
    contacts: tuple[Contact, ...]
    command_hash: str
    oracle: bool
    oracle_plugins: tuple[str, ...]
    faults: tuple[str, ...]
    objections: tuple[str, ...]
    notes: str
    events: tuple[EventRecord, ...]
    exploration: ExplorationResult | None = None
    map_changes: tuple[MapChange, ...] = ()
    assumed: tuple[Assumption, ...] = ()
    cause: str = ""
    cause_seen: str = ""

    def summary(self) -> dict[str, Any]:
        """Return the content of ``navfw run --json``: one flat object, the outcome first."""
        metrics = {one.name for one in fields(RunMetrics)}
        names = sorted((one.name for one in fields(RunResult)), key=metrics.__contains__)
        return {
            **{name: getattr(self, name) for name in names},
            "outcome": str(self.outcome),
            "cause": str(self.cause),
            "contacts": [*map(asdict, self.contacts)],
            "events": [*map(asdict, self.events)],
            "exploration": self.exploration and asdict(self.exploration),
            "map_changes": [asdict(change) for change in self.map_changes],
            "assumed": [one.as_data() for one in self.assumed],
        }

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON Schema of ``result.json`` and of ``navfw run --json``.

        A run that goes on, or whose process was killed, lacks ``command_hash`` and the metrics.
        """
        schema = TypeAdapter(cls).json_schema(mode="serialization")
        known, parts = schema["properties"], schema["$defs"]
        for name in ("min_clearance_m", "clearance_p05_m"):  # nothing is near: infinite
            known[name]["type"] = ["number", "null"]
        parts["Outcome"]["enum"].append(UNFINISHED)
        always = ["outcome", "reason", "world", "mission", "seed"]
        whole = [name for name in known if name not in (*always, "command_hash")]
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            **schema,
            "properties": {**known, "run_folder": {"type": ["string", "null"]}},
            "required": always,
            "dependentRequired": {"command_hash": whole},
        }


UNFINISHED = "unfinished"
"""Outcome in ``result.json`` of a run that still goes on, or whose process was killed."""


def path_length(points: Array) -> float:
    """Return the length [m] of the polyline through ``points`` (n, 2 or more; x and y first)."""
    steps = np.diff(points[:, :2], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def first_contacts(contacts: Sequence[Contact]) -> list[Contact]:
    """Return each collision's first contact; contacts less than 1 s after another belong to it.

    >>> touches = [Contact(t, 0.0, 0.0, "wall") for t in (1.0, 1.5, 2.4, 9.0)]
    >>> [contact.time for contact in first_contacts(touches)]
    [1.0, 9.0]
    """
    ordered = sorted(contacts, key=lambda contact: contact.time)
    before = [-math.inf, *(contact.time for contact in ordered)]
    return [c for c, last in zip(ordered, before, strict=False) if c.time - last >= _DEBOUNCE]


def traversal_time(log: RunLog, start: Point, goal: Point, within: float) -> float:
    """Return the time [s] from leaving ``start`` by 0.1 m to arriving ``within`` [m] of ``goal``.

    If the robot did not arrive, it ends with the run; it is 0 if the robot did not leave.
    """
    left = np.hypot(*(log.true[:, :2] - start).T) >= _SET_OUT
    if not left.any():
        return 0.0
    first = int(left.argmax())
    near = np.hypot(*(log.true[first:, :2] - goal).T) <= within
    last = first + int(near.argmax()) if near.any() else -1
    return float(log.time[last] - log.time[first])


def measure(
    log: RunLog,
    plan: SceneGeometry,
    *,
    start: Point,
    goal: Point,
    within: float,
    shortest: float,
    with_room: float,
    discs: Sequence[tuple[float, float, float]],
    succeeded: bool,
    stage_ms: Mapping[str, float] | None = None,
    moving: Sequence[WalkerTrack | ChangeTrack] = (),
) -> RunMetrics:
    """Compute the metrics of a run from ``start`` to ``goal``, points (x, y) [m] in ``map``.

    ``discs`` (x, y, radius [m]) cover the body. ``shortest`` and ``with_room`` [m] are lengths of
    the shortest paths through all goals; the last goal counts as reached ``within`` that distance
    [m]. Clearances are to the static objects in ``plan``, and to ``moving`` ones.
    """
    sampled = log.every(SAMPLING)
    true = log.true[sampled] if log.ticks else np.array([[*start, 0.0]])
    estimate = log.estimate[sampled] if log.ticks else true
    time = log.time[sampled] if log.ticks else np.zeros(1)
    driven = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))))
    clearance = _clearances(plan, moving if log.ticks else (), discs, true, time)
    error = np.hypot(*(estimate - true)[:, :2].T)
    confidence = np.ones(log.ticks) if log.confidence is None else log.confidence
    confidence = confidence[sampled] if log.ticks else np.zeros(1)
    believed, confident = confidence > 0.0, confidence >= _CONFIDENT
    p50, p95 = _median_and_p95(error[believed])
    localized = np.flatnonzero(confident & (error <= _CORRECT))
    durations = np.diff(time, append=time[-1])
    duration = float(log.time[-1] - log.time[0]) if log.ticks else 0.0
    length = path_length(true)
    return RunMetrics(
        estimate_error_p50_m=p50,
        estimate_error_p95_m=p95,
        localized_after_s=float(time[localized[0]] - time[0]) if len(localized) else None,
        localized_after_m=float(driven[localized[0]]) if len(localized) else None,
        confidently_wrong_s=float(durations[confident & (error > _CORRECT)].sum()),
        lost_s=float(durations[~believed].sum()),
        landmark_updates=log.updates,
        path_length_m=length,
        shortest_path_m=shortest,
        shortest_with_room_m=with_room,
        spl=_spl(succeeded, shortest, length),
        traversal_s=traversal_time(log, start, goal, within),
        collisions=len(first_contacts(log.contacts)),
        min_clearance_m=float(clearance.min()),
        clearance_p05_m=float(np.percentile(clearance, 5.0, method="lower")),
        distance_to_goal_m=math.dist(true[-1, :2], goal),
        estimate_error_m=float(error[-1]),
        estimate_error_max_m=float(error.max()),
        mean_speed_m_s=length / duration if duration > 0.0 else 0.0,
        emergencies=int((np.diff(log.emergency.astype(np.int8), prepend=0) == 1).sum()),
        route_changes=log.route_changes,
        why_slower=_shares_of_time(log),
        stage_ms=dict(stage_ms or {}),
    )


def shortest_with_room(plan: SceneGeometry, points: Sequence[Point], radius: float) -> float:
    """Return the shortest path's length [m] through ``points``, 0.15 m beside the robot's disc.

    A leg that has no such path counts with the shortest path without that space.
    """

    @cache
    def leg(start: Point, end: Point) -> float:
        try:
            return plan.shortest_path(start, end, radius + _ROOM)[0]
        except WorldError:
            return plan.shortest_path(start, end, radius)[0]

    return sum(leg(start, end) for start, end in pairwise(points))


def _median_and_p95(errors: Array) -> tuple[float | None, float | None]:
    """Median and 95th percentile; None without any."""
    if not errors.size:
        return None, None
    return float(np.median(errors)), float(np.percentile(errors, 95.0))


def _spl(succeeded: bool, shortest: float, length: float) -> float:
    """Success times shortest over driven length [m], at most 1."""
    longest = max(length, shortest)
    return shortest / longest if succeeded and longest > 0.0 else float(succeeded)


def _shares_of_time(log: RunLog) -> dict[str, float]:
    """Shares of the run's ticks of each reason why the robot was slower than its top speed."""
    counts = np.bincount(log.slower, minlength=len(log.slowers)) / max(log.ticks, 1)
    shares = zip(log.slowers, counts.tolist(), strict=True)
    return dict(sorted((s for s in shares if s[0]), key=lambda share: -share[1]))


def _clearances(
    plan: SceneGeometry,
    moving: Sequence[WalkerTrack | ChangeTrack],
    discs: Sequence[tuple[float, float, float]],
    poses: Array,
    times: Array,
) -> Array:
    """Distances (n,) [m] of a robot of ``discs`` at ``poses`` (n, 3) from the nearest object."""
    clearance = np.full(len(poses), np.inf)
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    for x, y, radius in discs:
        points = poses[:, :2] + np.stack([x * c - y * s, x * s + y * c], axis=1)
        free = [plan.clearances(points), *(track.clearances(points, times) for track in moving)]
        clearance = np.minimum(clearance, np.min(free, axis=0) - radius)
    return clearance
