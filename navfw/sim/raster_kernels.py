"""Compiled kernels of the rasteriser: the visible triangle of each pixel, with its weights.

The arithmetic follows PyBullet's TinyRenderer operation by operation and in the same precision, so
that both give the same image to the last bit; invisible pixels and triangles are skipped. Single
precision unless a docstring states double: numba's ``float`` does not convert singles.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array, Floats, Int32s

_ZERO, _ONE, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_MIN_DOUBLE_AREA = 1e-2
"""Smallest doubled area of a triangle that is drawn [px^2]."""
_BORDER = np.float32(1.01)
"""Largest visible clip coordinate, relative to w: 1 plus a margin for rounding."""
_SLACK = 1e-3
"""Margin by which the computed span of a row is widened, for rounding [px]."""
_SIMD_WIDTH = 8
"""Number of pixels computed together; a row's count is rounded up to a multiple of it."""


@numba.njit(cache=True)
def combine(left: Floats, right: Floats) -> Floats:
    """Multiply two matrices (4, 4), adding terms from the last to the first."""
    out = np.empty((4, 4), np.float32)
    for i in range(4):
        for j in range(4):
            total = left[i, 3] * right[3, j]
            for k in range(2, -1, -1):
                total += left[i, k] * right[k, j]
            out[i, j] = total
    return out


@numba.njit(cache=True)
def _transform(matrix: Floats, points: Floats, out: Floats) -> None:
    """``out`` (n or more, 4) = matrix (4, 4) times each of (points (n, 3), 1)."""
    for k in range(points.shape[0]):
        for i in range(4):
            total = matrix[i, 3] + matrix[i, 2] * points[k, 2]
            total += matrix[i, 1] * points[k, 1]
            out[k, i] = total + matrix[i, 0] * points[k, 0]


@numba.njit(cache=True, error_model="numpy")
def _to_screen(clip: Floats, width: int, height: int, out: Floats) -> None:
    """``out`` (3,) = pixel coordinates x, y of a clip coordinate, and its w."""
    half_width, half_height = np.float32(width) * _HALF, np.float32(height) * _HALF
    w = clip[3]
    out[0] = (half_width * w + half_width * clip[0]) / w
    out[1] = (half_height * w + half_height * clip[1]) / w
    out[2] = w


@numba.njit(cache=True, error_model="numpy")
def _clip_edge(a: Floats, b: Floats, out: Floats, count: int) -> int:
    """Add the part of the edge a ... b beyond the near plane to the polygon ``out``."""
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
def _sides(screen: Floats, sides: Array) -> None:
    """Fill ``sides`` (3, 5) of a triangle with corners ``screen`` (3, 3), for ``_span``.

    Columns: first and last row of a side; its least and greatest x at row 0; dx per row.
    """
    for k in range(3):
        m = (k + 1) % 3
        x0, y0 = np.float64(screen[k, 0]), np.float64(screen[k, 1])
        x1, y1 = np.float64(screen[m, 0]), np.float64(screen[m, 1])
        sides[k, 0], sides[k, 1] = min(y0, y1) - _SLACK, max(y0, y1) + _SLACK
        if abs(y1 - y0) < 1.0:
            # nearly horizontal: the side's whole extent
            sides[k, 2], sides[k, 3], sides[k, 4] = min(x0, x1), max(x0, x1), 0.0
            continue
        slope = (x1 - x0) / (y1 - y0)
        # the margin of the rows shifts x by up to slope times margin
        off = abs(slope) * _SLACK + _SLACK
        x = x0 - slope * y0
        sides[k, 2], sides[k, 3], sides[k, 4] = x - off, x + off, slope


@numba.njit(cache=True)
def _span(sides: Array, y: int, first: float, last: float) -> tuple[int, int]:
    """The range of columns within first ... last in which row ``y`` may intersect a triangle."""
    low, high = np.inf, -np.inf
    for k in range(3):
        if sides[k, 0] <= y <= sides[k, 1]:
            moved = sides[k, 4] * y
            low, high = min(low, sides[k, 2] + moved), max(high, sides[k, 3] + moved)
    if low > high:
        return 1, 0
    return int(math.ceil(max(low, first))), int(math.floor(min(high, last)))


