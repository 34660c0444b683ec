"""Detection of moving objects and stixels in all views of the robot's lens.

Frames are paired over a fixed time, in which moving objects show (``FrameBuffer``: over a
distance). The search is the most expensive stage, so it runs on a schedule.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from navfw.egomotion.pairing import PairingParams, PosedFrame, with_yaw_sigma
from navfw.egomotion.refinement import RefinementParams, refine
from navfw.flow.floor_aligned import FloorAlignedFlow
from navfw.movers.localization import locate_moving_objects, merge_views
from navfw.movers.motion_segmentation import crossing_cells, direction_sigma
from navfw.movers.stixels import find_stixels
from navfw.robot import RobotModel
from navfw.signals import FlowField, Frame, FramePair, MovingObject, Odometry, Stixels

_INTERVAL = 0.2  # chosen
"""Time between the frames of a pair [s]: a walking person moves far enough to be segmented."""
_NEAR_INTERVAL = 0.1  # chosen
"""Time [s] for near objects, whose image motion would otherwise leave the search range."""
_MAX_INTERVAL = 0.4  # chosen
"""Age [s] from which frames are dropped: images differ too much to be matched."""
_MAX_TURN = 0.35  # chosen
"""Largest turn between the frames of a pair [rad]: beyond it they share too little."""


class RecentFrames:
    """Keeps the frames of the last 0.4 s and pairs the newest with one of them.

    Of ``params`` only the errors of gyro and wheels are used.
    """

    def __init__(self, robot: RobotModel, params: PairingParams | None = None) -> None:
        self.params = PairingParams() if params is None else params
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Drop all frames."""
        self._frames: deque[PosedFrame] = deque()

    def add(self, frame: Frame, odometry: Odometry) -> None:
        """Add the newest ``frame`` with the odometry of (about) the same time."""
        now = PosedFrame.from_odometry(frame, odometry, self._robot)
        while self._frames and now.age(self._frames[0]) > _MAX_INTERVAL:
            self._frames.popleft()
        self._frames.append(now)

    def pair(self, near: bool = False) -> FramePair | None:
        """Pair the newest frame with one about 0.2 s older, or 0.1 s older for ``near`` objects.

        Returns None without an older frame, or if the robot turned by over 0.35 rad in between.
        """
        interval = _NEAR_INTERVAL if near else _INTERVAL
        if len(self._frames) < 2:
            return None
        *earlier, now = self._frames
        past = min(earlier, key=lambda past: abs(now.age(past) - interval))
        if now.turn(past) > _MAX_TURN:
            return None
        return now.pair(past, self._robot, self.params)


DetectionMode = Literal["full", "coarse", "idle"]
"""``full``: search the frame; ``coarse``: search it at low resolution first, and fully only if that
finds something; ``idle``: leave it out."""

QUIET_TIME = 2.0  # chosen
"""Time without a detection [s] after which frames are searched coarsely, and every other one
not."""
NEAR = 0.9  # chosen
"""Distance [m] below which moving objects are searched for over a shorter time between frames."""


