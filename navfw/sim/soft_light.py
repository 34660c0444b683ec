"""Soft light from above, computed once per world: surfaces are darker where others are near.

A surface loses the share of light that walls, furniture and floor cover as seen from it: the form
factor of a long upright face (Howell et al., Thermal Radiation Heat Transfer, 2020, appendix C).
The brightness is kept in the meshes' normals: with a light from straight above, the rasteriser
multiplies a texture by the height of the normal, and interpolates it between corners.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from navfw.numerics import Array
from navfw.sim.solids import solids_of
from navfw.sim.textured_mesh import TexturedMesh
from navfw.sim.worldspec import WorldSpec

_HEIGHT = 0.45
"""Height [m] of the faces that cover the light; at four times that distance they cover 0.015."""
_IN_FRONT = 0.2
"""Distance [m] by which a solid extends in front of a surface that it shades completely."""
_FLOOR, _CEILING = 0.5, 0.25
"""Shares of light that a wall loses at its foot, and just below the ceiling."""
_LEVEL, _UPRIGHT, _TURN = 0.95, 0.8, (0.09, -0.05)
"""Brightness of level and of upright surfaces; its change with the normal's x and y."""
_TOLERANCE = 0.05
"""Largest difference of brightness between a patch and the interpolation of its corners."""
_MIN_LENGTH, _MAX_SPLITS = 0.1, 8
"""Length [m] below which a patch is not split; largest number of splits of one patch."""
_LATTICE = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2))
"""Pairs of corners whose midpoints, with the corners, are a patch's lattice: four sides, middle."""
_ALONG, _UP = ((0, 4, 1), (7, 8, 5), (3, 6, 2)), ((0, 7, 3), (4, 8, 6), (1, 5, 2))
"""Lines of the lattice: first, middle and last point."""
_HALVES = ((0, 4, 6, 3), (4, 1, 2, 6)), ((0, 1, 5, 7), (7, 5, 2, 3))
"""The corners of the halves of a patch that is split along or up."""


class SoftLight:
    """Computes the soft light in ``world``; without ``light.soft`` it changes nothing."""

    def __init__(self, world: WorldSpec) -> None:
        self._soft = world.light.soft
        self._solids = solids_of(world) if self._soft else []
        self._bounds = np.array([solid.shape.bounds for solid in self._solids]).reshape(-1, 4)
        self._height = max([wall.height for wall in world.walls], default=100.0)

    def lit(self, mesh: TexturedMesh, alone: bool = False) -> TexturedMesh:
        """Return a mesh in ``map`` with its light; quadrangles are split until they interpolate it.

        A mesh that is ``alone``, as it will move, gets only the light above the floor.
        """
        if not self._soft:
            return mesh
        sides = 3 if len(mesh.indices) == len(mesh.vertices) else 4
        columns = mesh.vertices, mesh.normals, mesh.uvs, mesh.shifts or np.zeros_like(mesh.uvs)
        faces = np.concatenate([np.asarray(c) for c in columns], axis=1).reshape(-1, sides, 10)
        finished = [faces[:0]]
        for _ in range(_MAX_SPLITS if sides == 4 else 0):
            middles = [0.5 * (faces[:, a] + faces[:, b]) for a, b in _LATTICE]
            lattice = np.concatenate([faces, np.stack(middles, axis=1)], axis=1)
            level = self._level(lattice.reshape(-1, 10), alone).reshape(-1, 9)
            errors = np.stack([_error(lattice, level, lines) for lines in (_ALONG, _UP)])
            split, along = errors.max(axis=0) > _TOLERANCE, errors[0] >= errors[1]
            finished.append(faces[~split])
            ways = lattice[split & along], lattice[split & ~along]
            halves = [
                way[:, half] for way, pair in zip(ways, _HALVES, strict=True) for half in pair
            ]
            faces = np.concatenate(halves)
        corners = np.concatenate([*finished, faces]).reshape(-1, 10)
        level = self._level(corners, alone)
        fan = np.array([0, 1, 2] if sides == 3 else [0, 1, 2, 0, 2, 3])
        return replace(
            mesh,
            vertices=corners[:, :3].tolist(),
            normals=np.stack([np.sqrt(1.0 - level**2), 0.0 * level, level], axis=1).tolist(),
            uvs=corners[:, 6:8].tolist(),
            shifts=corners[:, 8:].tolist() if mesh.shifts else [],
            indices=(sides * np.arange(len(corners) // sides)[:, None] + fan).ravel().tolist(),
        )

    def _level(self, points: Array, alone: bool) -> Array:
        """Brightness (n,), 0 to 1, at points (n, 6 or more): x, y, z [m] and the normal."""
        x, y, z, nx, ny, nz = points.T[:6]
        upright = 1.0 - np.abs(nz)
        level: Array = _LEVEL + upright * (_UPRIGHT - _LEVEL + _TURN[0] * nx + _TURN[1] * ny)
        level *= 1.0 - upright * _FLOOR * _covered(np.maximum(z, 0.0))
        level *= 1.0 - upright * _CEILING * _covered(np.maximum(self._height - z, 0.0))
        if alone or not len(points):
            return level
        low, high = (
            points[:, :2].min(axis=0) - 4.0 * _HEIGHT,
            points[:, :2].max(axis=0) + 4.0 * _HEIGHT,
        )
        near = (self._bounds[:, :2] < high).all(axis=1) & (self._bounds[:, 2:] > low).all(axis=1)
        for solid in itertools.compress(self._solids, near):
            corners = solid.shape.corners
            before = np.max([nx * (a - x) + ny * (b - y) for a, b in corners.tolist()], axis=0)
            before += np.maximum(nz * (solid.top - z), nz * (solid.bottom - z))
            beside = np.maximum(solid.shape.distance(points[:, :2]), 0.0)
            over = np.maximum(np.maximum(solid.bottom - z, z - solid.top), 0.0)
            # of a ceiling, which lamps and floor light, half
            share = np.clip(before / _IN_FRONT, 0.0, 1.0) * np.where(nz < -0.5, 0.5, 1.0)
            level *= 1.0 - share * _covered(np.hypot(beside, over))
        return level


def _covered(distance: Array) -> Array:
    """Share of the light that an upright face at ``distance`` [m] covers, at most one half."""
    return np.asarray(0.5 - 0.5 * distance / np.sqrt(distance**2 + _HEIGHT**2))


def _error(lattice: Array, level: Array, lines: Sequence[tuple[int, int, int]]) -> Array:
    """(n,) errors of interpolating ``level`` (n, 9) along lines; 0 where they are short."""
    first, middle, last = np.array(lines).T
    error = np.abs(level[:, middle] - 0.5 * (level[:, first] + level[:, last])).max(axis=1)
    long = np.linalg.norm(lattice[:, first[0], :3] - lattice[:, last[0], :3], axis=1)
    return np.where(long > _MIN_LENGTH, error, 0.0)
