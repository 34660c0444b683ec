"""Software rasteriser of textured meshes: the same images as PyBullet's TinyRenderer, but faster.

TinyRenderer does nine divisions for every pixel of each triangle's bounding box, and shades pixels
that are covered later. Here only the triangle's span of each row is tested, with SIMD instructions,
and each pixel is shaded once. Rounding is the same, so that the images are equal bit for bit
(``tests/sim/test_sim_images.py`` compares them).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, Image
from navfw.numerics.arrays import Bytes, Floats, Indices, Int32s
from navfw.numerics.products import product
from navfw.sim.raster_kernels import cover
from navfw.sim.textured_mesh import MeshArrays, TexturedMesh

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_WHITE, _BRIGHTEST = np.uint8(255), np.float32(255.0)
"""Colour of the background, and the largest value of a channel."""
_OUTSIDE_GREY = np.float32(128.0)
"""Luminance at texture coordinates outside a texture."""
_NOTHING, _OUTSIDE = -1, -2
"""Texel indices of pixels without a triangle, and with coordinates outside the texture."""


@numba.njit(cache=True, error_model="numpy")
def shade(
    faces: Int32s,
    weights: Floats,
    screens: Floats,
    surfaces: Floats,
    tables: Indices,
    texels: Bytes,
    light: Floats,
    ambient: float,
    diffuse: float,
    out: Bytes,
) -> None:
    """Colour every pixel: nearest texel, ambient and diffuse light.

    Args:
        faces: (height, width) from ``cover``.
        weights: (3, height, width) from ``cover``; NaN weights are computed here.
        screens: (M, 3, 3) from ``cover``.
        surfaces: (M, 3, 5) normal in the map and texture coordinates of every corner.
        tables: (M, 3) index of the first texel, width and height of every triangle's texture.
        texels: (T, 3) texels of all textures, RGB, rows from the top.
        light: (3,) unit vector towards the light.
        ambient: share of the ambient light.
        diffuse: share of the directional light.
        out: (height, width, 3) filled with RGB, row 0 at the top.

    """
    height, width = faces.shape
    mixed, lit = np.empty((5, width), np.float32), np.empty(width, np.float32)
    places, colours = np.empty(width, np.int64), np.empty((width, 3), np.uint8)
    for y in range(height):
        _mix(faces[y], weights[:, y], screens, y, surfaces, mixed)
        _light(mixed, light, np.float32(diffuse), lit)
        _locate(faces[y], mixed, tables, places)
        # a loop of its own: many memory accesses can be in flight at once
        for x in range(width):
            place = max(places[x], 0)
            for c in range(3):
                colours[x, c] = texels[place, c]
        _paint(colours, places, np.float32(ambient), lit, out[height - 1 - y])


@numba.njit(cache=True, error_model="numpy")
def _mix(
    faces: Int32s, weights: Floats, screens: Floats, y: int, surfaces: Floats, mixed: Floats
) -> None:
    """Normal and texture coordinates of each pixel of row ``y``: ``mixed`` (5, width)."""
    for x in range(faces.size):
        face = max(faces[x], 0)
        b0, b1, b2 = weights[0, x], weights[1, x], weights[2, x]
        if math.isnan(b0):
            b0, b1, b2 = _weigh(screens[face], x, y)
        for k in range(5):
            total = surfaces[face, 2, k] * b2 + surfaces[face, 1, k] * b1
            mixed[k, x] = total + surfaces[face, 0, k] * b0


@numba.njit(cache=True, error_model="numpy")
def _weigh(screen: Floats, x: int, y: int) -> tuple[np.float32, np.float32, np.float32]:
    """Perspective-correct barycentric weights of the pixel (x, y). Double precision inside."""
    ax, ay = np.float64(screen[0, 0]), np.float64(screen[0, 1])
    bx, by = np.float64(screen[1, 0]) - ax, np.float64(screen[1, 1]) - ay
    cx, cy = np.float64(screen[2, 0]) - ax, np.float64(screen[2, 1]) - ay
    w0, w1, w2 = np.float64(screen[0, 2]), np.float64(screen[1, 2]), np.float64(screen[2, 2])
    area, sx, sy = cx * by - bx * cy, ax - x, ay - y
    u = bx * sy - sx * by
    v = sx * cy - cx * sy
    p0, p1, p2 = (1.0 - (u + v) / area) / w0, (v / area) / w1, (u / area) / w2
    total = p0 + p1 + p2
    return np.float32(p0 / total), np.float32(p1 / total), np.float32(p2 / total)


@numba.njit(cache=True, error_model="numpy")
def _light(mixed: Floats, light: Floats, diffuse: np.float32, lit: Floats) -> None:
    """``lit`` (width,) = diffuse light on the pixels of one row."""
    lx, ly, lz = light
    for i in range(lit.size):
        x, y, z = mixed[0, i], mixed[1, i], mixed[2, i]
        scale = _ONE / np.float32(math.sqrt(x * x + y * y + z * z))
        along = (z * scale) * lz + (y * scale) * ly + (x * scale) * lx
        lit[i] = diffuse * max(_ZERO, along)


@numba.njit(cache=True, error_model="numpy")
def _locate(faces: Int32s, mixed: Floats, tables: Indices, places: Indices) -> None:
    """``places`` (width,) = indices of the texels of one row's pixels."""
    for i in range(places.size):
        face = faces[i]
        if face < 0:
            places[i] = _NOTHING
            continue
        first, across, down = tables[face, 0], tables[face, 1], tables[face, 2]
        u, v = mixed[3, i], mixed[4, i]
        column = np.int32((u - np.float32(np.int32(u))) * np.float32(across))
        line = np.int32((v - np.float32(np.int32(v))) * np.float32(down))
        within = (0 <= column < across) & (0 <= line < down)
        places[i] = first + (down - 1 - line) * across + column if within else _OUTSIDE


