"""Scenes for tests of behaviours: contexts of short drives, without a simulator.

The flow of a robot between walls is computed from geometry only; OFFIS and the local map process it
like measured flow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.context import CommandGrid, Context
from navfw.flow.grid_flow import grid_points
from navfw.interfaces import Fusion
from navfw.localmap import LocalMap
from navfw.mofis.mofis import DecisionInputs, Mofis
from navfw.offis.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    CameraMotion,
    Command,
    FlowField,
    Odometry,
    Percept,
    Pose,
    Proposal,
    Twist,
    Waypoint,
)

PERIOD = 0.1
"""Time [s] between frames."""

_BASELINE = 0.06
"""Distance driven [m] between the two frames of a pair."""

_GRID = (12, 16)
"""Rows and columns of the flow field."""


_ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class BehaviorScene:
    """A drive of ``ticks`` frames at constant ``twist``, from the origin along x.

    ``ahead``, ``left``, ``right`` are distances [m] of walls from the start, ``waypoint`` is a
    position (x, y) [m] relative to the start, or None. ``moves`` is False for a robot with blocked
    wheels: it commands the twist and does not move. If ``perceives`` is False, there is no percept.
    """

    name: str
    twist: Twist
    waypoint: tuple[float, float] | None = (3.0, 0.0)
    ahead: float = 20.0
    left: float = 20.0
    right: float = 20.0
    ticks: int = 8
    moves: bool = True
    perceives: bool = True


SCENES: tuple[BehaviorScene, ...] = (
    BehaviorScene("before the first percept", Twist(0.0, 0.0), perceives=False, ticks=2),
    BehaviorScene("no waypoint", Twist(0.0, 0.0), waypoint=None),
    BehaviorScene("open floor", Twist(0.3, 0.0)),
    BehaviorScene("goal on the left", Twist(0.2, 0.3), waypoint=(1.0, 2.0)),
    BehaviorScene("goal behind", Twist(0.2, 0.0), waypoint=(-2.0, 0.1)),
    BehaviorScene("goal close", Twist(0.1, 0.0), waypoint=(0.2, 0.0)),
    BehaviorScene("wall ahead", Twist(0.3, 0.0), ahead=1.0),
    BehaviorScene("wall close ahead", Twist(0.2, 0.0), ahead=0.45),
    BehaviorScene("wall on the left", Twist(0.3, 0.0), left=0.5),
    BehaviorScene("wall on the right", Twist(0.3, 0.0), right=0.5),
    BehaviorScene("corridor", Twist(0.3, 0.0), left=0.7, right=0.7),
    BehaviorScene("dead end", Twist(0.1, 0.0), ahead=0.6, left=0.4, right=0.4),
    BehaviorScene("wheels blocked", Twist(0.3, 0.0), moves=False, ticks=30),
    BehaviorScene("reversing", Twist(-0.1, 0.0), ahead=0.5, left=0.6),
    BehaviorScene("turning on the spot", Twist(0.0, 1.0), left=1.0),
)
"""The scenes in which ``check_behavior`` runs a behaviour."""


def contexts_of(
    scene: BehaviorScene, robot: RobotModel | None = None, start: Pose = _ORIGIN
) -> list[Context]:
    """Compute the context of every frame of ``scene``, as MOFIS passes it to its behaviours.

    The robot begins at the pose ``start`` in ``map``; the walls are placed relative to it.
    """
    robot = robot or RobotModel()
    local_map = LocalMap(robot)
    mofis = Mofis(robot, {}, _Scripted(robot, scene.twist), CommandGrid(robot), local_map)
    offis = Offis(robot)
    pose = _ORIGIN
    twist = scene.twist if scene.moves else Twist(0.0, 0.0)
    flow: FlowField | None = None
    percept: Percept | None = None
    contexts = []
    for tick in range(1, scene.ticks + 1):
        time = tick * PERIOD
        if scene.moves:
            pose = pose.compose(Pose(twist.v * PERIOD, 0.0, twist.w * PERIOD))
        odometry = Odometry(time, pose, twist, 0.0, still=twist == Twist(0.0, 0.0))
        percepts: Sequence[Percept] = ()
        if scene.perceives and scene.moves and twist.v:
            walls = (scene.ahead - pose.x, scene.left - pose.y, scene.right + pose.y)
            flow = wall_flow(robot, time, *walls)
            percepts = [offis.perceive(flow, twist)]
            percept = percepts[0] if percepts[0].sees_depth else percept
        belief = Belief(time, start.compose(pose), np.zeros((3, 3)))
        local_map.update(odometry, percepts, None, belief.pose)
        waypoint = None
        if scene.waypoint is not None:
            tolerance = min(0.3, 0.5 * math.hypot(*scene.waypoint))
            waypoint = Waypoint.goal(*start.to_parent(*scene.waypoint), tolerance, "there")
        mofis.decide(DecisionInputs(odometry, belief, waypoint, percept, flow))
        if mofis.context is not None:
            contexts.append(mofis.context)
    return contexts


def wall_flow(robot: RobotModel, time: float, ahead: float, left: float, right: float) -> FlowField:
    """Compute the exact derotated flow of a robot driving straight on a floor between walls.

    ``ahead``, ``left`` and ``right`` [m] are distances of infinite walls from the robot's centre.
    """
    camera = robot.camera
    points = grid_points(camera, *_GRID)
    base = np.dstack([points / camera.focal, np.ones(_GRID)]) @ camera.base_from_camera.T
    x, y, z = np.moveaxis(base, -1, 0)
    walls = (x, ahead - camera.mount_forward), (y, left), (-y, right), (-z, camera.mount_height)
    nearness = np.full(_GRID, 0.02)
    for advance, distance in walls:
        nearness = np.maximum(nearness, advance / max(distance, 0.02))
    step = camera.base_from_camera.T @ np.array([_BASELINE, 0.0, 0.0])
    motion = CameraMotion(np.eye(3), step, 0.2, 1e-3, 1e-3)
    # a point p at depth Z flows by e / (Z + s_z), with e = p s_z - f s_xy
    e = points * step[2] - camera.focal * step[:2]
    vectors = e / (1.0 / nearness + step[2])[..., None]
    known = np.full(_GRID, 0.9), np.full(_GRID, 0.1)
    return FlowField(time, points, vectors, *known, motion, derotated=True)


class _Scripted(Fusion):
    """Commands the scene's twist, regardless of the proposals."""

    name = "scripted"

    def __init__(self, robot: RobotModel, twist: Twist) -> None:
        super().__init__(robot)
        self._twist = twist

    def fuse(self, context: Context, proposals: Mapping[str, Proposal]) -> Command:
        """Return the scene's command."""
        return Command(context.time, self._twist, "script", "the scene's twist")
