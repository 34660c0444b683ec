"""Detection of moving objects in the frames of one camera."""

from __future__ import annotations

from dataclasses import replace

from navfw.egomotion.camera_motion import with_yaw_sigma
from navfw.egomotion.pairing import PairingParams
from navfw.egomotion.refinement import RefinementParams, refine
from navfw.flow.floor_aligned import FloorAlignedFlow
from navfw.movers.detection_schedule import DetectionSchedule
from navfw.movers.localization import locate_moving_objects
from navfw.movers.motion_segmentation import direction_sigma
from navfw.movers.recent_frames import RecentFrames
from navfw.robot import RobotModel
from navfw.signals import FlowField, Frame, FramePair, MovingObject, Odometry

SIDEWAYS = 0.05
"""Sideways displacement of the camera [m] beyond which near points leave the search range."""

SHARED_ERRORS = 25.0
"""Number of neighbouring cells of the dense flow that share one error: cells are small."""

_REFINEMENT = RefinementParams(overlap=SHARED_ERRORS)


class MovingObjectDetector:
    """Detects moving objects in the frames of ``robot``'s camera.

    With ``always_full`` every frame is searched fully, else by the detection schedule. ``flow`` is
    the dense, derotated flow of the image's lower part in the newest frame; None if that frame was
    not searched fully.
    """

    def __init__(
        self, robot: RobotModel, pairing: PairingParams, *, always_full: bool = False
    ) -> None:
        self.camera = robot.camera
        self._frames = RecentFrames(robot, pairing)
        self._floor_aligned = FloorAlignedFlow(robot)
        self._schedule = DetectionSchedule(always_full)
        self.flow: FlowField | None = None

    def reset(self) -> None:
        """Drop all frames."""
        self._frames.reset()
        self._schedule.reset()
        self.flow = None

    def detect(self, frame: Frame, odometry: Odometry) -> tuple[MovingObject, ...]:
        """The moving objects in ``frame``; ``odometry`` is of (about) the same time."""
        self.flow = None
        if not self._floor_aligned.floor_visible:
            return ()
        self._frames.add(frame, odometry)
        mode = self._schedule.next_mode(frame.time)
        if mode == "idle":
            return ()
        detections: tuple[MovingObject, ...] = ()
        pair = self._pair()
        if pair is not None and (mode == "full" or self._coarse_search(pair, odometry)):
            self.flow = self.dense_flow(pair, odometry)
            detections = locate_moving_objects(self.flow, self.camera)
        self._schedule.update(detections, frame.time)
        return detections

    def dense_flow(self, pair: FramePair, odometry: Odometry, *, coarse: bool = False) -> FlowField:
        """Dense flow of the lower image between the frames of ``pair``, refined and derotated."""
        flow = with_yaw_sigma(self._floor_aligned.compute(pair, coarse), odometry)
        params = replace(_REFINEMENT, direction_sigma=direction_sigma(flow.motion))
        return refine(flow, self.camera, params).apply(flow, self.camera)

    def _coarse_search(self, pair: FramePair, odometry: Odometry) -> bool:
        """Whether anything is detected between these frames at low resolution."""
        flow = self.dense_flow(pair, odometry, coarse=True)
        return bool(locate_moving_objects(flow, self.camera))

    def _pair(self) -> FramePair | None:
        """The pair of frames to search; over a shorter time where image motion is large."""
        near = self._schedule.near
        pair = self._frames.pair(near)
        if near or pair is None or abs(pair.motion.translation[0]) <= SIDEWAYS:
            return pair
        return self._frames.pair(near=True)
