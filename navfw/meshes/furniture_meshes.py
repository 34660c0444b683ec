"""Meshes of furniture by file: any mesh file or URDF, scaled to metres, with the z axis up."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.input_file import shown_path
from navfw.errors import ConfigError
from navfw.meshes.mesh_file import FURNITURE_LIMITS, read_mesh
from navfw.meshes.mesh_outline import OutlineBox, boxes_around
from navfw.meshes.triangle_mesh import TriangleMesh, joined
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot.urdf import attribute_numbers, origin_frame, read_urdf, urdf_error

Up = Literal["y", "z"]

_MIN_SIZE, _MAX_SIZE = 0.02, 50.0
"""Bounds of the largest extent of a mesh [m]."""
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Turns the y axis up."""
_SIDES = 24
"""Sides of a cylinder, and of a sphere's equator."""


@lru_cache(maxsize=64)
def furniture_mesh(file: str, scale: float, up: Up) -> TriangleMesh:
    """The mesh in a file, or a URDF's collision shapes with all joints at zero, in metres, z up.

    Raises:
        ConfigError: the file cannot be used (see ``read_mesh`` and ``read_urdf``), a URDF has no
            collision shapes or one that cannot be drawn, or the scaled mesh is smaller than 2 cm or
            larger than 50 m.

    """
    path = Path(file)
    mesh = _urdf_mesh(path) if path.suffix.lower() == ".urdf" else read_mesh(path)
    largest = FURNITURE_LIMITS.triangles
    if len(mesh.faces) > largest:
        what = f"has {len(mesh.faces)} triangles, at most {largest}; simplify its meshes"
        raise ConfigError(what, file=shown_path(path))
    size = np.diag([scale, scale, scale, 1.0])
    mesh = mesh.moved(product(_Y_UP, size) if up == "y" else size)
    low, high = mesh.bounds
    extent = float((high - low).max())
    if not _MIN_SIZE <= extent <= _MAX_SIZE:
        what = (
            f"is {extent:g} m large, expected {_MIN_SIZE:g} to {_MAX_SIZE:g} m: give another scale"
        )
        raise ConfigError(f"{what} (0.001 for a file in millimetres)", file=shown_path(path))
    return mesh


@lru_cache(maxsize=64)
def furniture_outline(file: str, scale: float, up: Up) -> tuple[OutlineBox, ...]:
    """The boxes around the mesh in a file (see ``mesh_outline``); raises like it."""
    return boxes_around(furniture_mesh(file, scale, up))


# --- shapes of URDFs --------------------------------------------------------------------------


def _urdf_mesh(path: Path) -> TriangleMesh:
    """The collision shapes of all links in the axes of the root link [m]."""
    model = read_urdf(path)
    if not model.collisions:
        what = "no link has a collision shape; add <collision> elements, which are drawn as well"
        raise ConfigError(what, file=shown_path(path))
    return joined(
        [
            _shape_mesh(path, collision.shape).moved(
                product(model.frame_of(collision.link), origin_frame(path, collision.origin))
            )
            for collision in model.collisions
        ]
    )


def _shape_mesh(path: Path, shape: Element) -> TriangleMesh:
    """The mesh of one <geometry>, around its own origin."""
    if shape.tag == "box":
        return _box(_sizes(path, shape, "size", 3))
    if shape.tag == "cylinder":
        radius, length = *_sizes(path, shape, "radius", 1), *_sizes(path, shape, "length", 1)
        profile = np.array([[0.0, -0.5], [1.0, -0.5], [1.0, 0.5], [0.0, 0.5]])
        return _revolved(profile * (radius, length))
    if shape.tag == "sphere":
        angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _SIDES // 2 + 1)
        profile = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        profile[[0, -1], 0] = 0.0
        return _revolved(profile * _sizes(path, shape, "radius", 1)[0])
    if shape.tag == "mesh":
        mesh = read_mesh(path.parent / shape.get("filename", ""))
        scale = attribute_numbers(path, shape, "scale", [1.0, 1.0, 1.0])
        if min(scale) > 0.0:
            return mesh.moved(np.diag([*scale, 1.0]))
        what = "expected positive scales; mirror the mesh in a modelling program"
        raise urdf_error(path, shape, what)
    what = f"expected a box, cylinder, sphere or mesh, got <{shape.tag}>; replace it by one of them"
    raise urdf_error(path, shape, what)


def _sizes(path: Path, shape: Element, key: str, count: int) -> list[float]:
    sizes = attribute_numbers(path, shape, key, [0.0] * count)
    if min(sizes) <= 0.0:
        raise urdf_error(path, shape, f"{key} of <{shape.tag}>: expected positive lengths [m]")
    return sizes


def _box(size: list[float]) -> TriangleMesh:
    """A box around the origin."""
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners * size, np.array(faces, np.int64))


def _revolved(profile: Array) -> TriangleMesh:
    """The body of a profile (N, 2) of radius and height, upwards, that begins and ends at 0."""
    angles = np.arange(_SIDES) * (2.0 * math.pi / _SIDES)
    rings = [np.stack([r * np.cos(angles), r * np.sin(angles), z + 0.0 * angles], axis=1)
             for r, z in profile[1:-1]]  # fmt: skip
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    side = np.arange(_SIDES)
    following = (side + 1) % _SIDES
    last = _SIDES * (len(rings) - 1)
    south, north = _SIDES * len(rings), _SIDES * len(rings) + 1
    faces = [np.stack([np.full(_SIDES, south), following, side], axis=1)]
    for ring in range(len(rings) - 1):
        a, b = side + _SIDES * ring, following + _SIDES * ring
        faces += [np.stack([a, b, b + _SIDES], axis=1)]
        faces += [np.stack([a, b + _SIDES, a + _SIDES], axis=1)]
    faces += [np.stack([side + last, following + last, np.full(_SIDES, north)], axis=1)]
    return TriangleMesh(np.concatenate([*rings, poles]), np.concatenate(faces).astype(np.int64))
