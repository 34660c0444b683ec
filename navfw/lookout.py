"""On the lookout for what moves by itself: from the frames of one camera to movers."""

from __future__ import annotations

from dataclasses import replace

from navfw.egomotion.odometer import Odometer
from navfw.egomotion.pairing import PairingParams
from navfw.egomotion.recent import RecentFrames
from navfw.flow.floor_aligned import FloorAlignedFlow
from navfw.flow.refinement import RefinementParams, refine
from navfw.offis.movers import direction_sigma, find_movers
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Mover, Odometry

__all__ = ["Lookout"]

NEAR = 0.9
"""Movers nearer than this [m] are looked for over a shorter time."""

ASIDE = 0.05
"""Where the camera has gone farther to its side [m], what is at hand has gone too far to match."""

SMALL_CELLS = 25.0
"""So many of the small cells that movers are looked for in share one error of the flow."""


class Lookout:
    """Finds movers in the frames of ``robot``'s camera, one after the other."""

    def __init__(self, robot: RobotModel, pairing: PairingParams, odometer: Odometer) -> None:
        self._camera = robot.camera
        self._odometer = odometer
        self._frames = RecentFrames(robot, pairing)
        self._floor_aligned = FloorAlignedFlow(robot)
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._frames.reset()
        self._near = False

    def look(self, frame: Frame, odometry: Odometry) -> tuple[Mover, ...]:
        """What moves by itself in ``frame``, taken at (about) the time of ``odometry``."""
        if not self._floor_aligned.sees_floor:
            return ()
        self._frames.add(frame, odometry)
        pair = self._pair()
        self._near = False
        if pair is None:
            return ()
        flow = self._floor_aligned.compute(pair)
        flow = replace(flow, motion=self._odometer.trusted(flow.motion))
        params = RefinementParams(
            direction_sigma=direction_sigma(flow.motion.baseline), overlap=SMALL_CELLS
        )
        camera = self._camera
        movers = find_movers(refine(flow, camera, params).apply(flow, camera), camera)
        self._near = any(mover.distance < NEAR for mover in movers)
        return movers

    def _pair(self) -> FramePair | None:
        """Two frames a moment apart; a shorter one where much moves through the image."""
        pair = self._frames.pair(near=self._near)
        if self._near or pair is None or abs(pair.motion.translation[0]) <= ASIDE:
            return pair
        return self._frames.pair(near=True)
