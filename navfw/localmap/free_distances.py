"""Free distance: along the arc of each command, along one twist, and all around the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from navfw.localmap.cell_arrays import distances
from navfw.localmap.occupancy_grid import OBSERVED_FREE, WALL_DEPTH, OccupancyGrid
from navfw.localmap.ray_kernels import (
    TURN,
    Ground,
    Start,
    cast_ranges,
    follow_arc,
    follow_body,
    least_within,
    sweep_arcs,
    sweep_body,
)
from navfw.numerics import Array, Mask
from navfw.robot import RobotModel
from navfw.signals import Pose, Twist
from navfw.signals.immutability import Frozen, read_only

_SECTORS = 48  # chosen
_SWING = 2.0  # chosen
"""Radius of an arc, in reaches of the body, up to which its corners swing out to unseen floor."""
_MAX_BLIND = 1.0  # chosen
"""Distance [m] up to which hidden floor counts, if the camera sees no floor nearer."""
_BESIDE = np.ones((3, 3), np.uint8)  # defined

_BEARINGS = read_only(np.linspace(-math.pi, math.pi, _SECTORS + 1)[1:])  # defined


@dataclass(frozen=True, slots=True)
class Arcs(Frozen):
    """Free distance along the arc of every command; arrays (n_v, n_w) [m] but for ``turn``.

    ``free`` is the length until the body would touch an occupied cell (backward, also one not
    observed free, unless along its own track; in tight arcs of long bodies, and beside round ones,
    also a hidden one), ``observed`` that until its centre, or the middle of the leading end of a
    long body, would enter a cell not observed free (backward: its rim), both at most ``reach``.
    ``clearance`` is the least distance from the body's rim to an occupied cell over the first 0.6
    m. ``turn`` (n_w,) [rad] is the angle until a turn on the spot touches one; inf beyond 0.5 rad.
    """

    free: Array
    observed: Array
    clearance: Array
    turn: Array
    reach: float


class FreeDistance(NamedTuple):
    """Lengths [m] of one twist's arc until ``contact``, and until the first cell ``unobserved``."""

    contact: float
    unobserved: float


def arcs_of(
    occupancy: OccupancyGrid, pose: Pose, speeds: Array, turns: Array, margin: float
) -> Arcs:
    """Sweep the robot's body, widened by ``margin`` [m], along the arc of every command.

    Arcs begin at odom ``pose``; ``speeds`` (n_v,) [m/s] ascending and ``turns`` (n_w,) [rad/s] span
    the commands.
    """
    reach, horizon = 1.6, 0.6  # of the arcs, and of clearances [m]
    free, observed, clearance = np.empty((3, speeds.size, turns.size))
    turn = np.full(turns.size, math.inf)
    robot = occupancy.robot
    around = _with_hidden(occupancy, pose, occupancy.clearance)
    ground = ground_of(occupancy, occupancy.footprint_observed, around)
    behind = blind_ground(occupancy)
    start, discs, forward = _start(pose), np.array(robot.discs), speeds > 0.0

    def swept(ground: Ground, rows: Mask) -> Array:
        lengths = np.empty((3, int(rows.sum()), turns.size))
        if robot.footprint is None:
            radius = robot.radius + margin
            sweep_arcs(ground, start, speeds[rows], turns, radius, reach, horizon, *lengths)
        else:
            sweep_body(ground, start, speeds[rows], turns, discs, margin, reach, horizon, *lengths)
        return lengths

    free[forward], observed[forward], clearance[forward] = swept(ground, forward)
    seen = ground_of(occupancy, occupancy.footprint_observed, behind[0])
    free[~forward], observed[~forward], clearance[~forward] = swept(seen, ~forward)
    if robot.footprint is not None:
        turn[:] = _angle(free[speeds == 0.0], reach).min(axis=0, initial=math.inf)
        swings, near = _swings_out(robot, speeds[forward, None], turns), free[forward]
        free[forward] = np.where(swings, np.minimum(near, swept(seen, forward)[0]), near)
    # The camera does not look back: behind the robot, unobserved cells count as occupied. (Its own
    # footprint is observed, so its rim and not its centre must stay out of the unobserved.)
    backward, rim = speeds < 0.0, robot.disc_radius + margin
    known = np.stack([observed[backward], swept(behind, backward)[1]])
    known = np.where(known < reach, np.maximum(known - rim, 0.0), reach)
    observed[backward] = known[0]
    free[backward] = np.minimum(free[backward], known[1])
    return Arcs(free, observed, clearance + margin, turn, reach)


