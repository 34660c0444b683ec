"""From camera frames to what they show: pairs of frames, flow, OFFIS' percepts, and movers."""

from __future__ import annotations

from dataclasses import dataclass, replace

from navfw.egomotion.odometer import Odometer
from navfw.egomotion.pairing import FrameBuffer
from navfw.flow.derotation import derotate
from navfw.flow.horizon import above_horizon
from navfw.flow.refinement import refine
from navfw.interfaces import FlowProcessor, Perception
from navfw.movers.detector import MovingObjectDetector
from navfw.movers.stixels import find_stixels
from navfw.movers.view_merging import merge_views
from navfw.robot import RobotModel
from navfw.signals import FlowField, Frame, MovingObject, Odometry, Percept, Stixels
from navfw.stackfile import StackConfig
from navfw.stopwatch import timed

__all__ = ["View", "Vision"]

FAR_ENOUGH = 0.05
"""Baseline [m] from which the frames that movers are looked for in show standing things, too."""


@dataclass(frozen=True, slots=True)
class View:
    """What one frame shows, held against those before it.

    ``flows`` are the derotated flow fields of all useful pairs, ``percepts`` what OFFIS makes of
    each; none while the robot has not moved. ``movers`` move by themselves, ``standing`` is what
    stands in small columns.
    """

    flows: tuple[FlowField, ...] = ()
    percepts: tuple[Percept, ...] = ()
    movers: tuple[MovingObject, ...] = ()
    standing: Stixels | None = None

    @property
    def percept(self) -> Percept | None:
        """The newest percept that knows any depth."""
        return next((p for p in reversed(self.percepts) if p.sees_depth), None)


class Vision:
    """The stages flow and perception, and what goes on before and between them."""

    def __init__(
        self,
        robot: RobotModel,
        config: StackConfig,
        flow: FlowProcessor,
        perception: Perception,
        odometer: Odometer,
        timings: dict[str, float],
    ) -> None:
        self.flow = flow
        self.perception = perception
        self.timings = timings
        self._robot = robot
        self._config = config
        self._odometer = odometer
        self._frames = FrameBuffer(robot, config.pairing)
        self._stands = config.standing and config.floor_model and config.derotate
        eyes = (robot, *(robot.with_camera(side) for side in robot.side_cameras))
        self._lookouts = tuple(
            MovingObjectDetector(
                eye, config.pairing, odometer, closely=len(eyes) > 1 or self._stands
            )
            for eye in eyes
            if config.movers or self._stands
        )
        self._cameras = tuple(lookout.camera for lookout in self._lookouts)

    def reset(self) -> None:
        """Forget all frames."""
        self._frames.reset()
        self.flow.reset()
        self.perception.reset()
        for lookout in self._lookouts:
            lookout.reset()

    def look(self, frame: Frame, odometry: Odometry) -> View:
        """What ``frame`` shows, taken at (about) the time of ``odometry``."""
        flows: list[FlowField] = []
        percepts: list[Percept] = []
        self._frames.add(frame, odometry)
        for pair in self._frames.pairs():
            with timed(self.timings, "flow"):
                flow = self._derotated(self.flow.compute(pair))
            with timed(self.timings, "perception"):
                percepts.append(self.perception.perceive(flow, odometry.twist))
            flows.append(flow)
        with timed(self.timings, "movers"):
            movers = self._movers(frame, odometry)
            standing = self._standing() if self._stands else None
        return View(tuple(flows), tuple(percepts), movers, standing)

    def _movers(self, frame: Frame, odometry: Odometry) -> tuple[MovingObject, ...]:
        """What moves by itself, ahead and in the side views."""
        images = (frame.image, *frame.sides)
        views = [
            lookout.look(Frame(frame.time, image), odometry)
            for lookout, image in zip(self._lookouts, images, strict=False)
        ]
        if not self._config.movers:
            return ()
        return merge_views(views, self._cameras[: len(views)])

    def _standing(self) -> Stixels | None:
        """What stands in the newest frame, in small columns."""
        ahead = self._lookouts[0]
        flow = ahead.flow
        if flow is None or flow.motion.baseline < FAR_ENOUGH:
            # too little way since a moment ago to tell distances by
            pairs = self._frames.pairs()
            flow = ahead.aligned(pairs[0]) if pairs else None
        return None if flow is None else find_stixels(flow, self._robot.camera)

    def _derotated(self, flow: FlowField) -> FlowField:
        """``flow`` without its rotational part, the gyro's word refined by the flow itself.

        A stack that says ``derotate: false`` takes all of it for translation, as a robot without a
        gyro would; one that says ``floor_model: false`` looks above the horizon only.
        """
        camera = self._robot.camera
        if not self._config.floor_model:
            flow = above_horizon(flow, camera)
        if not self._config.derotate:
            return replace(flow, derotated=True)
        if not self._config.refine:
            return derotate(flow, camera)
        flow = replace(flow, motion=self._odometer.trusted(flow.motion))
        refinement = refine(flow, camera)
        self._odometer.contradict(refinement.yaw, flow.motion)
        return refinement.apply(flow, camera)
