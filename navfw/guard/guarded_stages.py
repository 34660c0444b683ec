"""The stages of the stack behind the guard: the same calls, with a fallback for each failure.

A stage that fails costs what it would have said: the frame shows nothing, the belief moves with the
odometry, the last waypoint stays. The safety monitor slows the robot, then stops it, while a vital
stage fails (``PluginGuard.failing``). ``plugin`` is the stage itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from navfw import interfaces
from navfw.guard import stage_answers as answers
from navfw.guard.answers import nothing
from navfw.guard.plugin_guard import PluginCallError, PluginGuard, label_of
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    Frame,
    FramePair,
    GrownGrid,
    LandmarkDetection,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    Twist,
    Waypoint,
)
from navfw.topomap import TopoMap

PluginT = TypeVar("PluginT", bound=interfaces.Plugin)

_UNKNOWN_POSITION = 1e3  # chosen
"""Standard deviation [m, rad] of a belief without any answer of the localizer."""


class GuardedStage(Generic[PluginT]):
    """A stage's plugin, called by a guard under the name ``KIND NAME``."""

    def __init__(self, guard: PluginGuard, plugin: PluginT) -> None:
        self.guard = guard
        self.plugin = plugin
        self.label = label_of(plugin)
        self._prepare = partial(guard.call, self.label, check=nothing)
        self._attempt = partial(guard.attempt, self.label)

    def reset(self) -> None:
        """Back to the start of a run.

        Raises:
            PluginCallError: the plugin fails, so the run cannot begin.

        """
        self._prepare(self.plugin.reset)


class GuardedFlow(GuardedStage[interfaces.FlowProcessor]):
    """A flow processor; None for a pair of frames at which it fails."""

    def compute(self, pair: FramePair) -> FlowField | None:
        """The flow of ``pair``."""
        check = partial(answers.check_flow, pair=pair)
        return self._attempt(self.plugin.compute, pair, check=check, vital=True)


class GuardedPerception(GuardedStage[interfaces.Perception]):
    """OFFIS; None for a flow field at which it fails."""

    def perceive(self, flow: FlowField, twist: Twist) -> Percept | None:
        """The percept of ``flow``."""
        check = partial(answers.check_percept, flow=flow)
        return self._attempt(self.plugin.perceive, flow, twist, check=check, vital=True)


class GuardedFeatures(GuardedStage[interfaces.FeatureRecognizer]):
    """A landmark recogniser; no detections in a frame at which it fails."""

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map. Raises PluginCallError if the plugin fails."""
        self._prepare(self.plugin.set_map, topo_map)

    def recognize(self, frame: Frame) -> tuple[LandmarkDetection, ...]:
        """The landmarks detected in ``frame``."""
        return self._attempt(self.plugin.recognize, frame, check=answers.check_detections) or ()


class GuardedLocalizer(GuardedStage[interfaces.Localizer]):
    """A localiser; while it fails, the last belief moves with the odometry.

    Without any belief so far the robot is lost.
    """

    _last: tuple[Belief, Odometry] | None = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose``. Raises PluginCallError if the plugin fails."""
        self._last = None
        self._prepare(self.plugin.start, topo_map, pose, odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief now."""
        inputs, check = (odometry, percept, detections), answers.check_belief
        belief = self._attempt(self.plugin.update, *inputs, check=check, vital=True)
        if belief is not None:
            self._last = (belief, odometry)
            return belief
        if self._last is None:
            unknown = np.eye(3) * _UNKNOWN_POSITION**2
            return Belief(odometry.time, Pose(0.0, 0.0, 0.0), unknown, {}, 0.0, lost=True)
        belief, before = self._last
        moved = before.pose.relative(odometry.pose)
        return replace(belief, time=odometry.time, pose=belief.pose.compose(moved))


class GuardedPlanner(GuardedStage[interfaces.Planner]):
    """A planner; while it fails, the last waypoint stays.

    Without any waypoint so far there is a failure instead: no waypoint would mean the end.
    """

    _last: Waypoint | None = None

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start a mission. Raises PluginCallError if the plugin fails."""
        self._prepare(self.plugin.start, topo_map, goals)
        self._last = goals[0] if goals else None

    def update(self, belief: Belief) -> Waypoint | None:
        """The waypoint to drive to, None at the end."""
        check = answers.check_waypoint
        with suppress(PluginCallError):
            self._last = self.guard.call(
                self.label, self.plugin.update, belief, check=check, vital=True
            )
        return self._last

    def observe(self, report: PassageReport) -> None:
        """Hand over the status of passages."""
        self._attempt(self.plugin.observe, report, check=nothing)

    @property
    def wants_grid(self) -> bool:
        """Whether the planner wants what was observed so far."""
        return self._attempt(lambda: self.plugin.wants_grid, check=answers.check_wish) or False

    def observe_grid(self, grid: GrownGrid) -> None:
        """Hand over what was observed so far."""
        self._attempt(self.plugin.observe_grid, grid, check=nothing)

    @property
    def path(self) -> tuple[Waypoint, ...]:
        """The waypoints still ahead."""
        return self._attempt(lambda: self.plugin.path, check=answers.check_path) or ()

    @property
    def queries(self) -> tuple[PassageQuery, ...]:
        """The passages whose status the planner wants."""
        return self._attempt(lambda: self.plugin.queries, check=answers.check_queries) or ()

    @property
    def no_route_reason(self) -> str | None:
        """Why no route leads to the goal; None while there is one."""
        return self._attempt(lambda: self.plugin.no_route_reason, check=answers.check_reason)

    @property
    def notes(self) -> str:
        """What was found to differ from the map."""
        return self._attempt(lambda: self.plugin.notes, check=answers.check_reason) or ""

    @property
    def findings(self) -> answers.Findings:
        """Closed passages, names and tracks of ways, and the map with these."""
        plugin, check = self.plugin, answers.check_findings
        findings = self._attempt(
            lambda: (plugin.closed, plugin.found, plugin.topo_map), check=check
        )
        return ((), (), None) if findings is None else findings

    def explain_choice(self, guard: PluginGuard | None = None) -> Mapping[str, Any]:
        """Why the planner heads for where it does; empty if a route says it.

        A fault goes to ``guard``, by default that of the stage.
        """
        explain, check = self.plugin.explain_choice, answers.check_explanation
        return (guard or self.guard).attempt(self.label, explain, check=check) or {}


class GuardedController(GuardedStage[interfaces.Controller]):
    """LOCOM; standstill at a tick at which it fails."""

    def control(self, command: Command | None, odometry: Odometry, dt: float) -> Twist:
        """The twist for the next ``dt`` [s]."""
        inputs, check = (command, odometry, dt), answers.check_twist
        twist = self._attempt(self.plugin.control, *inputs, check=check, vital=True)
        return Twist(0.0, 0.0) if twist is None else twist
