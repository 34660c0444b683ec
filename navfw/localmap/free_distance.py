"""Where each command would lead: free arcs through the ego map, and ranges around the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.localmap.ray_kernels import cast_ranges, follow_arc, least_within, sweep_arcs
from navfw.mofis.command_grid import CommandGrid
from navfw.signals import Array, Pose, Twist

__all__ = ["Arcs", "Ranges", "look_around", "room_along", "sweep"]

SECTORS = 48
_BEARINGS = np.linspace(-math.pi, math.pi, SECTORS + 1)[1:]
_BEARINGS.flags.writeable = False


@dataclass(frozen=True, slots=True)
class Arcs:
    """What lies along every command's arc; arrays (n_v, n_w) [m].

    ``free`` is the length until the body would touch something, ``known`` the length until its
    centre would enter what has never been seen free, both at most ``reach``; ``clearance`` is the
    least distance from the body's rim to anything, over the next stretch.
    """

    free: Array
    known: Array
    clearance: Array
    reach: float


def sweep(
    occupancy: OccupancyGrid,
    pose: Pose,
    commands: CommandGrid,
    margin: float,
    reach: float = 1.6,
    horizon: float = 0.6,
) -> Arcs:
    """Sweep the robot's disc, widened by ``margin`` [m], along every command's arc."""
    free, known, clearance = np.empty((3, *commands.shape))
    sweep_arcs(
        *_ground(occupancy, pose),
        commands.v,
        commands.w,
        occupancy.robot.radius + margin,
        reach,
        horizon,
        free,
        known,
        clearance,
    )
    backward = commands.backward_rows
    # No eyes at the back: there, what has never been seen free counts as taken. (The robot's own
    # place is known, so its rim and not its centre must not pass into the unseen.)
    behind = np.maximum(known[backward] - occupancy.robot.radius - margin, 0.0)
    behind[known[backward] >= reach] = reach
    free[backward] = np.minimum(free[backward], behind)
    return Arcs(free, known, clearance + margin, reach)


def room_along(
    occupancy: OccupancyGrid, pose: Pose, twist: Twist, reach: float = 1.0
) -> tuple[float, float]:
    """How far [m] ``twist`` leads from odom ``pose``: (until a touch, until the unseen).

    Both at most ``reach``; a robot that only turns has all the room it needs.
    """
    free, known, _ = follow_arc(
        *_ground(occupancy, pose),
        float(twist.v),
        float(twist.w),
        occupancy.robot.radius,
        reach,
        0.0,
    )
    return free, known


def _ground(
    occupancy: OccupancyGrid, pose: Pose
) -> tuple[Array, npt.NDArray[np.uint8], float, float, float, float, float, float]:
    """What arcs are followed over, and from where: the first arguments of the kernels."""
    cell = occupancy.params.cell
    return (
        occupancy.clearance,
        occupancy.familiar,
        *occupancy.origin,
        cell,
        pose.x,
        pose.y,
        pose.yaw,
    )


@dataclass(frozen=True)  # without slots: sides are kept, many behaviours ask for them
class Ranges:
    """Distance [m] from the robot's rim to the nearest remembered thing, all around.

    ``bearings`` (n,) [rad, left positive] in (-pi, pi]; ``free`` (n,) [m] to what blocks, ``seen``
    (n,) [m] to what has never been seen free; both at most ``limit``.
    """

    bearings: Array
    free: Array
    seen: Array
    limit: float

    def nearest(self, low: float, high: float) -> float:
        """Least free distance [m] for bearings in [low, high] [rad]."""
        return least_within(self.bearings, self.free, low, high, self.limit)

    @cached_property
    def corridor(self) -> float:
        """Degree in [0, 1] to which there is a wall at each side and room ahead."""
        side = max(self.left, self.right)
        return max(0.0, min(1.0, (1.6 - side) / 0.8)) * max(0.0, min(1.0, self.front / 0.8))

    @cached_property
    def front(self) -> float:
        """Least free distance [m] within 30 degrees of straight ahead."""
        return self.nearest(-math.radians(30), math.radians(30))

    @cached_property
    def left(self) -> float:
        """Least free distance [m] on the left side (30 to 120 degrees)."""
        return self.nearest(math.radians(30), math.radians(120))

    @cached_property
    def right(self) -> float:
        """Least free distance [m] on the right side (30 to 120 degrees)."""
        return self.nearest(-math.radians(120), -math.radians(30))


def look_around(occupancy: OccupancyGrid, pose: Pose, limit: float = 3.0) -> Ranges:
    """Ranges in ``SECTORS`` directions around ``pose``, from the ego map."""
    free, seen = np.empty((2, SECTORS))
    cast_ranges(
        occupancy.clearance,
        occupancy.known,
        occupancy.origin[0],
        occupancy.origin[1],
        occupancy.params.cell,
        pose.x,
        pose.y,
        _BEARINGS + pose.yaw,
        limit,
        free,
        seen,
    )
    radius = occupancy.robot.radius
    return Ranges(_BEARINGS, np.maximum(free - radius, 0.0), np.maximum(seen - radius, 0.0), limit)