def free_distance(
    occupancy: OccupancyGrid, pose: Pose, twist: Twist, reach: float = 1.0
) -> FreeDistance:
    """Follow the arc of ``twist`` from odom ``pose`` to the first contact, at most ``reach`` [m].

    Both lengths are 0 while the grid has no position, and if ``pose`` is outside it: an unknown map
    offers no room. A turn on the spot of a round body needs none, so its lengths are ``reach``;
    those of another body are less in proportion to the room (see ``free_turn``).
    """
    if not (occupancy.located and occupancy.contains(pose.x, pose.y)):
        return FreeDistance(0.0, 0.0)
    v, w, robot = float(twist.v), float(twist.w), occupancy.robot
    seen = _observed_behind(occupancy) if v < 0.0 else occupancy.footprint_observed
    if robot.footprint is None:
        # an obstacle that is 0.2 m beside the body's path, or more, does not bar it
        near = occupancy.clearance_near(pose.x, pose.y, reach + robot.radius + 0.2)
        near = near if v < 0.0 else _with_hidden(occupancy, pose, near)
        ground = ground_of(occupancy, seen, near)
        contact, unobserved, _ = follow_arc(ground, _start(pose), v, w, robot.radius, reach, 0.0)
    else:
        discs = np.array(robot.discs)
        around = occupancy.blind_clearance if _swings_out(robot, v, w) else occupancy.clearance
        ground = ground_of(occupancy, seen, around)
        contact, unobserved, _ = follow_body(ground, _start(pose), v, w, discs, 0.0, reach, 0.0)
    return FreeDistance(contact, unobserved)


def free_turn(occupancy: OccupancyGrid, pose: Pose, w: float) -> float:
    """Return the angle [rad] until a turn on the spot in the sense of ``w`` touches something.

    It is inf if at least ``TURN`` (0.5 rad) is free, and always for a round body.
    """
    if occupancy.robot.footprint is None:
        return math.inf
    contact = free_distance(occupancy, pose, Twist(0.0, w), reach=1.0).contact
    return float(_angle(np.array(contact), 1.0))


def _angle(free: Array, reach: float) -> Array:
    """Convert free lengths of turns on the spot to angles [rad]; inf where nothing is touched."""
    return np.where(free >= reach, math.inf, TURN * free / reach)


def _swings_out(robot: RobotModel, v: float | Array, w: float | Array) -> Mask:
    """Return whether commands [m/s, rad/s] bend so much that a long body's corners swing out."""
    return np.asarray(v <= _SWING * np.abs(w) * robot.reach)


def ground_of(
    occupancy: OccupancyGrid, observed: npt.NDArray[np.uint8], clearance: Array
) -> Ground:
    """Return the arrays to cast rays through; ``observed`` (n, n) says where floor was seen."""
    return clearance, observed, *occupancy.origin, occupancy.params.cell


def blind_ground(occupancy: OccupancyGrid) -> Ground:
    """Return the arrays for reversing, and for turns and tight arcs of a body that is not round.

    Beside a doorway the camera has seen a wall's near side only; the corners of a long body turn
    towards its far side.
    """
    is_round = occupancy.robot.footprint is None
    around = occupancy.clearance if is_round else occupancy.blind_clearance
    return ground_of(occupancy, _observed_behind(occupancy), around)


