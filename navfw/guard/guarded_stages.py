"""The stages of the stack, called through the guard, with a fallback for each failure.

If a stage fails, its answer is replaced: the frame shows nothing, the belief moves with the
odometry, the last waypoint is kept. While a vital stage fails (``PluginGuard.failing``), the safety
monitor slows the robot, then stops it. ``plugin`` is the stage itself.
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
"""Standard deviation [m, rad] of the belief if the localizer has never answered."""


class GuardedStage(Generic[PluginT]):
    """Calls a stage's plugin through a guard under the label ``KIND NAME``."""

    def __init__(self, guard: PluginGuard, plugin: PluginT) -> None:
        self.guard = guard
        self.plugin = plugin
        self.label = label_of(plugin)
        self._prepare = partial(guard.call, self.label, check=nothing)
        self._attempt = partial(guard.attempt, self.label)

    def reset(self) -> None:
        """Reset the plugin to the start of a run.

        Raises:
            PluginCallError: the plugin fails, so the run cannot begin.

        """
        self._prepare(self.plugin.reset)


class GuardedFlow(GuardedStage[interfaces.FlowProcessor]):
    """Calls a flow processor; returns None for a pair of frames at which it fails."""

    def compute(self, pair: FramePair) -> FlowField | None:
        """Compute the flow of ``pair``."""
        check = partial(answers.check_flow, pair=pair)
        return self._attempt(self.plugin.compute, pair, check=check, vital=True)


class GuardedPerception(GuardedStage[interfaces.Perception]):
    """Calls OFFIS; returns None for a flow field at which it fails."""

    def perceive(self, flow: FlowField, twist: Twist) -> Percept | None:
        """Compute the percept of ``flow``."""
        check = partial(answers.check_percept, flow=flow)
        return self._attempt(self.plugin.perceive, flow, twist, check=check, vital=True)


class GuardedFeatures(GuardedStage[interfaces.FeatureRecognizer]):
    """Calls a landmark recogniser; there are no detections in a frame at which it fails."""

    def set_map(self, topo_map: TopoMap) -> None:
        """Give the plugin the map. Raises PluginCallError if the plugin fails."""
        self._prepare(self.plugin.set_map, topo_map)

    def recognize(self, frame: Frame) -> tuple[LandmarkDetection, ...]:
        """Detect the landmarks in ``frame``."""
        return self._attempt(self.plugin.recognize, frame, check=answers.check_detections) or ()


class GuardedLocalizer(GuardedStage[interfaces.Localizer]):
    """Calls a localiser; while it fails, the last belief moves with the odometry.

    If it has never answered, the belief is lost.
    """

    _last: tuple[Belief, Odometry] | None = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` in ``map``. Raises PluginCallError if the plugin fails."""
        self._last = None
        self._prepare(self.plugin.start, topo_map, pose, odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """Return the belief at the time of ``odometry``."""
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
    """Calls a planner; while it fails, its last waypoint (at first the first goal) is kept.

    No waypoint would mean that the mission has ended.
    """

    _last: Waypoint | None = None

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start a mission on ``topo_map``. Raises PluginCallError if the plugin fails."""
        self._prepare(self.plugin.start, topo_map, goals)
        self._last = goals[0] if goals else None

    def update(self, belief: Belief) -> Waypoint | None:
        """Return the waypoint to drive to; None when the mission has ended."""
        check = answers.check_waypoint
        with suppress(PluginCallError):
            self._last = self.guard.call(
                self.label, self.plugin.update, belief, check=check, vital=True
            )
        return self._last

    def observe(self, report: PassageReport) -> None:
        """Give the planner the status of passages."""
        self._attempt(self.plugin.observe, report, check=nothing)

    @property
    def wants_grid(self) -> bool:
        """Whether the planner wants the grid of what was observed so far; False if it fails."""
        return self._attempt(lambda: self.plugin.wants_grid, check=answers.check_wish) or False

    def observe_grid(self, grid: GrownGrid) -> None:
        """Give the planner the grid of what was observed so far."""
        self._attempt(self.plugin.observe_grid, grid, check=nothing)

    @property
    def path(self) -> tuple[Waypoint, ...]:
        """The waypoints still ahead; empty if the planner fails."""
        return self._attempt(lambda: self.plugin.path, check=answers.check_path) or ()

    @property
    def queries(self) -> tuple[PassageQuery, ...]:
        """The passages whose status the planner wants; empty if it fails."""
        return self._attempt(lambda: self.plugin.queries, check=answers.check_queries) or ()

    @property
    def no_route_reason(self) -> str | None:
        """The reason why no route leads to the goal; None while there is one."""
        return self._attempt(lambda: self.plugin.no_route_reason, check=answers.check_reason)

    @property
    def notes(self) -> str:
        """Differences from the map that the planner found, as text; "" if there are none."""
        return self._attempt(lambda: self.plugin.notes, check=answers.check_reason) or ""

    @property
    def findings(self) -> answers.Findings:
        """Closed passages, new ways by name with their tracks, and the map with these, or None."""
        plugin, check = self.plugin, answers.check_findings
        findings = self._attempt(
            lambda: (plugin.closed, plugin.found, plugin.topo_map), check=check
        )
        return ((), (), None) if findings is None else findings

    def explain_choice(self, guard: PluginGuard | None = None) -> Mapping[str, Any]:
        """Explain the planner's present target; empty if it simply follows the route.

        A fault is recorded in ``guard``, by default in that of the stage.
        """
        explain, check = self.plugin.explain_choice, answers.check_explanation
        return (guard or self.guard).attempt(self.label, explain, check=check) or {}


class GuardedController(GuardedStage[interfaces.Controller]):
    """Calls LOCOM; the twist is 0 at a tick at which it fails."""

    def control(self, command: Command | None, odometry: Odometry, dt: float) -> Twist:
        """Return the twist for the next ``dt`` [s]."""
        inputs, check = (command, odometry, dt), answers.check_twist
        twist = self._attempt(self.plugin.control, *inputs, check=check, vital=True)
        return Twist(0.0, 0.0) if twist is None else twist
