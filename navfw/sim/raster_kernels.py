"""Compiled inner loops of drawing: which triangle each pixel shows, and in what colour.

The arithmetic is that of PyBullet's TinyRenderer, operation by operation and in its precisions, so
that both give the same image to the last bit; what no pixel can show is left out. Single precision
where names end in nothing, doubles where a comment says so.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["combine", "cover", "shade"]

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Longs = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]
Doubles = npt.NDArray[np.float64]

_ZERO, _ONE, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_WHITE, _BRIGHTEST = np.uint8(255), np.float32(255.0)
_BEYOND = np.float32(128.0)
"""Grey of what lies outside a texture."""
_NOTHING, _OUTSIDE = -1, -2
"""No texel: the pixel shows no triangle, or what lies outside its texture."""
_FLAT = 1e-2
"""Triangles of less than half of this area are not drawn [px^2]."""
_BORDER = np.float32(1.01)
"""How far from its middle the image surely ends, in halves of its size."""
_SLACK = 1e-3
"""How much wider than computed the span of a row is taken, for rounding [px]."""


@numba.njit(cache=True)
def combine(left: Floats, right: Floats) -> Floats:
    """Matrix product (4, 4), summed from the last term to the first."""
    out = np.empty((4, 4), np.float32)
    for i in range(4):
        for j in range(4):
            total = left[i, 3] * right[3, j]
            for k in range(2, -1, -1):
                total += left[i, k] * right[k, j]
            out[i, j] = total
    return out


@numba.njit(cache=True)
def _transform(matrix: Floats, point: Floats, out: Floats) -> None:
    """``out`` (3 or 4,) = matrix (4, 4) times (point, 1)."""
    for i in range(out.size):
        total = matrix[i, 3] + matrix[i, 2] * point[2]
        total += matrix[i, 1] * point[1]
        out[i] = total + matrix[i, 0] * point[0]


@numba.njit(cache=True, error_model="numpy")
def _to_screen(clip: Floats, width: int, height: int, out: Floats) -> None:
    """Pixel (x, y) of a clip coordinate, and its w."""
    half_width, half_height = np.float32(width) * _HALF, np.float32(height) * _HALF
    w = clip[3]
    out[0] = (half_width * w + half_width * clip[0]) / w
    out[1] = (half_height * w + half_height * clip[1]) / w
    out[2] = w


@numba.njit(cache=True, error_model="numpy")
def _clip_edge(a: Floats, b: Floats, out: Floats, count: int) -> int:
    """Add what of the edge a ... b lies beyond the near plane to the polygon ``out``."""
    a_inside = a[3] > _ZERO and a[2] > -a[3]
    b_inside = b[3] > _ZERO and b[2] > -b[3]
    if not (a_inside or b_inside):
        return count
    out[count], out[count + 1] = a, b
    if not (a_inside and b_inside):
        da, db = a[2] + a[3], b[2] + b[3]
        factor = np.float32(1.0 / np.float64(db - da))
        at = count + 1 if a_inside else count
        for k in range(4):
            out[at, k] = (a[k] * db - b[k] * da) * factor
    return count + 2


@numba.njit(cache=True, error_model="numpy")
def _span(screen: Floats, y: int, first: int, last: int) -> tuple[int, int]:
    """The part of columns first ... last in which row ``y`` may meet a triangle."""
    low, high = np.inf, -np.inf
    for k in range(3):
        m = (k + 1) % 3
        x0, y0 = np.float64(screen[k, 0]), np.float64(screen[k, 1])
        x1, y1 = np.float64(screen[m, 0]), np.float64(screen[m, 1])
        if min(y0, y1) - _SLACK > y or max(y0, y1) + _SLACK < y:
            continue
        if abs(y1 - y0) < 1.0:
            # a shallow edge: all of it
            low, high = min(low, x0, x1), max(high, x0, x1)
            continue
        x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
        # where the edge ends within the row's slack, x may be off by as much as its slope says
        off = abs((x1 - x0) / (y1 - y0)) * _SLACK + _SLACK
        low, high = min(low, x - off), max(high, x + off)
    if low > high:
        return 1, 0
    low, high = max(low, float(first)), min(high, float(last))
    return int(math.ceil(low)), int(math.floor(high))


@numba.njit(cache=True, error_model="numpy")
def _fill(
    screen: Floats,
    depths: Floats,
    face: int,
    clipped: bool,
    near: float,
    far: float,
    nearest: Floats,
    faces: Ints,
) -> None:
    """Enter one triangle into the images of depth (``nearest``) and of ``faces``.

    ``screen`` (3, 3) are its corners (x, y, w), ``depths`` (3,) their clip depths. Of what is
    equally near, the last one counts. Doubles.
    """
    height, width = nearest.shape
    ax, ay = np.float64(screen[0, 0]), np.float64(screen[0, 1])
    bx, by = np.float64(screen[1, 0]) - ax, np.float64(screen[1, 1]) - ay
    cx, cy = np.float64(screen[2, 0]) - ax, np.float64(screen[2, 1]) - ay
    area = cx * by - bx * cy
    if not abs(area) > _FLAT:
        return
    w0, w1, w2 = np.float64(screen[0, 2]), np.float64(screen[1, 2]), np.float64(screen[2, 2])
    d0, d1, d2 = np.float64(depths[0]), np.float64(depths[1]), np.float64(depths[2])
    left = max(0.0, min(screen[0, 0], screen[1, 0], screen[2, 0]))
    right = min(float(width - 1), max(screen[0, 0], screen[1, 0], screen[2, 0]))
    top = max(0.0, min(screen[0, 1], screen[1, 1], screen[2, 1]))
    bottom = min(float(height - 1), max(screen[0, 1], screen[1, 1], screen[2, 1]))
    if left > right or top > bottom:
        return
    inside, depth = np.empty(width), np.empty(width)
    for y in range(int(top), int(math.floor(bottom)) + 1):
        first, last = _span(screen, y, int(left), int(math.floor(right)))
        # two loops, of which the first is all arithmetic: processors do several pixels at once
        sy = ay - y
        for i in range(last + 1 - first):
            sx = ax - (first + i)
            u = bx * sy - sx * by
            v = sx * cy - cx * sy
            q0, q1, q2 = 1.0 - (u + v) / area, v / area, u / area
            p0, p1, p2 = q0 / w0, q1 / w1, q2 / w2
            total = p0 + p1 + p2
            inside[i] = min(q0, q1, q2)
            depth[i] = -(d2 * (p2 / total) + d1 * (p1 / total) + d0 * (p0 / total))
        for i in range(last + 1 - first):
            if inside[i] < 0.0 or nearest[y, first + i] > depth[i]:
                continue
            if clipped or -far <= depth[i] <= near:
                nearest[y, first + i] = depth[i]
                faces[y, first + i] = face


@numba.njit(cache=True, error_model="numpy")
def cover(
    points: Floats,
    corners: Ints,
    runs: Ints,
    shown: Flags,
    models: Floats,
    view: Floats,
    projection: Floats,
    eye: Doubles,
    nearest: Floats,
    faces: Ints,
    screens: Floats,
) -> None:
    """Find what every pixel shows.

    Args:
        points: (N, 3) of all bodies, in their own axes [m].
        corners: (M, 3) points of every triangle, counter-clockwise seen from its front.
        runs: (bodies, 4) first point, one past the last, first triangle, one past the last.
        shown: (bodies,) which of them to draw.
        models: (bodies, 4, 4) from their axes to those of the map.
        view: (4, 4) from the map to the camera's axes (right, up, back).
        projection: (4, 4) to clip coordinates.
        eye: (3,) the camera's place in the map [m].
        nearest: (height, width) filled with minus the clip depth; row 0 is the lowest.
        faces: (height, width) filled with triangles, -1 for none.
        screens: (M, 3, 3) filled with the corners (x, y, w) of the triangles that were drawn.

    """
    near = np.float64(projection[2, 3] / (projection[2, 2] - _ONE))
    far = np.float64(projection[2, 3] / (projection[2, 2] + _ONE))
    nearest[:] = -np.float32(far)
    faces[:] = -1
    most = 0
    for body in range(runs.shape[0]):
        most = max(most, runs[body, 1] - runs[body, 0])
    clip, world = np.empty((most, 4), np.float32), np.empty((most, 3), np.float32)
    for body in range(runs.shape[0]):
        if not shown[body]:
            continue
        first = runs[body, 0]
        matrix = combine(projection, combine(view, models[body]))
        for i in range(runs[body, 1] - first):
            _transform(matrix, points[first + i], clip[i])
            _transform(models[body], points[first + i], world[i])
        for face in range(runs[body, 2], runs[body, 3]):
            a, b, c = corners[face, 0] - first, corners[face, 1] - first, corners[face, 2] - first
            if _beside(clip[a], clip[b], clip[c]):
                continue
            if _faces_eye(world[a], world[b], world[c], eye):
                _enter(clip[a], clip[b], clip[c], face, near, far, nearest, faces, screens[face])


@numba.njit(cache=True)
def _beside(a: Floats, b: Floats, c: Floats) -> bool:
    """Whether a triangle lies wholly beside, above, below or behind what the camera sees."""
    left = right = above = below = behind = True
    for corner in (a, b, c):
        reach = _BORDER * corner[3]
        left &= corner[0] < -reach
        right &= corner[0] > reach
        above &= corner[1] > reach
        below &= corner[1] < -reach
        behind &= corner[3] < _ZERO
    return left or right or above or below or behind


@numba.njit(cache=True)
def _faces_eye(a: Floats, b: Floats, c: Floats, eye: Doubles) -> bool:
    """Whether the eye is in front of a triangle with these corners in the map. Doubles."""
    ax, ay, az = np.float64(a[0]), np.float64(a[1]), np.float64(a[2])
    ux, uy, uz = b[0] - ax, b[1] - ay, b[2] - az
    vx, vy, vz = c[0] - ax, c[1] - ay, c[2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return bool((ax - eye[0]) * nx + (ay - eye[1]) * ny + (az - eye[2]) * nz < 0.0)


@numba.njit(cache=True, error_model="numpy")
def _enter(
    a: Floats,
    b: Floats,
    c: Floats,
    face: int,
    near: float,
    far: float,
    nearest: Floats,
    faces: Ints,
    screen: Floats,
) -> None:
    """Enter the triangle with these clip coordinates, clipped if it reaches behind the camera."""
    height, width = nearest.shape
    depths = np.empty(3, np.float32)
    for k, corner in enumerate((a, b, c)):
        _to_screen(corner, width, height, screen[k])
        depths[k] = corner[2]
    if a[3] >= _ZERO and b[3] >= _ZERO and c[3] >= _ZERO:
        _fill(screen, depths, face, False, near, far, nearest, faces)
        return
    polygon, part = np.empty((6, 4), np.float32), np.empty((3, 3), np.float32)
    count = _clip_edge(a, b, polygon, 0)
    count = _clip_edge(b, c, polygon, count)
    count = _clip_edge(c, a, polygon, count)
    # as a fan
    for i in range(1, count - 1):
        for k, at in enumerate((0, i, i + 1)):
            _to_screen(polygon[at], width, height, part[k])
            depths[k] = polygon[at, 2]
        _fill(part, depths, face, True, near, far, nearest, faces)


@numba.njit(cache=True, error_model="numpy")
def shade(
    faces: Ints,
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
    weights, lit = np.empty((3, width), np.float32), np.empty(width, np.float32)
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
            _weigh(screens[face], y, begin, x, weights)
            _light(normals, points, weights, light, np.float32(diffuse), lit[begin:x])
            _locate(uvs, points, weights, table, places[begin:x])
        # nothing but this, so that many texels are on their way from memory at once
        for x in range(width):
            place = max(places[x], 0)
            for c in range(3):
                colours[x, c] = texels[place, c]
        _paint(colours, places, np.float32(ambient), lit, out[height - 1 - y])


@numba.njit(cache=True, error_model="numpy")
def _weigh(screen: Floats, y: int, begin: int, end: int, weights: Floats) -> None:
    """How much of each corner the pixels begin ... end of row ``y`` show, in perspective.

    Doubles inside.
    """
    ax, ay = np.float64(screen[0, 0]), np.float64(screen[0, 1])
    bx, by = np.float64(screen[1, 0]) - ax, np.float64(screen[1, 1]) - ay
    cx, cy = np.float64(screen[2, 0]) - ax, np.float64(screen[2, 1]) - ay
    w0, w1, w2 = np.float64(screen[0, 2]), np.float64(screen[1, 2]), np.float64(screen[2, 2])
    area, sy = cx * by - bx * cy, ay - y
    first, second, third = weights
    for i in range(end - begin):
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
