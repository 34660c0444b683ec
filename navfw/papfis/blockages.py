"""Passages closed, reopened and marked dangerous by what the robot observes (METHOD 4.3).

Each passage report holds the status of passages ahead, and each status is a vote. Successive
reports come from the same local map and are not independent, so votes on one passage count once
per interval. Net votes at the limit close the passage for a while; afterwards it is open again with
full uncertainty, and two more votes close it again.
"""

from __future__ import annotations

import math

from navfw.papfis.routes import Router
from navfw.signals import PassageQuery, PassageReport, PassageStatus
from navfw.topomap import Passage

_BARRIER_AHEAD = 0.4
"""Assumed distance [m] from the robot to what blocks a passage that is reported closed."""

_BARRIER_RANGE = 2.0
"""Distance [m] to a passage's barrier up to which a report on the passage is used."""

_DROP_REACH = 0.3
"""A drop endangers a passage up to this distance [m] beyond its edge."""

MAX_WIDTH = 2.0
"""Upper bound on a passage's width [m] in deciding whether a drop lies in it."""

_ROUNDING = 1e-6
"""Tolerance [s] for report times that are multiples of the interval."""

ChangedPassages = set[frozenset[str]]


class Blockages:
    """Closes and reopens the passages of a router by votes.

    ``closing_votes`` net votes close a passage for ``closed_for`` [s]; votes on a passage within
    ``vote_interval`` [s] of the last one are not counted.
    """

    def __init__(
        self, router: Router, closing_votes: float, vote_interval: float, closed_for: float
    ) -> None:
        self._router = router
        self._closing_votes = closing_votes
        self._interval = vote_interval
        self._closed_for = closed_for
        self._votes: dict[frozenset[str], float] = {}
        self._voted: dict[frozenset[str], float] = {}
        self._until: dict[frozenset[str], float] = {}
        self._dangers: set[frozenset[str]] = set()

    @property
    def closed(self) -> tuple[Passage, ...]:
        """The passages that are closed now, in the order of closing."""
        return tuple(self._router.topo_map.passage(*sorted(ends)) for ends in self._until)

    def expire(self, time: float) -> ChangedPassages:
        """Reopen, as uncertain, the passages closed for long enough; returns which."""
        over = [ends for ends, until in self._until.items() if time >= until]
        for ends in over:
            self._open(ends, votes=max(self._closing_votes - 2.0, 0.0))
            self._router.revise(self._passage(ends), uncertainty=1.0)
        return set(over)

    def update(self, report: PassageReport, time: float) -> ChangedPassages:
        """Count the votes of a report at ``time`` [s]; returns the passages that changed."""
        changed: ChangedPassages = set()
        for query, status in report.passages:
            if self._vote(query, status, time):
                changed.add(frozenset(query.passage))
        for drop in report.drops:
            changed |= self._endanger(drop)
        return changed

    def _vote(self, query: PassageQuery, status: PassageStatus, time: float) -> bool:
        """Count one vote; whether it closed or opened the passage."""
        ends = frozenset(query.passage)
        since = time - self._voted.get(ends, -math.inf)
        if status == "unknown" or since < self._interval - _ROUNDING:
            return False
        if ends in self._until and not self._covers_barrier(query):
            return False  # for example the leg back from the barrier
        self._voted[ends] = time
        step = 1.0 if status == "closed" else -1.0
        votes = min(
            max(self._votes.get(ends, 0.0) + step, -self._closing_votes), self._closing_votes
        )
        self._votes[ends] = votes
        if ends in self._until:
            if votes > 0.0:
                return False
            self._open(ends, votes)
            return True
        if votes < self._closing_votes:
            return False
        passage = self._passage(ends)
        self._until[ends] = time + self._closed_for
        self._router.close(passage, self._barrier(passage, query))
        return True

    def _open(self, ends: frozenset[str], votes: float) -> None:
        del self._until[ends]
        self._votes[ends] = votes
        self._router.reopen(self._passage(ends))

    def _barrier(self, passage: Passage, query: PassageQuery) -> float:
        """Position of what blocks the passage [m from ``a``]: a little ahead of the robot."""
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        barrier = start + _BARRIER_AHEAD if end >= start else start - _BARRIER_AHEAD
        return min(max(barrier, 0.0), passage.length)

    def _covers_barrier(self, query: PassageQuery) -> bool:
        """Whether the leg leads past the passage's barrier, and that is near."""
        passage = self._passage(frozenset(query.passage))
        barrier = self._router.costs.barrier(passage)
        if barrier is None:
            return True
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        return (
            min(start, end) <= barrier <= max(start, end) and abs(barrier - start) <= _BARRIER_RANGE
        )

    def _along(self, passage: Passage, point: tuple[float, float]) -> float:
        """The point's projection on the passage [m from ``a``, scaled to the passage's length]."""
        a, b = (self._router.topo_map.places[name] for name in (passage.a, passage.b))
        dx, dy = b.x - a.x, b.y - a.y
        square = dx * dx + dy * dy
        if square == 0.0:
            return 0.5 * passage.length
        share = ((point[0] - a.x) * dx + (point[1] - a.y) * dy) / square
        return min(max(share, 0.0), 1.0) * passage.length

    def _endanger(self, drop: tuple[float, float]) -> ChangedPassages:
        """Set the danger of the nearest passage to 1 if the drop (x, y) [m] lies in it."""
        projection = self._router.topo_map.nearest_passage(*drop)
        if projection is None:
            return set()
        passage = projection.passage
        reach = 0.5 * min(passage.width, MAX_WIDTH) + _DROP_REACH
        if projection.aside > reach or passage.ends in self._dangers:
            return set()
        self._dangers.add(passage.ends)
        self._router.revise(passage, danger=1.0)
        return {passage.ends}

    def _passage(self, ends: frozenset[str]) -> Passage:
        return self._router.topo_map.passage(*sorted(ends))
