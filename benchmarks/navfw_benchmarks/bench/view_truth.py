"""Ground truth of a view, only from the world's geometry; OFFIS is measured against it.

*Objects* are all surfaces in view except floor and ceiling. The *nearness of a quadrant* is the
largest value of 1/Z (Z: depth along the optical axis) that at least ``_CELL_AREA`` of its pixels
reach; that is the area of one grid cell, the smallest object that the grid resolves. The *nearest
object* is in the quadrants whose nearness is about the largest. "About" is fuzzy, so the truth is
two sets: quadrants with 85 % and more of the largest nearness are *certain*, those with 65 % and
more *possible*.

The *distance term* is the result of the rule base ``distance.yaml`` for the true distance of the
nearest object at the true speed.

The *elementary situation* (paper sec 4.4 and Table 1) follows only from the walls: a ray is cast
through each image column at camera height. The *plane of a half image* is the wall plane that fills
at least two thirds of its columns; its *slope* is the angle to the image plane, positive where the
outer side is nearer. Several situations may hold at once:

- ``wall``: both halves show the same plane, at most 13 degrees aslant;
- ``left slope wall`` / ``right slope wall``: the same, 13 to 60 degrees aslant, left / right side
  nearer. From 10 to 16 degrees wall and slope wall are both true;
- ``corner``: the halves show two planes that meet there, concave, at less than 150 degrees;
- ``corridor``: two planes facing each other, both steeper than 60 degrees;
- ``door``: the optical axis passes through a visible opening in a wall, which appears at least
  24 px wide (one matching window), extends at least 8 px to either side of the axis, and leaves at
  least a quarter of each image half for what is beside it.

The terms of ``slope.yaml`` cross at 13 and 60 degrees. A view without any of these situations is
``mixed``; a view with more than a third of the walls of either half behind furniture is ``hidden``.
Neither counts for or against the situations. A *possible* situation needs planes over half of the
columns of each image half only, and a door half as wide; furniture is ignored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navfw.numerics import Array
from navfw.numerics.arrays import Indices
from navfw.offis.nearness import TERMS, find_distances
from navfw.offis.pyramid import QUADRANTS
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim.camera import DepthImage
from navfw.sim.shapes import Rectangle
from navfw.sim.solids import opening_segment, solids_of, wall_segments
from navfw.sim.worldspec import WorldSpec

_CELL_AREA = 100
"""Area [px] of one cell of a 12 x 16 grid over 160 x 120 px."""

ALIKE, UNLIKE = 0.85, 0.65
"""Shares of the largest nearness from which on a quadrant is certain, and possible."""

_ORTHOGONAL, _STEEP = math.radians(13.0), math.radians(60.0)
"""Slopes [rad] at which the terms of ``slope.yaml`` cross."""

_FUZZY = math.radians(3.0)
"""Half-width [rad] of the interval of slopes in which wall and slope wall both hold."""

DOMINANT, HIDDEN = 2.0 / 3.0, 1.0 / 3.0
"""Least share of a half's columns on one plane; largest share of its walls behind furniture."""

MAJORITY = 0.5
"""Share of a half's columns on one plane from which on a situation is possible."""

DOOR_WIDTH, _DOOR_SIDE = 24.0, 8.0
"""Least width [px] in the image of a door ahead, and how far it reaches to either side of the axis;
a possible door has half of these."""

_FLOOR_MARGIN = 0.05
"""Height [m] above the floor, and below the ceiling, within which pixels belong to these."""


@dataclass(frozen=True, slots=True)
class HalfPlane:
    """The wall plane that fills most columns of the left or right half of an image.

    ``face`` is one of its faces, -1 if there is no wall; ``share`` is its share of the columns;
    ``slope`` [rad] is its angle to the image plane, positive where the outer side is nearer.
    """

    face: int
    share: float
    slope: float


@dataclass(frozen=True, slots=True)
class ViewTruth:
    """Ground truth of one view.

    ``nearness`` (4,) [1/m] of P1..P4; ``certain`` and ``possible`` name the quadrants of the
    nearest object; ``distance`` [m] is its depth and ``term`` its distance term. ``situations``
    are all that hold, or ``("mixed",)``, or ``("hidden",)``; ``possible_situations`` those that
    hold by the limits for possible ones if furniture is ignored. ``planes`` and ``hidden`` have
    the largest plane of the left and of the right half, and the share of its wall pixels that are
    behind furniture.
    """

    nearness: tuple[float, ...]
    certain: frozenset[str]
    possible: frozenset[str]
    distance: float
    term: str
    situations: tuple[str, ...]
    possible_situations: tuple[str, ...]
    planes: tuple[HalfPlane, HalfPlane]
    hidden: tuple[float, float]

    @property
    def clear(self) -> bool:
        """Whether the view shows an elementary situation."""
        return self.situations not in {("mixed",), ("hidden",)}


