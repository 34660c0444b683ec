"""A real camera's lens and image sensor: vignetting, exposure control, JPEG compression."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from navfw.numerics.functions import arccos
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.robot.camera_effects import CameraEffects
from navfw.signals import Array, Image

_MIN_EXPOSURE = 1.0 / 256.0
"""Shortest exposure that the control sets, as a share of the longest one."""
_DARKEST = 0.5
"""Mean grey value below which an image counts as black."""


class ImageSensor:
    """The state of the exposure, and what lens and sensor do to images; without effects nothing.

    Grey values are proportional to the light. The control's ``level`` is the amount of light
    relative to the longest exposure: below 1 the exposure is shorter, above 1 it is amplified. At
    the first frame the control has settled, since the camera was on before.
    """

    def __init__(self, effects: CameraEffects) -> None:
        self._effects = effects
        self._control = effects.auto_exposure
        self._level = 1.0
        self._metered: float | None = None

    @property
    def exposure_time(self) -> float:
        """For how long [s] every row of the next image is exposed."""
        return self._effects.exposure_time * min(1.0, self._level)

    @property
    def gain(self) -> float:
        """Amplification of the next image and its noise, at least 1."""
        return max(1.0, self._level)

    def settle(self, clean: Image, falloff: Array | None) -> None:
        """Set the exposure for the scene of the first image ``clean`` (height, width)."""
        if self._control is None or self._metered is not None:
            return
        light = clean.astype(np.float32) if falloff is None else clean * falloff
        self._set(self._control.target / max(float(light.mean()), _DARKEST))

    def expose(self, clean: Image, falloff: Array | None) -> Image:
        """The image (height, width) of the light ``clean``; ``falloff`` is that of the lens."""
        if falloff is None and self._level == 1.0:
            return clean
        light = self._level * (clean if falloff is None else clean * falloff)
        return np.rint(np.minimum(light, 255.0)).astype(np.uint8)

    def meter(self, image: Image, time: float) -> None:
        """Adjust the exposure to the image (height, width) delivered at ``time`` [s]."""
        if self._control is not None and self._metered is not None:
            follow = 1.0 - math.exp(-(time - self._metered) / self._control.time)
            mean = max(float(image.mean()), _DARKEST)
            self._set(self._level * (self._control.target / mean) ** follow)
        self._metered = time

    def _set(self, level: float) -> None:
        most = 1.0 if self._control is None else self._control.max_gain
        self._level = min(max(level, _MIN_EXPOSURE), most)

    def compress(self, image: Image) -> Image:
        """The image (height, width) after JPEG compression and decompression."""
        quality = self._effects.jpeg_quality
        if quality is None:
            return image
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        decoded = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
        return np.asarray(decoded, dtype=np.uint8)


def light_falloff(
    share: float, lens: Sequence[CameraModel], views: Sequence[CameraModel]
) -> Array | None:
    """Light that reaches each pixel of ``views`` side by side (height, sum of widths), 0 to 1.

    1 - ``share`` (a / a_max)^2 at the angle a from the optical axis; a_max is that of the farthest
    corner of ``lens``, the images through it, whose first one is about the optical axis. None if
    nothing is lost.
    """
    if share == 0.0:
        return None
    axis = lens[0].base_from_camera[:, 2]
    widest = max(float(_angles(view, axis).max()) for view in lens)
    angles = np.concatenate([_angles(view, axis) for view in views], axis=1)
    left: Array = np.maximum(1.0 - share * np.square(angles / widest), 0.0)
    return left.astype(np.float32)


def _angles(view: CameraModel, axis: Array) -> Array:
    """Angle [rad] of each pixel's ray (height, width) from the direction ``axis`` in base_link."""
    x = (np.arange(view.width) - 0.5 * (view.width - 1)) / view.focal
    y = (np.arange(view.height) - 0.5 * (view.height - 1)) / view.focal
    rays = np.stack([*np.meshgrid(x, y), np.ones((view.height, view.width))], axis=-1)
    along = product(rays, view.base_from_camera.T, axis) / np.linalg.norm(rays, axis=-1)
    angles: Array = arccos(np.clip(along, -1.0, 1.0))
    return angles
