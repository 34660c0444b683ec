"""The local planner: a local goal on the cheapest path through the occupancy grid to the waypoint.

Arcs by themselves get stuck in local minima, with true depth as often as with flow (METHOD 0); the
cost-to-go over the grid does not. Unobserved cells are passable at a price, small clearances cost.

A long body cannot turn where it stands, and sweeps more than a round one: in a corridor narrower
than its turning circle it must know before how it will turn, or back out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.localmap.cost_kernels import cost_to_go, descend, first_leg, price_cells
from navfw.localmap.free_distances import blind_ground, ground_of
from navfw.localmap.manoeuvre_kernels import search_lattice
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.localmap.ray_kernels import SLACK, Ground, body_room
from navfw.numerics import Array, Mask
from navfw.signals import OccupiedDisc, Pose, wrap_angle

TURN_PRICE = 0.25  # chosen
"""Extra price of the first turn [m/rad]."""
LEAVE_PRICE = 0.15  # chosen
"""Extra price [m per m] of a cell off the last plan's path."""

_GAPS = np.ones((3, 3), np.uint8)  # defined
_NO_WAY: Array = np.empty((0, 4))  # defined
_PROGRESS = 2.0  # chosen
"""Distance [m] by which a path comes nearer to the waypoint."""
_OFF = 0.12  # chosen
"""Distance [m] off the path, a radian off its heading as _LEVER [m], at which it is left."""
_LEVER = 0.3  # chosen
_GOAL_MOVED = 0.4  # chosen
"""Distance [m] by which the waypoint moves before the path is planned anew."""
_RETRY = 30  # chosen
"""Plans between two searches when there was no path."""
_LEAD = 0.25  # chosen
"""Distance [m] along the path of the point to head for."""
_WINDOW = 8  # chosen
"""Poses ahead on the path among which the robot looks for its own."""
_SPARE = (0.06, 0.0)  # chosen
"""Clearances [m] beyond the margin, in order; the first with a path is kept."""
_TOUCH = 0.02  # chosen
"""Distance [m], with each radian of a turn as _LEVER [m], within which the body stands."""
_STALLED = 90  # chosen
"""Plans that a body stands before its path is dropped, for as many plans."""
_AHEAD = 15  # chosen
"""Poses ahead on the path that decide whether it is narrow."""
_FAR = 8  # chosen
"""Poses ahead on the path of the point to head for where there is room."""
_TIGHT = 0.15  # chosen
"""Clearance [m] beyond the margin below which the body keeps to the path at a manoeuvre's speed."""