@numba.njit(cache=True, error_model="numpy")
def _fill(
    screen: Floats,
    depths: Floats,
    face: int,
    clipped: bool,
    near: float,
    far: float,
    nearest: Floats,
    faces: Int32s,
    weights: Floats,
) -> None:
    """Draw one triangle into the images of depth (``nearest``), of ``faces`` and of ``weights``.

    ``screen`` (3, 3) are its corners (x, y, w), ``depths`` (3,) their clip depths. At equal depth
    the later triangle wins. Double precision. The corners of a ``clipped`` part are not those of
    the triangle: its weights are NaN and computed by ``shade``.
    """
    height, width = nearest.shape
    ax, ay = np.float64(screen[0, 0]), np.float64(screen[0, 1])
    bx, by = np.float64(screen[1, 0]) - ax, np.float64(screen[1, 1]) - ay
    cx, cy = np.float64(screen[2, 0]) - ax, np.float64(screen[2, 1]) - ay
    area = cx * by - bx * cy
    if not abs(area) > _MIN_DOUBLE_AREA:
        return
    w0, w1, w2 = np.float64(screen[0, 2]), np.float64(screen[1, 2]), np.float64(screen[2, 2])
    d0, d1, d2 = np.float64(depths[0]), np.float64(depths[1]), np.float64(depths[2])
    left = max(0.0, min(screen[0, 0], screen[1, 0], screen[2, 0]))
    right = min(float(width - 1), max(screen[0, 0], screen[1, 0], screen[2, 0]))
    top = max(0.0, min(screen[0, 1], screen[1, 1], screen[2, 1]))
    bottom = min(float(height - 1), max(screen[0, 1], screen[1, 1], screen[2, 1]))
    if left > right or top > bottom:
        return
    sides = np.empty((3, 5))
    _sides(screen, sides)
    # for each pixel of a row: least barycentric coordinate, depth, three weights
    row = np.empty((5, width + _SIMD_WIDTH))
    for y in range(int(top), int(math.floor(bottom)) + 1):
        first, last = _span(sides, y, left, math.floor(right))
        count = last + 1 - first
        # two loops: the first has no branches and is vectorised
        sy = ay - y
        for i in range((count + _SIMD_WIDTH - 1) // _SIMD_WIDTH * _SIMD_WIDTH):
            sx = ax - (first + i)
            u = bx * sy - sx * by
            v = sx * cy - cx * sy
            q0, q1, q2 = 1.0 - (u + v) / area, v / area, u / area
            p0, p1, p2 = q0 / w0, q1 / w1, q2 / w2
            total = p0 + p1 + p2
            b0, b1, b2 = p0 / total, p1 / total, p2 / total
            row[0, i] = min(q0, q1, q2)
            row[1, i] = -(d2 * b2 + d1 * b1 + d0 * b0)
            row[2, i], row[3, i], row[4, i] = b0, b1, b2
        for i in range(count):
            # unsigned: numba then omits the test for negative indices
            line, x, depth = np.uint64(y), np.uint64(first + i), row[1, i]
            if row[0, i] < 0.0 or nearest[line, x] > depth:
                continue
            if clipped or -far <= depth <= near:
                nearest[line, x] = depth
                faces[line, x] = face
                for k in range(3):
                    weights[k, line, x] = np.nan if clipped else row[2 + k, i]


@numba.njit(cache=True, error_model="numpy")
def cover(
    points: Floats,
    corners: Int32s,
    runs: Int32s,
    models: Floats,
    view: Floats,
    projection: Floats,
    eye: Array,
    nearest: Floats,
    faces: Int32s,
    weights: Floats,
    screens: Floats,
) -> None:
    """Find the visible triangle of every pixel.

    Args:
        points: (N, 3) vertices of all bodies, in their own axes [m].
        corners: (M, 3) vertices of every triangle, counter-clockwise from its front.
        runs: (bodies, 4) first vertex, one past the last, first triangle, one past the last.
        models: (bodies, 4, 4) transforms from their axes to the map.
        view: (4, 4) transform from the map to the camera's axes (right, up, back).
        projection: (4, 4) transform to clip coordinates.
        eye: (3,) position of the camera in the map [m].
        nearest: (height, width) filled with the negative clip depth; row 0 is the lowest.
        faces: (height, width) filled with indices of triangles, -1 for none.
        weights: (3, height, width) filled with the perspective-correct barycentric weights of the
            triangle's corners; NaN for triangles that extend behind the camera.
        screens: (M, 3, 3) filled with the corners (x, y, w) of the triangles drawn.

    """
    near = np.float64(projection[2, 3] / (projection[2, 2] - _ONE))
    far = np.float64(projection[2, 3] / (projection[2, 2] + _ONE))
    nearest[:] = -np.float32(far)
    faces[:] = -1
    most = 0
    for body in range(runs.shape[0]):
        most = max(most, runs[body, 1] - runs[body, 0])
    clip, near_eye = np.empty((most, 4), np.float32), np.empty(3)
    for body in range(runs.shape[0]):
        first = runs[body, 0]
        matrix = combine(projection, combine(view, models[body]))
        _transform(matrix, points[first : runs[body, 1]], clip)
        for i in range(3):  # the eye in the body's axes
            near_eye[i] = 0.0
            for k in range(3):
                near_eye[i] += models[body, k, i] * (eye[k] - models[body, k, 3])
        for face in range(runs[body, 2], runs[body, 3]):
            a, b, c = corners[face, 0] - first, corners[face, 1] - first, corners[face, 2] - first
            if _outside_view(clip, a, b, c):
                continue
            if _faces_eye(points, first + a, first + b, first + c, near_eye):
                _draw_triangle(
                    *(clip[a], clip[b], clip[c], face, near, far),
                    *(nearest, faces, weights, screens[face]),
                )


@numba.njit(cache=True)
def _outside_view(clip: Floats, a: int, b: int, c: int) -> bool:
    """Whether a triangle is entirely beyond one border of the image, or behind the camera."""
    left = right = above = below = behind = True
    for i in (a, b, c):  # indices, as views of rows cost more than the test
        reach = _BORDER * clip[i, 3]
        left &= clip[i, 0] < -reach
        right &= clip[i, 0] > reach
        above &= clip[i, 1] > reach
        below &= clip[i, 1] < -reach
        behind &= clip[i, 3] < _ZERO
    return left or right or above or below or behind


@numba.njit(cache=True)
def _faces_eye(points: Floats, a: int, b: int, c: int, eye: Array) -> bool:
    """Whether the eye is in front of a triangle with these corners. Double precision."""
    ax, ay, az = np.float64(points[a, 0]), np.float64(points[a, 1]), np.float64(points[a, 2])
    ux, uy, uz = points[b, 0] - ax, points[b, 1] - ay, points[b, 2] - az
    vx, vy, vz = points[c, 0] - ax, points[c, 1] - ay, points[c, 2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return bool((ax - eye[0]) * nx + (ay - eye[1]) * ny + (az - eye[2]) * nz < 0.0)


@numba.njit(cache=True, error_model="numpy")
def _draw_triangle(
    a: Floats,
    b: Floats,
    c: Floats,
    face: int,
    near: float,
    far: float,
    nearest: Floats,
    faces: Int32s,
    weights: Floats,
    screen: Floats,
) -> None:
    """Draw the triangle with these clip coordinates, clipped if it extends behind the camera."""
    height, width = nearest.shape
    depths = np.empty(3, np.float32)
    for k, corner in enumerate((a, b, c)):
        _to_screen(corner, width, height, screen[k])
        depths[k] = corner[2]
    if a[3] >= _ZERO and b[3] >= _ZERO and c[3] >= _ZERO:
        _fill(screen, depths, face, False, near, far, nearest, faces, weights)
        return
    polygon, triangle = np.empty((6, 4), np.float32), np.empty((3, 3), np.float32)
    count = _clip_edge(a, b, polygon, 0)
    count = _clip_edge(b, c, polygon, count)
    count = _clip_edge(c, a, polygon, count)
    # the polygon as a triangle fan
    for i in range(1, count - 1):
        for k, at in enumerate((0, i, i + 1)):
            _to_screen(polygon[at], width, height, triangle[k])
            depths[k] = polygon[at, 2]
        _fill(triangle, depths, face, True, near, far, nearest, faces, weights)
