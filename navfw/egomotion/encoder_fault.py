"""Encoders that do not answer: wheels that were told to turn, and are not counted."""

from __future__ import annotations

import math

from navfw.robot import RobotModel
from navfw.signals import Encoders, Twist

__all__ = ["EncoderFaultDetector"]

#: Rim speeds below this [m/s] may well come to nothing: they prove no fault.
LEAST_SPEED = 0.03
#: Way [m] of the rim asked for without a single mark counted: the encoder is silent.
SILENT = 0.03
#: Way [m] from which there is doubt whether a wheel that seems to rest does.
DOUBT = 0.01


class EncoderFaultDetector:
    """Compares what was asked of each wheel with what its encoder counts.

    A count that stands still although the wheel was told to turn means a dead encoder, or a wheel
    that cannot turn: which of them, the gyro may tell. One mark counted, and all is well again.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Nothing asked, nothing heard."""
        self._unanswered = [0.0, 0.0]
        self._last: Encoders | None = None

    def update(self, encoders: Encoders, commanded: Twist) -> None:
        """Take note of a count, ``asked`` being what was driven since the last one."""
        last, self._last = self._last, encoders
        if last is None:
            return
        dt = encoders.time - last.time
        counted = (encoders.left - last.left, encoders.right - last.right)
        for index, speed in enumerate(self._robot.wheel_speeds(commanded)):
            way = abs(speed) * self._robot.wheel_radius
            if counted[index] != 0:
                self._unanswered[index] = 0.0
            elif way >= LEAST_SPEED and math.isfinite(way):
                self._unanswered[index] += way * dt

    @property
    def silent(self) -> tuple[bool, bool]:
        """Whether the encoders (left, right) say nothing."""
        left, right = self._unanswered
        return left >= SILENT, right >= SILENT

    @property
    def doubtful(self) -> bool:
        """Whether one of them may be silent: that it does not count is then no proof of rest."""
        return max(self._unanswered) >= DOUBT
