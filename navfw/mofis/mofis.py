"""MOFIS: keeps the ego map, asks every behaviour for its proposal, fuses them into one command."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.kinds import Behavior, Composite, Fusion
from navfw.mofis.commands import CommandGrid, CommandGridParams
from navfw.mofis.context import Context
from navfw.mofis.egomap import EgoMap, EgoMapParams
from navfw.mofis.encounters import EncounterParams, meet
from navfw.mofis.kernels import are_degrees
from navfw.mofis.lookahead import Aim, Lookahead, LookaheadParams
from navfw.mofis.passages import PassageWatch, PassageWatchParams
from navfw.mofis.reach import look_around, room_along, sweep
from navfw.mofis.tracks import Disc, TrackParams, Tracks
from navfw.mofis.watchdog import BehaviorTimeout, Watchdog
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    Mover,
    Odometry,
    Outlook,
    PassageQuery,
    Percept,
    Pose,
    Proposal,
    Standing,
    Twist,
    Waypoint,
)

__all__ = ["Fault", "Mofis", "MofisParams"]


class MofisParams(BaseModel):
    """The motion room's own settings, beside those of its plugins."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    ego_map: EgoMapParams = EgoMapParams()
    tracks: TrackParams = TrackParams()
    encounters: EncounterParams = EncounterParams()
    commands: CommandGridParams = CommandGridParams()
    lookahead: LookaheadParams = LookaheadParams()
    passages: PassageWatchParams = PassageWatchParams()
    margin: Annotated[
        float, Field(ge=0.0, le=0.3, description="clearance kept from the body's rim [m]")
    ] = 0.04
    memory: Annotated[
        bool, Field(description="keep an ego map; false: it holds the present percept alone")
    ] = True
    local_plan: Annotated[
        bool,
        Field(description="aim along the cheapest way through the ego map; false: straight on"),
    ] = True


@dataclass(frozen=True, slots=True)
class Fault:
    """A behaviour that made no usable proposal, first at ``time`` [s], ``count`` times in all."""

    time: float
    behavior: str
    error: str
    count: int = 1

    def __str__(self) -> str:
        times = "once" if self.count == 1 else f"{self.count} times"
        return f"{self.behavior}: {self.error} ({times}, first at {self.time:.1f} s)"


