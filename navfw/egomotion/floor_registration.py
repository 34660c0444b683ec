"""The robot's motion over the floor between two images, in metres and with its covariance.

The camera's height gives the scale: each pixel below the horizon shows a known point of the floor,
if it shows the floor at all. Pixels that show something else disagree and lose their weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from navfw.egomotion.floor_kernels import SLANT, UNKNOWNS, register_floor
from navfw.egomotion.pairing import camera_place
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats
from navfw.numerics.functions import log
from navfw.numerics.linear_systems import inverse, solve
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.signals.immutability import read_only

_STRIDE = 2  # chosen
"""Distance [px] between the pixels used, along rows and columns: neighbours are alike."""

_REACH = 3.2  # chosen
"""Farthest point of the floor that is used, in heights of the camera. Beyond, a pixel covers more
of the floor than the finest detail of its texture."""

_SMOOTHING = 1.0  # chosen
"""Standard deviation of the smoothing of images [px]: gradients are then linear over a pixel."""

_SMOOTHED = 8  # chosen
"""Rows above the horizon [px] that are kept, so that smoothing at the border changes no floor."""

_CORRELATION = 4.0  # chosen
"""Number of neighbouring pixels with a common error, by smoothing and by the texture's sampling."""

_GAIN, _OFFSET = 0.05, 5.0  # chosen
"""Standard deviations of the change of brightness: of the gain, and of the offset [grey levels]."""

_MIN_SHARE = 0.5  # chosen
"""Least share of the pixels that agree with one motion of the floor."""

_MIN_EXPLAINED = 0.5  # chosen
"""Least share of the variance of the grey levels that the motion explains: a wall in front of the
robot moves otherwise than the floor."""

_SLANT_SIGMA, _MAX_SLANT = 0.5, 0.25  # measured
"""Standard deviation of the slant (``floor_kernels.SLANT``) of a surface before it is measured, and
the slant beyond which it is no floor. Measured: 0.0 to 0.1 of floors, 0.5 to 1.0 of walls that fill
the view."""

_MIN_PIXELS = 100  # chosen
"""Least number of pixels that could show the floor."""

_SCALE_SIGMA = 1.5e-3  # chosen
"""Error of height and pitch of the camera, as a share of the distance; it does not average out."""

_ROCKING_SHARE = 2.5  # chosen
"""Error of distances, as a share, per amplitude of rocking [1/rad]: the effect of a wrong pitch at
twice the height of the camera."""

_MIN_SIGMA = np.array([1e-4, 1e-4, 5e-4])  # chosen
"""Least standard deviations of x, y [m] and yaw [rad]: of the interpolation of grey values."""


@dataclass(frozen=True, slots=True)
class FloorImage:
    """The part of an image below the horizon, prepared for registration.

    ``grey`` (rows, width) are its grey levels, smoothed; ``values`` (n,) those of the pixels used.
    ``pitch`` and ``rocking`` [rad] are those of a body that rocks; its image has been levelled.
    """

    grey: Floats
    values: Array
    pitch: float = 0.0
    rocking: float = 0.0


@dataclass(frozen=True, slots=True)
class FloorStep:
    """The robot's motion over the floor: ``pose`` in its past base_link, ``covariance`` (3, 3).

    ``share`` in [0, 1] is the share of the pixels that agree, ``explained`` that of the variance of
    the grey levels that this motion explains. ``rocking`` is true if the body rocks, so that an
    error of the scale is common to many steps.
    """

    pose: Pose
    covariance: Array
    share: float
    explained: float
    rocking: bool = False


