"""The stack: one plugin of each kind, stepped once per control tick from sensor readings only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from navfw.config.input_file import shown_path
from navfw.config.lookup import find
from navfw.egomotion.floor_odometry import FloorOdometry
from navfw.egomotion.odometer import Odometer, OdometryHistory
from navfw.errors import ConfigError
from navfw.guard import PluginGuard, construct, guarded_stages
from navfw.localization.passage_walls import KnownWalls
from navfw.localmap import LocalMap
from navfw.locom.unicycle import WheelTrim
from navfw.mofis.mofis import DecisionInputs, explain_command
from navfw.movers import ConflictPredictor, Tracker
from navfw.plugins import Registry
from navfw.robot import RobotModel
from navfw.safety import SafetyMonitor, SafetyVerdict
from navfw.signals import (
    Belief,
    FlowField,
    Frame,
    LandmarkDetection,
    OccupiedDisc,
    Odometry,
    PassageReport,
    Percept,
    Pose,
    SensorReading,
    Twist,
    Waypoint,
)
from navfw.stack.map_growth import MapGrowth
from navfw.stack.stack_state import ProgressWatch, StackState, why_slower
from navfw.stack.stackfile import Choice, StackConfig, load_stack, mofis_of
from navfw.stack.stopwatch import timed
from navfw.stack.vision import View, Vision, ready_frame, straight_reading
from navfw.topomap import TopoMap

TIMED: tuple[str, ...] = ("flow", "movers", "perception", "features", "localizer")
TIMED += ("planner", "motion", "control", "safety")


class Stack:
    """Runs all stages, one tick every ``period`` [s], on sensor readings and the map file only."""

    def __init__(self, config: StackConfig, robot: RobotModel, topo_map: TopoMap) -> None:
        self.guard = PluginGuard()
        stages = config.stages

        def build(choice: Choice) -> Any:
            return construct(choice.plugin, robot, choice.params)

        self.features = guarded_stages.GuardedFeatures(
            self.guard, build(stages["features"])
        )  # whole images
        self.camera = robot.camera  # of the images that it takes in
        self._lens, self._reduction = robot.camera.undistortion(), robot.camera.reduction
        self.robot = robot = robot.with_reduced_images()
        self.period = 1.0 / robot.control_rate

        settings = config.settings
        self.resolved = config
        self.topo_map = topo_map
        self.odometer = Odometer(robot)
        by_floor = settings.floor_odometry
        by_floor = robot.skid > 0.0 if by_floor is None else by_floor
        self.floor_odometry = FloorOdometry(robot) if by_floor else None
        self.history = OdometryHistory()
        self.timings: dict[str, float] = {}
        self.vision = Vision(
            robot,
            settings,
            guarded_stages.GuardedFlow(self.guard, build(stages["flow"])),
            guarded_stages.GuardedPerception(self.guard, build(stages["perception"])),
            self.timings,
        )
        self.localizer = guarded_stages.GuardedLocalizer(self.guard, build(stages["localizer"]))
        self.planner = guarded_stages.GuardedPlanner(self.guard, build(stages["planner"]))
        self.controller = guarded_stages.GuardedController(self.guard, build(stages["controller"]))
        self.local_map = LocalMap(robot, settings.local_map)
        self.known_walls = KnownWalls.of(topo_map, robot)
        self.tracker = Tracker(robot, settings.movers.tracking)
        self.conflicts = ConflictPredictor(robot, settings.movers.conflicts)
        self.mofis = mofis_of(config, robot, self.guard, self.local_map)
        self.growth = MapGrowth(robot, settings.growing_map)
        self.safety = SafetyMonitor(robot, self.local_map, settings.safety)
        self.trim = WheelTrim(robot)
        self._forget()

    def _forget(self) -> None:
        """Set what changes during a run to its initial value."""
        self.verdict = SafetyVerdict(Twist(0.0, 0.0))
        self.state = StackState(time=0.0)
        self._start_pose: Pose | None = None
        self._began: float | None = None
        self._localized = False
        self._decided: StackState | None = None
        self._percept: Percept | None = None
        self._flow: FlowField | None = None
        self._passage_report: PassageReport | None = None
        self._progress = ProgressWatch()

    def head_for(self, goals: Sequence[Waypoint]) -> None:
        """Drive to ``goals`` from now on; the rest stays as it is. Raises as the planner does."""
        self.planner.start(self.topo_map, goals)
        self.state = replace(self.state, finished=False)

    @classmethod
    def load(
        cls,
        name: str | Path,
        robot: RobotModel,
        topo_map: TopoMap,
        plugins: Registry,
        overrides: Sequence[str] = (),
    ) -> Self:
        """Build the stack of that name or file; raises like ``stackfile.load_stack``."""
        path = find("stack", name)
        config = load_stack(path, plugins, overrides)
        try:
            return cls(config, robot, topo_map)
        except ConfigError as error:  # parameters that do not suit the robot
            if error.file is not None:
                raise
            raise ConfigError(str(error), file=shown_path(path)) from None

    @property
    def config(self) -> dict[str, Any]:
        """The stack's resolved configuration as plain data."""
        return self.resolved.as_data()

    def explain(
        self, guard: PluginGuard | None = None, *, inference: bool = True
    ) -> dict[str, Any]:
        """Explain the last command: percept, proposals, weights, and the rules that fired.

        Returns plain data, as ``explanation_lines`` takes it; empty before the first command.
        Faults go to ``guard`` (default: the stack's); ``inference`` adds how OFFIS came to it.
        """
        state, guard = self._decided, guard or self.guard
        if state is None or state.command is None or state.proposals is None:
            return {}
        with guard.watchdog.on_duty():
            explanation = explain_command(state.command, state.proposals, self.mofis, guard)
            plan = self.planner.explain_choice(guard)
        if state.percept is not None:
            explanation["perception"] = {"sentence": state.percept.sentence}
            if inference:
                explanation["perception"]["inference"] = dict(state.percept.explanation)
        if state.stixels is not None:
            explanation["stixels"] = state.stixels.explain()
        if state.odometry is not None and state.odometry.doubt:
            explanation["odometry"] = state.odometry.doubt
        return {**explanation, "plan": plan} if plan else explanation

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Begin a mission at ``pose`` (map frame; None: unknown): visit ``goals`` in order.

        Raises:
            InputError: a plugin refuses the mission.
            PluginCallError: a plugin fails, so the mission cannot begin.

        """
        self.guard.reset()
        with self.guard.watchdog.on_duty():
            self._start(pose, goals)

    def _start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        self.odometer.reset()
        if self.floor_odometry is not None:
            self.floor_odometry.reset()
        self.history.reset()
        self.trim.reset()
        self._forget()
        self._start_pose = pose
        self.growth.reset(pose)
        for stage in (
            self.vision,
            self.features,
            self.localizer,
            self.planner,
            self.controller,
            self.local_map,
            self.tracker,
            self.mofis,
            self.safety,
        ):
            stage.reset()
        self.features.set_map(self.topo_map)
        self.planner.start(self.topo_map, goals)
        self.timings.update(dict.fromkeys(TIMED, 0.0))

    def step(self, reading: SensorReading) -> Twist:
        """Run one control tick; return the twist to drive until the next reading."""
        self.guard.time = reading.time
        if self.guard.watchdog.active:
            return self._step(reading)
        with self.guard.watchdog.on_duty():
            return self._step(reading)

    def _step(self, reading: SensorReading) -> Twist:
        measured = self.odometer.update(reading.inertial, reading.encoders, self.verdict.twist)
        self.history.add(measured)
        self.trim.update(reading.encoders)
        with timed(self.timings, "safety"):
            self.safety.update(reading, measured, tuple(self.guard.failing.values()))
        reading = straight_reading(reading, self._lens)
        frame = ready_frame(reading.frame, self.robot, self._reduction, self.history)
        odometry = self._corrected(measured, frame)
        self._began = reading.time if self._began is None else self._began
        if frame is not None:
            self._decide(reading, frame, odometry)
        with timed(self.timings, "control"):
            twist = self.controller.control(self.state.command, odometry, self.period)
        with timed(self.timings, "safety"):
            self.verdict = self.safety.limit(twist, reading.time, odometry.pose)
        if self.safety.failure is not None:
            self.state = replace(self.state, fault=self.safety.failure)
        return self.trim.apply(self.verdict.twist)

    # --- once per camera frame, in the order of the paper's Fig. 2 -------------------------------

    def _decide(self, reading: SensorReading, frame: Frame, odometry: Odometry) -> None:
        """Perceive, localise, plan and decide; the result is the new state."""
        seen_from = self._corrected(self.history.at(frame.time))
        view, detections = self._perceive(reading, frame, seen_from)
        belief = self._localize(odometry, view.percept, detections)
        waypoint = self._plan(belief)
        finished = waypoint is None and not belief.lost
        command, idle = None, 0.0
        slower = why_slower(self.state.command, self.verdict, self.mofis)
        if not finished and not self._warming_up(reading.time):
            moving_obstacles = self._map(frame, view, odometry, seen_from.pose, belief)
            inputs = self._inputs(odometry, belief, waypoint, moving_obstacles)
            with timed(self.timings, "motion"):
                command = self.mofis.decide(inputs)
            idle = self.mofis.idle
            self._check_passages(odometry, belief)
        veto = self.verdict.reason if self.verdict.stopped else ""
        no_route = self.planner.no_route_reason
        self._progress.update(reading.time, belief, waypoint, idle, no_route, veto)
        counts = Counter(self.state.detection_counts)
        counts.update(detection.identity for detection in detections)
        self.state = StackState(
            time=reading.time,
            odometry=odometry,
            belief=belief,
            flows=view.flows,
            percept=view.percept or self.state.percept,
            moving_objects=view.moving_objects,
            stixels=view.stixels,
            waypoint=waypoint,
            path=self.planner.path,
            proposals=self.mofis.proposals,
            command=command,
            finished=finished,
            unsure=self._progress.unsure,
            stuck=self._progress.give_up_reason,
            veto=veto,
            sight=self.local_map.sight.judgement,
            slower=slower,
            notes=self.planner.notes,
            faults=tuple(str(fault) for fault in self.guard.faults),
            landmark_detections=detections,
            detection_counts=counts,
        )
        self.guard.starting = False
        if command is not None:
            self._decided = self.state

    def _corrected(self, measured: Odometry, frame: Frame | None = None) -> Odometry:
        """Odometry ``measured`` by wheels and gyro, corrected by the floor; ``frame`` is new."""
        if self.floor_odometry is None:
            return measured
        if frame is not None and self.safety.senses.seeing:
            self.floor_odometry.observe(frame, self.history.at(frame.time))
        return self.floor_odometry.corrected(measured)

    def _perceive(
        self, reading: SensorReading, frame: Frame, odometry: Odometry
    ) -> tuple[View, tuple[LandmarkDetection, ...]]:
        """Flow, OFFIS, moving objects, landmarks, the odometry's yaw; nothing from invalid frames.

        A frozen image has no flow, which would mean that everything is far away.
        """
        if not self.safety.senses.seeing:
            return View(), ()
        view = self.vision.process(frame, odometry)
        for correction in view.yaw_corrections:
            (self.floor_odometry or self.odometer).correct(correction)
        shown = reading.landmark_frame if self.features.plugin.landmark_frames else reading.frame
        if shown is None:
            return view, ()
        with timed(self.timings, "features"):
            return view, self.features.recognize(shown)

    def _localize(
        self,
        odometry: Odometry,
        percept: Percept | None,
        detections: Sequence[LandmarkDetection],
    ) -> Belief:
        if not self._localized:
            self.localizer.start(self.topo_map, self._start_pose, odometry)
            self._localized = True
        with timed(self.timings, "localizer"):
            belief = self.localizer.update(odometry, percept, detections)
            return self.growth.corrected(belief, odometry)

    def _plan(self, belief: Belief) -> Waypoint | None:
        """Return the waypoint to head for; None at the end, and as long as the robot is lost.

        From a pose that is a guess the planner would pass waypoints that the robot never reached.
        """
        with timed(self.timings, "planner"):
            if belief.lost:
                return None
            if self._passage_report is not None:
                self.planner.observe(self._passage_report)
                self._passage_report = None
            self.growth.hand_over(self.planner, belief.time)
            return self.planner.update(belief)

    def _map(
        self, frame: Frame, view: View, odometry: Odometry, seen_from: Pose, belief: Belief
    ) -> tuple[OccupiedDisc, ...]:
        """Update local map and tracks; the discs that bar only the path to the local goal.

        While no behaviour handles moving obstacles, the local map counts them as occupied.
        """
        occupied = self._observe(frame, view, odometry, seen_from)
        self.growth.update(odometry, self.local_map, occupied, view.percept, seen_from, belief)
        if self.known_walls is not None:
            walls = self.known_walls.around(belief, odometry.pose)
            self.local_map.occupancy.set_walls(walls)
        self._percept = view.percept or self._percept
        self._flow = view.flows[-1] if view.flows else self._flow
        if self.mofis.handles_moving_obstacles:
            self.local_map.set_obstacles(())
            return occupied
        self.local_map.set_obstacles(occupied)
        return ()

    def _observe(
        self, frame: Frame, view: View, odometry: Odometry, seen_from: Pose
    ) -> tuple[OccupiedDisc, ...]:
        """Take the ``view`` into local map and tracks; return the tracks' discs."""
        with timed(self.timings, "motion"):
            if self.safety.senses.seeing:
                self.local_map.sight.observe_image(frame.image)
            self.local_map.update(odometry, view.percepts, view.stixels, seen_from, view.low_things)
        with timed(self.timings, "movers"):
            self.tracker.update(view.moving_objects, seen_from)
            self.tracker.prune(odometry.time, odometry.pose, self.local_map.occupancy.occupied_at)
            occupied = self.tracker.occupied_discs(odometry.time)
            self.local_map.forget_track(occupied)
        return occupied

    def _inputs(
        self,
        odometry: Odometry,
        belief: Belief,
        waypoint: Waypoint | None,
        moving_obstacles: tuple[OccupiedDisc, ...],
    ) -> DecisionInputs:
        with timed(self.timings, "movers"):
            conflicts = self.conflicts.predict(
                self.tracker.confirmed, odometry, self.mofis.commands.v, self.mofis.commands.w
            )
        return DecisionInputs(
            odometry,
            belief,
            waypoint,
            self._percept,
            self._flow,
            conflicts,
            moving_obstacles,
            self.verdict.twist,
        )

    def _check_passages(self, odometry: Odometry, belief: Belief) -> None:
        """Check the passages ahead; the planner receives the report at the next frame."""
        queries = tuple if belief.lost else lambda: self.planner.queries
        with timed(self.timings, "motion"):
            self._passage_report = self.local_map.passage_report(queries, odometry, belief)

    def _warming_up(self, time: float) -> bool:
        return self._began is None or time - self._began < self.resolved.settings.warmup