class Mofis:
    """Decides once per camera frame; holds the run's short-term memory.

    ``behaviors`` by name; a behaviour that raises or proposes nonsense loses the tick and is
    recorded in ``faults``, the others decide without it.
    """

    def __init__(
        self,
        robot: RobotModel,
        behaviors: Mapping[str, Behavior],
        fusion: Fusion,
        params: MofisParams | None = None,
        composite: Composite | None = None,
    ) -> None:
        self.robot = robot
        self.behaviors = dict(behaviors)
        self.composite = composite
        self.fusion = fusion
        self.params = params or MofisParams()
        self.commands = CommandGrid(robot, self.params.commands)
        self.egomap = EgoMap(robot, self.params.ego_map)
        self.tracks = Tracks(robot, self.params.tracks)
        self.lookahead = Lookahead(self.params.lookahead)
        self.passages = PassageWatch(self.egomap, self.params.passages)
        self.watchdog = Watchdog()
        self.reset()

    def reset(self) -> None:
        """Forget the last run."""
        self.egomap.reset()
        self.tracks.reset()
        self.passages.reset()
        self.fusion.reset()
        if self.composite is not None:
            self.composite.reset()
        for behavior in self.behaviors.values():
            behavior.reset()
        self.watchdog.reset()
        self._faults: dict[tuple[str, str], Fault] = {}
        self.proposals: dict[str, Proposal] = {}
        self.weights: Mapping[str, float] = {}
        self.context: Context | None = None
        self._percept: Percept | None = None
        self._flow: FlowField | None = None
        self._previous: Command | None = None
        self._watch = _ProgressWatch()

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What behaviours did wrong in this run, each kind of error once, oldest first."""
        return tuple(self._faults.values())

    def decide(
        self,
        odometry: Odometry,
        belief: Belief,
        percepts: Sequence[Percept],
        waypoint: Waypoint | None,
        flows: Sequence[FlowField] = (),
        seen_from: Pose | None = None,
        movers: Sequence[Mover] = (),
        standing: Standing | None = None,
    ) -> Command:
        """The command for now, from the newest ``percepts`` (may be none) and ``waypoint``.

        ``flows`` are the derotated flow fields of the percepts; ``seen_from`` is where the robot
        was in odom when their frame was taken, if that was not just now; ``movers`` were seen in
        that frame, and ``standing`` things in its small columns.
        """
        if not self.params.memory:
            self.egomap.reset()
        if flows:
            self._flow = flows[-1]
        self.egomap.move(odometry.pose, odometry.time)
        eye = odometry.pose if seen_from is None else seen_from
        for percept in percepts:
            if percept.sees_depth:
                self.egomap.enter(percept, eye)
                self.passages.enter(percept, eye)
                self._percept = percept
        if standing is not None:
            self.egomap.enter_standing(standing, eye)
        self.tracks.see(movers, eye)
        self.tracks.forget(odometry.time, odometry.pose)
        drops = self.passages.drops.discs() if self.params.memory else ()
        walked_on = self.tracks.discs(odometry.time)
        if not self._movers_heeded:
            drops, walked_on = (*walked_on, *drops), ()
        self.egomap.take(drops)
        self.context = self._context(odometry, belief, waypoint, walked_on)
        self.weights = self._weigh(self.context)
        self.proposals = {}
        with self.watchdog.on_duty():
            for name, behavior in self.behaviors.items():
                proposal = self._ask(name, behavior, self.context)
                if proposal is not None:
                    self.proposals[name] = proposal.weighted(self.weights.get(name, 1.0))
        self._previous = self.fusion.fuse(self.context, self.proposals)
        return self._previous

    def room(self, pose: Pose, twist: Twist) -> tuple[float, float]:
        """How far [m] ``twist`` leads from odom ``pose`` until a touch, and until the unseen."""
        if self.context is None:
            return math.inf, math.inf
        return room_along(self.egomap, pose, twist)

    def outlook(
        self, queries: Sequence[PassageQuery], odometry: Odometry, belief: Belief
    ) -> Outlook | None:
        """What the ego map says of the legs ahead; None before the first decision, or not yet."""
        if self.context is None:
            return None
        return self.passages.look(queries, odometry.pose, belief, odometry.time)

    @property
    def _movers_heeded(self) -> bool:
        """Whether one that heeds movers had a say last time: one that fails heeds nobody."""
        return any(self.behaviors[name].heeds_movers for name in self.proposals)

    def _context(
        self,
        odometry: Odometry,
        belief: Belief,
        waypoint: Waypoint | None,
        walked_on: tuple[Disc, ...],
    ) -> Context:
        pose = odometry.pose
        aim = None
        if waypoint is not None:
            local = belief.pose.to_local(waypoint.x, waypoint.y)
            if self.params.local_plan:
                aim = self.lookahead.aim(self.egomap, pose, *pose.to_parent(*local), walked_on)
            else:
                aim = Aim(*local, math.hypot(*local), reachable=True, detour=1.0)
        stalled, idle = self._watch.update(odometry, self._previous, waypoint, aim)
        return Context(
            time=odometry.time,
            robot=self.robot,
            commands=self.commands,
            twist=odometry.twist,
            pose=pose,
            belief=belief,
            percept=self._percept,
            arcs=sweep(self.egomap, pose, self.commands, self.params.margin),
            ranges=look_around(self.egomap, pose),
            waypoint=waypoint,
            aim=aim,
            previous=self._previous,
            stalled=stalled,
            idle=idle,
            flow=self._flow,
            encounters=meet(
                self.tracks.believed,
                self.robot,
                self.commands,
                pose,
                odometry.twist,
                odometry.time,
                self.params.encounters,
            ),
        )

    def _weigh(self, context: Context) -> Mapping[str, float]:
        """What the composite gives each primitive; nothing when it fails or there is none."""
        if self.composite is None:
            return {}
        try:
            weights = dict(self.composite.weigh(context))
            wrong = {name: w for name, w in weights.items() if not 0.0 <= w <= 1.0}
            error = f"weights {wrong} are not in [0, 1]" if wrong else None
        except Exception as exception:  # a plugin may raise anything; the robot drives on
            weights, error = {}, f"{type(exception).__name__}: {exception}"
        if error is None:
            return weights
        self._note_fault(context.time, self.composite.name, error)
        return {}

    def _ask(self, name: str, behavior: Behavior, context: Context) -> Proposal | None:
        """The behaviour's proposal, or None (and a recorded fault) when it is not usable."""
        if not self.watchdog.admits(name, context.time):
            return None
        try:
            with self.watchdog.watching(name, context.time):
                proposal = behavior.propose(context)
            error = _fault_of(proposal, self.commands.shape)
        except BehaviorTimeout as timeout:
            proposal, error = None, f"took too long: {timeout}"
        except Exception as exception:  # a plugin may raise anything; the robot drives on
            proposal, error = None, f"{type(exception).__name__}: {exception}"
        if error is None:
            return proposal
        self._note_fault(context.time, name, error)
        return None

    def _note_fault(self, time: float, name: str, error: str) -> None:
        known = self._faults.get((name, error), Fault(time, name, error, 0))
        self._faults[name, error] = replace(known, count=known.count + 1)


def _fault_of(proposal: object, shape: tuple[int, int]) -> str | None:
    """What is wrong with a behaviour's answer, or None."""
    if not isinstance(proposal, Proposal):
        return f"propose returned {type(proposal).__name__}, not a Proposal"
    if not 0.0 <= proposal.applicability <= 1.0:
        return f"applicability {proposal.applicability} is not in [0, 1]"
    for what in ("desirability", "prohibition"):
        layer = np.asarray(getattr(proposal, what), dtype=np.float64, order="C")
        if layer.shape != shape:
            return f"{what} has shape {layer.shape}, expected {shape}"
        if not are_degrees(layer):
            return f"{what} has values outside [0, 1]"
    return None


class _ProgressWatch:
    """Notices wheels that do not follow, and time without progress toward the waypoint."""

    def __init__(self) -> None:
        self._stalled_since: float | None = None
        self._goal: tuple[float, float] | None = None
        self._best = math.inf
        self._anchor: Pose | None = None
        self._progress_time = 0.0

    def update(
        self,
        odometry: Odometry,
        previous: Command | None,
        waypoint: Waypoint | None,
        aim: Aim | None,
    ) -> tuple[float, float]:
        """(stalled, idle) in seconds."""
        time = odometry.time
        wanted = 0.0 if previous is None else previous.twist.v
        if abs(wanted) > 0.08 and abs(odometry.twist.v) < 0.15 * abs(wanted):
            self._stalled_since = time if self._stalled_since is None else self._stalled_since
        else:
            self._stalled_since = None
        stalled = 0.0 if self._stalled_since is None else time - self._stalled_since

        goal = None if waypoint is None else (waypoint.x, waypoint.y)
        cost = math.inf if aim is None else aim.cost
        if goal != self._goal or goal is None:
            self._goal, self._best, self._progress_time = goal, cost, time
        elif cost < self._best - 0.1:
            self._best, self._progress_time = cost, time
        return stalled, time - self._progress_time
