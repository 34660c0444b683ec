"""The collision shapes of a URDF as one mesh, all joints at zero: furniture, not a robot."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.input_file import shown_path
from navfw.config.xml_file import line_of, read_xml
from navfw.errors import ConfigError
from navfw.numerics.products import product
from navfw.robot.urdf import MAX_BYTES, attribute_numbers, origin_frame, read_urdf
from navfw.signals import Array
from navfw.sim.mesh_file import TriangleMesh, joined, read_mesh

_SIDES = 24
"""Sides of a cylinder, and of a sphere's equator."""


def read_urdf_shapes(path: Path) -> TriangleMesh:
    """The collision shapes of all links in the axes of the root link [m].

    Raises:
        ConfigError: the file is no URDF (see ``read_urdf``), has no collision shapes, one of a kind
            that cannot be drawn, or a mesh that ``read_mesh`` refuses.

    """
    model = read_urdf(path)
    parts = []
    for link in read_xml(path, MAX_BYTES, "a URDF").findall("link"):
        frame = model.frame_of(link.get("name", ""))
        for collision in link.findall("collision"):
            placed = product(frame, origin_frame(path, collision.find("origin")))
            parts += [_shape(path, s).moved(placed) for s in collision.findall("geometry/*")]
    if not parts:
        what = "no link has a collision shape; add <collision> elements, which are drawn as well"
        raise ConfigError(what, file=shown_path(path))
    return joined(parts)


def _shape(path: Path, shape: Element) -> TriangleMesh:
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
        raise ConfigError(what, file=shown_path(path), line=line_of(shape))
    what = f"expected a box, cylinder, sphere or mesh, got <{shape.tag}>; replace it by one of them"
    raise ConfigError(what, file=shown_path(path), line=line_of(shape))


def _sizes(path: Path, shape: Element, key: str, count: int) -> list[float]:
    sizes = attribute_numbers(path, shape, key, [0.0] * count)
    if min(sizes) <= 0.0:
        what = f"{key} of <{shape.tag}>: expected positive lengths [m]"
        raise ConfigError(what, file=shown_path(path), line=line_of(shape))
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
