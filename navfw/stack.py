"""The stack: one plugin of each kind, stepped once per control tick from sensor readings alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from navfw.egomotion.odometer import Odometer
from navfw.egomotion.odometry_history import OdometryHistory
from navfw.interfaces import (
    Behavior,
    Composite,
    Controller,
    FeatureRecognizer,
    FlowProcessor,
    Fusion,
    Localizer,
    Perception,
    Planner,
)
from navfw.locom.trim import WheelTrim
from navfw.mofis.explanation import explain_command
from navfw.mofis.mofis import Mofis
from navfw.robot import RobotModel
from navfw.safety import SafetyMonitor, SafetyVerdict
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    Frame,
    LandmarkDetection,
    MovingObject,
    Odometry,
    PassageReport,
    Percept,
    Pose,
    Proposal,
    SensorReading,
    Stixels,
    Twist,
    Waypoint,
)
from navfw.stackfile import PluginSource, StackConfig, load_stack
from navfw.stopwatch import timed
from navfw.topomap import TopoMap
from navfw.vision import View, Vision

__all__ = ["Stack", "StackState"]

STUCK_AFTER = 60.0
"""Seconds without any progress toward a waypoint after which the stack gives up."""

SHUT_AFTER = 20.0
"""Seconds that the only way has to stay shut before the stack gives up: it may have looked so."""


TIMED = (
    "flow",
    "movers",
    "perception",
    "features",
    "localizer",
    "planner",
    "motion",
    "control",
    "safety",
)


@dataclass(frozen=True, slots=True)
class StackState:
    """What the stack knows and decided at its last step; read only, for displays and records.

    ``flows`` are the newest derotated flow fields; ``stuck`` says why the stack gave up, ``fault``
    which sensor has failed for good, or None. ``detections`` are the landmarks just
    recognised, known to the map or not; ``seen`` counts all of them so far, by identity.
    """

    time: float
    odometry: Odometry | None = None
    belief: Belief | None = None
    flows: tuple[FlowField, ...] = ()
    percept: Percept | None = None
    movers: tuple[MovingObject, ...] = ()
    standing: Stixels | None = None
    waypoint: Waypoint | None = None
    path: tuple[Waypoint, ...] = ()
    proposals: Mapping[str, Proposal] | None = None
    command: Command | None = None
    finished: bool = False
    stuck: str | None = None
    fault: str | None = None
    faults: tuple[str, ...] = ()
    detections: tuple[LandmarkDetection, ...] = ()
    seen: Mapping[str, int] = field(default_factory=dict)


class Stack:
    """Composes the stages. It sees sensor readings and the map file, nothing else."""

    def __init__(self, config: StackConfig, robot: RobotModel, topo_map: TopoMap) -> None:
        def build(stage: str) -> Any:
            choice = config.stages[stage]
            return choice.plugin(robot, choice.params)

        self.resolved = config
        self.robot = robot
        self.topo_map = topo_map
        self.odometer = Odometer(robot)
        self.history = OdometryHistory()
        self.timings: dict[str, float] = dict.fromkeys(TIMED, 0.0)
        self.vision = Vision(
            robot,
            config,
            cast(FlowProcessor, build("flow")),
            cast(Perception, build("perception")),
            self.odometer,
            self.timings,
        )
        self.features = cast(FeatureRecognizer, build("features"))
        self.localizer = cast(Localizer, build("localizer"))
        self.planner = cast(Planner, build("planner"))
        self.controller = cast(Controller, build("controller"))
        behaviors = {
            name: cast(Behavior, choice.plugin(robot, choice.params))
            for name, choice in config.behaviors.items()
        }
        self.safety = SafetyMonitor(robot, config.safety)
        self.verdict = SafetyVerdict(Twist(0.0, 0.0))
        self.trim = WheelTrim(robot)
        self.mofis = Mofis(
            robot,
            behaviors,
            cast(Fusion, build("fusion")),
            config.motion,
            cast(Composite, build("composite")),
        )
        self.state = StackState(time=0.0)
        self._start_pose: Pose | None = None
        self._began: float | None = None
        self._localized = False
        self._decided: StackState | None = None
        self._outlook: PassageReport | None = None
        self._shut_since: float | None = None

    @classmethod
    def load(
        cls,
        path: str | Path,
        robot: RobotModel,
        topo_map: TopoMap,
        plugins: PluginSource,
        overrides: Sequence[str] = (),
    ) -> Stack:
        """A stack from a stack file; raises as ``navfw.stackfile.load_stack``."""
        return cls(load_stack(path, plugins, overrides), robot, topo_map)

    @property
    def config(self) -> dict[str, Any]:
        """The resolved configuration as plain data."""
        return self.resolved.as_data()

    def explain(self) -> dict[str, Any]:
        """Why the last command was given: what OFFIS saw, what each behaviour said, which rules.

        Plain data, made on request; empty before the first command.
        """
        state = self._decided
        if state is None or state.command is None or state.proposals is None:
            return {}
        mofis = self.mofis
        explanation = explain_command(
            state.command, state.proposals, mofis.commands, mofis.composite, mofis.weights
        )
        if state.percept is not None:
            explanation["perception"] = {
                "sentence": state.percept.sentence,
                "inference": dict(state.percept.explanation),
            }
        if state.standing is not None:
            explanation["standing"] = state.standing.explain()
        return explanation

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Begin a mission at ``pose`` (map frame; None: unknown): visit ``goals`` in order."""
        self.odometer.reset()
        self.history.reset()
        self.trim.reset()
        self.verdict = SafetyVerdict(Twist(0.0, 0.0))
        for plugin in (
            self.vision,
            self.features,
            self.localizer,
            self.planner,
            self.controller,
        ):
            plugin.reset()
        self.mofis.reset()
        self.safety.reset()
        self.features.study(self.topo_map)
        self.planner.start(self.topo_map, goals)
        self.timings.update(dict.fromkeys(TIMED, 0.0))
        self.state = StackState(time=0.0)
        self._start_pose = pose
        self._began = None
        self._decided = None
        self._localized = False
        self._outlook = None
        self._shut_since = None

    def step(self, reading: SensorReading) -> Twist:
        """One control tick: the twist to drive until the next reading."""
        asked = self.verdict.twist
        odometry = self.odometer.update(reading.inertial, reading.encoders, asked)
        self.history.add(odometry)
        self.trim.hear(reading.encoders)
        with timed(self.timings, "safety"):
            self.safety.hear(reading, odometry)
        if self._began is None:
            self._began = reading.time
        if reading.frame is not None:
            self._decide(reading, reading.frame, odometry)
        with timed(self.timings, "control"):
            dt = 1.0 / self.robot.control_rate
            twist = self.controller.control(self.state.command, odometry, dt)
        with timed(self.timings, "safety"):
            verdict = self.safety.limit(
                twist, reading.time, lambda twist: self.mofis.room(odometry.pose, twist)
            )
        self.verdict = verdict
        if self.safety.failure is not None:
            self.state = replace(self.state, fault=self.safety.failure)
        return self.trim.apply(verdict.twist)

    # --- once per camera frame -------------------------------------------------------------------

    def _decide(self, reading: SensorReading, frame: Frame, odometry: Odometry) -> None:
        """Look, locate, plan and decide; the result is the new state."""
        then = self.history.at(frame.time)
        view, percept = View(), None
        detections: tuple[LandmarkDetection, ...] = ()
        # a frozen picture without flow would say that all the world is far away
        if self.safety.senses.seeing:
            view = self.vision.look(frame, then)
            percept = view.percept
            shown = reading.landmark_frame if self.features.landmark_frames else frame
            if shown is not None:
                with timed(self.timings, "features"):
                    detections = tuple(self.features.recognize(shown))
        if not self._localized:
            self.localizer.start(self.topo_map, self._start_pose, odometry)
            self._localized = True
        with timed(self.timings, "localizer"):
            belief = self.localizer.update(odometry, percept, detections)
        with timed(self.timings, "planner"):
            waypoint = self._plan(belief)
            path = tuple(self.planner.path)
        warming = self._began is None or reading.time - self._began < self.resolved.warmup
        finished = waypoint is None and not belief.lost
        command, idle = None, 0.0
        if not finished and not warming:
            with timed(self.timings, "motion"):
                command = self.mofis.decide(
                    odometry,
                    belief,
                    view.percepts,
                    waypoint,
                    view.flows,
                    then.pose,
                    view.movers,
                    view.standing,
                )
                # the planner hears of it at the next frame: data flow one way
                queries = () if belief.lost else self.planner.queries
                self._outlook = self.mofis.outlook(queries, odometry, belief)
            idle = 0.0 if self.mofis.context is None else self.mofis.context.idle
        stuck = self._stuck(reading.time, waypoint, idle)
        self.state = StackState(
            time=reading.time,
            odometry=odometry,
            belief=belief,
            flows=view.flows,
            percept=percept or self.state.percept,
            movers=view.movers,
            standing=view.standing,
            waypoint=waypoint,
            path=path,
            proposals=self.mofis.proposals,
            command=command,
            finished=finished,
            stuck=stuck,
            faults=tuple(str(fault) for fault in self.mofis.faults),
            detections=detections,
            seen=_counted(self.state.seen, detections),
        )
        if command is not None:
            self._decided = self.state

    def _plan(self, belief: Belief) -> Waypoint | None:
        """The waypoint to head for; None at the end, and as long as nobody knows where it is.

        A planner that took a guess for the pose would pass waypoints that the robot never saw.
        """
        if belief.lost:
            return None
        if self._outlook is not None:
            self.planner.observe(self._outlook)
            self._outlook = None
        return self.planner.update(belief)

    def _stuck(self, now: float, waypoint: Waypoint | None, idle: float) -> str | None:
        """Why there is no point in going on; None while there is one."""
        shut = self.planner.shut
        if shut is None or waypoint is None:
            self._shut_since = None
        elif self._shut_since is None:
            self._shut_since = now
        if self._shut_since is not None and now - self._shut_since >= SHUT_AFTER:
            return shut
        if idle > STUCK_AFTER and waypoint is not None:
            because = "" if shut is None else f"; {shut}"
            return f"no progress toward {waypoint.label} for {idle:.0f} s{because}"
        return None


def _counted(seen: Mapping[str, int], detections: Sequence[LandmarkDetection]) -> Mapping[str, int]:
    """``seen`` with these detections on top."""
    if not detections:
        return seen
    more = dict(seen)
    for detection in detections:
        more[detection.identity] = more.get(detection.identity, 0) + 1
    return more
