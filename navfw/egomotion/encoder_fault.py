"""Detection of failed wheel encoders: the drive is commanded to move, the count stands still."""

from __future__ import annotations

import math

from navfw.robot import RobotModel
from navfw.signals import Encoders, Twist

#: Least commanded rim speed [m/s] that counts as evidence: friction may stop a slower wheel.
_MIN_SPEED = 0.03
#: Commanded travel of the rim [m] without a tick from which on an encoder counts as silent.
SILENT = 0.03
#: Commanded travel of the rim [m] without a tick from which on a constant count no longer proves
#: that the wheel is at rest.
DOUBT = 0.01


class EncoderFaultDetector:
    """Compares the commanded motion of each wheel with the ticks of its encoder.

    A count that does not change while the wheel is commanded to turn means a failed encoder or a
    blocked wheel; the gyro can tell the two apart. A single tick clears the fault.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Return to the initial state: no command and no reading yet."""
        self._unanswered = [0.0, 0.0]
        self._last: Encoders | None = None

    def update(self, encoders: Encoders, commanded: Twist) -> None:
        """Process a new reading; ``commanded`` is the twist executed since the previous one."""
        last, self._last = self._last, encoders
        if last is None:
            return
        dt = encoders.time - last.time
        counted = (encoders.left - last.left, encoders.right - last.right)
        for index, speed in enumerate(self._robot.wheel_speeds(commanded)):
            way = abs(speed) * self._robot.wheel_radius
            if counted[index] != 0:
                self._unanswered[index] = 0.0
            elif way >= _MIN_SPEED and math.isfinite(way):
                self._unanswered[index] += way * dt

    @property
    def silent(self) -> tuple[bool, bool]:
        """Whether the encoder (left, right) has failed to count a commanded motion."""
        left, right = self._unanswered
        return left >= SILENT, right >= SILENT

    @property
    def doubtful(self) -> bool:
        """Whether either encoder may be silent, so that a constant count is no proof of rest."""
        return max(self._unanswered) >= DOUBT
