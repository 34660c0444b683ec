"""Triangle meshes with texture coordinates in metres.

Texture coordinates follow the position along the face (world or body coordinates), so that the
texture is continuous across adjacent patches; PyBullet's own boxes stretch one texture over a face.
Interpolation is perspective-correct: patches of 0.25 m and of 8 m give the same image (measured).
Splitting only keeps the texture coordinates small.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, products
from navfw.numerics.arrays import Floats
from navfw.sim.textures import TILE

Span = tuple[float, float]
"""An interval: from, to [m]."""

_MAX_PATCH = 2.0
"""Largest edge of a patch [m]."""


_RIM = 1e-3
"""Share of a stretched texture left out at each edge: coordinates beyond the edge wrap around."""
_NORMALIZATIONS = 4
"""TinyRenderer normalises normals at every use; after this number they no longer change."""


class MeshArrays(NamedTuple):
    """The arrays of a mesh: ``points`` (n, 3) without repetition, ``corners`` (m, 3) of triangles.

    Corners are indices of points; ``normals`` (m, 3, 3) and ``uvs`` (m, 3, 2) belong to corners.
    """

    points: Floats
    normals: Floats
    uvs: Floats
    corners: npt.NDArray[np.int32]


@dataclass(slots=True)
class TexturedMesh:
    """Triangles with normals and texture coordinates, in the form of PyBullet's GEOM_MESH.

    Texture coordinates are in periods of ``TILE``; ``shifts`` are the whole periods subtracted from
    those of each vertex.
    """

    vertices: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    uvs: list[list[float]] = field(default_factory=list)
    indices: list[int] = field(default_factory=list)
    shifts: list[list[float]] = field(default_factory=list)
    _kept: MeshArrays | None = field(default=None, init=False, compare=False)

    @property
    def arrays(self) -> MeshArrays:
        """The arrays that images are drawn from; cached until something is added."""
        if self._kept is None or self._kept.corners.size != len(self.indices):
            normals = np.array(self.normals, np.float32)
            for _ in range(_NORMALIZATIONS):
                x, y, z = normals.T
                normals = normals * (np.float32(1.0) / np.sqrt(x * x + y * y + z * z))[:, None]
            # each point once: faces share most of theirs, and a frame transforms all that are seen
            vertices, uvs = np.array(self.vertices, np.float32), np.array(self.uvs, np.float32)
            points, places = np.unique(vertices, axis=0, return_inverse=True)
            corners = np.array(self.indices, np.int32).reshape(-1, 3)
            shared = places.ravel().astype(np.int32)[corners]
            self._kept = MeshArrays(points, normals[corners], uvs[corners], shared)
        return self._kept

    @property
    def arguments(self) -> dict[str, list[Any]]:
        """The mesh as arguments of PyBullet's createVisualShape."""
        names = ("vertices", "indices", "uvs", "normals")
        return {name: getattr(self, name) for name in names}

    @classmethod
    def without_area(cls) -> TexturedMesh:
        """Make an invisible mesh: one degenerate triangle."""
        points, normals, uvs = [[0.0, 0.0, 0.0]] * 3, [[0.0, 0.0, 1.0]] * 3, [[0.0, 0.0]] * 3
        return cls(points, normals, uvs, [0, 1, 2], uvs)

    def add_polygons(self, corners: Array, normals: Array, uvs: Array) -> None:
        """Add convex polygons: (N, k, 3) corners, counter-clockwise, with normals (N, k, 3).

        Texture coordinates (N, k, 2) [m] are shifted by whole periods to be non-negative:
        TinyRenderer wraps only positive ones.
        """
        count, sides = corners.shape[:2]
        tiles = uvs / TILE
        shifts = np.floor(tiles.min(axis=1, keepdims=True) + 1e-9)
        starts = len(self.vertices) + sides * np.arange(count)[:, None]
        fan = np.array([(0, k, k + 1) for k in range(1, sides - 1)]).ravel()
        self.vertices += corners.reshape(-1, 3).tolist()
        self.normals += normals.reshape(-1, 3).tolist()
        self.uvs += np.maximum(tiles - shifts, 0.0).reshape(-1, 2).tolist()
        self.shifts += shifts.repeat(sides, axis=1).reshape(-1, 2).tolist()
        self.indices += (starts + fan).ravel().tolist()

    def placed(self, position: tuple[float, float, float], yaw: float) -> TexturedMesh:
        """Return the mesh rotated by ``yaw`` [rad] and translated by ``position`` [m]."""
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # for rows
        vertices = (products.product(np.array(self.vertices), turn) + position).tolist()
        normals = products.product(np.array(self.normals), turn).tolist()
        return replace(self, vertices=vertices, normals=normals)

    def append(self, mesh: TexturedMesh) -> None:
        """Add the triangles of another mesh without a transform."""
        first = len(self.vertices)
        self.vertices += mesh.vertices
        self.normals += mesh.normals
        self.uvs += mesh.uvs
        self.shifts += mesh.shifts
        self.indices += [first + index for index in mesh.indices]

    def stretched(self) -> TexturedMesh:
        """Return the same quadrangles, each with the whole of a texture once."""
        low, high = _RIM, 1.0 - _RIM
        corners = [[low, low], [high, low], [high, high], [low, high]]
        return replace(self, uvs=corners * (len(self.vertices) // 4), shifts=[])

    def with_period(self, width: float, height: float) -> TexturedMesh:
        """Return the mesh for a texture that covers ``width`` x ``height`` [m], not a tile."""
        tiles = (np.array(self.uvs) + self.shifts) * (TILE / width, TILE / height)
        tiles -= np.floor(tiles.min(axis=0))
        return replace(self, uvs=tiles.tolist(), shifts=[])

    def add_patch(
        self, corner: Array, right: Array, up: Array, columns: Span, rows: Span, shift: Array
    ) -> None:
        """Add a patch of a flat face: between two ``columns`` along ``right`` and ``rows`` up [m].

        ``corner`` is the origin of both axes; right x up is the outward normal. ``shift`` (2,) [m]
        translates the texture.
        """
        (a, b), (c, d) = columns, rows
        across = np.array([[a], [b], [b], [a]]) * right
        points = corner + across + np.array([[c], [c], [d], [d]]) * up
        normal = np.cross(right, up)
        uvs = _face_coordinates(points, normal) + shift
        self.add_polygons(points[None], np.tile(normal, (1, 4, 1)), uvs[None])


def _face_coordinates(points: Array, normal: Array) -> Array:
    """Texture coordinates (N, 2) [m] of points (N, 3) on a horizontal or vertical plane."""
    if abs(normal[2]) > 0.5:
        return points[:, :2].copy()
    along = points[:, 0] * -normal[1] + points[:, 1] * normal[0]
    return np.stack([along, points[:, 2]], axis=1)


def split_positions(
    length: float, at: list[float] | None = None, longest: float = _MAX_PATCH
) -> Array:
    """Divide 0 to ``length`` [m] at the positions ``at``, in parts of at most ``longest`` [m]."""
    cuts = [0.0, *sorted(c for c in at or [] if 1e-3 < c < length - 1e-3), length]
    parts = [
        np.linspace(low, high, math.ceil((high - low) / longest - 1e-9) + 1)[:-1]
        for low, high in pairwise(cuts)
        if high - low > 1e-9
    ]
    return np.append(np.concatenate(parts), length)


def box_mesh(
    size: tuple[float, float, float], shift: Array, faces: Iterable[int] = range(5)
) -> TexturedMesh:
    """Make a box around the origin with edges x, y, z [m], without its underside.

    ``faces`` are 0 to 3 for its sides, the even ones along x, and 4 for its top.
    """
    x, y, z = (0.5 * s for s in size)
    mesh = TexturedMesh()
    ex, ey, ez = np.eye(3)
    columns, rows = (split_positions(length) for length in size[:2])
    levels = np.array([0.0, size[2]])
    sides = (
        ((-x, -y, -z), ex, ez, columns, levels),
        ((x, -y, -z), ey, ez, rows, levels),
        ((x, y, -z), -ex, ez, columns, levels),
        ((-x, y, -z), -ey, ez, rows, levels),
        ((-x, -y, z), ex, ey, columns, rows),
    )
    for corner, right, up, across, above in (sides[face] for face in faces):
        for span, level in product(pairwise(across), pairwise(above)):
            mesh.add_patch(np.array(corner), right, up, span, level, shift)
    return mesh


def cylinder_mesh(radius: float, height: float, shift: Array, sides: int = 24) -> TexturedMesh:
    """Make an upright cylinder around the origin [m], without its underside."""
    mesh = TexturedMesh()
    angles = np.linspace(0.0, 2.0 * math.pi, sides + 1)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides + 1)], axis=1)
    quads = np.stack([np.arange(sides), np.arange(sides) + 1], axis=1)[:, [0, 1, 1, 0]]
    out = ring[quads]
    for low, high in pairwise(split_positions(height) - 0.5 * height):
        level = np.array([low, low, high, high])
        corners = radius * out
        corners[..., 2] = level
        uvs = np.stack([radius * angles[quads], np.broadcast_to(level, quads.shape)], axis=-1)
        mesh.add_polygons(corners, out, uvs + shift)
    top = np.zeros_like(out)
    top[:, 1:3] = radius * ring[quads[:, :2]]
    top[..., 2] = 0.5 * height
    mesh.add_polygons(top, np.broadcast_to([0.0, 0.0, 1.0], top.shape), top[..., :2] + shift)
    return mesh


def side_count(radius: float) -> int:
    """Number of sides (12 to 24) for which a cylinder's outline is within 2 mm of the circle."""
    return min(max(math.ceil(math.pi / math.acos(1.0 - min(0.002 / radius, 0.5))), 12), 24)


def triangle_mesh(corners: Array, shift: Array) -> TexturedMesh:
    """Make flat triangles (N, 3, 3) [m], each textured along the nearest coordinate plane."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    corners, normals = corners[lengths > 0.0], normals[lengths > 0.0]
    normals /= lengths[lengths > 0.0, None]
    axis = np.abs(normals).argmax(axis=1)
    # as on walls: to the right as seen from outside, and up; on level faces x and y
    signs = np.sign(normals[np.arange(len(axis)), axis])[:, None]
    x, y, z = np.moveaxis(corners, 2, 0)
    level = (axis == 2)[:, None]
    right = np.where(level, x, np.where((axis == 0)[:, None], signs * y, -signs * x))
    uvs = np.stack([right, np.where(level, y, z)], axis=2) + shift
    mesh = TexturedMesh()
    mesh.add_polygons(corners, np.repeat(normals[:, None], 3, axis=1), uvs)
    return mesh
