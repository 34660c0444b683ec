"""Where commands meet movers: the robot's way and theirs, step by step through the next seconds.

What stands is judged by the arc that leads past it, whenever that is; who walks is in the way only
for a while. So both are moved on together: one can pass behind somebody, or let somebody pass.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numba
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.mofis.command_grid import CommandGrid
from navfw.movers.tracking import Track
from navfw.robot import RobotModel
from navfw.signals import Array, Pose, Twist

__all__ = ["ConflictParams", "Conflicts", "predict_conflicts"]

STEP = 0.1
"""Time [s] between two looks ahead."""
TURNS = 1.0, 1.5, 2.0
"""A robot that turns on the spot to drive off may turn so long [s]: as suits it best."""
AT_HAND = 0.4
"""Only who is nearer than this [m] can be driven at within a moment."""
MOMENT = 0.5
"""How long a moment is [s]."""


class ConflictParams(BaseModel):
    """How far ahead the ways of robot and movers are followed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    horizon: Annotated[float, Field(gt=0.0, le=10.0, description="how far ahead [s]")] = 6.0
    turning: Annotated[
        float,
        Field(ge=0.0, le=10.0, description="turns while driving are taken to last so long [s]"),
    ] = 1.0
    onward: Annotated[
        float, Field(ge=0.0, le=2.0, description="speed after a turn on the spot [m/s]")
    ] = 0.35
    doubt: Annotated[
        float, Field(ge=0.0, le=1.0, description="how much less sure, the later it is [m/s]")
    ] = 0.06


@dataclass(frozen=True, slots=True)
class Conflicts:
    """How near movers come, whatever is commanded; arrays (n_v, n_w).

    ``gap`` [m] is the least distance between the robot's rim and any mover's within the horizon,
    negative where they overlap; ``after`` [s] is when, or when they touch. ``closing`` [m] is how
    much nearer the command would bring the robot to somebody at hand within a moment, if they
    stood. ``nearest`` [m] is how near one is now.
    """

    gap: Array
    after: Array
    closing: Array
    nearest: float


def predict_conflicts(
    tracks: Sequence[Track],
    robot: RobotModel,
    commands: CommandGrid,
    pose: Pose,
    twist: Twist,
    time: float,
    params: ConflictParams,
) -> Conflicts | None:
    """Follow every command from odom ``pose`` and ``twist``, and every mover; None without any."""
    if not tracks:
        return None
    movers = np.array([[*track.at(time), *track.velocity, track.radius] for track in tracks])
    gap, after, closing = np.empty((3, *commands.shape))
    _predict(
        movers,
        commands.v,
        commands.w,
        np.array([pose.x, pose.y, pose.yaw, twist.v, twist.w]),
        np.array([robot.max_accel, robot.max_brake, robot.max_turn_accel]),
        robot.radius,
        np.array([params.horizon, params.turning, params.doubt, params.onward]),
        gap,
        after,
        closing,
    )
    away = np.hypot(movers[:, 0] - pose.x, movers[:, 1] - pose.y) - movers[:, 4] - robot.radius
    return Conflicts(gap, after, closing, float(away.min()))


