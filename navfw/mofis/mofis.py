"""MOFIS: a proposal from every behaviour, fused into one command that can be explained."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from navfw import signals
from navfw.context import CommandGrid, Context
from navfw.guard import PluginCallError, PluginGuard, label_of
from navfw.guard.answers import items, mapping, nothing, number, text
from navfw.guard.stage_answers import check_command, check_proposal, check_weights
from navfw.interfaces import Behavior, Composite, Fusion, Plugin
from navfw.localmap import Arcs, LocalGoal, LocalMap, Ranges
from navfw.mofis.fusion import CUT
from navfw.mofis.rules import Verdict, rounded
from navfw.robot import RobotModel

MOVING = 0.08  # chosen
"""Commanded speed [m/s] from which the wheels are expected to follow."""
_FOLLOWING = 0.15  # chosen
"""Share of the commanded speed below which the wheels do not follow."""
STEP = 0.1  # chosen
"""Decrease of the cost-to-go [m] that counts as progress."""


class ProgressMonitor:
    """Measures how long wheels have not followed commands, and how long progress was missing."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._stalled_since: float | None = None
        self._goal: tuple[float, float] | None = None
        self._best = math.inf
        self._progress_time = 0.0

    def update(
        self,
        odometry: signals.Odometry,
        driven: signals.Twist | None,
        waypoint: signals.Waypoint | None,
        local_goal: LocalGoal | None,
    ) -> tuple[float, float]:
        """Return (stalled, idle) [s]: how long wheels have not followed, and progress was missing.

        Progress is a fall of the local goal's cost; ``driven`` is the last command to the wheels:
        wheels that are not to turn are not blocked.
        """
        time, wanted = odometry.time, 0.0 if driven is None else driven.v
        if abs(wanted) > MOVING and abs(odometry.twist.v) < _FOLLOWING * abs(wanted):
            self._stalled_since = time if self._stalled_since is None else self._stalled_since
        else:
            self._stalled_since = None
        stalled = 0.0 if self._stalled_since is None else time - self._stalled_since

        goal = None if waypoint is None else (waypoint.x, waypoint.y)
        cost = math.inf if local_goal is None else local_goal.cost
        if goal != self._goal or goal is None:
            self._goal, self._best, self._progress_time = goal, cost, time
        elif cost < self._best - STEP:
            self._best, self._progress_time = cost, time
        return stalled, time - self._progress_time


@dataclass(frozen=True, slots=True)
class DecisionInputs:
    """What one decision of MOFIS is based on.

    ``percept`` and ``flow`` are the newest with any depth, None before the robot has moved.
    ``conflicts`` are those of all commands with moving obstacles, None without any;
    ``moving_obstacles`` the discs that bar the path to the local goal. ``driven`` is the last twist
    that the safety monitor let through, None if that was the last command.
    """

    odometry: signals.Odometry
    belief: signals.Belief
    waypoint: signals.Waypoint | None
    percept: signals.Percept | None = None
    flow: signals.FlowField | None = None
    conflicts: signals.Conflicts | None = None
    moving_obstacles: tuple[signals.OccupiedDisc, ...] = ()
    driven: signals.Twist | None = None


