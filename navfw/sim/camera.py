"""The simulated camera: rendering with an exact pinhole projection, and image noise."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, Image
from navfw.numerics.products import product, sum_in_order
from navfw.robot import CameraModel
from navfw.robot.urdf_model import quaternion_matrix
from navfw.sim.raster import Light, RenderRequest, depth_buffer
from navfw.sim.scenery import Scenery
from navfw.sim.worldspec import LightSpec

NEAR, FAR = 0.03, 40.0
"""Distances of the clipping planes [m]."""

DepthImage = npt.NDArray[np.float32]
Place = tuple[float, float, float]
Turn = tuple[float, float, float, float]

_NOISE_BANK = 1 << 20
"""Size of the noise that is drawn once [bytes]; every frame uses a random section of it."""
_MAX_VIEW = 2.8
"""Largest horizontal field of view with a fault [rad]: a pinhole image ends at pi."""
_RIGHT_UP_BACK = np.array([[1.0], [-1.0], [-1.0]])
"""Signs of OpenGL's camera axes (right, up, back) relative to right, down, ahead."""


def _projection_matrix(camera: CameraModel, supersample: int = 1) -> Array:
    """OpenGL projection (4, 4) with ``focal`` px and the principal point in the image centre.

    The image centre is ((width - 1) / 2, (height - 1) / 2), with pixel centres at integers. The
    raster samples a pixel's corner instead of its centre: column i samples x = i - width / 2 and
    row j samples y = j - (height / 2 - 1) (measured); the two entries of 1 / width and 1 / height
    shift both by half a pixel.
    """
    width, height = camera.width * supersample, camera.height * supersample
    focal = camera.focal * supersample
    deep = FAR - NEAR
    return np.array(
        [
            [2.0 * focal / width, 0.0, 1.0 / width, 0.0],
            [0.0, 2.0 * focal / height, 1.0 / height, 0.0],
            [0.0, 0.0, -(FAR + NEAR) / deep, -2.0 * FAR * NEAR / deep],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


class Camera:
    """Renders images and depth for a pose of ``base_link``.

    ``supersample`` 2 renders at twice the size and averages, against aliasing, at four times the
    cost. ``noise`` is the standard deviation [grey levels] of the image noise.
    """

    def __init__(
        self,
        camera: CameraModel,
        light: LightSpec,
        scenery: Scenery,
        rng: np.random.Generator,
        noise: float = 0.0,
        supersample: int = 1,
    ) -> None:
        self.model = camera
        self._scenery = scenery
        self._supersample = supersample
        self._rng = rng
        self._banks = _noise_banks(rng, noise) if noise > 0.0 else None
        self._light_spec = light
        self._mount = np.array([camera.mount_forward, 0.0, camera.mount_height])
        self._base_from_camera = camera.base_from_camera
        self.set_optics()

    def set_optics(self, light: float = 1.0, hfov_error: float = 0.0) -> None:
        """Set the remaining share of the light, and the relative error of the field of view."""
        spec = self._light_spec
        direction = (0.0, 0.0, 1.0) if spec.soft else spec.direction
        length = math.sqrt(sum_in_order(d * d for d in direction))
        x, y, z = (d / length for d in direction)
        self._light = Light((x, y, z), light * spec.ambient, light * spec.diffuse)
        hfov = min(self.model.hfov * (1.0 + hfov_error), _MAX_VIEW)
        true = self.model.model_copy(update={"hfov": hfov})
        self._projection = _projection_matrix(true, self._supersample)

    def render(self, position: Place, turn: Turn) -> tuple[Image, npt.NDArray[np.float32]]:
        """Render luminance (height, width) without noise, and raw depth for ``depth`` to convert.

        ``position`` [m] and ``turn`` (quaternion x, y, z, w) are the pose of base_link in ``map``.
        """
        rgb, depth = self._scenery.raster.draw(self.request(position, turn))
        grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
        if self._supersample > 1:
            grey = cv2.resize(
                grey, (self.model.width, self.model.height), interpolation=cv2.INTER_AREA
            )
        return grey.astype(np.uint8, copy=False), depth

    def request(self, position: Place, turn: Turn) -> RenderRequest:
        """Make the render request for a pose of base_link."""
        return self.request_at(*self.camera_pose(position, turn))

    def request_at(self, eye: Array, axes: Array) -> RenderRequest:
        """Make the request for a camera at ``eye`` (3,) [m] with ``axes`` as of ``camera_pose``."""
        scale = self._supersample
        size = (self.model.width * scale, self.model.height * scale)
        return RenderRequest(_view(eye, axes), self._projection, eye, size, self._light)

    def add_noise(self, clean: Image, gain: float = 1.0) -> Image:
        """Return the image (height, width) with sensor noise, amplified by ``gain``."""
        if self._banks is None:
            return clean
        if clean.size >= self._banks[0].size:  # an image of megapixels: the noise repeats
            positive, negative = (np.resize(bank, 2 * clean.size) for bank in self._banks)
            self._banks = positive, negative
        begin = int(self._rng.integers(self._banks[0].size - clean.size))
        part = slice(begin, begin + clean.size)
        brighter, darker = [bank[part].reshape(clean.shape) for bank in self._banks]
        if gain != 1.0:
            noise = np.float32(gain) * (brighter.astype(np.float32) - darker)
            return np.clip(np.rint(clean + noise), 0, 255).astype(np.uint8)
        noisy = cv2.subtract(cv2.add(clean, brighter), darker)  # saturates at 0 and 255
        return noisy.astype(np.uint8, copy=False)

    def depth(self, raw: npt.NDArray[np.float32]) -> DepthImage:
        """Convert ``raw`` from ``render`` to depth along the optical axis (height, width) [m].

        inf where no surface is visible. A supersampled pixel has the least depth of its samples.
        """
        buffer = depth_buffer(raw, self._projection)
        metres = FAR * NEAR / (FAR - (FAR - NEAR) * buffer.astype(np.float64))
        metres[buffer >= 1.0 - 1e-6] = np.inf
        scale = self._supersample
        if scale > 1:
            shape = (self.model.height, scale, self.model.width, scale)
            metres = metres.reshape(shape).min(axis=(1, 3))
        return metres.astype(np.float32)

    def camera_pose(self, position: Place, turn: Turn) -> tuple[Array, Array]:
        """Camera position (3,) [m] and axes (3, 3; columns: right, down, ahead) in ``map``."""
        rotation = quaternion_matrix(*turn)
        eye: Array = position + product(rotation, self._mount)
        return eye, product(rotation, self._base_from_camera)


def _noise_banks(rng: np.random.Generator, noise: float) -> tuple[Image, Image]:
    """Positive and negative part of noise [grey levels], apart: saturated bytes are fast."""
    drawn = np.rint(rng.standard_normal(_NOISE_BANK, dtype=np.float32) * noise)
    return np.clip(drawn, 0, 127).astype(np.uint8), np.clip(-drawn, 0, 127).astype(np.uint8)


def _view(eye: Array, axes: Array) -> Array:
    """OpenGL view matrix (4, 4) of a camera at ``eye`` with ``axes``."""
    view = np.zeros((4, 4))
    turn = np.multiply(axes.T, _RIGHT_UP_BACK, out=view[:3, :3])
    view[:3, 3] = product(-turn, eye)
    view[3, 3] = 1.0
    return view
