"""MOFIS: keeps the ego map, asks every behaviour for its proposal, fuses them into one command."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.interfaces import Behavior, Composite, Fusion
from navfw.localmap.free_distance import look_around, room_along, sweep
from navfw.localmap.local_planner import LocalGoal, LocalPlanner, LocalPlannerParams
from navfw.localmap.occupancy_grid import OccupancyGrid, OccupancyParams
from navfw.localmap.ray_kernels import are_degrees
from navfw.localmap.traversability import TraversabilityCheck, TraversabilityParams
from navfw.mofis.command_grid import CommandGrid, CommandGridParams
from navfw.mofis.context import Context
from navfw.mofis.watchdog import BehaviorTimeout, Watchdog
from navfw.movers.conflict_prediction import ConflictParams, predict_conflicts
from navfw.movers.tracking import Disc, TrackParams, Tracks
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    MovingObject,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    Proposal,
    Stixels,
    Twist,
    Waypoint,
)

__all__ = ["Fault", "Mofis", "MofisParams"]


class MofisParams(BaseModel):
    """The motion room's own settings, beside those of its plugins."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    ego_map: OccupancyParams = OccupancyParams()
    tracks: TrackParams = TrackParams()
    encounters: ConflictParams = ConflictParams()
    commands: CommandGridParams = CommandGridParams()
    lookahead: LocalPlannerParams = LocalPlannerParams()
    passages: TraversabilityParams = TraversabilityParams()
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
        self.occupancy = OccupancyGrid(robot, self.params.ego_map)
        self.tracks = Tracks(robot, self.params.tracks)
        self.lookahead = LocalPlanner(self.params.lookahead)
        self.passages = TraversabilityCheck(self.occupancy, self.params.passages)
        self.watchdog = Watchdog()
        self.reset()

    def reset(self) -> None:
        """Forget the last run."""
        self.occupancy.reset()
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
        movers: Sequence[MovingObject] = (),
        standing: Stixels | None = None,
    ) -> Command:
        """The command for now, from the newest ``percepts`` (may be none) and ``waypoint``.

        ``flows`` are the derotated flow fields of the percepts; ``seen_from`` is where the robot
        was in odom when their frame was taken, if that was not just now; ``movers`` were seen in
        that frame, and ``standing`` things in its small columns.
        """
        if not self.params.memory:
            self.occupancy.reset()
        if flows:
            self._flow = flows[-1]
        self.occupancy.move(odometry.pose, odometry.time)
        eye = odometry.pose if seen_from is None else seen_from
        for percept in percepts:
            if percept.sees_depth:
                self.occupancy.enter(percept, eye)
                self.passages.enter(percept, eye)
                self._percept = percept
        if standing is not None:
            self.occupancy.integrate_stixels(standing, eye)
        self.tracks.see(movers, eye)
        self.tracks.forget(odometry.time, odometry.pose)
        drops = self.passages.drops.discs() if self.params.memory else ()
        moving_obstacles = self.tracks.discs(odometry.time)
        if not self.handles_moving_obstacles:
            drops, moving_obstacles = (*moving_obstacles, *drops), ()
        self.occupancy.take(drops)
        self.context = self._context(odometry, belief, waypoint, moving_obstacles)
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
        return room_along(self.occupancy, pose, twist)

    def outlook(
        self, queries: Sequence[PassageQuery], odometry: Odometry, belief: Belief
    ) -> PassageReport | None:
        """What the ego map says of the legs ahead; None before the first decision, or not yet."""
        if self.context is None:
            return None
        return self.passages.look(queries, odometry.pose, belief, odometry.time)

    @property
    def handles_moving_obstacles(self) -> bool:
        """Whether one that heeds movers had a say last time: one that fails heeds nobody."""
        return any(self.behaviors[name].handles_moving_obstacles for name in self.proposals)

    def _context(
        self,
        odometry: Odometry,
        belief: Belief,
        waypoint: Waypoint | None,
        moving_obstacles: tuple[Disc, ...],
    ) -> Context:
        pose = odometry.pose
        aim = None
        if waypoint is not None:
            local = belief.pose.to_local(waypoint.x, waypoint.y)
            if self.params.local_plan:
                aim = self.lookahead.aim(
                    self.occupancy, pose, *pose.to_parent(*local), moving_obstacles
                )
            else:
                aim = LocalGoal(*local, math.hypot(*local), reachable=True, detour=1.0)
        stalled, idle = self._watch.update(odometry, self._previous, waypoint, aim)
        return Context(
            time=odometry.time,
            robot=self.robot,
            commands=self.commands,
            twist=odometry.twist,
            pose=pose,
            belief=belief,
            percept=self._percept,
            arcs=sweep(self.occupancy, pose, self.commands, self.params.margin),
            ranges=look_around(self.occupancy, pose),
            waypoint=waypoint,
            aim=aim,
            previous=self._previous,
            stalled=stalled,
            idle=idle,
            flow=self._flow,
            encounters=predict_conflicts(
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
        aim: LocalGoal | None,
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
