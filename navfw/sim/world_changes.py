"""Moving obstacles, doors, boxes and textures that change in a world during a mission.

A walker follows its path at constant speed, deterministic in simulated time, and nothing stops it.
A walker that yields waits as long as the robot is close in front of it, then continues.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from navfw.numerics import Array
from navfw.signals import Pose
from navfw.sim.event_actions import DoorChange, Obstacle, Textureless
from navfw.sim.physics_world import PhysicsWorld
from navfw.sim.shapes import Rectangle, Shape
from navfw.sim.solids import Solid, drop_under, solids_of
from navfw.sim.worldspec import WalkerSpec, WorldSpec

_YIELD_DISTANCE = 0.6
"""Largest gap [m] to a robot in front of it at which a yielding walker waits."""

_YIELD_MARGIN = 0.15
"""Margin [m] on either side of a lane as wide as both bodies that counts as in front."""

CLOSING_SPEED, CLOSING_TIME = 0.05, 1.0
"""The robot causes a contact if it approaches the walker faster than this [m/s], or if it has
closed more of the distance than the walker over this time [s]."""


class Walker:
    """A moving obstacle at ``x``, ``y`` [m], ``heading`` [rad] in ``map``; may be ``waiting``."""

    def __init__(self, spec: WalkerSpec) -> None:
        self.spec = spec
        self.waiting = False
        corners = list(spec.path)
        if spec.walk == "loop":
            corners.append(corners[0])
        else:
            corners += corners[-2::-1]
        self._corners = corners
        self._starts = [0.0]
        for a, b in pairwise(corners):
            self._starts.append(self._starts[-1] + math.dist(a, b))
        self._travelled = spec.phase * self.length
        self.x, self.y, self.heading = self.pose_at(self._travelled)

    @property
    def length(self) -> float:
        """Length [m] of one round of its path, from the first point back to it."""
        return self._starts[-1]

    def pose_at(self, travelled: float) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] after ``travelled`` [m] of path, over any number of rounds."""
        travelled %= self.length
        i = min(bisect_right(self._starts, travelled), len(self._corners) - 1) - 1
        (ax, ay), (bx, by) = self._corners[i], self._corners[i + 1]
        leg = self._starts[i + 1] - self._starts[i]
        share = (travelled - self._starts[i]) / leg
        return ax + share * (bx - ax), ay + share * (by - ay), math.atan2(by - ay, bx - ax)

    def update_waiting(self, robot: Pose, radius: float) -> None:
        """Set ``waiting`` for the robot's true pose and ``radius`` [m], if the spec ``yields``."""
        if not self.spec.yields:
            return
        dx, dy = robot.x - self.x, robot.y - self.y
        c, s = math.cos(self.heading), math.sin(self.heading)
        both = self.spec.radius + radius
        self.waiting = (
            math.hypot(dx, dy) <= both + _YIELD_DISTANCE
            and c * dx + s * dy > 0.0
            and abs(c * dy - s * dx) <= both + _YIELD_MARGIN
        )

    def advance(self, dt: float) -> None:
        """Move on by ``dt`` [s], unless waiting."""
        if not self.waiting:
            self._travelled += self.spec.speed * dt
            self.x, self.y, self.heading = self.pose_at(self._travelled)


def caused_by_robot(before: Pose, after: Pose, dt: float, walker: Walker) -> bool:
    """Whether the robot, moving from one pose to the next in ``dt`` [s], approached the walker.

    A robot that stands, moves away or passes by does not cause the contact.
    """
    dx, dy = walker.x - after.x, walker.y - after.y
    away = math.hypot(dx, dy)
    if away == 0.0 or dt <= 0.0:
        return False
    speed = ((after.x - before.x) * dx + (after.y - before.y) * dy) / (away * dt)
    return speed > CLOSING_SPEED


def closed_by_robot(robot: Array, walker: Array) -> bool:
    """Whether the robot's motion closed more of their distance than the walker's motion did.

    ``robot`` and ``walker`` (n, 2) are positions [m] at the same times.
    """
    between = walker[:-1] - robot[:-1]
    away = np.maximum(np.hypot(between[:, 0], between[:, 1]), 1e-9)
    both = np.diff(robot, axis=0) + np.diff(walker, axis=0)
    return bool(np.sum(both * between / away[:, None]) > 0.0)