class Manoeuvres:
    """Plans and keeps the path of one long body until it is driven, barred or left."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Drop the path."""
        self._way: Array = _NO_WAY
        self._goal = (math.inf, math.inf)
        self._wait = 0
        self._stood = Pose(0.0, 0.0, 0.0), 0
        self._room = math.inf

    def next_point(
        self,
        occupancy: OccupancyGrid,
        pose: Pose,
        goal: tuple[float, float],
        value: Array,
        margin: float,
    ) -> tuple[float, float, int | None] | None:
        """Find the odom point (x, y) [m] to head for from odom ``pose``, and the gear to it.

        The gear is 1 ahead, -1 back and 0 for a turn on the spot toward the point; None where there
        is room to drive freely. Returns None if there is no path to ``goal`` (odom).
        ``value`` is the local planner's cost-to-go; the body keeps ``margin`` [m].
        """
        seen = cv2.dilate(occupancy.observed, _GAPS).astype(np.uint8, copy=False)
        ground = ground_of(occupancy, seen, occupancy.clearance)
        discs = np.array(occupancy.robot.discs)
        same = math.dist(goal, self._goal) <= _GOAL_MOVED
        if self._stalled(pose):
            self._way, self._wait = _NO_WAY, _STALLED
        if not (same and self._holds(ground, discs, margin, pose)):
            self._way = _NO_WAY
            self._wait = self._wait - 1 if same else 0
            if self._wait > 0:
                return None
            self._goal = goal
            start, blind = (pose.x, pose.y, pose.yaw), blind_ground(occupancy)
            for spare in _SPARE:
                self._way = search_lattice(
                    ground, blind, discs, margin + spare, value, start, _PROGRESS
                )
                if len(self._way):
                    break
            self._wait = 0 if len(self._way) else _RETRY
            if not self._holds(ground, discs, margin, pose):
                return None
        if self._room > _TIGHT and not (self._way[1:, 3] < 1.0).any():
            x, y, _, _ = self._way[min(_FAR, len(self._way) - 1)]
            return float(x), float(y), None
        return self._lead(pose)

    def _holds(self, ground: Ground, discs: Array, margin: float, pose: Pose) -> bool:
        """Return whether the robot is on the path, with a rest of it, and the rest is free."""
        if len(self._way) < 2:
            return False
        away = np.hypot(self._way[:, 0] - pose.x, self._way[:, 1] - pose.y)
        turned = np.abs((self._way[:, 2] - pose.yaw + math.pi) % (2.0 * math.pi) - math.pi)
        near = int(np.argmin(away[:_WINDOW] + _LEVER * turned[:_WINDOW]))
        if away[near] + _LEVER * turned[near] > _OFF or near >= len(self._way) - 1:
            return False
        self._way = self._way[near:]
        rooms = [body_room(ground, x, y, yaw, discs, margin) for x, y, yaw, _ in self._way]
        self._room = min(rooms[:_AHEAD])
        return min(rooms) >= min(0.0, rooms[0]) - SLACK

    def _stalled(self, pose: Pose) -> bool:
        """Return whether the body has stood for _STALLED plans since this was last so."""
        at, count = self._stood
        if math.hypot(pose.x - at.x, pose.y - at.y) + _LEVER * abs(pose.yaw - at.yaw) > _TOUCH:
            self._stood = pose, 0
            return False
        self._stood = at, (count + 1) % _STALLED
        return count + 1 == _STALLED

    def _lead(self, pose: Pose) -> tuple[float, float, int]:
        """Return the point of the first run of one gear that is _LEAD ahead, or its end."""
        gear = int(self._way[1, 3])
        run = 1
        length = 0.0
        while run + 1 < len(self._way) and self._way[run + 1, 3] == gear and length < _LEAD:
            length += math.dist(self._way[run, :2], self._way[run - 1, :2])
            run += 1
        x, y, yaw = self._way[run, :3]
        if gear == 0:
            while run + 1 < len(self._way) and self._way[run + 1, 3] == gear:
                run += 1
            yaw = self._way[run, 2]
            return pose.x + math.cos(yaw), pose.y + math.sin(yaw), 0
        return float(x), float(y), gear


_LEG = 0.4  # chosen
"""Length [m] of the first leg, which decides among several paths of similar cost."""
_OTHER_WAY = math.radians(40.0)  # chosen
"""Angle [rad] between a first leg and the cheapest path beyond which it is another path."""
_BESIDE = 0.35  # chosen
"""Distance [m] from the last plan's path within which a cell belongs to it."""
_BEARINGS = np.linspace(-math.pi, math.pi, 49)[:-1]  # defined
_AROUND = np.ones((3, 3), np.uint8)  # defined
_STILL, _PATIENCE = 0.15, 40  # chosen
"""Distance [m] that a body moves less, and number of plans, until the gap ahead is given up."""
_GAP_AHEAD, _MOVER_NEAR = 1.0, 1.5  # chosen
"""Distances [m] of the gap at most, and of moving obstacles for which the body waits."""
_GIVEN_UP, _GAP_PRICE = 0.3, 8.0  # chosen
"""Radius [m] around a gap that was given up, and extra price of the cells there."""
_WIDER, _MAX_GAPS = 0.05, 8  # chosen
"""Clearance [m] by which a gap that was given up has become wider, and the number of them kept."""


class LocalPlannerParams(StrictModel):
    """Prices of the cells of the grid."""

    distance: float = Field(0.8, gt=0.1, le=3.0, description="distance of the local goal [m]")
    clear: float = Field(
        0.25, ge=0.0, le=1.0, description="clearance from which a cell costs no more [m]"
    )
    unobserved_price: float = Field(
        0.2, ge=0.0, le=20.0, description="extra price of an unobserved cell"
    )
    margin: float = Field(
        0.04, ge=0.0, le=0.3, description="least clearance of a passable cell [m]"
    )


@dataclass(frozen=True, slots=True)
class LocalGoal:
    """The point x, y [m] in base_link to head for now; ``cost`` [m, priced] is to the waypoint.

    ``reachable`` is false when occupied cells bar every path; the goal then lies straight toward
    the waypoint. ``detour`` is the path's cost over the straight distance, at least 1. ``gear`` is
    of a manoeuvre: 1 ahead, -1 back, 0 a turn on the spot; None while there is none.
    """

    x: float
    y: float
    cost: float
    reachable: bool
    detour: float
    gear: int | None = None

    @property
    def distance(self) -> float:
        """Distance [m] of the local goal from base_link."""
        return math.hypot(self.x, self.y)

    @property
    def bearing(self) -> float:
        """Bearing [rad, left positive] of the local goal from base_link's x axis."""
        return math.atan2(self.y, self.x)