class DetectionSchedule:
    """Decides how to search frames: all fully while something moves, else every other coarsely.

    The price is a delay of a few frames when an object enters the view. With ``always_full`` every
    frame is searched fully. Call ``next_mode`` before a search and ``update`` after it.
    """

    def __init__(self, always_full: bool = False) -> None:
        self._always_full = always_full
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first detection."""
        self._last_detection = -math.inf
        self._skipped = False
        self._nearest = math.inf

    @property
    def near(self) -> bool:
        """Whether the frame searched last showed a moving object nearer than 0.9 m."""
        return self._nearest < NEAR

    def next_mode(self, time: float) -> DetectionMode:
        """Decide how to search the next frame, of ``time`` [s]; call it once per frame."""
        quiet = not self._always_full and time - self._last_detection > QUIET_TIME
        self._skipped = quiet and not self._skipped
        if self._skipped:
            return "idle"
        return "coarse" if quiet else "full"

    def update(self, detections: Sequence[MovingObject], time: float) -> None:
        """Record what the search of the frame of ``time`` [s] has found."""
        if detections:
            self._last_detection = time
        self._nearest = min((detection.distance for detection in detections), default=math.inf)


_SIDEWAYS = 0.05  # chosen
"""Sideways displacement of the camera [m] beyond which near points leave the search range."""

_SHARED_ERRORS = 25.0  # chosen
"""Number of neighbouring cells of the dense flow that share one error: cells are small."""

_REFINEMENT = RefinementParams(overlap=_SHARED_ERRORS)


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

    def detect(
        self, frame: Frame, odometry: Odometry, whole: FlowField | None = None
    ) -> tuple[MovingObject, ...]:
        """Detect moving objects in ``frame``, if it is searched: if any cross in ``whole``."""
        self.flow = None
        if not self._floor_aligned.floor_visible:
            return ()
        self._frames.add(frame, odometry)
        mode = self._schedule.next_mode(frame.time)
        if mode != "full" and whole is not None and crossing_cells(whole, self.camera):
            mode = "full"
        if mode == "idle":
            return ()
        detections: tuple[MovingObject, ...] = ()
        pair = self._pair()
        if pair is not None and (mode == "full" or self._coarse_search(pair, odometry)):
            self.flow = self.dense_flow(pair, odometry)
            detections = locate_moving_objects(self.flow, self.camera, whole)
        self._schedule.update(detections, frame.time)
        return detections

    def dense_flow(self, pair: FramePair, odometry: Odometry, *, coarse: bool = False) -> FlowField:
        """Compute dense, refined, derotated flow of the lower image between a pair's frames."""
        flow = with_yaw_sigma(self._floor_aligned.compute(pair, coarse), odometry)
        params = replace(_REFINEMENT, direction_sigma=direction_sigma(flow.motion))
        return refine(flow, self.camera, params).apply(flow, self.camera)

    def _coarse_search(self, pair: FramePair, odometry: Odometry) -> bool:
        """Return whether anything is detected between these frames at low resolution."""
        flow = self.dense_flow(pair, odometry, coarse=True)
        return bool(locate_moving_objects(flow, self.camera))

    def _pair(self) -> FramePair | None:
        """Choose the pair of frames to search; over a shorter time where image motion is large."""
        near = self._schedule.near
        pair = self._frames.pair(near)
        if near or pair is None or abs(pair.motion.translation[0]) <= _SIDEWAYS:
            return pair
        return self._frames.pair(near=True)


_STIXEL_BASELINE = 0.05  # chosen
"""Baseline [m] from which the frames searched for moving objects also give stixels."""


class MultiViewDetector:
    """Detects moving objects in the camera's image and all side views, and stixels ahead.

    ``moving_objects`` and ``stixels`` switch on the detection of each.
    """

    def __init__(
        self, robot: RobotModel, pairing: PairingParams, *, moving_objects: bool, stixels: bool
    ) -> None:
        self._moving_objects = moving_objects
        self._stixels = stixels
        views = (robot, *(robot.with_camera(side) for side in robot.side_cameras))
        always_full = len(views) > 1 or stixels
        self._detectors = tuple(
            MovingObjectDetector(view, pairing, always_full=always_full)
            for view in views
            if moving_objects or stixels
        )
        self._cameras = tuple(detector.camera for detector in self._detectors)

    def reset(self) -> None:
        """Drop all frames."""
        for detector in self._detectors:
            detector.reset()

    def detect(
        self, frame: Frame, odometry: Odometry, whole: FlowField | None = None
    ) -> tuple[MovingObject, ...]:
        """Detect moving objects in all views, left to right, call it every frame."""
        images = (frame.image, *frame.sides)
        views = [
            detector.detect(Frame(frame.time, image), odometry, None if k else whole)
            for k, (detector, image) in enumerate(zip(self._detectors, images, strict=False))
        ]
        if not self._moving_objects:
            return ()
        return merge_views(views, self._cameras[: len(views)])

    def stixels(self, pairs: Sequence[FramePair], odometry: Odometry) -> Stixels | None:
        """Find the stixels of the frame given to ``detect`` last; None if unknown or switched off.

        They are found in the flow of the search for moving objects if its baseline is at least
        0.05 m, else in that of the first of ``pairs``.
        """
        if not self._stixels:
            return None
        ahead = self._detectors[0]
        flow = ahead.flow
        if flow is None or flow.motion.baseline < _STIXEL_BASELINE:
            flow = ahead.dense_flow(pairs[0], odometry) if pairs else None
        return None if flow is None else find_stixels(flow, ahead.camera)