@dataclass(frozen=True)
class WalkerTrack:
    """Positions of walkers: ``time`` (T,) [s] ascending, ``points`` (T, M, 2), ``radii`` (M,) [m].

    With ``SceneGeometry``, which has the static solids, it gives the geometry at any time.
    """

    names: tuple[str, ...]
    radii: Array
    time: Array
    points: Array

    def at(self, times: Array) -> Array:
        """Positions (N, M, 2) at times (N,) [s], interpolated; constant beyond either end."""
        after = np.clip(np.searchsorted(self.time, times), 1, max(len(self.time) - 1, 1))
        if len(self.time) < 2:
            return np.repeat(self.points[:1], len(times), axis=0)
        span = self.time[after] - self.time[after - 1]
        share = np.clip((times - self.time[after - 1]) / span, 0.0, 1.0)[:, None, None]
        return (1.0 - share) * self.points[after - 1] + share * self.points[after]

    def clearances(self, points: Array, times: Array) -> Array:
        """Distances (N,) [m] of points (N, 2) at times (N,) [s] to the nearest walker's body."""
        if not self.names:
            return np.full(len(points), np.inf)
        away = np.linalg.norm(self.at(times) - points[:, None, :], axis=2) - self.radii
        nearest: Array = away.min(axis=1)
        return nearest


CLEAR_OF_ROBOT = 0.1
"""Distance [m] from the robot's body below which a door or obstacle is not inserted yet."""


@dataclass(frozen=True, slots=True)
class Presence:
    """A solid that was present from ``begin`` to ``end`` [s]; inf: to the end of the run."""

    name: str
    shape: Shape
    begin: float
    end: float


@dataclass(frozen=True, slots=True)
class ChangeTrack:
    """The solids that were present only during part of a run; ``SceneGeometry`` has static ones."""

    presences: tuple[Presence, ...]

    @property
    def names(self) -> frozenset[str]:
        """Names of all solids that were inserted or removed."""
        return frozenset(presence.name for presence in self.presences)

    def clearances(self, points: Array, times: Array) -> Array:
        """Distances (N,) [m] of points (N, 2) to the nearest solid present at times (N,) [s]."""
        nearest = np.full(len(points), np.inf)
        for presence in self.presences:
            present = (times >= presence.begin) & (times < presence.end)
            away = presence.shape.distance(points[present])
            nearest[present] = np.minimum(nearest[present], away)
        return nearest


WorldChange = DoorChange | Obstacle | Textureless
"""An action that changes the world."""


