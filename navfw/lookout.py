"""On the lookout for what moves by itself: from the frames of one camera to movers."""

from __future__ import annotations

from dataclasses import replace

from navfw.egomotion.odometer import Odometer
from navfw.egomotion.pairing import PairingParams
from navfw.egomotion.recent import RecentFrames
from navfw.flow.floor_aligned import FloorAlignedFlow
from navfw.flow.refinement import RefinementParams, refine
from navfw.offis.movers import direction_sigma, find_movers
from navfw.offis.vigilance import Vigilance
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Mover, Odometry

__all__ = ["Lookout"]

ASIDE = 0.05
"""Where the camera has gone farther to its side [m], what is at hand has gone too far to match."""

SMALL_CELLS = 25.0
"""So many of the small cells that movers are looked for in share one error of the flow."""


class Lookout:
    """Finds movers in the frames of ``robot``'s camera, one after the other.

    ``among_people`` every frame is searched closely, elsewhere only while something moves.
    """

    def __init__(
        self,
        robot: RobotModel,
        pairing: PairingParams,
        odometer: Odometer,
        among_people: bool = False,
    ) -> None:
        self._camera = robot.camera
        self._odometer = odometer
        self._frames = RecentFrames(robot, pairing)
        self._floor_aligned = FloorAlignedFlow(robot)
        self._vigilance = Vigilance(among_people)

    def reset(self) -> None:
        """Forget all frames."""
        self._frames.reset()
        self._vigilance.reset()

    def look(self, frame: Frame, odometry: Odometry) -> tuple[Mover, ...]:
        """What moves by itself in ``frame``, taken at (about) the time of ``odometry``."""
        if not self._floor_aligned.sees_floor:
            return ()
        self._frames.add(frame, odometry)
        if not self._vigilance.searches(frame.time):
            return ()
        pair, calm = self._pair(), self._vigilance.calm(frame.time)
        movers: tuple[Mover, ...] = ()
        if pair is not None and (not calm or self._search(pair, glance=True)):
            movers = self._search(pair)
        self._vigilance.saw(movers, frame.time)
        return movers

    def _pair(self) -> FramePair | None:
        """Two frames a moment apart; a shorter one where much moves through the image."""
        near = self._vigilance.near
        pair = self._frames.pair(near)
        if near or pair is None or abs(pair.motion.translation[0]) <= ASIDE:
            return pair
        return self._frames.pair(near=True)

    def _search(self, pair: FramePair, glance: bool = False) -> tuple[Mover, ...]:
        """What moves by itself between these frames."""
        flow = self._floor_aligned.compute(pair, glance)
        flow = replace(flow, motion=self._odometer.trusted(flow.motion))
        params = RefinementParams(
            direction_sigma=direction_sigma(flow.motion.baseline), overlap=SMALL_CELLS
        )
        camera = self._camera
        return find_movers(refine(flow, camera, params).apply(flow, camera), camera)