class Mofis:
    """Decides once per camera frame: asks all behaviours for proposals and fuses them.

    A behaviour that fails (see ``guard``) makes no proposal; the others decide without it.
    ``known`` are the names of all behaviours that a composite may weigh, these or others.
    """

    def __init__(
        self,
        robot: RobotModel,
        behaviors: Mapping[str, Behavior],
        fusion: Fusion,
        commands: CommandGrid,
        local_map: LocalMap,
        composite: Composite | None = None,
        guard: PluginGuard | None = None,
        known: Collection[str] = (),
    ) -> None:
        self.robot = robot
        self.guard = guard or PluginGuard()
        self.behaviors = dict(behaviors)
        self.composite = composite
        self.fusion = fusion
        self.commands = commands
        self.local_map = local_map
        self.progress = ProgressMonitor()
        self._fusion_label = label_of(fusion)
        self._composite_label = "" if composite is None else label_of(composite)
        self._check_proposal = partial(check_proposal, shape=commands.shape)
        self._check_weights = partial(check_weights, known=known)
        none, nowhere = commands.zeros(), np.zeros(1)
        self._no_room = Arcs(none, none, none, none[0], 0.0), Ranges(nowhere, nowhere, nowhere, 0.0)
        self._forget()

    def _forget(self) -> None:
        """Set what changes during a run to its initial value."""
        self.progress.reset()
        self.proposals: dict[str, signals.Proposal] = {}
        self.weights: Mapping[str, float] = {}
        self.context: Context | None = None
        self._previous: signals.Command | None = None

    def reset(self) -> None:
        """Return to the start of a run, all plugins included.

        Raises:
            PluginCallError: a plugin fails, so the run cannot begin.

        """
        plugins: dict[str, Plugin] = {self._fusion_label: self.fusion}
        if self.composite is not None:
            plugins[self._composite_label] = self.composite
        plugins |= {f"behavior {name}": behavior for name, behavior in self.behaviors.items()}
        for label, plugin in plugins.items():
            self.guard.call(label, plugin.reset, check=nothing)
        self._forget()

    @property
    def handles_moving_obstacles(self) -> bool:
        """Whether a behaviour that handles moving obstacles made a proposal in the last decision.

        With a fusion that needs no proposals: whether there is any such behaviour.
        """
        names = self.proposals if self.fusion.needs_proposals else self.behaviors
        return any(self.behaviors[name].handles_moving_obstacles for name in names)

    @property
    def idle(self) -> float:
        """Time [s] without progress toward the waypoint, at the last decision."""
        return 0.0 if self.context is None else self.context.idle

    def decide(self, inputs: DecisionInputs) -> signals.Command | None:
        """Decide on the present command; None if the fusion fails."""
        return self.decide_in(self._context(inputs))

    def decide_in(self, context: Context) -> signals.Command | None:
        """Decide in this context, which may be a recorded one; None if the fusion fails."""
        self.context = context
        self.proposals = {}
        asked = self.fusion.needs_proposals
        self.weights = self.weigh(self.composite, context) if asked else {}
        for name, behavior in self.behaviors.items() if asked else ():
            proposal = self.propose(name, behavior, context)
            if proposal is not None:
                self.proposals[name] = proposal.weighted(self.weights.get(name, 1.0))
        label, proposals = self._fusion_label, MappingProxyType(self.proposals)
        self._previous = self.guard.attempt(
            label, self.fusion.fuse, context, proposals, check=check_command, vital=True
        )
        return self._previous

    def _context(self, inputs: DecisionInputs) -> Context:
        odometry, belief, waypoint = inputs.odometry, inputs.belief, inputs.waypoint
        pose, commands = odometry.pose, self.commands
        local_goal, asked = None, self.fusion.needs_proposals
        if waypoint is not None and asked:
            target = belief.pose.to_local(waypoint.x, waypoint.y)
            local_goal = self.local_map.local_goal(pose, target, inputs.moving_obstacles)
        previous = None if self._previous is None else self._previous.twist
        driven = previous if inputs.driven is None else inputs.driven
        arcs, ranges = self._no_room
        if self.fusion.needs_room:
            arcs = self.local_map.arcs(pose, commands.v, commands.w)
            ranges = self.local_map.ranges(pose)
        stalled, idle = self.progress.update(odometry, driven, waypoint, local_goal)
        return Context(
            time=odometry.time,
            robot=self.robot,
            commands=commands,
            twist=odometry.twist,
            pose=pose,
            belief=belief,
            percept=inputs.percept,
            arcs=arcs,
            ranges=ranges,
            waypoint=waypoint,
            local_goal=local_goal,
            previous=self._previous,
            stalled=stalled,
            idle=idle if asked else 0.0,
            flow=inputs.flow,
            conflicts=inputs.conflicts,
        )

    @property
    def slower(self) -> str:
        """Behaviour, and its strongest rule, that kept the last command below the top speed.

        That is the one that prohibits the top speed at the command's turning rate, or else the one
        that prefers the command's speed to it the most. Empty without a command, or at top speed.
        """
        if self._previous is None or not self.proposals:
            return ""
        (row, column), top = self.commands.nearest(self._previous.twist), self.commands.v.size - 1
        if row == top:
            return ""
        barred = {name: p.prohibition[top, column] for name, p in self.proposals.items()}
        name = max(barred, key=barred.__getitem__)
        if barred[name] <= CUT:
            losses = {
                name: p.applicability * (p.desirability[row, column] - p.desirability[top, column])
                for name, p in self.proposals.items()
            }
            name, top = max(losses, key=losses.__getitem__), row
        rules = _rules(self.guard, f"behavior {name}", self.proposals[name].explain, top, column)
        about = [r["rule"] for r in rules if "speed IS" in r["rule"]] or [r["rule"] for r in rules]
        return f"{name}: {about[0]}" if about else name

    def propose(self, name: str, behavior: Behavior, context: Context) -> signals.Proposal | None:
        """Ask a behaviour for its proposal; None if it fails."""
        label, check = f"behavior {name}", self._check_proposal
        return self.guard.attempt(label, behavior.propose, context, check=check)

    def weigh(self, composite: Composite | None, context: Context) -> Mapping[str, float]:
        """Ask a composite for each primitive's weight; empty if it fails or there is none."""
        if composite is None:
            return {}
        label, check = self._composite_label, self._check_weights
        return self.guard.attempt(label, composite.weigh, context, check=check) or {}