@numba.njit(cache=True)
def _predict(
    movers: Array,
    speeds: Array,
    turns: Array,
    state: Array,
    limits: Array,
    radius: float,
    ahead: Array,
    gap: Array,
    after: Array,
    closing: Array,
) -> None:
    """Fill ``gap``, ``after`` and ``closing`` for all commands (``speeds``, ``turns``).

    ``state`` is (x, y, yaw, v, w), ``limits`` are accelerations, ``ahead`` the parameters.
    """
    horizon, turning, doubt, onward = ahead
    steps = int(horizon / STEP)
    ways = _ways(speeds, state[3], limits[0], limits[1], math.inf, 0.0, steps)
    headings = _headings(turns, state[2], state[4], limits[2], turning, steps)
    for i in range(speeds.size):
        for j in range(turns.size):
            closing[i, j] = _closing(movers, state[:2], ways[i], headings[j], radius)
            if speeds[i] == 0.0 and turns[j] != 0.0:
                gap[i, j], after[i, j] = -math.inf, 0.0  # as the best of the turns below
                continue
            gap[i, j], after[i, j] = _follow(movers, state[:2], ways[i], headings[j], radius, doubt)
    # turning on the spot makes room for nobody, unless to drive off that way
    for lasting in TURNS:
        leaving = _ways(np.zeros(1), state[3], limits[0], limits[1], lasting, onward, steps)
        headings = _headings(turns, state[2], state[4], limits[2], lasting, steps)
        for i in range(speeds.size):
            for j in range(turns.size):
                if speeds[i] != 0.0 or turns[j] == 0.0:
                    continue
                wide, when = _follow(movers, state[:2], leaving[0], headings[j], radius, doubt)
                if wide > gap[i, j]:
                    gap[i, j], after[i, j] = wide, when


@numba.njit(cache=True)
def _follow(
    movers: Array, start: Array, way: Array, heading: Array, radius: float, doubt: float
) -> tuple[float, float]:
    """Least gap [m] to any mover on one way, and when [s] it is, or when they touch."""
    x, y = start
    least, when = math.inf, 0.0
    for k in range(way.size):
        t = k * STEP
        for m in range(movers.shape[0]):
            dx = movers[m, 0] + movers[m, 2] * t - x
            dy = movers[m, 1] + movers[m, 3] * t - y
            away = math.hypot(dx, dy) - movers[m, 4] - radius - doubt * t
            if away < least:
                when = t if least > 0.0 else when
                least = away
        x += way[k] * heading[k, 0]
        y += way[k] * heading[k, 1]
    return least, when


@numba.njit(cache=True)
def _closing(movers: Array, start: Array, way: Array, heading: Array, radius: float) -> float:
    """How much nearer [m] the first moment of a way leads to where somebody at hand is now."""
    x, y = start
    for k in range(int(MOMENT / STEP)):
        x += way[k] * heading[k, 0]
        y += way[k] * heading[k, 1]
    most = 0.0
    for m in range(movers.shape[0]):
        before = math.hypot(movers[m, 0] - start[0], movers[m, 1] - start[1])
        if before - movers[m, 4] - radius < AT_HAND:
            most = max(most, before - math.hypot(movers[m, 0] - x, movers[m, 1] - y))
    return most


@numba.njit(cache=True)
def _ways(
    speeds: Array, v: float, accel: float, brake: float, turning: float, onward: float, steps: int
) -> Array:
    """(n_v, steps + 1) how far [m] each step leads, from speed ``v`` towards each of ``speeds``.

    After ``turning`` [s], those that stood drive ``onward`` [m/s].
    """
    ways = np.empty((speeds.size, steps + 1))
    for i in range(speeds.size):
        now = v
        for k in range(steps + 1):
            wanted = onward if speeds[i] == 0.0 and k * STEP >= turning else speeds[i]
            change = accel if abs(wanted) > abs(now) else brake
            now += min(max(wanted - now, -change * STEP), change * STEP)
            ways[i, k] = now * STEP
    return ways


@numba.njit(cache=True)
def _headings(
    turns: Array, yaw: float, w: float, turn_accel: float, turning: float, steps: int
) -> Array:
    """(n_w, steps + 1, 2) the direction of each step; ``turns`` last for ``turning`` [s]."""
    headings = np.empty((turns.size, steps + 1, 2))
    for j in range(turns.size):
        direction, now = yaw, w
        for k in range(steps + 1):
            wanted = turns[j] if k * STEP < turning else 0.0
            now += min(max(wanted - now, -turn_accel * STEP), turn_accel * STEP)
            direction += 0.5 * now * STEP
            headings[j, k, 0], headings[j, k, 1] = math.cos(direction), math.sin(direction)
            direction += 0.5 * now * STEP
    return headings
