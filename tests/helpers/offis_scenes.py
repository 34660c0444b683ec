"""Analytic scenes for OFFIS: rays against planes and boxes give ideal derotated flow and truth.

World axes: x ahead, y left, z up; the camera stands above the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.flow import grid_points
from navfw.numerics import Array
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField


@dataclass(frozen=True)
class Wall:
    """A vertical wall from (x, y) ``start`` to ``end``, between heights ``low`` and ``high``."""

    start: tuple[float, float]
    end: tuple[float, float]
    low: float = 0.0
    high: float = 2.4


@dataclass(frozen=True)
class Scene:
    walls: tuple[Wall, ...] = ()
    floor: float | None = 0.0
    ceiling: float | None = None
    holes: tuple[tuple[float, float, float, float], ...] = ()

    def depth(self, points: Array, camera: CameraModel) -> Array:
        """Depth along the optical axis for image points (..., 2) [px]; inf where nothing is hit."""
        f = camera.focal
        rays = np.stack([points[..., 0] / f, points[..., 1] / f, np.ones(points.shape[:-1])], -1)
        rays = rays @ camera.base_from_camera.T
        depth = np.full(points.shape[:-1], np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            for level in (self.floor, self.ceiling):
                if level is not None:
                    t = (level - camera.mount_height) / rays[..., 2]
                    depth = np.where((t > 1e-9) & (t < depth), t, depth)
            for x0, x1, y0, y1 in self.holes:
                assert self.floor is not None
                t = (self.floor - camera.mount_height) / rays[..., 2]
                inside = (rays[..., 0] * t > x0) & (rays[..., 0] * t < x1)
                inside &= (rays[..., 1] * t > y0) & (rays[..., 1] * t < y1) & (t > 0)
                deeper = (self.floor - 0.5 - camera.mount_height) / rays[..., 2]
                depth = np.where(inside & (depth == t), deeper, depth)
            for wall in self.walls:
                (ax, ay), (bx, by) = wall.start, wall.end
                nx, ny = -(by - ay), bx - ax
                t = (nx * ax + ny * ay) / (rays[..., 0] * nx + rays[..., 1] * ny)
                hx, hy = rays[..., 0] * t, rays[..., 1] * t
                along = ((hx - ax) * (bx - ax) + (hy - ay) * (by - ay)) / (nx * nx + ny * ny)
                z = camera.mount_height + rays[..., 2] * t
                hit = (t > 1e-9) & (t < depth) & (along >= 0) & (along <= 1)
                hit &= (z >= wall.low) & (z <= wall.high)
                depth = np.where(hit, t, depth)
        return depth

    def mirrored(self) -> Scene:
        """The scene with left and right exchanged."""

        def flip(p: tuple[float, float]) -> tuple[float, float]:
            return p[0], -p[1]

        walls = tuple(Wall(flip(w.start), flip(w.end), w.low, w.high) for w in self.walls)
        holes = tuple((x0, x1, -y1, -y0) for x0, x1, y0, y1 in self.holes)
        return Scene(walls, self.floor, self.ceiling, holes)


def box(x: float, y: float, size: float, height: float) -> tuple[Wall, ...]:
    """Four sides of a square box whose centre is at (x, y)."""
    r = size / 2
    corners = [(x - r, y - r), (x - r, y + r), (x + r, y + r), (x + r, y - r)]
    return tuple(Wall(corners[i], corners[(i + 1) % 4], 0.0, height) for i in range(4))


def motion(
    forward: float = 0.06, left: float = 0.0, camera: CameraModel | None = None, **sigmas: float
) -> CameraMotion:
    camera = camera or CameraModel()
    translation = camera.base_from_camera.T @ np.array([forward, left, 0.0])
    return CameraMotion(np.eye(3), translation, 0.2, **sigmas)


def ideal_flow(
    scene: Scene,
    camera: CameraModel | None = None,
    moved: CameraMotion | None = None,
    rows: int = 12,
    cols: int = 16,
    sigma: float = 0.05,
    noise: np.random.Generator | None = None,
) -> tuple[FlowField, Array]:
    """(derotated flow, true depth) of ``scene``; ``noise`` adds errors of ``sigma`` [px]."""
    camera = camera or CameraModel()
    moved = moved or motion(camera=camera)
    points = grid_points(camera, rows, cols)
    depth = scene.depth(points, camera)
    s = moved.translation
    e = points * s[2] - camera.focal * s[:2]
    vectors = e / (depth + s[2])[..., None]
    if noise is not None:
        vectors = vectors + noise.normal(0.0, sigma, vectors.shape)
    full = np.ones((rows, cols))
    return FlowField(1.0, points, vectors, full, sigma * full, moved, derotated=True), depth


def wall_ahead(distance: float, angle: float = 0.0, half: float = 20.0) -> Wall:
    """A long wall across the x axis at ``distance``; its left is nearer when ``angle`` > 0."""
    dx, dy = -math.sin(angle) * half, math.cos(angle) * half
    return Wall((distance + dx, dy), (distance - dx, -dy))


def corridor(half: float = 0.8, end: float = 6.0, shift: float = 0.0) -> tuple[Wall, ...]:
    """A corridor along x with an end wall; ``shift`` [m] moves the robot to its left."""
    left, right = half - shift, -half - shift
    return (
        Wall((-5.0, left), (end, left)),
        Wall((-5.0, right), (end, right)),
        Wall((end, left), (end, right)),
    )


def corner(distance: float, angle: float = math.pi / 4) -> tuple[Wall, ...]:
    """Two walls meeting ``distance`` ahead; the left one is turned by 90 degrees - ``angle``."""
    c, s = 20.0 * math.cos(angle), 20.0 * math.sin(angle)
    return (Wall((distance, 0.0), (distance - c, s)), Wall((distance, 0.0), (distance - s, -c)))


def door(distance: float, behind: float = 3.0, angle: float = 0.0) -> tuple[Wall, ...]:
    """A wall with a door gap of 0.95 m straight ahead, and the next wall ``behind`` it."""

    def at(along: float) -> tuple[float, float]:
        return distance - math.sin(angle) * along, math.cos(angle) * along

    gap = 0.475
    return (Wall(at(20.0), at(gap)), Wall(at(-gap), at(-20.0)), wall_ahead(distance + behind))