def explain_command(
    command: signals.Command,
    proposals: Mapping[str, signals.Proposal],
    mofis: Mofis,
    guard: PluginGuard | None = None,
) -> dict[str, Any]:
    """Explain ``command`` as plain data: how each behaviour rated it, and by which rules.

    For each behaviour: applicability, desirability and prohibition of this command, the largest
    desirability of any command (``best``), the reason, and the rules that fired, strongest first.
    With a composite: the primitives' weights, and the rules that fired for them. If a plugin fails
    to explain, its error replaces the rules; ``guard`` (default: that of ``mofis``) records it.
    """
    guard = mofis.guard if guard is None else guard
    row, column = mofis.commands.nearest(command.twist)
    explanation = {
        "time": command.time,
        "v": command.twist.v,
        "w": command.twist.w,
        "leader": command.leader,
        "reason": command.reason,
        "emergency": command.emergency,
        "behaviors": {
            name: {
                "applicability": rounded(proposal.applicability),
                "weight": rounded(command.weights.get(name, 0.0)),
                "desirability": rounded(proposal.desirability[row, column]),
                "best": rounded(proposal.desirability.max()),
                "prohibition": rounded(proposal.prohibition[row, column]),
                "reason": proposal.reason,
                "rules": _rules(guard, f"behavior {name}", proposal.explain, row, column),
            }
            for name, proposal in proposals.items()
        },
    }
    if mofis.composite is not None:
        explanation["composite"] = {
            "name": mofis.composite.name,
            "weights": {name: rounded(weight) for name, weight in mofis.weights.items()},
            "rules": _rules(guard, label_of(mofis.composite), mofis.composite.explain),
        }
    return explanation


def _rules(
    guard: PluginGuard, plugin: str, explain: Callable[..., object], *command: int
) -> list[dict[str, Any]]:
    """Return the rules that a plugin says fired; if it fails, its error in place of a rule."""
    if isinstance(getattr(explain, "__self__", None), Verdict):
        return cast("list[dict[str, Any]]", explain(*command))  # needs no check
    try:
        return guard.call(plugin, explain, *command, check=_check_rules)
    except PluginCallError as error:
        return [{"rule": str(error), "strength": 0.0}]


def _check_rules(answer: object) -> list[dict[str, Any]]:
    rules = [mapping(rule, "a rule") for rule in items(answer, "explain's answer")]
    for rule in rules:
        text(rule.get("rule"), "rule")
        number(rule.get("strength"), "strength")
    return rules
