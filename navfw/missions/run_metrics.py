"""What a run was worth, in numbers: success weighted by path length, clearance, errors (METHOD 5).

Everything here is computed from the truth after the run; the stack never sees any of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from navfw.missions.localization_metrics import LocalizationMetrics, measure_localization
from navfw.recording.run_log import Contact, RunLog
from navfw.signals import Array

__all__ = [
    "ClearanceSource",
    "RunMetrics",
    "TimedClearanceSource",
    "count_collisions",
    "measure",
    "path_length",
]

Point = tuple[float, float]

SAMPLING = 0.1
"""Period [s] at which the path is measured: finer than that, one measures the wheels' tremor."""

DEBOUNCE = 1.0
"""Contacts less than this [s] apart are one collision."""


class ClearanceSource(Protocol):
    """What metrics ask of a world's floor plan (``navfw.sim.floorplan.FloorPlan``)."""

    def clearances(self, points: Array) -> Array:
        """(n,) distances [m] of points (n, 2) to the nearest wall or thing; negative inside."""
        ...


class TimedClearanceSource(Protocol):
    """What metrics ask about those who walk (``navfw.sim.movers.MoverTrack``)."""

    def clearances(self, points: Array, times: Array) -> Array:
        """(n,) distances [m] of points (n, 2) at times (n,) [s] to the nearest walker."""
        ...


@dataclass(frozen=True, slots=True)
class RunMetrics:
    """The numbers of one run; lengths in metres, times in seconds.

    ``spl`` is success times shortest over driven length (Anderson et al. 2018). Clearances are from
    the robot's body to the nearest thing. ``distance_to_goal_m`` is of the true position,
    ``estimate_error_m`` is how far off the stack's own belief was at the end. ``stage_ms`` is
    computing time per camera frame; it alone varies from run to run of the same seed.
    """

    path_length_m: float
    shortest_path_m: float
    spl: float
    collisions: int
    min_clearance_m: float
    clearance_p05_m: float
    distance_to_goal_m: float
    estimate_error_m: float
    estimate_error_max_m: float
    mean_speed: float
    emergencies: int
    localization: LocalizationMetrics
    stage_ms: Mapping[str, float] = field(default_factory=dict)


def path_length(points: Array) -> float:
    """Length [m] of the polyline ``points`` (n, 2 or more; x and y first)."""
    steps = np.diff(points[:, :2], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def count_collisions(contacts: Sequence[Contact], debounce: float = DEBOUNCE) -> int:
    """How often the robot hit something: contacts closer in time than ``debounce`` [s] are one.

    >>> touches = [Contact(t, 0.0, 0.0, "wall") for t in (1.0, 1.5, 2.4, 9.0)]
    >>> count_collisions(touches)
    2
    """
    count, last = 0, -math.inf
    for contact in sorted(contacts, key=lambda contact: contact.time):
        count += contact.time - last >= debounce
        last = contact.time
    return count


def measure(
    track: RunLog,
    plan: ClearanceSource,
    *,
    start: Point,
    goal: Point,
    shortest: float,
    radius: float,
    succeeded: bool,
    stage_ms: Mapping[str, float] | None = None,
    moving: TimedClearanceSource | None = None,
) -> RunMetrics:
    """The metrics of a run from ``start`` to ``goal`` by a robot of this ``radius`` [m].

    ``shortest`` [m] is the length of the shortest way past all goals of the mission. ``moving``
    counts in clearances too; ``plan`` holds what stands still.
    """
    sampled = track.every(SAMPLING)
    true = track.true[sampled] if track.ticks else np.array([[*start, 0.0]])
    estimate = track.estimate[sampled] if track.ticks else true
    driven = path_length(true)
    clearance = plan.clearances(true[:, :2])
    if moving is not None and track.ticks:
        clearance = np.minimum(clearance, moving.clearances(true[:, :2], track.time[sampled]))
    clearance = clearance - radius
    error = np.hypot(*(estimate - true)[:, :2].T)
    duration = float(track.time[-1] - track.time[0]) if track.ticks else 0.0
    started = np.flatnonzero(np.diff(track.emergency.astype(np.int8), prepend=0) == 1)
    longest = max(driven, shortest)
    return RunMetrics(
        path_length_m=driven,
        shortest_path_m=shortest,
        spl=shortest / longest if succeeded and longest > 0.0 else float(succeeded),
        collisions=count_collisions(track.contacts),
        min_clearance_m=float(clearance.min()),
        clearance_p05_m=float(np.percentile(clearance, 5.0, method="lower")),
        distance_to_goal_m=math.dist(true[-1, :2], goal),
        estimate_error_m=float(error[-1]),
        estimate_error_max_m=float(error.max()),
        mean_speed=driven / duration if duration > 0.0 else 0.0,
        emergencies=len(started),
        localization=measure_localization(track, sampled),
        stage_ms=dict(stage_ms or {}),
    )
