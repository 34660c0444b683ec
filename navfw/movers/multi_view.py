"""Moving objects and stixels from all views of the robot's lens."""

from __future__ import annotations

from collections.abc import Sequence

from navfw.egomotion.pairing import PairingParams
from navfw.movers.detector import MovingObjectDetector
from navfw.movers.stixels import find_stixels
from navfw.movers.view_merging import merge_views
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, MovingObject, Odometry, Stixels

_STIXEL_BASELINE = 0.05
"""Baseline [m] from which the frames searched for moving objects also give stixels."""


class MultiViewDetector:
    """One detector for the camera's image, and one for each side view.

    ``moving_objects`` and ``stixels`` say what is wanted of it.
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

    def detect(self, frame: Frame, odometry: Odometry) -> tuple[MovingObject, ...]:
        """Moving objects in all views of ``frame``, left to right; call it for every frame."""
        images = (frame.image, *frame.sides)
        views = [
            detector.detect(Frame(frame.time, image), odometry)
            for detector, image in zip(self._detectors, images, strict=False)
        ]
        if not self._moving_objects:
            return ()
        return merge_views(views, self._cameras[: len(views)])

    def stixels(self, pairs: Sequence[FramePair], odometry: Odometry) -> Stixels | None:
        """Stixels of the frame given to ``detect`` last; None if unknown, or not wanted.

        They take the flow of the search for moving objects where its baseline is long enough, else
        that of the first of ``pairs``.
        """
        if not self._stixels:
            return None
        ahead = self._detectors[0]
        flow = ahead.flow
        if flow is None or flow.motion.baseline < _STIXEL_BASELINE:
            flow = ahead.dense_flow(pairs[0], odometry) if pairs else None
        return None if flow is None else find_stixels(flow, ahead.camera)
