"""Which two frames show what moves by itself: those a moment apart, whatever way the robot came."""

from __future__ import annotations

from collections import deque

from navfw.egomotion.pairing import PairingParams, PosedFrame
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Odometry

__all__ = ["RecentFrames"]

LAPSE = 0.2
"""Time [s] between two frames in which what walks comes far enough to be told from what stands."""
NEAR_LAPSE = 0.1
"""The same for what is near, which would come too far in the image to be matched [s]."""
LONGEST_LAPSE = 0.4
"""What has gone on for longer [s] looks too different."""
LARGEST_TURN = 0.35
"""Frames a larger turn [rad] apart show too little in common."""


class RecentFrames:
    """Keeps the frames of the last moment and pairs the newest with one of them.

    Of ``params`` only the errors of gyro and wheels count.
    """

    def __init__(self, robot: RobotModel, params: PairingParams | None = None) -> None:
        self.params = PairingParams() if params is None else params
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._frames: deque[PosedFrame] = deque()

    def add(self, frame: Frame, odometry: Odometry) -> None:
        """Take in the newest ``frame`` with the odometry of (about) the same time."""
        now = PosedFrame.from_odometry(frame, odometry, self._robot)
        while self._frames and now.age(self._frames[0]) > LONGEST_LAPSE:
            self._frames.popleft()
        self._frames.append(now)

    def pair(self, near: bool = False) -> FramePair | None:
        """The newest frame with that of a moment ago: for what is ``near`` a shorter one.

        None if there is none, or if it shows too little of what is seen now.
        """
        lapse = NEAR_LAPSE if near else LAPSE
        if len(self._frames) < 2:
            return None
        *earlier, now = self._frames
        past = min(earlier, key=lambda past: abs(now.age(past) - lapse))
        if now.turn(past) > LARGEST_TURN:
            return None
        return now.pair(past, self._robot, self.params)
