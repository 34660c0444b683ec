"""Compiled kernels of the rasteriser: the colour of each pixel.

Rounded like PyBullet's TinyRenderer (see ``navfw.sim.raster_kernels``).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Bytes, Floats, Indices, Int32s

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_WHITE, _BRIGHTEST = np.uint8(255), np.float32(255.0)
"""Background, and the limit of a channel."""
_OUTSIDE_GREY = np.float32(128.0)
"""Luminance for texture coordinates outside a texture."""
_NOTHING, _OUTSIDE = -1, -2
"""Texel indices of pixels without triangle, and with coordinates outside the texture."""


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
        weights: (3, height, width) from ``cover``; NaN ones are computed here.
        screens: (M, 3, 3) from ``cover``.
        surfaces: (M, 3, 5) normal in the map and texture coordinates of every corner.
        tables: (M, 3) first texel, width and height of every triangle's texture.
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