class WorldChanges:
    """Applies the active changes to the physics world; of a door's changes the newest counts.

    ``settled`` is False while a change is pending: until the robot is clear of its place, or until
    an obstacle ahead of the robot has floor under it.
    """

    def __init__(self, world: WorldSpec, physics: PhysicsWorld) -> None:
        self._world = world
        self._physics = physics
        doors = tuple(door.model_copy(update={"state": "closed"}) for door in world.doors)
        closed = solids_of(world.model_copy(update={"doors": doors}))
        self._doors = {solid.name: solid for solid in closed if solid.kind == "door"}
        self._active: list[WorldChange] = []
        # the obstacles that have a place, and the covers, by their index in the list
        self._made: list[Solid | int | None] = []
        self._present = {d.name: self._doors[d.name] for d in world.doors if d.state == "closed"}
        self._begins = dict.fromkeys(self._present, 0.0)
        self._past: list[Presence] = []
        self._changed: set[str] = set()
        self.settled = True

    def begin(self, change: WorldChange) -> None:
        """Activate a change; ``update`` applies it once the robot is clear of its place."""
        made = None
        if isinstance(change, Textureless):
            covered = _blanked(self._world, change)
            made = self._physics.scenery.add_cover(covered, change.brightness)
        self._active.append(change)
        self._made.append(made)

    def end(self, change: WorldChange) -> None:
        """Deactivate a change: remove a cover now; ``update`` restores doors, removes obstacles."""
        index = self._active.index(change)
        self._active.pop(index)
        made = self._made.pop(index)
        if isinstance(made, int):
            self._physics.scenery.remove(made)

    def update(self, time: float, robot: Pose, radius: float) -> None:
        """Insert and remove solids as the active changes require, at ``time`` [s].

        ``robot`` is the robot's true pose and ``radius`` [m] its radius.
        """
        state = {door.name: door.state for door in self._world.doors}
        wanted: dict[str, Solid] = {}
        waiting = False
        for index, change in enumerate(self._active):
            if isinstance(change, DoorChange):
                state[change.name] = change.state
            elif isinstance(change, Obstacle):
                solid = self._made[index] or self._place(change, robot)
                self._made[index] = solid
                if isinstance(solid, Solid):
                    wanted[solid.name] = solid
                waiting |= solid is None
        wanted = {n: self._doors[n] for n in state if state[n] == "closed"} | wanted
        for name in [name for name in self._present if name not in wanted]:
            self._physics.remove_solid(name)
            shape, begin = self._present.pop(name).shape, self._begins.pop(name)
            self._past.append(Presence(name, shape, begin, time))
            self._changed.add(name)
        robot_at = np.array([[robot.x, robot.y]])
        for name, solid in wanted.items():
            if name in self._present:
                continue
            if float(solid.shape.distance(robot_at)[0]) > radius + CLEAR_OF_ROBOT:
                self._physics.add_solid(solid)
                self._present[name], self._begins[name] = solid, time
                self._changed.add(name)
        self.settled = wanted.keys() == self._present.keys() and not waiting

    def track(self) -> ChangeTrack:
        """Return the solids inserted or removed so far; doors without a change are not included."""
        still = [
            Presence(name, solid.shape, self._begins[name], math.inf)
            for name, solid in self._present.items()
            if name in self._changed
        ]
        return ChangeTrack((*self._past, *still))

    def _place(self, obstacle: Obstacle, robot: Pose) -> Solid | None:
        """Return the obstacle as a solid; None while its place is above a drop."""
        x, y = obstacle.at or robot.to_parent(obstacle.ahead or 0.0, 0.0)
        shape = obstacle.footprint(x, y)
        if drop_under(self._world, shape) is not None:
            return None
        kind: Literal["box", "cylinder"] = "cylinder" if obstacle.size is None else "box"
        return Solid(obstacle.name, kind, shape, 0.0, obstacle.height, obstacle.texture)


def _blanked(world: WorldSpec, change: Textureless) -> list[Solid]:
    """Return the solids to cover: whole boxes and cylinders, the parts of walls within the area.

    Meshes keep their texture: their upright parts would hide their shape.
    """
    blanked = []
    for solid in solids_of(world):
        if solid.kind == "mesh" or (change.name is not None and solid.name != change.name):
            continue
        shape: Shape | None = solid.shape
        if solid.kind in ("wall", "lintel") and isinstance(shape, Rectangle):
            shape = _stretch_within(shape, change.x, change.y)
        elif not all(
            span is None or span[0] <= value <= span[1]
            for value, span in ((solid.shape.x, change.x), (solid.shape.y, change.y))
        ):
            shape = None
        if shape is not None:
            blanked.append(replace(solid, shape=shape, front=None))
    return blanked


def _stretch_within(
    wall: Rectangle, x: tuple[float, float] | None, y: tuple[float, float] | None
) -> Rectangle | None:
    """Return the part of a wall piece whose centre line is within an area; None when there is none.

    >>> _stretch_within(Rectangle(0.0, 0.0, 3.0, 0.05), (1.0, 9.0), None)
    Rectangle(x=2.0, y=0.0, half_x=1.0, half_y=0.05, yaw=0.0)
    """
    low, high = -wall.half_x, wall.half_x
    direction = (math.cos(wall.yaw), math.sin(wall.yaw))
    for span, middle, step in zip((x, y), (wall.x, wall.y), direction, strict=True):
        if span is None:
            continue
        if abs(step) < 1e-9:
            if not span[0] <= middle <= span[1]:
                return None
            continue
        ends = sorted((bound - middle) / step for bound in span)
        low, high = max(low, ends[0]), min(high, ends[1])
    if high - low < 0.01:
        return None
    along = 0.5 * (low + high)
    centre = (wall.x + direction[0] * along, wall.y + direction[1] * along)
    return Rectangle(*centre, 0.5 * (high - low), wall.half_y, wall.yaw)
