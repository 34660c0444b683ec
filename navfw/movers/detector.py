"""On the lookout for what moves by itself: from the frames of one camera to movers."""

from __future__ import annotations

from dataclasses import replace

from navfw.egomotion.odometer import Odometer
from navfw.egomotion.pairing import PairingParams
from navfw.flow.floor_aligned import FloorAlignedFlow
from navfw.flow.refinement import RefinementParams, refine
from navfw.movers.detection_schedule import DetectionSchedule
from navfw.movers.localization import locate_moving_objects
from navfw.movers.motion_segmentation import direction_sigma
from navfw.movers.recent_frames import RecentFrames
from navfw.robot import RobotModel
from navfw.signals import FlowField, Frame, FramePair, MovingObject, Odometry

__all__ = ["MovingObjectDetector"]

ASIDE = 0.05
"""Where the camera has gone farther to its side [m], what is at hand has gone too far to match."""

SMALL_CELLS = 25.0
"""So many of the small cells that movers are looked for in share one error of the flow."""

_REFINEMENT = RefinementParams(overlap=SMALL_CELLS)


class MovingObjectDetector:
    """Finds movers in the frames of ``robot``'s camera, one after the other.

    ``closely`` every frame is searched, or else only while something moves. ``flow`` is what the
    newest frame was searched by, the dense flow of its lower part, derotated; None if it was not.
    """

    def __init__(
        self, robot: RobotModel, pairing: PairingParams, odometer: Odometer, closely: bool = False
    ) -> None:
        self.camera = robot.camera
        self._odometer = odometer
        self._frames = RecentFrames(robot, pairing)
        self._floor_aligned = FloorAlignedFlow(robot)
        self._vigilance = DetectionSchedule(closely)
        self.flow: FlowField | None = None

    def reset(self) -> None:
        """Forget all frames."""
        self._frames.reset()
        self._vigilance.reset()
        self.flow = None

    def look(self, frame: Frame, odometry: Odometry) -> tuple[MovingObject, ...]:
        """What moves by itself in ``frame``, taken at (about) the time of ``odometry``."""
        self.flow = None
        if not self._floor_aligned.floor_visible:
            return ()
        self._frames.add(frame, odometry)
        if not self._vigilance.searches(frame.time):
            return ()
        movers: tuple[MovingObject, ...] = ()
        pair = self._pair()
        if pair is not None and (not self._vigilance.calm(frame.time) or self._glance(pair)):
            self.flow = self.aligned(pair)
            movers = locate_moving_objects(self.flow, self.camera)
        self._vigilance.saw(movers, frame.time)
        return movers

    def aligned(self, pair: FramePair, glance: bool = False) -> FlowField:
        """Dense flow of the lower image, derotated."""
        flow = self._floor_aligned.compute(pair, glance)
        flow = replace(flow, motion=self._odometer.trusted(flow.motion))
        # a copy, for speed: nothing of it has to be checked again
        params = _REFINEMENT.model_copy(
            update={"direction_sigma": direction_sigma(flow.motion.baseline)}
        )
        return refine(flow, self.camera, params).apply(flow, self.camera)

    def _glance(self, pair: FramePair) -> bool:
        """Whether anything seems to move by itself between these frames."""
        return bool(locate_moving_objects(self.aligned(pair, glance=True), self.camera))

    def _pair(self) -> FramePair | None:
        """Two frames a moment apart; a shorter one where much moves through the image."""
        near = self._vigilance.near
        pair = self._frames.pair(near)
        if near or pair is None or abs(pair.motion.translation[0]) <= ASIDE:
            return pair
        return self._frames.pair(near=True)
