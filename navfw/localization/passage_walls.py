"""Walls by the map: those beside its passages correct the pose, those it has not seen bar turns.

A topological map has no walls, but it has straight passages with their widths: a corridor has a
wall on each side, parallel to its edge and equally far from it; a door is a gap of known width in a
wall across its edge (METHOD 4.1). Seen, they give heading and lateral position.

A camera does not see what is beside the robot. A round body may turn there; the corners of another
one swing out to walls that it has never seen, but which the map has (``KnownWalls``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from navfw.localization.plan_field import PlanScan
from navfw.numerics import Array
from navfw.numerics.linear_systems import inverse, solve
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Belief, Pose, wrap_angle
from navfw.signals.immutability import read_only
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import OccupancyMap

MAX_WIDTH = 3.0  # chosen
"""Largest width [m] of a passage between walls."""

_ALIGNED = 0.1  # chosen
"""Largest distance [m] of the ends of collinear passages from their common line."""

TOLERANCE = 0.2  # chosen
"""Largest difference [m] of the distance between two walls from the width on the map."""

_SPREAD = 0.1  # chosen
"""Scale [m] of the residuals of points that belong to a wall: skirting, frames, posters."""

_MIN_SPAN = 0.6  # chosen
"""Least length [m] of wall that gives a heading."""

MIN_POINTS = 6  # chosen
"""Least number of points on a wall."""

_AXIS_SIGMA, _AXIS_YAW_SIGMA = 0.05, 0.02  # chosen
"""Standard deviations [m, rad] of an edge of the map from the middle between the walls, and of its
direction: places are set by hand."""

_DOOR_SIGMA = 0.06  # chosen
"""Standard deviation [m] of the middle between two seen door posts."""

_POST = 0.1  # chosen
"""Quantile of the distances of a wall's points from the middle of a door that is its post: single
points are wrong."""

_FATTENING = 0.4  # chosen
"""How much narrower [m] than it is a gap may look: cells of the image reach over its edges."""


@dataclass(frozen=True, slots=True)
class PassageAxis:
    """A corridor or door as a straight axis from ``origin`` [m, map] along ``yaw`` [rad].

    A corridor has ``length`` and ``width`` [m]; a door has length 0 and its origin between the
    posts.
    """

    origin: tuple[float, float]
    yaw: float
    length: float
    width: float

    def frame(self, pose: Pose) -> Pose:
        """Convert ``pose`` (map) to the frame of the axis: x along it, y to its left."""
        return Pose(*self.origin, self.yaw).relative(pose)

    def heading_off(self, pose: Pose) -> float:
        """Return the angle in [0, pi/2] [rad] between the heading of ``pose`` and the axis."""
        off = abs(wrap_angle(pose.yaw - self.yaw))
        return min(off, math.pi - off)

    @property
    def is_door(self) -> bool:
        """Whether this is a door, a gap in a wall across the axis."""
        return self.length == 0.0


@dataclass(frozen=True, slots=True)
class PassageFix:
    """Corrections of a believed pose: ``turn`` [rad] of its yaw, ``shift`` [m] to the axis' left.

    ``turn_sigma`` and ``shift_sigma`` are standard deviations; infinite if no wall shows it.
    """

    axis: PassageAxis
    turn: float
    turn_sigma: float
    shift: float
    shift_sigma: float

    def rows(self) -> tuple[Array, Array, Array]:
        """Return observed directions in x, y, yaw (n, 3), corrections (n,) and variances (n,)."""
        across = [-math.sin(self.axis.yaw), math.cos(self.axis.yaw), 0.0]
        rows = np.array([[0.0, 0.0, 1.0], across])
        observed = np.isfinite([self.turn_sigma, self.shift_sigma])
        values = np.array([self.turn, self.shift])
        variances = np.array([self.turn_sigma, self.shift_sigma]) ** 2
        return rows[observed], values[observed], variances[observed]


def passage_axes(topo_map: TopoMap) -> list[PassageAxis]:
    """Find the straight corridors and the doors of a map that are at most 3 m wide."""
    return [*_corridors(topo_map), *_doors(topo_map)]


def _corridors(topo_map: TopoMap) -> Iterator[PassageAxis]:
    """Find the straight corridors: passages one after the other on a line, as wide as the widest.

    The width of a passage is that of its narrowest point, between things in the corridor.
    """
    rest = [passage for passage in topo_map.passages if _is_corridor(topo_map, passage)]
    while rest:
        first = rest.pop(0)
        a, b = topo_map.place(first.a), topo_map.place(first.b)
        axis = PassageAxis((a.x, a.y), math.atan2(b.y - a.y, b.x - a.x), 0.0, first.width)
        low, high, width = 0.0, a.distance(b.x, b.y), first.width
        while joined := [
            (passage, span)
            for passage in rest
            if (span := _span(topo_map, axis, passage)) is not None
            and span[0] <= high + _ALIGNED
            and span[1] >= low - _ALIGNED
        ]:
            for passage, span in joined:
                rest.remove(passage)
                low, high = min(low, span[0]), max(high, span[1])
                width = max(width, passage.width)
        start = Pose(a.x, a.y, axis.yaw).compose(Pose(low, 0.0, 0.0))
        yield PassageAxis((start.x, start.y), axis.yaw, high - low, width)


def _span(topo_map: TopoMap, axis: PassageAxis, passage: Passage) -> tuple[float, float] | None:
    """Return the extent [m] of a passage along the axis; None if it is not on that line."""
    ends = [axis.frame(_at(topo_map.place(name))) for name in (passage.a, passage.b)]
    if max(abs(end.y) for end in ends) > _ALIGNED:
        return None
    return min(end.x for end in ends), max(end.x for end in ends)


def _doors(topo_map: TopoMap) -> Iterator[PassageAxis]:
    """Find each door place on a straight line between two others."""
    for door in topo_map.places.values():
        around = topo_map.passages_at(door.name) if door.kind == "door" else ()
        if len(around) != 2:
            continue
        before, after = (topo_map.place(p.other(door.name)) for p in around)
        yaw = math.atan2(after.y - before.y, after.x - before.x)
        width = min(p.width for p in around)
        axis = PassageAxis((door.x, door.y), yaw, 0.0, width)
        if width <= MAX_WIDTH and abs(axis.frame(_at(before)).y) <= _ALIGNED:
            yield axis


def _is_corridor(topo_map: TopoMap, passage: Passage) -> bool:
    kinds = {topo_map.place(name).kind for name in passage.ends}
    return kinds <= {"corridor", "junction"} and passage.width <= MAX_WIDTH


def _at(place: Place) -> Pose:
    return Pose(place.x, place.y, 0.0)


def corridor_fix(axis: PassageAxis, pose: Pose, scan: PlanScan) -> PassageFix | None:
    """Compute corrections of the believed ``pose`` (map) by a corridor's walls; None if too few.

    Two parallel lines are fitted to the points of ``scan``, robustly (Cauchy weights).
    """
    robot = axis.frame(pose)
    points = robot.points_to_parent(scan.points)
    half = 0.5 * axis.width
    near = np.abs(np.abs(points[:, 1]) - half) <= TOLERANCE + _SPREAD
    near &= (points[:, 0] >= -_ALIGNED) & (points[:, 0] <= axis.length + _ALIGNED)
    along, across, sigma = points[near, 0] - robot.x, points[near, 1], scan.sigma[near]
    left = across > 0.0
    if len(along) < MIN_POINTS or np.ptp(along) < _MIN_SPAN:
        return None
    design = np.column_stack([left, ~left, along]).astype(np.float64)
    start = np.array([half, -half, 0.0])
    lines, covariance = _robust_lines(design, across, sigma, start)
    slope_sigma = math.sqrt(covariance[2, 2])
    shift, shift_sigma = 0.0, math.inf
    both = min(int(left.sum()), int((~left).sum())) >= MIN_POINTS
    if both and abs(lines[0] - lines[1] - axis.width) <= TOLERANCE:
        shift = -0.5 * float(lines[0] + lines[1])
        middle = np.array([0.5, 0.5, 0.0])
        shift_sigma = math.hypot(math.sqrt(product(middle, covariance, middle)), _AXIS_SIGMA)
    turn_sigma = math.hypot(slope_sigma, _AXIS_YAW_SIGMA)
    return PassageFix(axis, -math.atan(lines[2]), turn_sigma, shift, shift_sigma)


def _robust_lines(design: Array, across: Array, sigma: Array, start: Array) -> tuple[Array, Array]:
    """Fit parameters (3,) of the lines, with a weak prior at ``start``; and covariance (3, 3)."""
    lines, prior = start, np.diag([TOLERANCE**-2, TOLERANCE**-2, 0.3**-2])
    variance = sigma**2 + (0.5 * _SPREAD) ** 2
    information = prior
    for _ in range(8):
        residual = across - product(design, lines)
        weight = 1.0 / (variance * (1.0 + (residual / _SPREAD) ** 2))
        weighted = (design * weight[:, None]).T
        information = prior + product(weighted, design)
        lines = lines + solve(
            information, product(weighted, residual) - product(prior, lines - start)
        )
    return lines, inverse(information)


def door_fix(axis: PassageAxis, pose: Pose, scan: PlanScan) -> PassageFix | None:
    """Compute corrections of the believed ``pose`` (map) by a door's posts; None without both."""
    points = axis.frame(pose).points_to_parent(scan.points)
    in_wall = np.abs(points[:, 0]) <= TOLERANCE + scan.sigma
    posts = []
    for side in (1.0, -1.0):
        off = side * points[in_wall, 1]
        off = off[(off > 0.0) & (off < axis.width)]
        if len(off) < MIN_POINTS // 2:
            return None
        posts.append(float(np.quantile(off, _POST)))
    gap = posts[0] + posts[1]
    if not axis.width - _FATTENING <= gap <= axis.width + TOLERANCE:
        return None
    return PassageFix(axis, 0.0, math.inf, -0.5 * (posts[0] - posts[1]), _DOOR_SIGMA)


