"""A whole stack for tests: chosen behaviours, and views by a script instead of camera images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from scripted_run import FakeSimulator

from navfw.config import find
from navfw.context import Context
from navfw.interfaces import Behavior, FeatureRecognizer, Localizer, Planner
from navfw.numerics import Image
from navfw.offis import Offis
from navfw.plugins import Registry, default_registry
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Encoders,
    Frame,
    Inertial,
    LandmarkDetection,
    MovingObject,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    Proposal,
    SensorReading,
    Twist,
    Waypoint,
)
from navfw.stack import Stack, load_stack
from navfw.stack.stackfile import Choice
from navfw.stack.vision import View, Vision
from navfw.testing.behavior_scenes import wall_flow
from navfw.topomap import Passage, Place, TopoMap

ROBOT = RobotModel()
START = Pose(0.0, 0.0, 0.0)
SHAPE = (ROBOT.camera.height, ROBOT.camera.width)
"""(rows, columns) of an image."""
RNG = np.random.default_rng(0)
GOAL = Waypoint(3.0, 0.0, 0.3, "goal", "goal", final=True)
LINE = TopoMap(
    "line",
    [Place("start", 0.0, 0.0), Place("goal", 3.0, 0.0)],
    [Passage("start", "goal", 3.0)],
)
"""A map of two places: the start at the origin, and a goal 3 m ahead."""

OFFIS = Offis(ROBOT)
Script = Callable[[Frame, Odometry], View]


def wall_view(time: float = 0.0) -> View:
    """Flow and percept of a wall 2 m ahead."""
    flow = wall_flow(ROBOT, time, 2.0, 20.0, 20.0)
    return View(flows=(flow,), percepts=(OFFIS.perceive(flow, Twist(0.3, 0.0)),))


def person_ahead(frame: Frame, odometry: Odometry) -> View:
    """A standing person straight ahead, 0.7 m from the camera."""
    person = MovingObject(frame.time, 0.0, 0.3, 0.7, np.zeros((2, 2)), np.zeros(2))
    return View(moving_objects=(person,))


@cache
def registry() -> Registry:
    """The registry with the behaviours that ship."""
    return default_registry()


class ScriptedVision(Vision):
    """Vision whose views come from a script; ``frames`` are those it was given."""

    def __init__(self, script: Script) -> None:
        self.script = script
        self.frames: list[Frame] = []

    def reset(self) -> None:
        self.frames.clear()

    def process(self, frame: Frame, odometry: Odometry) -> View:
        self.frames.append(frame)
        return self.script(frame, odometry)


class Idle(Behavior):
    """Desires and prohibits nothing."""

    name = "idle"

    def propose(self, context: Context) -> Proposal:
        nothing = context.commands.zeros()
        return Proposal(0.0, nothing, nothing, "nothing")


class Ahead(Idle):
    """Desires to drive straight on at full speed."""

    name = "ahead"

    def propose(self, context: Context) -> Proposal:
        commands = context.commands
        return Proposal(1.0, commands.around(1.0, 0.0), commands.zeros(), "straight on")


class RecordingPlanner(Planner):
    """Gives ``waypoint``, ``legs`` and ``reason``; records the beliefs and reports that it gets."""

    name = "recording_planner"

    def reset(self) -> None:
        self.waypoint: Waypoint | None = GOAL
        self.reason: str | None = None
        self.legs: tuple[PassageQuery, ...] = ()
        self.reports: list[PassageReport] = []
        self.beliefs: list[Belief] = []

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        pass

    def update(self, belief: Belief) -> Waypoint | None:
        self.beliefs.append(belief)
        return self.waypoint

    @property
    def path(self) -> Sequence[Waypoint]:
        return () if self.waypoint is None else (self.waypoint,)

    @property
    def queries(self) -> Sequence[PassageQuery]:
        return self.legs

    def observe(self, report: PassageReport) -> None:
        self.reports.append(report)

    @property
    def no_route_reason(self) -> str | None:
        return self.reason


class RecordingLocalizer(Localizer):
    """Takes the odometry for the pose; records what it gets. ``lost`` is set by a test."""

    name = "recording_localizer"

    def reset(self) -> None:
        self.lost = False
        self.starts: list[tuple[TopoMap, Pose | None, Odometry]] = []
        self.updates: list[tuple[Odometry, Percept | None, Sequence[LandmarkDetection]]] = []

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        self.starts.append((topo_map, pose, odometry))

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        self.updates.append((odometry, percept, detections))
        return Belief(odometry.time, odometry.pose, 1e-4 * np.eye(3), lost=self.lost)


class RecordingFeatures(FeatureRecognizer):
    """Gives the ``detections`` that a test sets; records the frames that it gets."""

    name = "recording_features"

    def reset(self) -> None:
        self.detections: tuple[LandmarkDetection, ...] = ()
        self.frames: list[Frame] = []

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        self.frames.append(frame)
        return self.detections


def sample_stack(
    *behaviors: type[Behavior],
    script: Script = lambda frame, odometry: View(),
    overrides: Sequence[str] = (),
    stack: str = "default",
) -> Stack:
    """A started stack at START without warm-up, on its way to GOAL.

    ``behaviors`` replace those of the shipped ``stack``; without any it has one that is idle.
    """
    config = load_stack(find("stack", stack), registry(), ["warmup=0", *overrides])
    chosen = {plugin.name: Choice(plugin.name, plugin, plugin.Params()) for plugin in behaviors}
    config = replace(config, behaviors=chosen or {"idle": Choice("idle", Idle, Idle.Params())})
    built = Stack(config, ROBOT, LINE)
    built.vision = ScriptedVision(script)
    built.start(START, [GOAL])
    return built


def context_of(stack: Stack) -> Context:
    """The context of the stack's last decision."""
    assert stack.mofis.context is not None
    return stack.mofis.context


