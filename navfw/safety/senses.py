"""Which sensors can be believed right now: ages of their last useful word."""

from __future__ import annotations

import cv2
import numpy as np

from navfw.signals import Frame, Image, Odometry, SensorReading, wrap_angle

__all__ = ["Senses"]

DARK, BRIGHT = 8.0, 247.0
"""Mean grey levels beyond which a picture shows nothing."""
FLAT = 2.5
"""Standard deviation [grey levels] below which a picture shows nothing (noise alone has some)."""
MOVED = (0.02, 0.035)
"""Way [m] and turn [rad] after which a picture must have changed."""
STIRRED = 0.002
"""Way [m] or turn [rad] after which a picture that is still the same tells nothing new."""


class Senses:
    """Follows the readings and keeps how old [s] each sensor's last useful word is.

    A frame that is missing, dark, over-exposed, without contrast, or equal to the one before
    although the robot has moved is no useful word. A gyro or encoder reading that carries an old
    time stamp is none either. A frame is as old as its own time says, however late it comes.

    ``seeing`` is whether the newest frame may be looked at: already the slightest motion must
    change a picture, although only a clear one counts as trouble.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Nothing heard yet."""
        self.camera_age = 0.0
        self.gyro_age = 0.0
        self.encoder_age = 0.0
        self.silence = 0.0
        self._answered = 0.0
        self.trouble = ""
        self.seeing = True
        self._began: float | None = None
        self._last_useful: float | None = None
        self._picture: Image | None = None
        self._way = 0.0
        self._turn = 0.0
        self._pose: Odometry | None = None

    def hear(self, reading: SensorReading, odometry: Odometry) -> None:
        """Take note of one reading, made while ``odometry`` says how the robot moves."""
        time = reading.time
        if self._began is None:
            self._began = self._last_useful = self._answered = time
        self.gyro_age = time - reading.inertial.time
        self.encoder_age = time - reading.encoders.time
        if not odometry.silent:
            self._answered = time
        self.silence = time - self._answered
        self._move(odometry)
        if reading.frame is not None:
            self.trouble = self._fault_of(reading.frame)
            self.seeing = not self.trouble and self._way <= STIRRED and self._turn <= STIRRED
            if not self.trouble:
                self._last_useful = reading.frame.time
        last = self._last_useful if self._last_useful is not None else time
        self.camera_age = time - last

    def _move(self, odometry: Odometry) -> None:
        if self._pose is not None:
            before, now = self._pose.pose, odometry.pose
            ahead, aside = before.to_local(now.x, now.y)
            self._way += abs(ahead) + abs(aside)
            self._turn += abs(wrap_angle(now.yaw - before.yaw))
        self._pose = odometry

    def _fault_of(self, frame: Frame) -> str:
        """Why ``frame`` shows nothing new, or an empty text."""
        image = frame.image
        # every fourth pixel is plenty to tell light from dark
        mean, spread = (value.item() for value in cv2.meanStdDev(image[::4, ::4]))
        if mean < DARK:
            return "the camera sees only dark"
        if mean > BRIGHT:
            return "the camera is over-exposed"
        if spread < FLAT:
            return "the camera sees no contrast"
        moved = self._way > MOVED[0] or self._turn > MOVED[1]
        frozen = self._picture is not None and np.array_equal(image, self._picture)
        if frozen and moved:
            return "the camera's picture is frozen"
        if not frozen:
            self._picture, self._way, self._turn = image, 0.0, 0.0
        return ""
