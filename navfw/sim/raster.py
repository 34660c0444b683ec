"""Software rasteriser of textured meshes: the images of PyBullet's TinyRenderer, but faster.

TinyRenderer does nine divisions for every pixel of each triangle's bounding box, and shades pixels
that are covered later. Here only the triangle's span of each row is tested, with SIMD instructions,
and each pixel is shaded once. Rounding is the same, so that the images are equal bit for bit
(``tests/sim/test_sim_images.py`` compares them).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, Image, Mask
from navfw.numerics.arrays import Floats
from navfw.numerics.products import product
from navfw.sim.raster_kernels import cover
from navfw.sim.raster_shading import shade
from navfw.sim.textured_mesh import MeshArrays, TexturedMesh


@dataclass(frozen=True, slots=True)
class Light:
    """Ambient and directional light, as shares of a texture's colour.

    ``direction`` (3,) is a vector towards the light.
    """

    direction: tuple[float, float, float]
    ambient: float
    diffuse: float


class RenderRequest(NamedTuple):
    """A camera at ``eye`` (3,) [m], and the image's ``size`` (width, height) [px].

    ``view`` (4, 4) transforms from the map to the camera's axes (right, up, back) and
    ``projection`` (4, 4) from there to clip coordinates, as in OpenGL.
    """

    view: Array
    projection: Array
    eye: Array
    size: tuple[int, int]
    light: Light


@dataclass(slots=True)
class _Body:
    mesh: MeshArrays
    texture: int
    model: Floats


@dataclass(frozen=True, slots=True)
class _PackedBodies:
    """The concatenated arrays of all bodies (see ``cover`` and ``shade``)."""

    points: Floats
    corners: npt.NDArray[np.int32]
    runs: npt.NDArray[np.int32]
    surfaces: Floats
    tables: npt.NDArray[np.int64]
    texels: Image
    models: Floats
    screens: Floats


def depth_buffer(depth: Floats, projection: Array) -> Floats:
    """Depth in [0, 1] as in OpenGL's depth buffer, from a rendered image's ``depth``.

    1 at the far plane; rounded like TinyRenderer. ``projection`` (4, 4) is that of the image.
    """
    scale, shift = np.float32(projection[2, 2]), np.float32(projection[2, 3])
    near, far = shift / (scale - np.float32(1.0)), shift / (scale + np.float32(1.0))
    over = far * (near - depth)
    under = 2.0 * float(far) * float(near) - (far * depth).astype(np.float64)
    return (over / (under + (near * depth))).astype(np.float32)


class Raster:
    """Renders bodies, each a mesh with one texture; at equal depth the newest body is visible."""

    def __init__(self) -> None:
        self._bodies: dict[int, _Body] = {}
        self._shown: Mask | None = None
        self._hidden: set[int] = set()
        self._images: list[Image] = []
        self._packed: _PackedBodies | None = None
        self._texels: tuple[npt.NDArray[np.int64], Image] | None = None
        self._next = 0

    def add_texture(self, image: Image) -> int:
        """Add a texture (height, width, 3), RGB; returns its index."""
        self._images.append(image)
        self._texels = None
        return len(self._images) - 1

    def add(
        self,
        mesh: TexturedMesh,
        texture: int,
        position: Sequence[float] = (0.0, 0.0, 0.0),
        turn: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
    ) -> int:
        """Add a body at ``position`` [m] with orientation ``turn`` (x, y, z, w); returns its id."""
        self._bodies[self._next] = _Body(mesh.arrays, texture, _model(position, turn))
        self._packed = self._shown = None
        self._next += 1
        return self._next - 1

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Set a body's position [m] and orientation (x, y, z, w)."""
        moved = self._bodies[body]
        moved.model = _model(position, turn)
        if self._packed is not None:
            index = list(self._bodies).index(body)
            first, end = self._packed.runs[index, 2:]
            self._packed.models[index] = moved.model
            turned = _turned(moved.mesh.normals, moved.model)
            self._packed.surfaces[first:end, :, :3] = turned[moved.mesh.corners]

    def remove(self, body: int) -> None:
        """Remove a body."""
        del self._bodies[body]
        self._hidden.discard(body)
        self._packed = self._shown = None

    def hide(self, bodies: Sequence[int]) -> None:
        """Set the bodies that are not drawn."""
        self._hidden = set(bodies)
        self._shown = None

    def draw(self, request: RenderRequest) -> tuple[Image, Floats]:
        """An image (height, width, 3), RGB, and its negative clip depth (height, width)."""
        packed, nearest, faces, weights = self._covered(request)
        rgb = np.empty((*nearest.shape, 3), np.uint8)
        light = request.light
        towards = np.array(light.direction, np.float32).astype(np.float64)
        shade(
            faces,
            weights,
            packed.screens,
            packed.surfaces,
            packed.tables,
            packed.texels,
            _singles(towards / np.sqrt(product(towards, towards))),
            light.ambient,
            light.diffuse,
            rgb,
        )
        return rgb, nearest[::-1]

    def depth(self, request: RenderRequest) -> Floats:
        """The depth (height, width) of ``draw``, without the image."""
        return self._covered(request)[1][::-1]

    def _covered(
        self, request: RenderRequest
    ) -> tuple[_PackedBodies, Floats, npt.NDArray[np.int32], Floats]:
        """The bodies; of each pixel, bottom row first, depth, triangle, weights of its corners."""
        packed = self._pack()
        if self._shown is None:
            shown = [body not in self._hidden for body in self._bodies]
            self._shown = np.array(shown, np.bool_)
        width, height = request.size
        nearest = np.empty((height, width), np.float32)
        faces = np.empty((height, width), np.int32)
        weights = np.empty((3, height, width), np.float32)
        cover(
            packed.points,
            packed.corners,
            packed.runs,
            self._shown,
            packed.models,
            _singles(request.view),
            _singles(request.projection),
            np.asarray(request.eye, dtype=np.float64),
            nearest,
            faces,
            weights,
            packed.screens,
        )
        return packed, nearest, faces, weights

    def _pack(self) -> _PackedBodies:
        if self._packed is None:
            bodies = list(self._bodies.values())
            points = np.cumsum([0, *(len(b.mesh.points) for b in bodies)])
            faces = np.cumsum([0, *(len(b.mesh.corners) for b in bodies)])
            runs = np.stack([points[:-1], points[1:], faces[:-1], faces[1:]], axis=1)
            corners = [b.mesh.corners + first for b, first in zip(bodies, points[:-1], strict=True)]
            textures = np.repeat([b.texture for b in bodies], np.diff(faces)).astype(np.int64)
            tables, texels = self._all_texels()
            self._packed = _PackedBodies(
                points=_joined([b.mesh.points for b in bodies], (3,)),
                corners=np.concatenate([np.empty((0, 3), np.int64), *corners]).astype(np.int32),
                runs=runs.astype(np.int32),
                # normal in the map's axes and texture coordinates of every corner
                surfaces=_joined(
                    [
                        np.hstack([_turned(b.mesh.normals, b.model), b.mesh.uvs])[b.mesh.corners]
                        for b in bodies
                    ],
                    (3, 5),
                ),
                tables=tables[textures],
                texels=texels,
                models=np.array([b.model for b in bodies], np.float32).reshape(-1, 4, 4),
                screens=np.zeros((int(faces[-1]), 3, 3), np.float32),
            )
        return self._packed

    def _all_texels(self) -> tuple[npt.NDArray[np.int64], Image]:
        """(textures, 3) first texel, width and height of each; (N, 3) texels of all textures."""
        if self._texels is None:
            heights, widths = ([i.shape[axis] for i in self._images] for axis in (0, 1))
            begins = np.cumsum([0, *(h * w for h, w in zip(heights, widths, strict=True))])[:-1]
            tables = np.stack([begins, widths, heights], axis=1).astype(np.int64)
            texels = np.concatenate(
                [np.empty((0, 3), np.uint8), *(i.reshape(-1, 3) for i in self._images)]
            )
            self._texels = tables, texels
        return self._texels