def drive(stack: Stack, seconds: float, simulator: FakeSimulator | None = None) -> FakeSimulator:
    """Step ``stack`` at its control rate; the simulator, with which to drive on."""
    simulator = simulator or FakeSimulator(START, ROBOT)
    for _ in range(round(seconds * ROBOT.control_rate)):
        twist = stack.step(simulator.read())
        simulator.drive(*ROBOT.wheel_speeds(twist))
        simulator.advance(1.0 / ROBOT.control_rate)
    return simulator


@dataclass
class Rig:
    """A stack whose planner, localiser and landmark recogniser are records."""

    stack: Stack = field(default_factory=lambda: sample_stack(Idle))
    planner: RecordingPlanner = field(default_factory=lambda: RecordingPlanner(ROBOT))
    localizer: RecordingLocalizer = field(default_factory=lambda: RecordingLocalizer(ROBOT))
    features: RecordingFeatures = field(default_factory=lambda: RecordingFeatures(ROBOT))

    def __post_init__(self) -> None:
        self.stack.planner.plugin, self.stack.localizer.plugin = self.planner, self.localizer
        self.stack.features.plugin = self.features
        self.stack.start(START, [GOAL])

    def step(
        self,
        time: float,
        image: Image | str | None = "noise",
        *,
        frame_time: float | None = None,
        landmark_frame: Frame | None = None,
        ticks: int = 0,
    ) -> Twist:
        """One control tick at ``time`` [s] of a robot whose wheels have turned by ``ticks``."""
        frame = None
        if image is not None:
            pixels = RNG.integers(0, 256, SHAPE, np.uint8) if isinstance(image, str) else image
            frame = Frame(time if frame_time is None else frame_time, pixels)
        return self.stack.step(
            SensorReading(
                time, Inertial(time, 0, 0, 0), Encoders(time, ticks, ticks), frame, landmark_frame
            )
        )