class FloorRegistration:
    """Registers the lower part of two images of one camera as images of a level floor."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot, camera = robot, robot.camera
        rows, columns = np.mgrid[2 : camera.height - 2 : _STRIDE, 2 : camera.width - 2 : _STRIDE]
        x = columns - 0.5 * (camera.width - 1)
        y = rows - 0.5 * (camera.height - 1)
        rays = np.stack([x / camera.focal, y / camera.focal, np.ones_like(x)], axis=-1)
        rays = product(rays, camera.base_from_camera.T)
        near = -rays[..., 2] * _REACH > np.hypot(rays[..., 0], rays[..., 1])
        rays = rays[near]
        horizon = 0.5 * (camera.height - 1) - camera.focal * math.tan(camera.pitch)
        self._top = min(max(math.floor(horizon) - _SMOOTHED, 0), camera.height - 1)
        self._at = rows[near] - self._top, columns[near]
        depth = camera.mount_height / -rays[:, 2]
        ground = depth[:, None] * rays[:, :2] + np.array([camera.mount_forward, 0.0])
        self._ground = read_only(np.ascontiguousarray(ground))
        distance = depth * np.hypot(rays[:, 0], rays[:, 1])
        self._farness = read_only(log(distance / distance.min(initial=np.inf)))
        self._camera = read_only(
            np.array(
                [
                    *(camera.focal, camera.mount_forward, camera.mount_height),
                    *(0.5 * (camera.width - 1), 0.5 * (camera.height - 1) - self._top),
                ]
            )
        )
        self._base_from_camera = np.ascontiguousarray(camera.base_from_camera)
        self._known = np.diag([0.0, 0.0, 0.0, _GAIN**-2, _OFFSET**-2, _SLANT_SIGMA**-2])

    def prepare(self, image: Image, pitch: float = 0.0, rocking: float = 0.0) -> FloorImage:
        """Smooth ``image`` (height, width) for ``register``; the rest as in ``FloorImage``."""
        blurred = cv2.GaussianBlur(image[self._top :].astype(np.float32), (0, 0), _SMOOTHING)
        grey = np.asarray(blurred, dtype=np.float32)
        return FloorImage(grey, grey[self._at].astype(np.float64), pitch, rocking)

    def _seen_at(self, image: FloorImage) -> tuple[Array, Array]:
        """The floor that the pixels of ``image`` show, and its camera, as the kernel needs them."""
        if image.pitch == 0.0:
            return self._ground, self._camera
        model, camera = self._robot.camera, self._camera.copy()
        ahead, _, above = camera_place(self._robot, image.pitch).tolist()
        camera[1:3] = ahead, model.mount_height + above
        scale, usual = camera[2] / model.mount_height, (model.mount_forward, 0.0)
        return scale * (self._ground - usual) + (ahead, 0.0), camera

    def register(
        self, past: FloorImage, now: FloorImage, guess: Pose, covariance: Array
    ) -> FloorStep | None:
        """Measure the motion from ``past`` to ``now``; None if they show no level floor's motion.

        ``guess`` with ``covariance`` (3, 3) is the motion expected. It guides the fit, which
        separates the floor from other things by it, but the answer does not contain it.
        """
        if len(self._ground) < _MIN_PIXELS:
            return None
        start = np.array([guess.x, guess.y, guess.yaw, 0.0, 0.0])
        prior = self._known[:UNKNOWNS, :UNKNOWNS].copy()
        prior[:3, :3] = inverse(covariance)
        at, information, slanted, share, explained = register_floor(
            past.grey,
            now.values,
            self._seen_at(now)[0],
            self._farness,
            self._seen_at(past)[1],
            self._base_from_camera,
            start,
            _CORRELATION * prior,
        )
        if share < _MIN_SHARE or explained < _MIN_EXPLAINED:
            return None
        information = information / _CORRELATION + self._known
        # of the prior of the motion, back to the start; of the images, on the slant
        pull = np.zeros(UNKNOWNS + 1)
        pull[:3] = product(prior[:3, :3], at[:3] - start[:3])
        pull[SLANT] = slanted / _CORRELATION
        # covariance of the motion if the slant is not known beforehand, either
        spread = inverse(information)
        if float(product(spread[SLANT], pull)) > _MAX_SLANT:
            return None
        # the answer of the images without the prior: where they and the prior pull equally hard
        at = at + solve(information[:SLANT, :SLANT], pull[:SLANT])
        spread = spread[:3, :3].copy()
        spread[np.diag_indices(3)] += _MIN_SIGMA**2
        rocking = max(past.rocking, now.rocking)
        scale_sigma = math.hypot(_SCALE_SIGMA, _ROCKING_SHARE * rocking)
        spread[:2, :2] += scale_sigma**2 * np.outer(at[:2], at[:2])
        return FloorStep(Pose(*at[:3].tolist()), spread, share, explained, rocking > 0.0)
