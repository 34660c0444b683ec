"""Landmarks of a world as thin textured plates: visible from one side, without collision shape."""

from __future__ import annotations

import math

import numpy as np

from navfw.features.landmark_appearance import landmark_kind
from navfw.numerics.products import product
from navfw.signals import Array
from navfw.sim.meshes import Mesh
from navfw.sim.visibility import PartBounds
from navfw.sim.worldspec import LandmarkPlateSpec

_STAND_OFF = 0.006
"""Distance of a plate from its wall [m]: more than that of the textureless cover of a wall."""
_RIM = 1e-3
"""Part of the texture left out at each side: texture coordinates beyond it wrap around."""


def plate_mesh(mark: LandmarkPlateSpec) -> Mesh:
    """The plate as a mesh in the map frame, its image upright as seen from in front of it."""
    right, normal = plate_axes(mark)
    half = 0.5 * landmark_kind(mark.kind).plate_side(mark.size)
    middle = np.array([*mark.at, mark.z]) + _STAND_OFF * normal
    up = np.array([0.0, 0.0, half])
    across = half * right
    corners = [
        middle - across - up,
        middle + across - up,
        middle + across + up,
        middle - across + up,
    ]
    low, high = _RIM, 1.0 - _RIM
    return Mesh(
        vertices=[corner.tolist() for corner in corners],
        normals=[normal.tolist()] * 4,
        uvs=[[low, low], [high, low], [high, high], [low, high]],
        indices=[0, 1, 2, 0, 2, 3],
    )


def plate_bounds(mark: LandmarkPlateSpec) -> PartBounds:
    """The plate's bounds in the plane, with the plane in front of which it is visible."""
    _, normal = plate_axes(mark)
    points = np.array(plate_mesh(mark).vertices)
    plane = (float(normal[0]), float(normal[1]), 0.0, float(product(points[0], normal)))
    return PartBounds.around(points, mark.yaw + 0.5 * math.pi, plane)


def plate_axes(mark: LandmarkPlateSpec) -> tuple[Array, Array]:
    """Unit vectors (3,) in the map: the image's right side as seen from in front; the normal."""
    c, s = math.cos(mark.yaw), math.sin(mark.yaw)
    return np.array([-s, c, 0.0]), np.array([c, s, 0.0])