def _joined(parts: Sequence[Floats], shape: tuple[int, ...]) -> Floats:
    """Concatenated arrays (N, *shape)."""
    return np.concatenate([np.empty((0, *shape), np.float32), *parts])


def _singles(values: Array) -> Floats:
    return np.ascontiguousarray(values, np.float32)


def _model(position: Sequence[float], turn: Sequence[float]) -> Floats:
    """Transform (4, 4) from a body's axes to the map's."""
    x, y, z, w = turn
    double = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * double, y * double, z * double
    matrix = np.array(
        [
            [1.0 - (y * ys + z * zs), x * ys - w * zs, x * zs + w * ys, position[0]],
            [x * ys + w * zs, 1.0 - (x * xs + z * zs), y * zs - w * xs, position[1]],
            [x * zs - w * ys, y * zs + w * xs, 1.0 - (x * xs + y * ys), position[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    return matrix.astype(np.float32)


def _turned(normals: Floats, model: Floats) -> Floats:
    """Normals (N, 3) in the map's axes: times the inverse transpose, which divides by the scale."""
    axes = model[:3, :3]
    axes = axes / (axes[0, 2] * axes[0, 2] + axes[0, 1] * axes[0, 1] + axes[0, 0] * axes[0, 0])
    x, y, z = normals[:, :1], normals[:, 1:2], normals[:, 2:]
    turned: Floats = z * axes[:, 2] + y * axes[:, 1] + x * axes[:, 0]
    return turned
