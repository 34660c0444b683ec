"""From map to command: belief, waypoints, landmark detections, passage status, proposals."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from navfw.numerics.arrays import Array, Indices, Mask
from navfw.signals.geometry import Pose, Twist, position_sigma
from navfw.signals.immutability import Frozen


@dataclass(frozen=True, slots=True)
class LandmarkDetection(Frozen):
    """A landmark recognised in one image: bearing [rad, left positive] and range [m] in base_link.

    ``covariance`` (2, 2) is that of (bearing, range); ``identity`` is KIND-ID, as in "aruco-7".
    """

    time: float
    identity: str
    bearing: float
    range: float
    covariance: Array


@dataclass(frozen=True, slots=True)
class Belief(Frozen):
    """The localiser's estimate: ``pose`` in ``map`` with ``covariance`` (3, 3) of (x, y, yaw).

    ``places`` gives the probability of each place of the topological map (may be empty).
    ``confidence`` in [0, 1] is the probability that the true position is within 1 m of ``pose``.
    While ``lost``, ``pose`` is not valid and must not be used for planning. ``updates`` counts the
    landmark detections used so far, ``hypotheses`` the poses that the last search for an unknown
    pose could not distinguish (0 before any search).
    """

    time: float
    pose: Pose
    covariance: Array
    places: Mapping[str, float] = field(default_factory=dict)
    confidence: float = 1.0
    lost: bool = False
    updates: int = 0
    hypotheses: int = 0

    @property
    def sigma(self) -> float:
        """Standard deviation [m] of the position in the direction in which it is largest."""
        return position_sigma(self.covariance)


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where to go next: x, y [m] in ``map``; passed when nearer than ``tolerance`` [m].

    ``place`` is the place's name, ``kind`` its kind in the map ("goal" for a mission goal);
    ``final`` marks the last waypoint of the present goal. ``width`` [m] is that of the passage
    that leads there, ``passage`` the names of the two places that it joins, as in the map.
    """

    x: float
    y: float
    tolerance: float
    place: str
    kind: str
    final: bool
    width: float = math.inf
    passage: tuple[str, str] | None = None

    @classmethod
    def goal(cls, x: float, y: float, tolerance: float, place: str = "") -> Self:
        """Make the waypoint of a mission goal at (x, y) [m, map], of kind "goal" and ``final``."""
        return cls(x, y, tolerance, place, "goal", final=True)

    @property
    def label(self) -> str:
        """Name of the waypoint in messages: that of its place or, without one, the coordinates."""
        return self.place or f"({self.x:g}, {self.y:g})"


@dataclass(frozen=True, slots=True)
class PassageQuery:
    """A leg of the route whose traversability the planner queries.

    ``passage`` holds the names of the two places that the leg joins; it goes straight from
    ``start`` to ``end`` (x, y) [m] in ``map`` through a passage ``width`` [m] wide. If ``end`` is a
    door, ``normal`` is the unit direction (x, y) through it.
    """

    passage: tuple[str, str]
    start: tuple[float, float]
    end: tuple[float, float]
    width: float = math.inf
    normal: tuple[float, float] | None = None


PassageStatus = Literal["open", "closed", "unknown"]


@dataclass(frozen=True, slots=True)
class SightLines(Frozen):
    """What the local map knows of straight lines from the robot to points ahead on the route.

    ``ends`` (m, 2) [m, map] lie on the legs of these indices ``legs`` (m,), in their order. At n
    equally spaced points of each line, the last at its end, ``clearance`` (m, n) [m] is from the
    body's rim to the nearest occupied cell, and ``observed`` (m, n) says if the floor was seen.
    """

    ends: Array
    legs: Indices
    clearance: Array
    observed: Mask


@dataclass(frozen=True, slots=True)
class PassageReport:
    """Whether the route ahead is open, by the local map, for the next few metres (METHOD 4.3).

    ``passages`` are the queries that could be judged, in their order: "open" if a path through the
    leg was observed free, "closed" if observed obstacles leave none, "unknown" otherwise. ``drops``
    are points (x, y) [m] in ``map`` where the floor is missing; ``covered`` are ends of legs that
    are occupied by an obstacle; ``lines`` those to points ahead, None while it is not known where
    the robot is. ``openings`` are pairs of such an end that is a door, and the point of its wall
    where a free opening was seen instead.
    """

    time: float
    passages: tuple[tuple[PassageQuery, PassageStatus], ...] = ()
    drops: tuple[tuple[float, float], ...] = ()
    covered: tuple[tuple[float, float], ...] = ()
    lines: SightLines | None = None
    openings: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()


Explain = Callable[[int, int], Sequence[Mapping[str, Any]]]
"""Returns the rules that fired for the command at (row, column) of the grid, strongest first."""


def _no_rules(row: int, column: int) -> Sequence[Mapping[str, Any]]:
    return ()


@dataclass(frozen=True, slots=True)
class Proposal(Frozen):
    """The rating of all commands of the grid by one behaviour (METHOD 3.6).

    ``applicability`` in [0, 1]; ``desirability`` and ``prohibition`` are (n_v, n_w) in [0, 1];
    ``reason`` is one line for a person. ``explain(row, column)`` returns the rules that fired.
    """

    applicability: float
    desirability: Array
    prohibition: Array
    reason: str
    explain: Explain = _no_rules

    def weighted(self, weight: float) -> Proposal:
        """Return the same proposal with its applicability multiplied by ``weight``."""
        if weight == 1.0:
            return self
        degree = weight * self.applicability
        return Proposal(degree, self.desirability, self.prohibition, self.reason, self.explain)


@dataclass(frozen=True, slots=True)
class Command(Frozen):
    """The fused command: ``twist``, the name of the leading behaviour, and its reason.

    ``emergency`` makes LOCOM brake fully. ``weights`` gives each behaviour's share by name.
    """

    time: float
    twist: Twist
    leader: str
    reason: str
    emergency: bool = False
    weights: Mapping[str, float] = field(default_factory=dict)
    explanation: Mapping[str, Any] = field(default_factory=dict)
