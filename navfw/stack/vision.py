"""From camera frames to a view: frames made ready, pairs, flow, percepts, moving objects.

Frames are made straight, reduced, and made level where the body rocks: all that is known of the
floor, of heights and of bearings supposes a level camera of fixed pitch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from navfw import signals
from navfw.camera_geometry.image_reduction import reduce_frame
from navfw.camera_geometry.rotations import derotate
from navfw.egomotion.odometer import OdometryHistory
from navfw.egomotion.pairing import FrameBuffer, pitch_rotation, with_yaw_sigma
from navfw.egomotion.refinement import refine
from navfw.flow.grid_flow import above_horizon, align_past, with_shutter_sigma
from navfw.guard.guarded_stages import GuardedFlow, GuardedPerception
from navfw.lenses import Undistortion
from navfw.movers import MultiViewDetector
from navfw.movers.low_things import LowThings
from navfw.numerics import Array, Image
from navfw.numerics.products import product
from navfw.robot import CameraEffects, CameraModel, RobotModel
from navfw.stack.stackfile import StackSettings
from navfw.stack.stopwatch import timed


def straight_reading(
    reading: signals.SensorReading, lens: Undistortion | None
) -> signals.SensorReading:
    """Return ``reading`` with its frame undistorted, as a pinhole camera would show it.

    Without ``lens``, or with a frame of another size (the flow refuses it), it is returned
    unchanged. Side views and landmark frames are straight already.
    """
    frame = reading.frame
    if lens is None or frame is None or frame.image.shape != lens.shape:
        return reading
    return replace(reading, frame=replace(frame, image=lens.apply(frame.image)))


def ready_frame(
    frame: signals.Frame | None, robot: RobotModel, factor: int, history: OdometryHistory
) -> signals.Frame | None:
    """Reduce ``frame`` by ``factor`` and turn it as if the camera of ``robot`` were level.

    ``robot`` has reduced images; its body's pitch at the time of the frame is in ``history``.
    """
    if frame is None:
        return None
    frame = reduce_frame(frame, factor)
    pitch = history.at(frame.time).pitch
    if pitch == 0.0:
        return frame
    sides = zip(frame.sides, robot.side_cameras, strict=True)
    return signals.Frame(
        frame.time,
        _level(frame.image, robot.camera, pitch),
        tuple(_level(side, camera, pitch) for side, camera in sides),
    )


def _level(image: Image, camera: CameraModel, pitch: float) -> Image:
    """Warp ``image`` of a camera on a body of this pitch [rad] as if the body were level."""
    axes = camera.base_from_camera
    return align_past(image, product(axes.T, pitch_rotation(pitch), axes), camera)


@dataclass(frozen=True, slots=True)
class View:
    """What one frame shows, compared with earlier frames.

    ``flows`` are the derotated flow fields of all useful pairs and ``percepts`` what OFFIS makes of
    them; empty while the robot has not moved, and where the stage fails. ``moving_objects`` are
    detections in all views, ``stixels`` upright obstacles by image columns, ``low_things`` what
    ``LowThings.search`` found. ``yaw_corrections`` are for the odometer. ``percept`` is the newest
    of the percepts with any depth.
    """

    flows: tuple[signals.FlowField, ...] = ()
    percepts: tuple[signals.Percept, ...] = ()
    moving_objects: tuple[signals.MovingObject, ...] = ()
    stixels: signals.Stixels | None = None
    low_things: Array | None = None
    yaw_corrections: tuple[signals.YawCorrection, ...] = ()
    percept: signals.Percept | None = field(init=False)

    def __post_init__(self) -> None:
        seen = (percept for percept in reversed(self.percepts) if percept.sees_depth)
        object.__setattr__(self, "percept", next(seen, None))


MoverDetection = Callable[..., tuple[signals.MovingObject, ...]]
"""Detects the moving objects in a frame, by odometry of (about) its time and its derotated flow."""


class Vision:
    """Runs the stages flow and perception, with pairing before and derotation between them.

    ``detect`` detects moving objects; a simulation without rendering sets it to return the truth.
    """

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
        # only those of the simulated camera's effects stay as they were measured
        self._shutter = robot.camera_effects if robot.camera.calibration else CameraEffects()
        self._settings = settings
        self._frames = FrameBuffer(robot, settings.pairing)
        self._low_things = LowThings(robot)
        self._detector = MultiViewDetector(
            robot,
            settings.pairing,
            moving_objects=settings.movers.detect,
            stixels=settings.stixels and settings.floor_model and settings.derotate,
        )
        self.detect: MoverDetection = self._detector.detect

    def reset(self) -> None:
        """Drop all frames."""
        self._frames.reset()
        self.flow.reset()
        self.perception.reset()
        self._detector.reset()
        self._low_things.reset()

    def process(self, frame: signals.Frame, odometry: signals.Odometry) -> View:
        """Compare ``frame`` with earlier ones; ``odometry`` is of (about) the same time."""
        flows: list[signals.FlowField] = []
        percepts: list[signals.Percept] = []
        corrections: list[signals.YawCorrection] = []
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
            moving_objects = self.detect(frame, odometry, flows[-1] if flows else None)
            stixels = self._detector.stixels(self._frames.pairs(), odometry)
            metric = self._settings.floor_model and self._settings.derotate
            metric = metric and not self._settings.oracle  # its images may show nothing
            low_things = self._low_things.search(frame, odometry) if metric else None
        return View(
            *(tuple(flows), tuple(percepts), moving_objects, stixels, low_things),
            yaw_corrections=tuple(corrections),
        )

    def _derotated(
        self, flow: signals.FlowField, odometry: signals.Odometry
    ) -> tuple[signals.FlowField, signals.YawCorrection | None]:
        """Remove the rotational part of ``flow``; return it and the correction of the gyro's yaw.

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
        correction = signals.YawCorrection(refinement.yaw, refinement.yaw_sigma, flow.motion)
        return refinement.apply(flow, camera), correction