class LocalPlanner:
    """Finds the local goal: the next point on the cheapest path to a waypoint in the odom frame.

    The planner keeps to the path of its last plan: cells off it cost more, so it changes only if
    that path is barred, or another one is cheaper by a margin. A gap before which the robot has
    stood for 4 s is given up: it costs more until it is seen to be wider.
    """

    def __init__(self, params: LocalPlannerParams | None = None) -> None:
        self.params = params or LocalPlannerParams()
        self._manoeuvres = Manoeuvres()
        self.reset()

    def reset(self) -> None:
        """Drop the path."""
        self._way: Array = np.empty((0, 2))
        self._stood = Pose(0.0, 0.0, 0.0), 0
        self._gaps: list[tuple[float, float, float]] = []
        self._manoeuvres.reset()

    def plan(
        self,
        occupancy: OccupancyGrid,
        pose: Pose,
        x: float,
        y: float,
        moving_obstacles: tuple[OccupiedDisc, ...] = (),
    ) -> LocalGoal:
        """Plan from odom ``pose`` to the odom point (x, y) [m]; return the local goal.

        ``moving_obstacles`` count as occupied beside the grid's own cells.
        """
        cell = 2.0 * occupancy.params.cell
        cost = self._prices(occupancy, moving_obstacles)
        if len(self._way):
            cost[~self._beside_way(occupancy, cost.shape)] += LEAVE_PRICE
        self._watch_gaps(occupancy, pose, moving_obstacles)
        for at_x, at_y, _ in self._gaps:
            at = (
                round((at_x - occupancy.origin[0]) / cell),
                round((at_y - occupancy.origin[1]) / cell),
            )
            near = cv2.circle(np.zeros(cost.shape, np.uint8), at, round(_GIVEN_UP / cell), 1, -1)
            cost[near > 0] += _GAP_PRICE
        value = _sources(cost.shape[0], occupancy.origin, cell, x, y)
        # an obstacle on the waypoint itself must not hide it: its direction still counts
        cost_to_go(cost, value, 24)

        column = (pose.x - occupancy.origin[0]) / cell
        row = (pose.y - occupancy.origin[1]) / cell
        straight = math.hypot(x - pose.x, y - pose.y)
        steps = round(2.0 * min(self.params.distance, max(straight, 2 * cell)) / cell)
        path, count = self._path(value, cost, row, column, pose.yaw, steps, cell)
        to_go = float(value[round(row), round(column)]) * cell
        if count == 0 or not math.isfinite(
            value[round(path[count - 1, 0]), round(path[count - 1, 1])]
        ):
            local = pose.to_local(x, y)
            scale = min(1.0, self.params.distance / max(straight, 1e-6))
            return LocalGoal(local[0] * scale, local[1] * scale, math.inf, False, math.inf)
        self._keep_way(occupancy, value, path[:count])
        end = path[count - 1]
        ahead = pose.to_local(
            occupancy.origin[0] + end[1] * cell, occupancy.origin[1] + end[0] * cell
        )
        gear = None
        if occupancy.robot.footprint is not None:
            point = self._manoeuvres.next_point(occupancy, pose, (x, y), value, self.params.margin)
            if point is not None:
                ahead, gear = pose.to_local(*point[:2]), point[2]
        if not math.isfinite(to_go):
            to_go = float(value[round(end[0]), round(end[1])]) * cell + math.hypot(*ahead)
        detour = max(1.0, to_go / max(straight, cell))
        return LocalGoal(ahead[0], ahead[1], to_go, True, detour, gear)

    def _watch_gaps(
        self, occupancy: OccupancyGrid, pose: Pose, moving_obstacles: tuple[OccupiedDisc, ...]
    ) -> None:
        """Give up the narrowest point ahead if the body has stood too long; forget wider ones.

        It may stand for ``moving_obstacles``, and where nothing is narrow.
        """

        def room(x: float, y: float) -> float:
            inside = occupancy.contains(x, y)
            return float(occupancy.clearance[occupancy.index(x, y)]) if inside else math.inf

        self._gaps = [gap for gap in self._gaps if room(*gap[:2]) <= gap[2] + _WIDER]
        at, count = self._stood
        waits = any(math.hypot(m.x - pose.x, m.y - pose.y) < _MOVER_NEAR for m in moving_obstacles)
        if waits or math.hypot(pose.x - at.x, pose.y - at.y) > _STILL:
            self._stood = pose, 0
            return
        self._stood = at, (count + 1) % _PATIENCE
        if count + 1 < _PATIENCE:
            return
        ahead = [p for p in self._way.tolist() if math.dist(p, (pose.x, pose.y)) <= _GAP_AHEAD]
        rooms = [room(*point) for point in ahead]
        if ahead and min(rooms) < occupancy.robot.radius + self.params.clear:
            narrowest = rooms.index(min(rooms))
            self._gaps = [*self._gaps, (*ahead[narrowest], rooms[narrowest])][-_MAX_GAPS:]

    def _path(
        self,
        value: Array,
        cost: Array,
        row: float,
        column: float,
        yaw: float,
        steps: int,
        cell: float,
    ) -> tuple[Array, int]:
        """Find the path ahead (steps, 2) [cells], and the number of its valid rows.

        The cheapest path, unless another one is cheaper once the first turn is priced: of two paths
        round an obstacle at about equal cost the robot keeps to the one it faces.
        """
        path = np.empty((steps, 2))
        count = descend(value, row, column, steps, path)
        if count == 0 or steps * 0.5 * cell < 1.5 * _LEG:
            return path, count
        leg = _LEG / cell
        r, c, bearing = first_leg(value, cost, row, column, yaw, _BEARINGS, leg, TURN_PRICE / cell)
        ahead = path[min(count, round(2.0 * leg)) - 1]
        cheapest = math.atan2(ahead[0] - row, ahead[1] - column)
        if r < 0.0 or abs(wrap_angle(yaw + bearing - cheapest)) <= _OTHER_WAY:
            return path, count
        count = descend(value, r, c, steps - round(2.0 * leg), path)
        if count == 0:
            path[0] = r, c
            count = 1
        return path, count

    def _beside_way(self, occupancy: OccupancyGrid, shape: tuple[int, int]) -> Mask:
        """Return the cells (m, m) within _BESIDE of the path of the last plan."""
        cell = 2.0 * occupancy.params.cell
        beside = np.zeros(shape, np.uint8)
        points = np.rint((self._way - occupancy.origin) / cell).astype(np.int32)
        cv2.polylines(beside, [points], False, 1, 2 * round(_BESIDE / cell))
        return beside.astype(bool)

    def _keep_way(self, occupancy: OccupancyGrid, value: Array, path: Array) -> None:
        """Remember the path (k, 2) [cells] and its continuation down to the waypoint."""
        rest = np.empty((4 * len(value), 2))
        count = descend(value, path[-1, 0], path[-1, 1], len(rest), rest)
        way = np.concatenate([path, rest[:count]])[::4, ::-1]
        self._way = np.array(occupancy.origin) + way * (2.0 * occupancy.params.cell)

    def _prices(
        self, occupancy: OccupancyGrid, moving_obstacles: tuple[OccupiedDisc, ...]
    ) -> Array:
        """Compute the price (m, m) of each cell of twice the grid's size; infinite where barred."""
        p = self.params
        radius = occupancy.robot.radius
        # rays diverge with distance and leave gaps: a cell with an observed neighbour is observed
        observed = cv2.dilate(occupancy.observed, _AROUND).astype(np.uint8, copy=False)
        clearance = occupancy.clearance_with(moving_obstacles)
        return price_cells(clearance, observed, radius, p.clear, p.margin, p.unobserved_price)


def _sources(n: int, origin: tuple[float, float], cell: float, x: float, y: float) -> Array:
    """Return boundary values (n, n) [cells]: 0 at the waypoint, or its distance on the border."""
    value = np.full((n, n), np.inf)
    column, row = (x - origin[0]) / cell, (y - origin[1]) / cell
    if 0 <= round(row) < n and 0 <= round(column) < n:
        value[round(row), round(column)] = 0.0
        return value
    edge = np.arange(n)
    value[0, :] = np.hypot(row, edge - column)
    value[-1, :] = np.hypot(row - (n - 1), edge - column)
    value[:, 0] = np.minimum(value[:, 0], np.hypot(edge - row, column))
    value[:, -1] = np.minimum(value[:, -1], np.hypot(edge - row, column - (n - 1)))
    return value