def _with_hidden(occupancy: OccupancyGrid, pose: Pose, clearance: Array) -> Array:
    """Return ``clearance`` (n, n) [m] for forward arcs of a round body at odom ``pose``.

    Beside it, out of view, hidden cells within 0.15 m of an occupied one count as occupied too: of
    a thing the camera has shown only the side that faced it. Gaps between rays are not hidden.
    """
    robot, cell = occupancy.robot, occupancy.params.cell
    if robot.footprint is not None:
        return clearance
    reach = robot.camera.mount_forward + min(occupancy.blind, _MAX_BLIND)
    row, column = occupancy.index(pose.x, pose.y)
    half = math.ceil((reach + robot.radius) / cell)
    window = np.s_[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1]
    near, unseen = clearance[window], occupancy.log_odds[window] > OBSERVED_FREE
    unseen &= near > 0.0
    deep = unseen & (near <= WALL_DEPTH)
    if not deep.any():
        return clearance
    beside = np.zeros(near.shape, np.uint8)
    at, radius = (min(column, half), min(row, half)), round(reach / cell)
    yaw, aside = math.degrees(pose.yaw), math.degrees(robot.seen_aside)
    cv2.ellipse(beside, at, (radius, radius), yaw, aside, 360.0 - aside, 1, cv2.FILLED)
    thick = cv2.morphologyEx(unseen.view(np.uint8), cv2.MORPH_OPEN, _BESIDE)
    hidden = deep & (thick > 0) & (beside > 0)
    if not hidden.any():
        return clearance
    clearance = clearance.copy()
    clearance[window] = np.minimum(near, distances(hidden, cell))
    return clearance


def _observed_behind(occupancy: OccupancyGrid) -> npt.NDArray[np.uint8]:
    """Return where floor was seen, (n, n) for driving backward: the own track counts as seen."""
    return occupancy.footprint_observed | (cv2.dilate(occupancy.driven, _BESIDE) > 0.0)


def _start(pose: Pose) -> Start:
    return float(pose.x), float(pose.y), float(pose.yaw)


@dataclass(frozen=True)  # without slots: the cached properties serve many behaviours
class Ranges(Frozen):
    """Distances [m] from the robot's rim in all directions, by rays of ``limit`` from base_link.

    ``bearings`` (n,) [rad, left positive] in (-pi, pi]; ``free`` (n,) to the first occupied cell,
    where unobserved cells count as free; ``observed`` (n,) to the first cell not observed free.
    """

    bearings: Array
    free: Array
    observed: Array
    limit: float

    def nearest(self, low: float, high: float) -> float:
        """Return the least ``free`` [m] for bearings in [low, high] [rad]; ``limit`` if none is."""
        return least_within(self.bearings, self.free, low, high, self.limit)

    @cached_property
    def corridor(self) -> float:
        """Degree in [0, 1] to which both sides have a wall within 1.6 m, with free space ahead."""
        side = max(self.left, self.right)
        return max(0.0, min(1.0, (1.6 - side) / 0.8)) * max(0.0, min(1.0, self.front / 0.8))

    @cached_property
    def front(self) -> float:
        """Least ``free`` [m] from the rim, +-30 degrees ahead; unobserved cells count as free."""
        return self.nearest(-math.radians(30), math.radians(30))

    @cached_property
    def left(self) -> float:
        """Least ``free`` [m] from the rim, 30 to 120 degrees left; unobserved counts as free."""
        return self.nearest(math.radians(30), math.radians(120))

    @cached_property
    def right(self) -> float:
        """Least ``free`` [m] from the rim, 30 to 120 degrees right; unobserved counts as free."""
        return self.nearest(-math.radians(120), -math.radians(30))


def ranges_around(occupancy: OccupancyGrid, pose: Pose, limit: float = 3.0) -> Ranges:
    """Cast 48 rays of ``limit`` [m] around odom ``pose``; RuntimeError without a grid position."""
    free, observed = np.empty((2, _SECTORS))
    ground = ground_of(occupancy, occupancy.observed, occupancy.clearance)
    cast_ranges(ground, _start(pose), _BEARINGS, limit, free, observed)
    rim = _rim(occupancy.robot)
    return Ranges(_BEARINGS, np.maximum(free - rim, 0.0), np.maximum(observed - rim, 0.0), limit)


def _rim(robot: RobotModel) -> float | Array:
    """Return the distance [m] from base_link to the body's rim; at each bearing if not round."""
    footprint = robot.footprint
    if footprint is None:
        return robot.radius
    ahead, aside = np.cos(_BEARINGS), np.abs(np.sin(_BEARINGS))
    along = np.where(ahead >= 0.0, footprint.front, footprint.rear)
    across = 0.5 * footprint.width / np.maximum(aside, 1e-9)
    return np.minimum(along / np.maximum(np.abs(ahead), 1e-9), across)
