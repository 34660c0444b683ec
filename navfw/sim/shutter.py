"""What a real camera does to images: shutter and motion blur, lens, exposure control, JPEG.

A frame delivered at time t has its last row exposed until t and its first row until t minus the
readout time, as cameras give frames that are stamped on arrival. The scene is rendered from several
poses of that time, and each row is a mean of those within its exposure, so that near and far
surfaces move differently and edges cover what they hide. Walkers are drawn where they are at t: the
blur is that of the robot's own motion.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import cv2
import numpy as np

from navfw.numerics import Array, Image
from navfw.numerics.functions import arccos
from navfw.numerics.products import product
from navfw.robot import CameraEffects, CameraModel
from navfw.sim.camera import Camera, DepthImage
from navfw.sim.robot_body import BodyState

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


_MAX_POSES = 16
"""Limit of the number of poses rendered for one image."""
_NEAR = 0.5
"""Distance of near surfaces [m]: their motion in the image decides the number of poses."""
_NEGLIGIBLE = 0.1
"""Motion in the image [px] below which one pose is enough."""
_SAMPLES = 16
"""Number of moments of a row's exposure whose mean it is."""


class Shutter:
    """Renders images over the times at which ``effects`` expose their rows.

    ``record`` has to be called at every control tick, with the true state of the body.
    """

    def __init__(self, effects: CameraEffects) -> None:
        self._readout = effects.readout_time
        self._span = effects.shutter_time
        self._states: deque[tuple[float, BodyState]] = deque()

    def record(self, time: float, body: BodyState) -> None:
        """Keep the true state ``body`` at ``time`` [s]; times ascend."""
        if self._span == 0.0:
            return
        self._states.append((time, body))
        while len(self._states) > 2 and self._states[1][0] <= time - self._span:
            self._states.popleft()

    def render(
        self, camera: Camera, time: float, body: BodyState, exposure: float
    ) -> tuple[Image, DepthImage]:
        """Luminance (height, width) without noise, and the raw depth at ``time`` [s].

        Every row is exposed for ``exposure`` [s]; ``body`` is the state at ``time``.
        """
        span = exposure + self._readout
        if span == 0.0:
            return camera.render(*body)
        motion = image_motion(camera, self._state_at(time - span), body)
        if motion < _NEGLIGIBLE:
            return camera.render(*body)
        count = min(1 + math.ceil(motion), _MAX_POSES)
        mean = np.zeros((camera.model.height, camera.model.width), np.float32)
        weights = row_weights(camera.model.height, count, exposure / span)
        for index, moment in enumerate(np.linspace(time - span, time, count).tolist()):
            state = body if index == count - 1 else self._state_at(moment)
            image, depth = camera.render(*state)
            mean += weights[:, index, None] * image
        return np.rint(mean).astype(np.uint8), depth

    def _state_at(self, time: float) -> BodyState:
        """The body's state at ``time`` [s], between recorded ones; at rest before the first."""
        later = next((i for i, (at, _) in enumerate(self._states) if at >= time), None)
        if later is None:
            return self._states[-1][1]
        if later == 0:
            return self._states[0][1]
        (begin, first), (end, second) = self._states[later - 1], self._states[later]
        return _between(first, second, (time - begin) / (end - begin))


def image_motion(camera: Camera, first: BodyState, second: BodyState) -> float:
    """How far [px] a near surface at the image's edge moves at most between two states."""
    way = math.dist(first[0], second[0])
    opposite = (-x for x in second[1])  # the same turn as ``second``
    apart = min(math.dist(first[1], second[1]), math.dist(first[1], tuple(opposite)))
    model = camera.model
    per_radian = model.focal * (1.0 + math.tan(0.5 * model.hfov) ** 2)
    return per_radian * 2.0 * apart + model.focal * way / _NEAR  # for turns below 1 rad


def row_weights(rows: int, poses: int, exposed: float) -> Array:
    """(rows, poses) weights of the images from ``poses`` moments, evenly spaced over the shutter.

    ``exposed`` is the share of that time for which each row is exposed; the first row's exposure
    begins with it, the last row's ends with it. Between two moments the images are interpolated.

    >>> row_weights(2, 2, 0.0).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    ends = exposed + (1.0 - exposed) * np.linspace(0.0, 1.0, rows)
    within = exposed * (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    moments = (ends[:, None] - within) * (poses - 1)
    distances = np.abs(moments[..., None] - np.arange(poses))
    weights: Array = np.maximum(1.0 - distances, 0.0).mean(axis=1)
    return weights.astype(np.float32)


def _between(first: BodyState, second: BodyState, share: float) -> BodyState:
    """The state at ``share`` of the small motion from ``first`` to ``second``."""
    place = (1.0 - share) * np.array(first[0]) + share * np.array(second[0])
    one, other = np.array(first[1]), np.array(second[1])
    turn = (1.0 - share) * one + share * (other if product(one, other) > 0.0 else -other)
    x, y, z = place.tolist()
    qx, qy, qz, qw = (turn / math.hypot(*turn)).tolist()
    return (x, y, z), (qx, qy, qz, qw)
