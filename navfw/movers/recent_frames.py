"""Pairs of frames over a fixed time, in which moving objects show (``FrameBuffer``: over a way)."""

from __future__ import annotations

from collections import deque

from navfw.egomotion.pairing import PairingParams, PosedFrame
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Odometry

INTERVAL = 0.2
"""Time between the frames of a pair [s]: a walking person moves far enough to be segmented."""
_NEAR_INTERVAL = 0.1
"""The same for near objects [s], whose image motion would leave the search range."""
_MAX_INTERVAL = 0.4
"""Age [s] from which frames are dropped: images differ too much to be matched."""
_MAX_TURN = 0.35
"""Largest turn between the frames of a pair [rad]: beyond it they share too little."""


class RecentFrames:
    """Keeps the frames of the last _MAX_INTERVAL s and pairs the newest with one of them.

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
        """The newest frame with one INTERVAL s older, or _NEAR_INTERVAL s for ``near`` objects.

        None if there is none, or if the robot has turned too far in between.
        """
        interval = _NEAR_INTERVAL if near else INTERVAL
        if len(self._frames) < 2:
            return None
        *earlier, now = self._frames
        past = min(earlier, key=lambda past: abs(now.age(past) - interval))
        if now.turn(past) > _MAX_TURN:
            return None
        return now.pair(past, self._robot, self.params)
