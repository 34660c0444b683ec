"""Keep clear: of what was near and has left the view, by dead reckoning."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw import Array, Context, Label, Percept, Pose, Proposal, RuledBehavior

MAX_AGE = 15.0
"""Age at which it is forgotten [s]."""
MIN_ROOM = 0.2
"""Way ahead below which it turns [m]."""
MAX_TIME = 12.0
"""Longest time of turn and drive [s]."""

Mask = npt.NDArray[np.bool_]

VIEW_RIM = 0.05
"""Angle [rad] within the border of the view where a percept does not count as seeing an object."""
SHADOW = (0.0, 0.1, 0.2, 0.3)
"""Distances [m] behind what is seen of an object, along the ray, that count as the object."""
MIN_WEIGHT = 1.0
"""Least weight of the nearest cells of an image column [cells of confidence 1]."""
NEAR_SHARE = 0.125
"""Share of a column's object cells in its nearest part, as in OFFIS' regions."""
MIN_CONFIDENCE = 0.15
"""Least confidence of a cell that counts."""
MAX_DISTANCE = 0.5
"""Distance [m] straight ahead up to which room is judged: the range of the rules' input."""
FREE = 0.35
"""Distance [m] ahead from which a heading is free; the rules turn on until about there."""
HEADINGS = 12
"""Turns of either sense that are compared, evenly up to half a turn."""
GOAL_SHARE = 0.3
"""Price of an angle [rad] off the waypoint, in angles to turn."""
AHEAD, DELAY = 0.15, 0.2
"""Distance [m] and time [s] for which a command is driven before the robot brakes."""
MIN_APPROACH = 0.2
"""Share of the distance driven that a command must come nearer to be barred: others lead past."""
SPACING = 0.04
"""Distance [m] within which two points count as one."""
STRAIGHT = 0.15
"""Share of the top turning rate up to which a command is straight."""


