"""Bearing and range of an upright square, with covariance, from its corners in the image.

The orientation of a small square is ambiguous (two solutions), but its range is not: both of its
sides are vertical, and the length of a side over the difference of its ends' slopes is its
horizontal distance, at any orientation (METHOD 4.6: range and bearing only).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from navfw.features.landmark_appearance import identity_of
from navfw.numerics import Array
from navfw.numerics.functions import arctan2
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.signals import LandmarkDetection
from navfw.topomap import TopoMap

_STEP = 0.25
"""Step of the numerical derivative [px]."""
_MAX_LEAN = 0.25
"""Largest lean of a side (horizontal over vertical extent): camera and plates are upright."""
_BEARING_FLOOR = math.radians(0.3)
_RANGE_FLOOR = 0.01
"""Standard deviations of errors other than the corners': camera mount, focal length, plate. Bearing
in rad, range as a share."""


def landmark_sizes(topo_map: TopoMap, kind: str) -> Mapping[int, float]:
    """Sides [m] of the map's landmarks of ``kind``, by id."""
    marks = topo_map.landmarks.values()
    return {mark.id: mark.size for mark in marks if mark.kind == kind}


def locate(corners: Array, side: float, camera: CameraModel) -> Array:
    """Bearing [rad] and range [m] in base_link (..., 2) of the centres of upright squares.

    ``corners`` (..., 4, 2) [px, relative to the principal point] are top left, top right, bottom
    right, bottom left in the image; ``side`` [m] is the squares' side.
    """
    ahead = np.full((*corners.shape[:-1], 1), camera.focal)
    rays = product(np.concatenate([corners, ahead], axis=-1), camera.base_from_camera.T)
    level = np.hypot(rays[..., 0], rays[..., 1])
    slopes = rays[..., 2] / level
    directions = rays[..., :2] / level[..., None]
    # left side: corners 0 and 3; right side: corners 1 and 2
    drop = np.maximum(slopes[..., :2] - slopes[..., :1:-1], 1e-6)
    along = 0.5 * (directions[..., :2, :] + directions[..., :1:-1, :])
    points = (side / drop)[..., None] * along
    middle = points.mean(axis=-2)
    x = middle[..., 0] + camera.mount_forward
    return np.stack([arctan2(middle[..., 1], x), np.hypot(x, middle[..., 1])], axis=-1)


def locate_with_covariance(
    corners: Array, side: float, camera: CameraModel, sigma: float
) -> tuple[Array, Array]:
    """Bearing and range (2,) of one square, and their covariance (2, 2).

    ``sigma`` [px] is one standard deviation of each coordinate of ``corners`` (4, 2).
    """
    shifts = _STEP * np.eye(8).reshape(8, 4, 2)
    varied = locate(np.concatenate([corners[None], corners + shifts]), side, camera)
    located = varied[0]
    jacobian = (varied[1:] - located) / _STEP
    covariance = product(sigma**2 * jacobian.T, jacobian)
    covariance += np.diag([_BEARING_FLOOR**2, (_RANGE_FLOOR * located[1]) ** 2])
    return located, covariance


def is_upright(corners: Array) -> bool:
    """Whether corners (4, 2) can be those of an upright square viewed from its front."""
    left, right = corners[3] - corners[0], corners[2] - corners[1]
    leans = abs(left[0]) > _MAX_LEAN * left[1] or abs(right[0]) > _MAX_LEAN * right[1]
    return bool(not leans and corners[0, 0] < corners[1, 0] and corners[3, 0] < corners[2, 0])


def square_detection(
    time: float,
    kind: str,
    number: int,
    pixels: Array,
    side: float,
    camera: CameraModel,
    sigma: float,
) -> LandmarkDetection:
    """The detection of a landmark with corners ``pixels`` (4, 2) [px, from the image's corner].

    ``side`` [m] is the landmark's side, ``sigma`` [px] the corners' standard deviation.
    """
    corners = pixels - 0.5 * np.array([camera.width - 1, camera.height - 1])
    (bearing, away), covariance = locate_with_covariance(corners, side, camera, sigma)
    return LandmarkDetection(
        time, identity_of(kind, number), float(bearing), float(away), covariance
    )
