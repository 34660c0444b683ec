"""Compiled inner loops of drawing: in what colour each pixel shows its triangle.

Rounded as PyBullet's TinyRenderer rounds (see ``navfw.sim.raster_kernels``).
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["shade"]

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Longs = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_WHITE, _BRIGHTEST = np.uint8(255), np.float32(255.0)
_BEYOND = np.float32(128.0)
"""Grey of what lies outside a texture."""
_NOTHING, _OUTSIDE = -1, -2
"""No texel: the pixel shows no triangle, or what lies outside its texture."""


@numba.njit(cache=True, error_model="numpy")
def shade(
    faces: Ints,
    weights: Floats,
    screens: Floats,
    corners: Ints,
    normals: Floats,
    uvs: Floats,
    textures: Ints,
    tables: Longs,
    texels: Bytes,
    light: Floats,
    ambient: float,
    diffuse: float,
    out: Bytes,
) -> None:
    """Colour every pixel: nearest texel, ambient light and diffuse light.

    Args:
        faces: (height, width) as ``cover`` gives them.
        weights: (3, height, width) as ``cover`` gives them; those missing are filled in.
        screens: (M, 3, 3) as ``cover`` gives them.
        corners: (M, 3) points of every triangle.
        normals: (N, 3) of the points, in the map.
        uvs: (N, 2) texture coordinates of the points.
        textures: (M,) texture of every triangle.
        tables: (textures, 3) first texel, width and height of every texture.
        texels: (T, 3) of all textures, RGB, rows from the top.
        light: (3,) unit vector towards the light.
        ambient: share of the light that comes from everywhere.
        diffuse: share of the light that comes from one side.
        out: (height, width, 3) filled with RGB, row 0 at the top.

    """
    height, width = faces.shape
    lit = np.empty(width, np.float32)
    places, colours = np.empty(width, np.int64), np.empty((width, 3), np.uint8)
    for y in range(height):
        x = 0
        while x < width:
            face, begin = faces[y, x], x
            while x < width and faces[y, x] == face:
                x += 1
            if face < 0:
                places[begin:x] = _NOTHING
                continue
            points, table = corners[face], tables[textures[face]]
            shares = weights[:, y, begin:x]
            if min(screens[face, 0, 2], screens[face, 1, 2], screens[face, 2, 2]) < _ZERO:
                _weigh(screens[face], y, begin, shares)
            _light(normals, points, shares, light, np.float32(diffuse), lit[begin:x])
            _locate(uvs, points, shares, table, places[begin:x])
        # nothing but this, so that many texels are on their way from memory at once
        for x in range(width):
            place = max(places[x], 0)
            for c in range(3):
                colours[x, c] = texels[place, c]
        _paint(colours, places, np.float32(ambient), lit, out[height - 1 - y])


@numba.njit(cache=True, error_model="numpy")
def _weigh(screen: Floats, y: int, begin: int, weights: Floats) -> None:
    """How much of each corner the pixels from ``begin`` on of row ``y`` show. Doubles inside."""
    ax, ay = np.float64(screen[0, 0]), np.float64(screen[0, 1])
    bx, by = np.float64(screen[1, 0]) - ax, np.float64(screen[1, 1]) - ay
    cx, cy = np.float64(screen[2, 0]) - ax, np.float64(screen[2, 1]) - ay
    w0, w1, w2 = np.float64(screen[0, 2]), np.float64(screen[1, 2]), np.float64(screen[2, 2])
    area, sy = cx * by - bx * cy, ay - y
    first, second, third = weights
    for i in range(first.size):
        sx = ax - (begin + i)
        u = bx * sy - sx * by
        v = sx * cy - cx * sy
        p0, p1, p2 = (1.0 - (u + v) / area) / w0, (v / area) / w1, (u / area) / w2
        total = p0 + p1 + p2
        first[i], second[i], third[i] = p0 / total, p1 / total, p2 / total


@numba.njit(cache=True, error_model="numpy")
def _light(
    normals: Floats,
    points: Ints,
    weights: Floats,
    light: Floats,
    diffuse: np.float32,
    lit: Floats,
) -> None:
    """Diffuse light on neighbouring pixels of one triangle."""
    ax, ay, az = normals[points[0]]
    bx, by, bz = normals[points[1]]
    cx, cy, cz = normals[points[2]]
    lx, ly, lz = light
    first, second, third = weights
    for i in range(lit.size):
        b0, b1, b2 = first[i], second[i], third[i]
        x = cx * b2 + bx * b1 + ax * b0
        y = cy * b2 + by * b1 + ay * b0
        z = cz * b2 + bz * b1 + az * b0
        scale = _ONE / np.float32(math.sqrt(x * x + y * y + z * z))
        along = (z * scale) * lz + (y * scale) * ly + (x * scale) * lx
        lit[i] = diffuse * max(_ZERO, along)


@numba.njit(cache=True, error_model="numpy")
def _locate(uvs: Floats, points: Ints, weights: Floats, table: Longs, places: Longs) -> None:
    """Which texels neighbouring pixels of one triangle show."""
    first, across, down = table
    au, av = uvs[points[0]]
    bu, bv = uvs[points[1]]
    cu, cv = uvs[points[2]]
    one, two, three = weights
    for i in range(places.size):
        u = cu * three[i] + bu * two[i] + au * one[i]
        v = cv * three[i] + bv * two[i] + av * one[i]
        column = np.int32((u - np.float32(np.int32(u))) * np.float32(across))
        line = np.int32((v - np.float32(np.int32(v))) * np.float32(down))
        within = (0 <= column < across) & (0 <= line < down)
        places[i] = first + (down - 1 - line) * across + column if within else _OUTSIDE


@numba.njit(cache=True, error_model="numpy")
def _paint(colours: Bytes, places: Longs, ambient: np.float32, lit: Floats, row: Bytes) -> None:
    """Light the texels ``colours`` of one row."""
    for i in range(places.size):
        for c in range(3):
            colour = np.float32(colours[i, c]) if places[i] != _OUTSIDE else _BEYOND
            painted = np.uint8(min(ambient * colour + lit[i] * colour, _BRIGHTEST))
            row[i, c] = painted if places[i] != _NOTHING else _WHITE