REACH = 2.0  # chosen
"""Distance [m] from the robot up to which walls count."""
SURE_XY, SURE_YAW = 0.1, 0.1  # chosen
"""Largest standard deviations [m, rad] of the pose with which they count."""
_BESIDE_DOOR = read_only(np.arange(0.03, 0.3, 0.05))  # chosen
"""Distances [m] from a door's post of the points of its wall."""


class KnownWalls:
    """Provides ``points`` (n, 2) [m, map] on walls near the robot, where its pose is certain."""

    def __init__(self, points: Array) -> None:
        self._points = points

    @classmethod
    def of(cls, topo_map: TopoMap, robot: RobotModel) -> KnownWalls | None:
        """Return the walls of the floor plan, or those beside doors; None for a round body."""
        if robot.footprint is None:
            return None
        plan = topo_map.floor_plan
        return cls(_beside_doors(topo_map) if plan is None else _faces(plan))

    def around(self, belief: Belief, pose: Pose) -> Array:
        """Return wall points (n, 2) [m, odom] within 2 m of odom ``pose``; none while unsure."""
        at = belief.pose
        unsure = belief.sigma > SURE_XY or math.sqrt(belief.covariance[2, 2]) > SURE_YAW
        if belief.lost or unsure:
            return np.empty((0, 2))
        off = np.abs(self._points - (at.x, at.y)).max(axis=1, initial=0.0)
        return pose.points_to_parent(at.points_to_local(self._points[off <= REACH]))


def _faces(plan: OccupancyMap) -> Array:
    """Return the centres (n, 2) [m, map] of occupied cells of a plan that touch a free one."""
    opened = np.pad(~plan.occupied, 1, constant_values=True)
    beside = opened[:-2, 1:-1] | opened[2:, 1:-1] | opened[1:-1, :-2] | opened[1:-1, 2:]
    return plan.centres(*np.nonzero(plan.occupied & beside))


def _beside_doors(topo_map: TopoMap) -> Array:
    """Return points (n, 2) [m, map] of the walls on both sides of each door of known width."""
    walls = [np.empty((0, 2))]
    for place in topo_map.places.values():
        width = min((p.width for p in topo_map.passages_at(place.name)), default=math.inf)
        normal = topo_map.door_normal(place)
        if place.kind == "door" and normal is not None and math.isfinite(width):
            off = 0.5 * width + _BESIDE_DOOR
            off = np.concatenate([-off, off])[:, None]
            walls.append((place.x, place.y) + off * (-normal[1], normal[0]))
    return np.concatenate(walls)
