"""Passages that are closed, opened again and avoided, by what the robot observes of them."""

from __future__ import annotations

import math
from collections import Counter

from navfw.papfis.routes import Router
from navfw.signals import PassageQuery, PassageReport, PassageStatus
from navfw.topomap import Passage

CLOSING_VOTES = 3.0  # chosen
"""Net votes that close a passage."""

_BARRIER_AHEAD = 0.4  # chosen
"""Assumed distance [m] from the robot to what blocks a passage that is reported closed."""

_BARRIER_RANGE = 2.0  # chosen
"""Distance [m] to a passage's barrier up to which a report on the passage is used."""

_DROP_REACH = 0.3  # chosen
"""A drop endangers a passage up to this distance [m] beyond its edge."""

MAX_WIDTH = 2.0  # chosen
"""Upper bound on a passage's width [m] in deciding whether a drop lies in it."""

_ROUNDING = 1e-6  # chosen
"""Tolerance [s] for report times that are multiples of the interval."""

ChangedPassages = set[frozenset[str]]


class Blockages:
    """Closes, reopens and marks passages by what the robot observes of them (METHOD 4.3).

    Each passage report holds the status of passages ahead, and each status is a vote. Successive
    reports come from the same local map and are not independent, so votes on one passage count
    once per interval. A reopened passage has full uncertainty: two more votes close it again.

    CLOSING_VOTES net votes close a passage for ``closed_for`` [s], for twice as long if it was not
    seen to be open since it was closed last; votes on a passage within ``vote_interval`` [s] of the
    last one are not counted.
    """

    def __init__(self, router: Router, vote_interval: float, closed_for: float) -> None:
        self._router = router
        self._interval = vote_interval
        self._closed_for = closed_for
        self._votes: dict[frozenset[str], float] = {}
        self._voted: dict[frozenset[str], float] = {}
        self._until: dict[frozenset[str], float] = {}
        self._closings: Counter[frozenset[str]] = Counter()
        self._dangers: set[frozenset[str]] = set()

    @property
    def closed(self) -> tuple[Passage, ...]:
        """Passages that are closed now, in the order of closing."""
        return tuple(self._router.topo_map.passage(*sorted(ends)) for ends in self._until)

    def expire(self, time: float) -> ChangedPassages:
        """Reopen, as uncertain, passages closed long enough by ``time`` [s]; return which."""
        over = [ends for ends, until in self._until.items() if time >= until]
        for ends in over:
            self._open(ends, votes=max(CLOSING_VOTES - 2.0, 0.0))
            self._router.revise(self._passage(ends), uncertainty=1.0)
        return set(over)

    def update(self, report: PassageReport, time: float) -> ChangedPassages:
        """Count the votes of a report at ``time`` [s]; return the passages that changed."""
        changed: ChangedPassages = set()
        for query, status in report.passages:
            if self._vote(query, status, time):
                changed.add(frozenset(query.passage))
        for drop in report.drops:
            changed |= self._endanger(drop)
        return changed

    def _vote(self, query: PassageQuery, status: PassageStatus, time: float) -> bool:
        """Count one vote; return whether it closed or opened the passage."""
        ends = frozenset(query.passage)
        since = time - self._voted.get(ends, -math.inf)
        if status == "unknown" or since < self._interval - _ROUNDING:
            return False
        if ends in self._until and not self._covers_barrier(query):
            return False  # for example the leg back from the barrier
        self._voted[ends] = time
        step = 1.0 if status == "closed" else -1.0
        votes = min(max(self._votes.get(ends, 0.0) + step, -CLOSING_VOTES), CLOSING_VOTES)
        self._votes[ends] = votes
        if ends in self._until:
            if votes > 0.0:
                return False
            self._open(ends, votes)
            del self._closings[ends]
            return True
        if votes < CLOSING_VOTES:
            return False
        self._close(ends, self._barrier(self._passage(ends), query), time)
        return True

    def close(self, ends: tuple[str, str], at: tuple[float, float], time: float) -> ChangedPassages:
        """Close a passage at ``time`` [s]: the robot, ``at`` (x, y) [m, map], gets no further."""
        passage = self._passage(frozenset(ends))
        if passage.ends in self._until:
            return set()
        self._votes[passage.ends] = CLOSING_VOTES
        self._close(passage.ends, self._along(passage, at), time)
        return {passage.ends}

    def _close(self, ends: frozenset[str], barrier: float, time: float) -> None:
        self._closings[ends] += 1
        self._until[ends] = time + self._closed_for * 2.0 ** (self._closings[ends] - 1)
        self._router.close(self._passage(ends), barrier)

    def _open(self, ends: frozenset[str], votes: float) -> None:
        del self._until[ends]
        self._votes[ends] = votes
        self._router.reopen(self._passage(ends))

    def _barrier(self, passage: Passage, query: PassageQuery) -> float:
        """Guess where the passage is blocked [m from ``a``]: a little ahead of the robot."""
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        barrier = start + _BARRIER_AHEAD if end >= start else start - _BARRIER_AHEAD
        return min(max(barrier, 0.0), passage.length)

    def _covers_barrier(self, query: PassageQuery) -> bool:
        """Return whether the leg leads past the passage's barrier, and that is near."""
        passage = self._passage(frozenset(query.passage))
        barrier = self._router.costs.barrier(passage)
        if barrier is None:
            return True
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        return (
            min(start, end) <= barrier <= max(start, end) and abs(barrier - start) <= _BARRIER_RANGE
        )

    def _along(self, passage: Passage, point: tuple[float, float]) -> float:
        """Project the point onto the passage [m from ``a``, scaled to the passage's length]."""
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
