"""From camera frames to a view: frame pairs, flow, derotation, percepts, moving objects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from navfw.camera_geometry.rotations import derotate
from navfw.egomotion.camera_motions import with_yaw_sigma
from navfw.egomotion.pairing import FrameBuffer
from navfw.egomotion.refinement import refine
from navfw.flow.confidence import with_shutter_sigma
from navfw.flow.grid_flow import above_horizon
from navfw.guard.guarded_stages import GuardedFlow, GuardedPerception
from navfw.movers import MultiViewDetector
from navfw.robot import CameraEffects, RobotModel
from navfw.signals import FlowField, Frame, MovingObject, Odometry, Percept, Stixels, YawCorrection
from navfw.stack.stackfile import StackSettings
from navfw.stack.stopwatch import timed


@dataclass(frozen=True, slots=True)
class View:
    """What one frame shows, compared with earlier frames.

    ``flows`` are the derotated flow fields of all useful pairs and ``percepts`` what OFFIS makes of
    them; empty while the robot has not moved, and where the stage fails. ``moving_objects`` are
    detections in all views, ``stixels`` upright obstacles by image columns. ``yaw_corrections`` are
    for the odometer. ``percept`` is the newest of the percepts with any depth.
    """

    flows: tuple[FlowField, ...] = ()
    percepts: tuple[Percept, ...] = ()
    moving_objects: tuple[MovingObject, ...] = ()
    stixels: Stixels | None = None
    yaw_corrections: tuple[YawCorrection, ...] = ()
    percept: Percept | None = field(init=False)

    def __post_init__(self) -> None:
        seen = (percept for percept in reversed(self.percepts) if percept.sees_depth)
        object.__setattr__(self, "percept", next(seen, None))


class Vision:
    """The stages flow and perception, and what comes before and between them."""

    def __init__(
        self,
        robot: RobotModel,
        settings: StackSettings,
        flow: GuardedFlow,
        perception: GuardedPerception,
        timings: dict[str, float],
    ) -> None:
        self.flow = flow
        self.perception = perception
        self.timings = timings
        self._camera = robot.camera
        # those of the simulated camera's effects alone stay as they were measured
        self._shutter = robot.camera_effects if robot.camera.calibration else CameraEffects()
        self._settings = settings
        self._frames = FrameBuffer(robot, settings.pairing)
        self._detector = MultiViewDetector(
            robot,
            settings.pairing,
            moving_objects=settings.movers.detect,
            stixels=settings.stixels and settings.floor_model and settings.derotate,
        )

    def reset(self) -> None:
        """Drop all frames."""
        self._frames.reset()
        self.flow.reset()
        self.perception.reset()
        self._detector.reset()

    def process(self, frame: Frame, odometry: Odometry) -> View:
        """The view of ``frame``; ``odometry`` is of (about) the same time."""
        flows: list[FlowField] = []
        percepts: list[Percept] = []
        corrections: list[YawCorrection] = []
        self._frames.add(frame, odometry)
        for pair in self._frames.pairs():
            with timed(self.timings, "flow"):
                computed = self.flow.compute(pair)
                if computed is None:
                    continue
                if self._shutter.shutter_time > 0.0:
                    computed = with_shutter_sigma(computed, self._shutter, self._camera.height)
                flow, correction = self._derotated(computed, odometry)
            with timed(self.timings, "perception"):
                percept = self.perception.perceive(flow, odometry.twist)
            flows.append(flow)
            if percept is not None:
                percepts.append(percept)
            if correction is not None:
                corrections.append(correction)
        with timed(self.timings, "movers"):
            moving_objects = self._detector.detect(frame, odometry)
            stixels = self._detector.stixels(self._frames.pairs(), odometry)
        return View(tuple(flows), tuple(percepts), moving_objects, stixels, tuple(corrections))

    def _derotated(
        self, flow: FlowField, odometry: Odometry
    ) -> tuple[FlowField, YawCorrection | None]:
        """``flow`` without its rotational part, and the yaw by which the gyro was refined.

        With ``derotate: false`` all flow counts as translational, as for a robot without a gyro;
        with ``floor_model: false`` only the flow above the horizon is kept.
        """
        camera, settings = self._camera, self._settings
        if not settings.floor_model:
            flow = above_horizon(flow, camera)
        if not settings.derotate:
            return replace(flow, derotated=True), None
        if not settings.refine:
            return derotate(flow, camera), None
        flow = with_yaw_sigma(flow, odometry)
        refinement = refine(flow, camera)
        correction = YawCorrection(refinement.yaw, refinement.yaw_sigma, flow.motion)
        return refinement.apply(flow, camera), correction
