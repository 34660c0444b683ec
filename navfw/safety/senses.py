"""Validity of the sensors: the age of the last valid reading of each."""

from __future__ import annotations

import cv2
import numpy as np

from navfw.signals import Frame, Image, Odometry, SensorReading, wrap_angle

_DARK, BRIGHT = 8.0, 247.0
"""Mean grey levels below and above which an image is invalid."""
_FLAT = 2.5
"""Standard deviation [grey levels] below which an image has no contrast (noise alone has some)."""
MOVED = (0.02, 0.035)
"""Displacement [m] and turn [rad] after which an unchanged image is frozen."""
MOVED_SLIGHTLY = 0.002
"""Displacement [m] or turn [rad] after which an unchanged image is not used for flow."""


class Senses:
    """The age [s] of the last valid reading of each sensor.

    A frame is invalid if it is missing, dark, over-exposed, without contrast, or equal to the one
    before although the robot has moved. A gyro or encoder reading with an old time stamp is
    invalid. A frame's age counts from its own time stamp, however late it arrives.

    ``seeing`` tells whether the newest frame may be used for flow: the slightest motion must change
    an image, although only a clear one counts as ``trouble``.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Back to the start of a run."""
        self.camera_age = 0.0
        self.gyro_age = 0.0
        self.encoder_age = 0.0
        self.silence = 0.0
        self._last_count = 0.0
        self.trouble = ""
        self.seeing = True
        self._began: float | None = None
        self._last_useful: float | None = None
        self._image: Image | None = None
        self._displacement = 0.0
        self._turn = 0.0
        self._pose: Odometry | None = None

    def update(self, reading: SensorReading, odometry: Odometry) -> None:
        """Take in one reading, and the ``odometry`` made of it."""
        time = reading.time
        if self._began is None:
            self._began = self._last_useful = self._last_count = time
        self.gyro_age = time - reading.inertial.time
        self.encoder_age = time - reading.encoders.time
        if not odometry.silent:
            self._last_count = time
        self.silence = time - self._last_count
        self._move(odometry)
        if reading.frame is not None:
            self.trouble = self._fault_of(reading.frame)
            self.seeing = (
                not self.trouble
                and self._displacement <= MOVED_SLIGHTLY
                and self._turn <= MOVED_SLIGHTLY
            )
            if not self.trouble:
                self._last_useful = reading.frame.time
        last = self._last_useful if self._last_useful is not None else time
        self.camera_age = time - last

    def _move(self, odometry: Odometry) -> None:
        if self._pose is not None:
            before, now = self._pose.pose, odometry.pose
            ahead, aside = before.to_local(now.x, now.y)
            self._displacement += abs(ahead) + abs(aside)
            self._turn += abs(wrap_angle(now.yaw - before.yaw))
        self._pose = odometry

    def _fault_of(self, frame: Frame) -> str:
        """Why ``frame`` is invalid; an empty text if it is valid."""
        image = frame.image
        # every fourth pixel is enough for mean and spread
        mean, spread = (value.item() for value in cv2.meanStdDev(image[::4, ::4]))
        if mean < _DARK:
            return "the camera image is dark"
        if mean > BRIGHT:
            return "the camera is over-exposed"
        if spread < _FLAT:
            return "the camera image has no contrast"
        moved = self._displacement > MOVED[0] or self._turn > MOVED[1]
        frozen = self._image is not None and np.array_equal(image, self._image)
        if frozen and moved:
            return "the camera image is frozen"
        if not frozen:
            self._image, self._displacement, self._turn = image, 0.0, 0.0
        return ""
