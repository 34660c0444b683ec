"""Convert images of a real camera to those of the robot's pinhole camera: grey and straight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from navfw.errors import ConfigError, InputError
from navfw.lenses import Undistortion
from navfw.lenses.camera_info import info_text, info_undistortion
from navfw.numerics import Image
from navfw.recording import ros_image
from navfw.robot import CameraModel

_SHAPE = 0.01
"""Relative difference of the shape of an image from that of the robot's camera that is allowed."""
_SAME = 0.005
"""Largest shift of pixels by a lens, as a share of the width, that is not corrected."""


class CameraImages:
    """Converts the images on the topic ``name`` to those of the robot's ``camera``.

    If a ``CameraInfo`` describes their lens, they are straightened to the view of the robot file.
    ``note`` is called with remarks for people.
    """

    def __init__(self, camera: CameraModel, name: str, note: Callable[[str], object]) -> None:
        self._camera, self._name, self._note = camera, name, note
        self._info = self._topic = ""
        self._shape: tuple[int, ...] = ()
        self._lens: Undistortion | None = None

    def describe(self, topic: str, info: Any) -> None:
        """Take the ``CameraInfo`` that came on ``topic``; later images are straightened by it."""
        text = info_text(info, self._name)
        if text == self._info or not info.width:
            return
        self._info, self._topic, self._shape = text, topic, ()

    @property
    def described(self) -> bool:
        """Whether a ``CameraInfo`` has come."""
        return bool(self._info)

    def taken(self, grey: Image) -> Image:
        """Return ``grey`` (height, width) as the robot's camera would take it.

        Raises:
            ConfigError: it has another shape.

        """
        if grey.shape != self._shape:
            self._shape = grey.shape
            self._lens = self._fitting() if self._info else None
        camera = self._camera
        if self._lens is not None:
            grey = self._lens.apply(grey)
        height, width = grey.shape
        if (width, height) == (camera.width, camera.height):
            return grey
        if abs(width * camera.height / (height * camera.width) - 1.0) > _SHAPE:
            what = f"images of {width} x {height} have another shape than those of the robot's"
            how = "give a robot file with its camera"
            raise ConfigError(f"{what} camera, {camera.width} x {camera.height}: {how}")
        size = camera.width, camera.height
        return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def _fitting(self) -> Undistortion | None:
        """Return the object that straightens the images; None if there is none, or no need."""
        if self._camera.calibration is not None:
            self._note(f"the robot file's calibration is used, not {self._topic}")
            return None
        height, width = self._shape
        try:
            lens = info_undistortion(self._info, self._topic, width, height, self._camera.hfov)
        except InputError as error:
            reason = str(error).partition(";")[0]
            self._note(f"{self._topic} is not used, the robot file's camera is: {reason}")
            return None
        if lens.shift <= _SAME * width:
            return None
        for note in lens.notes:
            self._note(note)
        return lens


def grey_image(message: Any, topic: str) -> Image:
    """Decode the luminance (height, width) of an image message; see ``ros_image``."""
    return np.asarray(cv2.cvtColor(ros_image(message, topic), cv2.COLOR_BGR2GRAY), dtype=np.uint8)
