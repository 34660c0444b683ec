"""The planner ``explorer``: drives from frontier to frontier of the growing map, then home.

Frontiers are rated by fuzzy rules (``frontier_choice``). The chosen one is kept until it was
observed, cannot be reached, or another one has become clearly better. One at which nothing new is
seen for a while is given up, until what is known around it changes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from navfw.interfaces import Planner
from navfw.numerics import Array
from navfw.papfis.frontier_choice import (
    INPUTS,
    RULE_BASE,
    ChosenFrontier,
    FrontierRules,
    inputs_of,
)
from navfw.papfis.given_up import GivenUp, Pursuit, narrow_passages
from navfw.papfis.known_ground import (
    MIN_GAIN,
    Frontier,
    KnownGround,
    steady,
    with_thin_walls,
    without_spots,
)
from navfw.signals import Belief, GrownGrid, PassageQuery, PassageReport, Pose, Waypoint
from navfw.topomap import TopoMap

Point = tuple[float, float]

_SAME = 0.7  # chosen
"""Distance [m] by which a frontier may move between two plans and still be the same."""
_BLIND = 0.75  # chosen
"""Distance [m] from the robot up to which it does not look at a frontier: the camera hardly sees
the floor there, and depth needs a few decimetres of driving."""
_LOOK = 0.6  # chosen
"""Time [s] without anything new after which a frontier that is so near is given up."""
_TOO_NEAR = 0.5  # chosen
"""Distance [m] at which it is given up in any case: a body that turns there touches what it did not
see."""
_TRIES = 2  # chosen
"""Times that a frontier is given up before it is for good; the robot comes from elsewhere then."""
_MUCH, _LONG_LOOK = 0.25, 4.0  # chosen
"""Share of the known ground that the gains of what is left are above, if frontiers are to be tried
twice more; time [s] for which the robot then stays at one."""
_WORTH = 1.0  # measured
"""Least gain [m^2] per metre of path of a frontier that is tried again: most such ones are parts
of walls that were not seen. With 0.5, paths are an eighth longer, and 0.3 % more is observed."""
_TRIFLE = 0.05  # chosen
"""Least gain [m^2] of any frontier per metre of path: crumbs beside furniture are no journey."""
_ROOM = 2.0  # chosen
"""Least gain [m^2] of a frontier between the bands of walls: a room begins there."""
_LEAVING = 3.0  # chosen
"""Length [m] of the paths to all frontiers above which nearer ones come first that are in doubt:
behind spots, or between the bands of walls. The robot need not come back for them."""
_REPLAN = 0.5  # chosen
"""Time [s] between two plans: the robot moves by a few cells."""
_AHEAD = 1.0  # chosen
"""Distance [m] of the waypoint straight ahead, as long as there is no grid."""
_SLOW, _USUAL = 0.08, 0.3  # chosen
"""Lower bound [m/s] of the speed by which times are reckoned, and its value before the robot has
driven for ``_WELL_KNOWN`` seconds."""
_WELL_KNOWN = 20.0  # chosen
_LOOKAHEAD = 3.0  # chosen
"""Largest distance [m] of the waypoint."""
_SPARE_TIME = 10.0  # chosen
"""Time [s] at home before the limit."""


class Explorer(Planner):
    """Explores what the robot can reach, frontier by frontier; fuzzy rules choose the next one.

    It plans on the grown grid (a stack with ``growing_map: true``), in the frame ``map`` in which
    the mission starts. The last goal is the place to return to; without goals it is the start.
    """

    name: ClassVar[str] = "explorer"

    class Params(Planner.Params):
        """Time limit, return, and when a frontier is kept or given up."""

        limit: float = Field(
            1800.0, gt=0.0, le=7200.0, description="time to be back at the start [s]"
        )
        return_home: bool = Field(
            True, description="drive back to the start; false: stop where it ends"
        )
        rules: str | None = Field(
            None, min_length=1, max_length=1000, description="file of rules; none: as shipped"
        )
        keep: float = Field(
            0.03, ge=0.0, le=1.0, description="merit by which another frontier must be better"
        )
        patience: float = Field(
            12.0, gt=0.0, le=600.0, description="time without progress to give a frontier up [s]"
        )

    params: Params

    def __init__(self, robot: Any, params: Planner.Params | None = None) -> None:
        super().__init__(robot, params)
        self._rules = FrontierRules(Path(self.params.rules) if self.params.rules else RULE_BASE)
        self.reset()

    @classmethod
    def check_files(cls) -> None:
        """Read and check the rules that ship."""
        FrontierRules()

    def reset(self) -> None:
        """Return to the state before ``start``."""
        self._goal: Waypoint | None = None
        self._began: float | None = None
        self._planned = -math.inf
        self._grid: GrownGrid | None = None
        self._report: PassageReport | None = None
        self._pose: Pose | None = None
        self._driven = 0.0
        self._choice: ChosenFrontier | None = None
        self._pursuit: Pursuit | None = None
        self._given_up: list[GivenUp] = []
        self._left: list[GivenUp] = []
        self._narrow: list[Point] = []
        self._waypoint: Waypoint | None = None
        self._way: list[Waypoint] = []
        self._no_route: str | None = None
        self._done = self._insists = False

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start an exploration that ends at the last of ``goals``, or where it begins."""
        self._goal = goals[-1] if goals else None

    @property
    def wants_grid(self) -> bool:
        """Always: frontiers are on the grid."""
        return True

    def observe_grid(self, grid: GrownGrid) -> None:
        """Keep what was observed so far; the next plan is made on it."""
        self._grid = grid

    def observe(self, report: PassageReport) -> None:
        """Keep the report on the leg ahead: it says why a frontier is given up."""
        self._report = report

    @property
    def queries(self) -> Sequence[PassageQuery]:
        """The leg to the waypoint ahead."""
        if self._pose is None or self._waypoint is None:
            return ()
        start, end = (self._pose.x, self._pose.y), (self._waypoint.x, self._waypoint.y)
        return (PassageQuery(("here", self._waypoint.place), start, end),)

    def update(self, belief: Belief) -> Waypoint | None:
        """Return the waypoint to drive to; None when the exploration has ended."""
        pose = belief.pose
        if self._began is None or self._pose is None:
            self._began, self._pose = belief.time, pose
            self._goal = self._goal or Waypoint.goal(pose.x, pose.y, 0.2, "start")
        self._driven += math.dist((pose.x, pose.y), (self._pose.x, self._pose.y))
        self._pose = pose
        if self._done:
            return None
        if self._grid is None:
            x, y = pose.to_parent(_AHEAD, 0.0)
            return Waypoint(x, y, 0.3, "", "waypoint", final=False)
        if belief.time - self._planned >= _REPLAN - 1e-6:
            self._planned = belief.time
            self._plan(self._grid, belief.time)
        home = self._home
        near = math.dist((pose.x, pose.y), (home.x, home.y)) <= home.tolerance
        if self._choice is None and (near or not self.params.return_home):
            self._done, self._way = True, []
            return None
        return self._waypoint

    @property
    def _home(self) -> Waypoint:
        if self._goal is None:
            raise RuntimeError("start() comes before update()")
        return self._goal

    # --- planning --------------------------------------------------------------------------------

    def _plan(self, grid: GrownGrid, time: float) -> None:
        pose = self._pose or Pose(0.0, 0.0, 0.0)
        at, home = (pose.x, pose.y), self._home
        ground, costs, candidates = self._looked(grid, at, time)
        for other, least in ((without_spots, 0.0), (with_thin_walls, _ROOM)):
            if all(f.length > _LEAVING for f in candidates):
                again = self._looked(other(grid), at, time, least, tried=not candidates)
                near = [f for f in again[2] if not candidates or f.length <= _LEAVING]
                if near:
                    ground, costs, candidates = *again[:2], near
        self._choice = self._chosen(candidates, ground, time)
        if self._choice is not None:
            frontier = self._choice.frontier
            end = Waypoint(frontier.x, frontier.y, 0.3, "frontier", "waypoint", final=False)
        else:
            self._pursuit = None
            end = home
        self._head_for(ground, costs, at, end)

    def _looked(
        self, grid: GrownGrid, at: Point, time: float, least: float = 0.0, *, tried: bool = True
    ) -> tuple[KnownGround, Array, list[Frontier]]:
        """Return the ground of ``grid``, the costs of paths from ``at``, the frontiers to try.

        These have a gain of ``least`` [m^2] at least. If there is none, those count that were
        ``tried`` before.
        """
        ground = KnownGround.of(grid, self.robot, at)
        costs = ground.costs_from(*at)
        seen = ground.frontiers(costs)
        frontiers = [f for f in seen if f.gain >= max(MIN_GAIN, _TRIFLE * f.length)]
        self._narrow = narrow_passages(ground, costs)
        self._give_up(frontiers, ground, time)
        self._left = [g for g in self._given_up if any(g.is_at(f) for f in frontiers)]
        self._given_up = [g.seen_from(at) for g in self._given_up]
        large = [f for f in frontiers if f.gain >= least]
        candidates = [f for f in large if not any(g.covers(f) for g in self._given_up)]
        self._insists = False
        if not candidates and tried:
            worth = [f for f in large if f.gain >= _WORTH * f.length]
            self._insists = sum(f.gain for f in worth) > _MUCH * ground.known_area
            most = _TRIES + (2 if self._insists else 0)
            final = [g for g in self._given_up if g.tries >= most]
            candidates = [f for f in worth if not any(g.covers(f) for g in final)]
        return ground, costs, self._in_sight(candidates, at)

    def _in_sight(self, frontiers: list[Frontier], at: Point) -> list[Frontier]:
        """Return ``frontiers`` without those too near to be looked at, but for the one pursued."""
        last = self._choice.frontier if self._choice and self._pursuit else None
        same = None if last is None else _nearest(frontiers, (last.x, last.y))
        away = [f for f in frontiers if f is same or math.dist((f.x, f.y), at) >= _BLIND]
        begins = self._driven < _BLIND  # all that is known so far is the floor below the robot
        return frontiers if begins and not away else away

    def _give_up(self, seen: Sequence[Frontier], ground: KnownGround, time: float) -> None:
        """Give up the frontier that is pursued if it was tried for long enough."""
        if self._choice is None or self._pursuit is None:
            return
        before = self._choice.frontier
        now = _nearest(seen, (before.x, before.y))
        if now is None:
            return
        self._pursuit.update(time, now.length, ground.known_area)
        robot = (self._pose.x, self._pose.y) if self._pose else (now.x, now.y)
        apart = math.dist((now.x, now.y), robot)
        arrived = self._pursuit.begin >= _BLIND > apart
        patience = _LOOK if arrived else self.params.patience
        if arrived and self._insists:
            patience = _LONG_LOOK
        elif arrived and apart < _TOO_NEAR:
            patience = 0.0
        if time - self._pursuit.since >= patience:
            before_that = [g for g in self._given_up if g.covers(now) or (g.open and g.is_at(now))]
            tries = 1 + max((g.tries for g in before_that), default=0)
            self._given_up = [g for g in self._given_up if g not in before_that]
            self._given_up.append(GivenUp(now.x, now.y, now.gain, self._why(), tries))
            self._pursuit = None

    def _why(self) -> str:
        """Say why the frontier ahead is given up, by the last report on the leg to it."""
        closed = self._report is not None and "closed" in dict(self._report.passages).values()
        return "the way there is too narrow or blocked" if closed else "nothing can be seen there"

    def _chosen(
        self, candidates: Sequence[Frontier], ground: KnownGround, time: float
    ) -> ChosenFrontier | None:
        """Choose among ``candidates`` for which there is time; None if there is none."""
        reserves = self._reserves(candidates, ground, time)
        fitting = [(f, r) for f, r in zip(candidates, reserves, strict=True) if r > 0.0]
        if not fitting or self._pose is None:
            why = f"no time was left of {self.params.limit:.0f} s"
            self._left += [GivenUp(f.x, f.y, f.gain, why) for f in candidates]
            return None
        frontiers = [f for f, _ in fitting]
        rows = inputs_of(frontiers, self._pose, [r for _, r in fitting])
        merits = self._rules.merits(dict(zip(INPUTS, rows, strict=True))).tolist()
        order = sorted(
            range(len(frontiers)),
            key=lambda k: (-merits[k], frontiers[k].length, frontiers[k].x, frontiers[k].y),
        )
        best = order[0]
        if self._choice is not None and self._pursuit is not None:
            before = self._choice.frontier
            same = _nearest(frontiers, (before.x, before.y))
            kept = -1 if same is None else frontiers.index(same)
            if kept >= 0 and merits[best] <= merits[kept] + self.params.keep:
                best = kept
            if best != kept:
                self._pursuit = None
        if self._pursuit is None:
            self._pursuit = Pursuit(time, frontiers[best].length, ground.known_area)
        inputs = dict(zip(INPUTS, rows[:, best].tolist(), strict=True))
        others = tuple((frontiers[k], merits[k]) for k in order if k != best)
        return ChosenFrontier(time, frontiers[best], inputs, merits[best], others)

    def _reserves(
        self, frontiers: Sequence[Frontier], ground: KnownGround, time: float
    ) -> list[float]:
        """Return the times [s] that are left after each of ``frontiers`` and the way home."""
        driving = 0.0 if self._began is None else time - self._began
        speed = _USUAL if driving < _WELL_KNOWN else max(self._driven / driving, _SLOW)
        left = self.params.limit - driving - _SPARE_TIME
        if not self.params.return_home:
            return [left - f.length / speed for f in frontiers]
        lengths = ground.lengths_from(self._home.x, self._home.y)
        return [
            left - (f.length + _or_straight(lengths, ground, f, self._home)) / speed
            for f in frontiers
        ]

    def _head_for(self, ground: KnownGround, costs: Array, at: Point, end: Waypoint) -> None:
        """Set the waypoint: the farthest point of the path to ``end`` in a straight line."""
        path = ground.path_to(costs, end.x, end.y)
        self._no_route = None if len(path) else f"no known floor leads back to {end.label}"
        self._way = ground.way(path, at, end, _LOOKAHEAD)
        self._waypoint = steady(self._waypoint, self._way[0], at)

    # --- what others read ------------------------------------------------------------------------

    @property
    def path(self) -> Sequence[Waypoint]:
        """The corners of the path to the frontier, or home."""
        return self._way

    @property
    def no_route_reason(self) -> str | None:
        """A message if no known floor leads home; None otherwise."""
        return self._no_route

    @property
    def notes(self) -> str:
        """What was left unexplored, and why."""
        left = [f"({g.x:.1f}, {g.y:.1f}): {g.reason}" for g in self._left]
        left += [f"({x:.1f}, {y:.1f}): the passage is too narrow" for x, y in self._narrow]
        return "; ".join(left)

    def explain_choice(self) -> dict[str, Any]:
        """Explain the choice of the frontier: inputs, merit, the rules that fired, the others."""
        given_up = [{"x": g.x, "y": g.y, "why": g.reason} for g in self._left]
        if self._choice is None:
            return {"heads_for": "start", "rules": [], "given_up": given_up}
        choice = self._choice
        return {
            "heads_for": "frontier",
            "x": choice.frontier.x,
            "y": choice.frontier.y,
            "merit": choice.merit,
            "inputs": choice.inputs,
            "rules": self._rules.explain(choice.inputs),
            "others": [
                {"x": f.x, "y": f.y, "gain": f.gain, "path": f.length, "merit": merit}
                for f, merit in choice.others
            ],
            "given_up": given_up,
        }


def _nearest(frontiers: Sequence[Frontier], point: Point) -> Frontier | None:
    """Return the frontier nearest to ``point``; None if it is farther than _SAME."""
    near = [(math.dist((f.x, f.y), point), f.x, f.y, f) for f in frontiers]
    near = [one for one in near if one[0] <= _SAME]
    return min(near, key=lambda one: one[:3])[3] if near else None


def _or_straight(lengths: Array, ground: KnownGround, f: Frontier, home: Waypoint) -> float:
    """Return the length [m] of the path from a frontier home; 1.5 times straight without one."""
    length = ground.length_at(lengths, f.x, f.y)
    return length if math.isfinite(length) else 1.5 * math.dist((f.x, f.y), (home.x, home.y))
