"""MOFIS: one proposal from every behaviour, fused into one command (paper Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from navfw.context import CommandGrid, Context
from navfw.interfaces import Behavior, Composite, Fusion
from navfw.localmap import LocalMap
from navfw.mofis.progress import ProgressMonitor
from navfw.mofis.proposal_check import proposal_error
from navfw.mofis.watchdog import BehaviorTimeout, Watchdog
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    Conflicts,
    FlowField,
    OccupiedDisc,
    Odometry,
    Percept,
    Proposal,
    Waypoint,
)

__all__ = ["DecisionInputs", "Mofis", "PluginFault"]


@dataclass(frozen=True, slots=True)
class PluginFault:
    """An error of a plugin, first at ``time`` [s], ``count`` times in all."""

    time: float
    plugin: str
    error: str
    count: int = 1

    def __str__(self) -> str:
        times = "once" if self.count == 1 else f"{self.count} times"
        return f"{self.plugin}: {self.error} ({times}, first at {self.time:.1f} s)"


@dataclass(frozen=True, slots=True)
class DecisionInputs:
    """What a decision starts from.

    ``percept`` and ``flow`` are the newest with any depth, None before the robot has moved.
    ``conflicts`` are those of all commands with moving obstacles, None without any;
    ``moving_obstacles`` the discs that bar the way to the local goal.
    """

    odometry: Odometry
    belief: Belief
    waypoint: Waypoint | None
    percept: Percept | None = None
    flow: FlowField | None = None
    conflicts: Conflicts | None = None
    moving_obstacles: tuple[OccupiedDisc, ...] = ()


class Mofis:
    """Decides once per camera frame, by the behaviours' proposals and the local map.

    A behaviour that raises an exception or returns an invalid proposal loses the tick and is
    recorded in ``faults``; the others decide without it.
    """

    def __init__(
        self,
        robot: RobotModel,
        behaviors: Mapping[str, Behavior],
        fusion: Fusion,
        commands: CommandGrid,
        local_map: LocalMap,
        composite: Composite | None = None,
    ) -> None:
        self.robot = robot
        self.behaviors = dict(behaviors)
        self.composite = composite
        self.fusion = fusion
        self.commands = commands
        self.local_map = local_map
        self.watchdog = Watchdog()
        self.progress = ProgressMonitor()
        self.reset()

    def reset(self) -> None:
        """Back to the start of a run, all plugins included."""
        self.fusion.reset()
        if self.composite is not None:
            self.composite.reset()
        for behavior in self.behaviors.values():
            behavior.reset()
        self.watchdog.reset()
        self.progress.reset()
        self._faults: dict[tuple[str, str], PluginFault] = {}
        self.proposals: dict[str, Proposal] = {}
        self.weights: Mapping[str, float] = {}
        self.context: Context | None = None
        self._previous: Command | None = None

    @property
    def faults(self) -> tuple[PluginFault, ...]:
        """Errors of plugins in this run, each kind of error once, oldest first."""
        return tuple(self._faults.values())

    @property
    def handles_moving_obstacles(self) -> bool:
        """Whether a behaviour that handles moving obstacles made a proposal in the last decision.

        One that fails handles none.
        """
        return any(self.behaviors[name].handles_moving_obstacles for name in self.proposals)

    @property
    def idle(self) -> float:
        """Time [s] without progress toward the waypoint, at the last decision."""
        return 0.0 if self.context is None else self.context.idle

    def decide(self, inputs: DecisionInputs) -> Command:
        """The command for now."""
        context = self.context = self._context(inputs)
        self.weights = self._weigh(context)
        self.proposals = {}
        with self.watchdog.on_duty():
            for name, behavior in self.behaviors.items():
                proposal = self._propose(name, behavior, context)
                if proposal is not None:
                    self.proposals[name] = proposal.weighted(self.weights.get(name, 1.0))
        self._previous = self.fusion.fuse(context, self.proposals)
        return self._previous

    def _context(self, inputs: DecisionInputs) -> Context:
        odometry, belief, waypoint = inputs.odometry, inputs.belief, inputs.waypoint
        pose, commands = odometry.pose, self.commands
        local_goal = None
        if waypoint is not None:
            target = belief.pose.to_local(waypoint.x, waypoint.y)
            local_goal = self.local_map.local_goal(pose, target, inputs.moving_obstacles)
        stalled, idle = self.progress.update(odometry, self._previous, waypoint, local_goal)
        return Context(
            time=odometry.time,
            robot=self.robot,
            commands=commands,
            twist=odometry.twist,
            pose=pose,
            belief=belief,
            percept=inputs.percept,
            arcs=self.local_map.arcs(pose, commands.v, commands.w),
            ranges=self.local_map.ranges(pose),
            waypoint=waypoint,
            local_goal=local_goal,
            previous=self._previous,
            stalled=stalled,
            idle=idle,
            flow=inputs.flow,
            conflicts=inputs.conflicts,
        )

    def _weigh(self, context: Context) -> Mapping[str, float]:
        """The composite's weight of each primitive; none when it fails or there is none."""
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
        self._record_fault(context.time, self.composite.name, error)
        return {}

    def _propose(self, name: str, behavior: Behavior, context: Context) -> Proposal | None:
        """The behaviour's proposal, or None (and a recorded fault) when it is not usable."""
        if not self.watchdog.admits(name, context.time):
            return None
        try:
            with self.watchdog.watching(name, context.time):
                proposal = behavior.propose(context)
            error = proposal_error(proposal, self.commands.shape)
        except BehaviorTimeout as timeout:
            proposal, error = None, f"took too long: {timeout}"
        except Exception as exception:  # a plugin may raise anything; the robot drives on
            proposal, error = None, f"{type(exception).__name__}: {exception}"
        if error is None:
            return proposal
        self._record_fault(context.time, name, error)
        return None

    def _record_fault(self, time: float, name: str, error: str) -> None:
        known = self._faults.get((name, error), PluginFault(time, name, error, 0))
        self._faults[name, error] = replace(known, count=known.count + 1)
