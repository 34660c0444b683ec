"""The command grid: the finite set of (v, w) that behaviours rate and fusion chooses from."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Twist
from navfw.signals.immutability import Sealed, read_only

_SPEED_STEP = 0.0625
"""Largest step [m/s] between forward speeds: from standstill the robot begins with one step."""

_MIN_FORWARD, _MAX_FORWARD = 9, 40
"""Bounds of the number of forward speeds that follows from the top speed."""


class CommandGridParams(BaseModel):
    """Resolution and limits of the command grid (METHOD 3.6)."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    forward: Annotated[
        int | None,
        Field(
            ge=4,
            le=40,
            description="forward speeds, standstill included; none: as many as the top speed needs",
        ),
    ] = None
    reverse: Annotated[int, Field(ge=0, le=10, description="backward speeds")] = 2
    turns: Annotated[
        int, Field(ge=5, le=81, description="turning rates; odd, zero in the middle")
    ] = 21
    cruise: Annotated[
        float,
        Field(gt=0.0, le=2.0, description="top speed used, below the robot's own limit [m/s]"),
    ] = 0.5
    turn_rate: Annotated[
        float, Field(gt=0.0, le=4.0, description="top turning rate used [rad/s]")
    ] = 1.2


class CommandGrid(Sealed):
    """Speeds ``v`` (n_v,) [m/s] ascending and turning rates ``w`` (n_w,) [rad/s] ascending.

    ``relative_v`` and ``relative_w`` are the same in units of the top speed and top turning rate:
    the units of ``speed`` and ``turn`` in behaviours' rule bases. ``backward_rows`` and
    ``forward_rows`` are the slices of ``v`` with that sign; the one speed between them is zero.
    The top speed is the least of ``params.cruise``, that of the robot, and ``seeing_speed`` [m/s],
    up to which the camera shows depth.
    """

    def __init__(
        self,
        robot: RobotModel,
        params: CommandGridParams | None = None,
        seeing_speed: float = math.inf,
    ) -> None:
        params = params or CommandGridParams()
        self.max_v = min(params.cruise, robot.max_v, seeing_speed)
        self.max_w = min(params.turn_rate, robot.max_w)
        turns = params.turns | 1  # an odd count contains zero
        backward = np.linspace(-robot.max_reverse, 0.0, params.reverse + 1)[:-1]
        forward = np.linspace(0.0, self.max_v, params.forward or _forward_speeds(self.max_v))
        self.v: Array = read_only(np.concatenate([backward, forward]))
        self.w: Array = read_only(np.linspace(-self.max_w, self.max_w, turns))
        self.relative_v: Array = read_only(self.v / self.max_v)
        self.relative_w: Array = read_only(self.w / self.max_w)
        self.shape = (self.v.size, self.w.size)
        self.backward_rows = slice(0, backward.size)
        self.forward_rows = slice(backward.size + 1, self.v.size)
        self._seal()

    def zeros(self) -> Array:
        """A (n_v, n_w) layer of zeros: nothing desired, nothing prohibited."""
        return np.zeros(self.shape)

    def product(self, speed: Array, turn: Array) -> Array:
        """Desirability (n_v, n_w) from a set over speeds (n_v,) and one over turns (n_w,)."""
        return speed[:, None] * turn

    def around(self, speed: float, turn: float) -> Array:
        """Desirability (n_v, n_w) of one command and of its neighbours on the grid.

        ``speed`` and ``turn`` are in units of the top speed and top turning rate.
        """
        return self.product(peak(speed, self.relative_v), peak(turn, self.relative_w))

    def turning(self, turn: float, width: float = 0.3) -> Array:
        """A set over turns (n_w,): a triangle about ``turn`` of half width ``width``.

        Both are in units of the top turning rate.
        """
        return triangle(turn, self.relative_w, width)

    def on_the_spot(self, turn: float, width: float = 0.3) -> Array:
        """Desirability (n_v, n_w) of no speed, with the set of turns that ``turning`` gives."""
        return self.product(1.0 * (self.v == 0.0), self.turning(turn, width))

    def forward(self) -> Array:
        """A layer (n_v, n_w) that is 1 for forward commands: a prohibition of driving forward."""
        layer = self.zeros()
        layer[self.forward_rows] = 1.0
        return layer

    def nearest(self, twist: Twist) -> tuple[int, int]:
        """Indices of the grid command nearest to ``twist``."""
        return (
            int(np.abs(self.v - twist.v).argmin()),
            int(np.abs(self.w - twist.w).argmin()),
        )


def _forward_speeds(max_v: float) -> int:
    """Number of forward speeds up to ``max_v`` [m/s], standstill included, _SPEED_STEP apart."""
    return min(max(math.ceil(max_v / _SPEED_STEP) + 1, _MIN_FORWARD), _MAX_FORWARD)


def peak(value: float, values: Array, steps: float = 1.5) -> Array:
    """A triangle about ``value`` at ``values`` (n,) ascending, of half width ``steps`` steps.

    With more than half a step its support always contains at least one of them.
    """
    return triangle(value, values, steps * float(np.diff(values).max()))


def triangle(value: float, values: Array, width: float) -> Array:
    """A triangle about ``value`` at ``values`` (n,), 1 there and 0 from ``width`` off."""
    return np.maximum(0.0, 1.0 - np.abs(values - value) / width)
