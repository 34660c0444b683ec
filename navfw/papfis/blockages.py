"""What the robot learns of passages on its way: barred, open again, dangerous (METHOD 4.3).

Each look at a passage ahead is a vote. The ego map remembers, so two looks in short succession say
the same thing twice: they count once. Net votes that reach the limit close the passage for a while;
afterwards it is admitted again as uncertain, and two more votes close it again.
"""

from __future__ import annotations

import math

from navfw.papfis.routes import Router
from navfw.signals import PassageQuery, PassageReport, PassageStatus
from navfw.topomap import Passage

__all__ = ["Blockages"]

AHEAD = 0.4
"""Nothing bars the way nearer ahead of the robot than this [m] when it finds a passage barred."""

NEAR = 2.0
"""From so near [m] a look tells whether a closed passage is still barred."""

DROP_REACH = 0.3
"""A drop endangers a passage when it is so near its rim, or nearer [m]."""

WIDEST = 2.0
"""Passages count as at most so wide [m] when asked whether a drop lies in them."""

_ROUNDING = 1e-6
"""Looks come in step with the interval, but for rounding [s]."""

Changed = set[frozenset[str]]


class Blockages:
    """Closes and reopens the passages of a router by what is seen of them.

    ``closing`` net votes close a passage for ``closed_for`` [s]; votes on a passage within
    ``interval`` [s] of the last one are not counted.
    """

    def __init__(self, router: Router, closing: float, interval: float, closed_for: float) -> None:
        self._router = router
        self._closing = closing
        self._interval = interval
        self._closed_for = closed_for
        self._votes: dict[frozenset[str], float] = {}
        self._voted: dict[frozenset[str], float] = {}
        self._until: dict[frozenset[str], float] = {}
        self._dangers: set[frozenset[str]] = set()

    @property
    def closed(self) -> tuple[Passage, ...]:
        """The passages that are closed now, in the order in which they were."""
        return tuple(self._router.topo_map.passage(*sorted(ends)) for ends in self._until)

    def expire(self, time: float) -> Changed:
        """Admit again, as uncertain, what has been closed for long enough; tells which."""
        over = [ends for ends, until in self._until.items() if time >= until]
        for ends in over:
            self._open(ends, votes=max(self._closing - 2.0, 0.0))
            self._router.revise(self._passage(ends), uncertainty=1.0)
        return set(over)

    def hear(self, outlook: PassageReport, time: float) -> Changed:
        """Take note of what has been seen at ``time`` [s]; tells which passages it changed."""
        changed: Changed = set()
        for query, state in outlook.passages:
            if self._vote(query, state, time):
                changed.add(frozenset(query.passage))
        for drop in outlook.drops:
            changed |= self._endanger(drop)
        return changed

    def _vote(self, query: PassageQuery, state: PassageStatus, time: float) -> bool:
        ends = frozenset(query.passage)
        since = time - self._voted.get(ends, -math.inf)
        if state == "unknown" or since < self._interval - _ROUNDING:
            return False
        if ends in self._until and not self._looks_at_barrier(query):
            return False  # the way back from it, say
        self._voted[ends] = time
        step = 1.0 if state == "closed" else -1.0
        votes = min(max(self._votes.get(ends, 0.0) + step, -self._closing), self._closing)
        self._votes[ends] = votes
        if ends in self._until:
            if votes > 0.0:
                return False
            self._open(ends, votes)
            return True
        if votes < self._closing:
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
        """Where along the passage it is barred [m from ``a``]: ahead of the robot."""
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        barred = start + AHEAD if end >= start else start - AHEAD
        return min(max(barred, 0.0), passage.length)

    def _looks_at_barrier(self, query: PassageQuery) -> bool:
        """Whether the leg leads past where the passage was found barred, and that is near."""
        passage = self._passage(frozenset(query.passage))
        barrier = self._router.costs.barrier(passage)
        if barrier is None:
            return True
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        return min(start, end) <= barrier <= max(start, end) and abs(barrier - start) <= NEAR

    def _along(self, passage: Passage, point: tuple[float, float]) -> float:
        """How far along the passage a point is [m from ``a``, in the passage's own length]."""
        a, b = (self._router.topo_map.places[name] for name in (passage.a, passage.b))
        dx, dy = b.x - a.x, b.y - a.y
        square = dx * dx + dy * dy
        if square == 0.0:
            return 0.5 * passage.length
        share = ((point[0] - a.x) * dx + (point[1] - a.y) * dy) / square
        return min(max(share, 0.0), 1.0) * passage.length

    def _endanger(self, drop: tuple[float, float]) -> Changed:
        """Put the danger on the nearest passage, if the drop lies in it."""
        footing = self._router.topo_map.nearest_passage(*drop)
        if footing is None:
            return set()
        passage = footing.passage
        reach = 0.5 * min(passage.width, WIDEST) + DROP_REACH
        if footing.aside > reach or passage.ends in self._dangers:
            return set()
        self._dangers.add(passage.ends)
        self._router.revise(passage, danger=1.0)
        return {passage.ends}

    def _passage(self, ends: frozenset[str]) -> Passage:
        return self._router.topo_map.passage(*sorted(ends))