class WallGeometry:
    """The walls of one world: faces for ray casting, their planes, and openings."""

    def __init__(self, world: WorldSpec) -> None:
        starts, ends, planes = [], [], []
        keys: dict[tuple[int, int, int], int] = {}
        for solid in solids_of(world):
            if solid.kind != "wall" or not isinstance(solid.shape, Rectangle):
                continue
            corners = solid.shape.corners
            for a, b in pairwise([*corners, corners[0]]):
                edge = (b - a) / np.hypot(*(b - a))
                normal = np.array([edge[1], -edge[0]])  # corners run counter-clockwise: outward
                key = tuple(np.rint([*(normal * 100.0), normal @ a * 50.0]).astype(int).tolist())
                starts.append(a)
                ends.append(b)
                planes.append(keys.setdefault(key, len(keys)))
        self._start, self._end = np.array(starts), np.array(ends)
        self._plane = np.array(planes)
        edges = self._end - self._start
        edges /= np.hypot(edges[:, 0], edges[:, 1])[:, None]
        self._normal = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
        self._gaps = [
            (np.array(opening.at), 0.5 * opening.width, wall_segments(wall)[index].yaw)
            for wall in world.walls
            for opening in wall.openings
            if (index := opening_segment(wall, opening)) is not None
        ]
        self.height = max((wall.height for wall in world.walls), default=0.0)

    def cast(self, pose: Pose, camera: CameraModel) -> tuple[Array, Indices]:
        """Depth [m] (inf: no wall) and face of each image column (width,), at camera height."""
        x = np.arange(camera.width) - 0.5 * (camera.width - 1)
        eye, ahead, right = _axes(pose, camera)
        rays = ahead + x[:, None] / camera.focal * right  # depth 1 along the optical axis
        edge = self._end - self._start
        to_start = self._start - eye
        cross = rays[:, :1] * edge[:, 1] - rays[:, 1:] * edge[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (to_start[:, 0] * edge[:, 1] - to_start[:, 1] * edge[:, 0]) / cross
            along = (to_start[:, 0] * rays[:, 1:] - to_start[:, 1] * rays[:, :1]) / cross
        hit = (depth > 1e-6) & (along >= 0.0) & (along <= 1.0)
        depth = np.where(hit, depth, np.inf)
        face = depth.argmin(axis=1)
        return depth[np.arange(x.size), face], face

    def situations(
        self, pose: Pose, camera: CameraModel, *, possible: bool = False
    ) -> tuple[str, ...]:
        """All elementary situations that the walls form, or ``("mixed",)``.

        With ``possible``, planes need fill only ``MAJORITY``, and doors may be half as wide.
        """
        depth, _ = self.cast(pose, camera)
        left, right = self.halves(pose, camera)
        situations = []
        if self._door_ahead(pose, camera, depth, 0.5 if possible else 1.0):
            situations.append("door")
        if min(left.share, right.share) >= (MAJORITY if possible else DOMINANT):
            situations += self._from_planes(left, right)
        return tuple(situations) or ("mixed",)

    def halves(self, pose: Pose, camera: CameraModel) -> tuple[HalfPlane, HalfPlane]:
        """The largest planes of the left and of the right half of the image."""
        depth, face = self.cast(pose, camera)
        half = face.size // 2
        return (
            self._largest(pose, depth[:half], face[:half], outer=-1.0),
            self._largest(pose, depth[half:], face[half:], outer=1.0),
        )

    def _largest(self, pose: Pose, depth: Array, face: Indices, outer: float) -> HalfPlane:
        """The largest plane of a half whose outer side is the left (-1) or the right (1)."""
        planes = np.where(np.isfinite(depth), self._plane[face], -1)
        values, counts = np.unique(planes, return_counts=True)
        best = int(values[counts.argmax()])
        share = float(counts.max() / face.size)
        if best < 0:
            return HalfPlane(-1, 0.0, 0.0)
        one = int(face[planes == best][0])
        ahead, right = _ahead_and_right(pose)
        towards = -self._normal[one]  # nearness grows along it
        slope = math.atan2(float(towards @ right), float(towards @ ahead))
        return HalfPlane(one, share, outer * slope)

    def _from_planes(self, left: HalfPlane, right: HalfPlane) -> list[str]:
        slope_left, slope_right = left.slope, right.slope
        if self._plane[left.face] == self._plane[right.face]:
            aslant = abs(slope_left)
            side = "left" if slope_left > 0.0 else "right"
            situations = ["wall"] if aslant <= _ORTHOGONAL + _FUZZY else []
            if _ORTHOGONAL - _FUZZY <= aslant <= _STEEP:
                situations.append(f"{side} slope wall")
            return situations
        if min(slope_left, slope_right) > _STEEP:
            facing = float(self._normal[left.face] @ self._normal[right.face])
            return ["corridor"] if facing < -math.cos(math.radians(10.0)) else []
        between = math.pi - slope_left - slope_right
        concave = slope_left + slope_right > math.radians(30.0)
        return ["corner"] if concave and between < math.radians(150.0) else []

    def _door_ahead(self, pose: Pose, camera: CameraModel, depth: Array, scale: float) -> bool:
        eye, ahead, right = _axes(pose, camera)
        for middle, half, yaw in self._gaps:
            along = np.array([math.cos(yaw), math.sin(yaw)]) * half
            ends = np.array([middle - along, middle + along]) - eye
            far = ends @ ahead
            if far.min() < 0.2:
                continue
            x0, x1 = sorted((camera.focal * (ends @ right) / far).tolist())
            quarter = 0.375 * camera.width
            side = scale * _DOOR_SIDE
            if x1 - x0 < scale * DOOR_WIDTH or x0 > -side or x1 < side:
                continue
            if x0 < -quarter or x1 > quarter:
                continue
            column = round(0.5 * (camera.width - 1))
            if depth[column] > far.max():
                return True
        return False


def truth_of(
    walls: WallGeometry, pose: Pose, speed: float, depth: DepthImage, robot: RobotModel
) -> ViewTruth:
    """Ground truth of the view from ``pose`` at ``speed`` [m/s], with its ``depth`` image [m]."""
    camera = robot.camera
    rows, columns = depth.shape
    y = np.arange(rows)[:, None] - 0.5 * (rows - 1)
    height = camera.mount_height - depth * (y / camera.focal)
    solid = np.isfinite(depth) & (height > _FLOOR_MARGIN) & (height < walls.height - _FLOOR_MARGIN)
    nearness = np.where(solid, 1.0 / np.maximum(depth, 1e-3), 0.0)
    largest = quadrant_nearness(nearness, _CELL_AREA)
    biggest = max(largest)
    distance = 1.0 / max(biggest, 1e-3)

    walls_depth, _ = walls.cast(pose, camera)
    wall_height = camera.mount_height - walls_depth * (y / camera.focal)
    expected = (
        np.isfinite(walls_depth) & (wall_height > _FLOOR_MARGIN) & (wall_height < walls.height)
    )
    hides = expected & solid & (depth < 0.97 * walls_depth - 0.02)
    sides = np.s_[: columns // 2], np.s_[columns // 2 :]
    hidden = [float(hides[:, side].sum() / max(expected[:, side].sum(), 1)) for side in sides]
    situations = walls.situations(pose, camera)
    return ViewTruth(
        nearness=tuple(largest),
        certain=_alike(largest, ALIKE),
        possible=_alike(largest, UNLIKE),
        distance=distance,
        term=true_term(distance, speed),
        situations=("hidden",) if max(hidden) > HIDDEN else situations,
        possible_situations=walls.situations(pose, camera, possible=True),
        planes=walls.halves(pose, camera),
        hidden=(hidden[0], hidden[1]),
    )


def quadrant_nearness(nearness: Array, area: int) -> list[float]:
    """The greatest nearness that ``area`` pixels reach in P1 (upper right) to P4, as QUADRANTS."""
    rows, columns = nearness.shape
    halves = np.s_[: rows // 2], np.s_[rows // 2 :]
    sides = np.s_[: columns // 2], np.s_[columns // 2 :]
    parts = [nearness[halves[i], sides[j]].ravel() for i, j in ((0, 1), (0, 0), (1, 0), (1, 1))]
    return [float(np.partition(part, -area)[-area]) for part in parts]


def true_term(distance: float, speed: float) -> str:
    """The distance term by ``distance.yaml`` for a distance [m] at a speed [m/s]."""
    inferred = find_distances(np.array([1.0 / distance]), np.ones(1), speed)
    return TERMS[int(inferred.term[0])]


def _alike(nearness: list[float], share: float) -> frozenset[str]:
    least = share * max(nearness)
    return frozenset(q for q, value in zip(QUADRANTS, nearness, strict=True) if value >= least)


def _axes(pose: Pose, camera: CameraModel) -> tuple[Array, Array, Array]:
    """Camera position [m], optical axis and right-hand axis, in the plane (2,) each."""
    ahead, right = _ahead_and_right(pose)
    return np.array([pose.x, pose.y]) + camera.mount_forward * ahead, ahead, right


def _ahead_and_right(pose: Pose) -> tuple[Array, Array]:
    cosine, sine = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.array([cosine, sine]), np.array([sine, -cosine])