@numba.njit(cache=True, error_model="numpy")
def _paint(colours: Bytes, places: Indices, ambient: np.float32, lit: Floats, row: Bytes) -> None:
    """``row`` (width, 3) = lit colours of one row's texels ``colours``."""
    for i in range(places.size):
        for c in range(3):
            colour = np.float32(colours[i, c]) if places[i] != _OUTSIDE else _OUTSIDE_GREY
            painted = np.uint8(min(ambient * colour + lit[i] * colour, _BRIGHTEST))
            row[i, c] = painted if places[i] != _NOTHING else _WHITE


@dataclass(frozen=True, slots=True)
class Light:
    """Ambient and directional light, as shares of a texture's colour.

    ``direction`` (3,) is a vector towards the light in ``map``.
    """

    direction: tuple[float, float, float]
    ambient: float
    diffuse: float


class RenderRequest(NamedTuple):
    """What to render: a camera at ``eye`` (3,) [m, ``map``], ``size`` (width, height) [px], light.

    ``view`` (4, 4) transforms from ``map`` to the camera's axes (right, up, back) and
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
    """Convert a rendered image's ``depth`` to that of OpenGL's depth buffer, in [0, 1].

    It is 1 at the far plane, and rounded like TinyRenderer's. ``projection`` (4, 4) is the image's.
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
        self._images: list[Image] = []
        self._packed: _PackedBodies | None = None
        self._texels: tuple[npt.NDArray[np.int64], Image] | None = None
        self._next = 0

    def add_texture(self, image: Image) -> int:
        """Add a texture (height, width, 3), RGB; return its index."""
        self._images.append(image)
        self._texels = None
        return len(self._images) - 1

    def add(self, mesh: TexturedMesh, texture: int) -> int:
        """Add a body at the origin of ``map``; ``place`` moves it. Return its id."""
        at_origin = _model((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        self._bodies[self._next] = _Body(mesh.arrays, texture, at_origin)
        self._packed = None
        self._next += 1
        return self._next - 1

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Set a body's position [m] and orientation (x, y, z, w) in ``map``."""
        moved = self._bodies[body]
        moved.model = _model(position, turn)
        if self._packed is not None:
            index = list(self._bodies).index(body)
            first, end = self._packed.runs[index, 2:]
            self._packed.models[index] = moved.model
            self._packed.surfaces[first:end, :, :3] = _turned(moved.mesh.normals, moved.model)

    def remove(self, body: int) -> None:
        """Remove a body."""
        del self._bodies[body]
        self._packed = None

    def draw(self, request: RenderRequest) -> tuple[Image, Floats]:
        """Draw an image (height, width, 3), RGB, and its negative clip depth (height, width)."""
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

    def _covered(
        self, request: RenderRequest
    ) -> tuple[_PackedBodies, Floats, npt.NDArray[np.int32], Floats]:
        """The bodies; of each pixel, bottom row first, depth, triangle, weights of its corners."""
        packed = self._pack()
        width, height = request.size
        nearest = np.empty((height, width), np.float32)
        faces = np.empty((height, width), np.int32)
        weights = np.empty((3, height, width), np.float32)
        cover(
            packed.points,
            packed.corners,
            packed.runs,
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
                        np.concatenate([_turned(b.mesh.normals, b.model), b.mesh.uvs], axis=2)
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
    """Normals (..., 3) in the map's axes: times the inverse transpose, which undoes the scale."""
    axes = model[:3, :3]
    axes = axes / (axes[0, 2] * axes[0, 2] + axes[0, 1] * axes[0, 1] + axes[0, 0] * axes[0, 0])
    x, y, z = normals[..., :1], normals[..., 1:2], normals[..., 2:]
    turned: Floats = z * axes[:, 2] + y * axes[:, 1] + x * axes[:, 0]
    return turned