class KeepClear(RuledBehavior):
    """Prohibits forward commands that lead into what the newest percepts had near.

    The camera does not see beside the body, and nearer than ``blind`` flow exceeds its search
    range: what a body touches has left the percept before. So the nearest object of each image
    column is remembered as a point until a percept shows the place again, or the robot has passed
    it. If one is straight ahead, the robot turns on the spot away from it, drives on
    past it, and does not turn back before.
    """

    name: ClassVar[str] = "keep_clear"

    class Params(RuledBehavior.Params):
        """What is remembered, and the path kept free of it."""

        near: float = Field(
            0.9, gt=0.0, le=3.0, description="largest distance of what is remembered [m]"
        )
        blind: float = Field(
            0.45, ge=0.0, le=3.0, description="distance within which a percept denies nothing [m]"
        )
        passing: float = Field(
            0.9, gt=0.0, le=3.0, description="distance at which it is forgotten [m]"
        )
        margin: float = Field(0.05, ge=0.0, le=0.5, description="clearance from the body's rim [m]")
        onward: float = Field(
            0.25, ge=0.0, le=2.0, description="distance driven before it may turn back [m]"
        )

    params: Params

    def reset(self) -> None:
        """Forget all points, and end any turn."""
        self._points = np.empty((0, 5))  # x, y [m] and ray (x, y) in odom, and the time [s]
        self._seen = -math.inf
        self._way: float | None = None
        self._began = 0.0
        self._free_at: Pose | None = None

    def propose(self, context: Context) -> Proposal:
        """Prohibit the paths into remembered objects; turn and drive on while one is ahead."""
        commands, pose = context.commands, context.pose
        self._observe(context)
        nearby = self._objects(pose)
        prohibited = self._barred(context, nearby)
        room = self._room(nearby)
        self._follow(context, nearby, room)
        if self._way is None:
            return Proposal(0.0, commands.zeros(), prohibited, "nothing near is in the way")
        away = self._way * commands.relative_w
        # discouraged only: an emergency may have to turn back
        back = away < -STRAIGHT
        prohibited[:, back] = np.maximum(prohibited[:, back], 0.5)
        verdict = self.rules.evaluate(room=room)
        desire = commands.product(
            verdict.over("speed", commands.relative_v), verdict.over("turn", away)
        )
        side = "left" if self._way > 0.0 else "right"
        return Proposal(
            applicability=1.0,
            desirability=desire,
            prohibition=prohibited,
            reason=f"{side} of what was near, {room:.2f} m of path",
            explain=verdict.explain,
        )

    # --- what is remembered -------------------------------------------------------------------

    def _observe(self, context: Context) -> None:
        """Remember what a new percept shows near, and forget what is passed or old."""
        percept, pose = context.percept, context.pose
        if percept is not None and percept.sees_depth and percept.time > self._seen:
            self._seen = percept.time
            kept = self._points[~self._in_view(self._local(pose))]
            nearest = self._nearest(percept)
            camera = pose.to_parent(self.robot.camera.mount_forward, 0.0)
            seen = np.array([pose.to_parent(x, y) for x, y in nearest]).reshape(-1, 2)
            rays = seen - camera
            rays /= np.maximum(np.hypot(rays[:, :1], rays[:, 1:]), 1e-9)
            times = np.full((len(seen), 1), percept.time)
            points = np.concatenate([np.concatenate([seen, rays, times], axis=1), kept])
            _, first = np.unique(np.round(points[:, :2] / SPACING), axis=0, return_index=True)
            self._points = points[first]
        nearby = self._local(pose)
        close = np.hypot(nearby[:, 0], nearby[:, 1]) < self.params.passing
        young = self._points[:, 4] > context.time - MAX_AGE
        self._points = self._points[close & young]

    def _local(self, pose: Pose) -> Array:
        """Return the remembered points (n, 2) [m] in base_link."""
        return pose.points_to_local(self._points[:, :2])

    def _objects(self, pose: Pose) -> Array:
        """Return the points with what each hides (4 n, 2) [m]: unknown is not free."""
        hidden = [self._points[:, :2] + far * self._points[:, 2:4] for far in SHADOW]
        return pose.points_to_local(np.concatenate(hidden))

    def _in_view(self, points: Array) -> Mask:
        """Return whether a percept shows what is at ``points`` (n, 2) in base_link (n,)."""
        camera = self.robot.camera
        ahead = points[:, 0] - camera.mount_forward
        edge = ahead * math.tan(0.5 * camera.hfov - VIEW_RIM)
        seen: Mask = (ahead > self.params.blind) & (np.abs(points[:, 1]) < edge)
        return seen

    def _nearest(self, percept: Percept) -> list[tuple[float, float]]:
        """Return the positions [m] in base_link of the nearest object of each image column."""
        camera = self.robot.camera
        shown: Mask = (
            (percept.label == Label.OBSTACLE)
            & (percept.confidence >= MIN_CONFIDENCE)
            & (percept.nearness > 1.0 / self.params.near)
        )
        positions = []
        for column in np.flatnonzero(shown.any(axis=0)):
            cells = shown[:, column]
            nearness, weight = percept.nearness[cells, column], percept.confidence[cells, column]
            depth = _nearest_depth(nearness, weight)
            if depth is not None:
                slope = -float(percept.points[0, column, 0]) / camera.focal
                positions.append((camera.mount_forward + depth, slope * depth))
        return positions

    # --- the path past it ----------------------------------------------------------------------

    def _follow(self, context: Context, nearby: Array, room: float) -> None:
        """Begin a turn where the path ahead is barred; end it once the object is passed."""
        params, pose = self.params, context.pose
        if room < MIN_ROOM:
            self._free_at = None
            if self._way is None:
                self._way, self._began = self._freer_way(context, nearby), context.time
        elif self._free_at is None:
            self._free_at = pose
        if self._free_at is not None:
            driven = math.hypot(pose.x - self._free_at.x, pose.y - self._free_at.y)
            if driven > params.onward:
                self._way = None
        if context.time - self._began > MAX_TIME:
            self._way = None

    def _freer_way(self, context: Context, nearby: Array) -> float:
        """Choose the sense of the turn to a free path near the waypoint: 1 left, -1 right."""
        prices = {}
        for sense in (1.0, -1.0):
            turns = sense * math.pi * np.arange(1, HEADINGS + 1) / HEADINGS
            free = [
                t for t in turns if self._room(Pose(0.0, 0.0, t).points_to_local(nearby)) >= FREE
            ]
            turn = free[0] if free else turns[-1]
            off = abs(math.remainder(context.waypoint_bearing - turn, 2.0 * math.pi))
            prices[sense] = abs(turn) + GOAL_SHARE * off
        return min(prices, key=prices.__getitem__)

    def _room(self, points: Array) -> float:
        """Return the distance [m] ahead until the body meets one of ``points`` (n, 2)."""
        radius = self.robot.radius + self.params.margin
        ahead = points[(np.abs(points[:, 1]) < radius) & (points[:, 0] > 0.0)]
        distances = ahead[:, 0] - np.sqrt(radius**2 - ahead[:, 1] ** 2)
        return float(np.clip(distances.min(initial=MAX_DISTANCE), 0.0, MAX_DISTANCE))

    def _barred(self, context: Context, nearby: Array) -> Array:
        """Return a layer (n_v, n_w): 1 for forward commands that come too near to a point."""
        layer, rows = context.commands.zeros(), context.commands.forward_rows
        if len(nearby):
            places, driven = _places(context)
            now = np.hypot(nearby[:, 0], nearby[:, 1])
            offset = nearby - places[..., None, :]
            then = np.hypot(offset[..., 0], offset[..., 1])
            touched = then < self.robot.radius + self.params.margin
            nearer = then < now - MIN_APPROACH * driven[:, None, :, None]
            layer[rows] = (touched & nearer).any(axis=(2, 3))
        return layer


def _places(context: Context) -> tuple[Array, Array]:
    """Compute positions (n_v, n_w, 4, 2) [m] along forward arcs, and distances (n_v, 4) [m].

    The last one is where the robot stands if it brakes after ``AHEAD`` and one more decision.
    """
    commands, robot = context.commands, context.robot
    v = commands.v[commands.forward_rows]
    length = AHEAD + DELAY * v + v**2 / (2.0 * robot.max_brake)
    driven = length[:, None] * np.array([0.25, 0.5, 0.75, 1.0])
    half = 0.5 * np.clip(commands.w[None, :, None] / v[:, None, None] * driven[:, None, :], -2, 2)
    chord = driven[:, None, :] * np.sinc(half / math.pi)
    return np.stack([chord * np.cos(half), chord * np.sin(half)], axis=-1), driven


def _nearest_depth(nearness: Array, weight: Array) -> float | None:
    """Return the mean depth [m] of the nearest eighth of the cells; None with too little weight."""
    nearest_first = np.argsort(-nearness, kind="stable")
    total = np.cumsum(weight[nearest_first])
    if total[-1] < MIN_WEIGHT:
        return None
    count = int(np.searchsorted(total, max(NEAR_SHARE * total[-1], MIN_WEIGHT))) + 1
    chosen = nearest_first[:count]
    return float(weight[chosen].sum() / (weight[chosen] * nearness[chosen]).sum())
