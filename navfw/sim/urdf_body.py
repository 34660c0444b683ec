"""A robot's own URDF in PyBullet: driven by its wheel joints, with its inertia and shapes.

All links collide with floor and solids; every contact with anything but the floor is a collision.
Links without inertia get next to none, where PyBullet would assume 1 kg.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from navfw.errors import SimulationError
from navfw.numerics.products import sum_in_order
from navfw.robot import DrivenUrdf, RobotModel
from navfw.robot.urdf import UrdfDrive, urdf_drive
from navfw.signals import Pose
from navfw.sim.engine import bullet, quiet_output
from navfw.sim.physics_world import BODY_GROUP, FLOOR_GROUP, SOLID_GROUP, WHEEL_GROUP
from navfw.sim.robot_body import BodyState, WheeledBody

_NO_MASS = 1e-3
"""Mass of a link without inertia [kg]; PyBullet takes one without mass for fixed to the world."""
_NO_INERTIA = 1e-6
"""Its moments of inertia [kg m^2]."""
_HOLDING = 50.0
"""Torque limit of joints that are held [N m], or force limit [N]."""


class UrdfBody(WheeledBody):
    """The robot of a URDF, with one or more wheels on each side.

    ``floor`` are the ids of the bodies that form the floor.
    """

    def __init__(self, robot: RobotModel, client: int, start: Pose, floor: Collection[int]) -> None:
        if robot.urdf is None:
            raise ValueError("the robot has no URDF")
        super().__init__(client)
        self._floor = frozenset(floor)
        drive = urdf_drive(robot)
        self.body = self._load(robot.urdf.file, drive, start)
        joints, links = self._names()
        wheels = [joints[name] for name in (*drive.left, *drive.right)]
        self._sides = (len(drive.left), len(drive.right))
        self._sense = [drive.sense[name] for name in (*drive.left, *drive.right)]
        self._supports = drive.supports
        self._set_dynamics(drive, joints, links, wheels)
        self._set_grip(robot.urdf, joints, wheels)
        self._bind(wheels, robot.urdf.torque)
        # base_link in the frame that PyBullet reports, which is that of the base's inertia
        inertial = self._call("getDynamicsInfo", self.body, -1)[3:5]
        to_root = bullet.invertTransform(*inertial)
        self._offset = bullet.multiplyTransforms(*to_root, drive.origin.tolist(), [0, 0, 0, 1])
        self.set_wheel_speeds(0.0, 0.0)

    def _load(self, file: str, drive: UrdfDrive, start: Pose) -> int:
        turn = [0.0, 0.0, math.sin(0.5 * start.yaw), math.cos(0.5 * start.yaw)]
        x, y = start.to_parent(-float(drive.origin[0]), -float(drive.origin[1]))
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        at = [x, y, -float(drive.origin[2])]
        try:
            with quiet_output():  # PyBullet prints a warning for every link without inertia
                return int(self._call("loadURDF", file, at, turn, flags=flags))
        except bullet.error as error:
            raise SimulationError(f"PyBullet cannot load {file}: {error}") from None

    def _names(self) -> tuple[dict[str, int], dict[str, int]]:
        """PyBullet's indices of joints and of links by their names in the file."""
        infos = [
            self._call("getJointInfo", self.body, index)
            for index in range(self._call("getNumJoints", self.body))
        ]
        root = self._call("getBodyInfo", self.body)[0].decode()
        links = {info[12].decode(): info[0] for info in infos} | {root: -1}
        return {info[1].decode(): info[0] for info in infos}, links

    def _set_dynamics(
        self,
        drive: UrdfDrive,
        joints: dict[str, int],
        links: dict[str, int],
        wheels: list[int],
    ) -> None:
        for name, link in links.items():
            self._call("changeDynamics", self.body, link, linearDamping=0.0, angularDamping=0.0)
            if name in drive.massless:
                inertia = [_NO_INERTIA] * 3
                self._call(
                    "changeDynamics", self.body, link, mass=_NO_MASS, localInertiaDiagonal=inertia
                )
            groups = BODY_GROUP | WHEEL_GROUP, SOLID_GROUP | FLOOR_GROUP
            self._call("setCollisionFilterGroupMask", self.body, link, *groups)
        for name, joint in joints.items():
            held = name in drive.held
            if held or joint not in wheels:
                self._call(
                    "setJointMotorControl2",
                    self.body,
                    joint,
                    bullet.POSITION_CONTROL if held else bullet.VELOCITY_CONTROL,
                    force=_HOLDING if held else 0.0,
                )

    def _set_grip(self, urdf: DrivenUrdf, joints: dict[str, int], wheels: list[int]) -> None:
        """Set the friction of wheels along their axles, and that of casters: none."""
        for wheel in wheels:
            axis = np.abs(self._call("getJointInfo", self.body, wheel)[13])
            along_axle = np.where(axis > 0.9, urdf.side_friction, 1.0).tolist()
            self._call("changeDynamics", self.body, wheel, anisotropicFriction=along_axle)
        for name in urdf.casters:
            self._call("changeDynamics", self.body, joints[name], lateralFriction=0.0)

    def set_wheel_speeds(self, left: float, right: float) -> None:
        """Set the motors' target angular speeds [rad/s] of each side, forward positive."""
        speeds = [left] * self._sides[0] + [right] * self._sides[1]
        self._set_motors(
            targetVelocities=[s * sense for s, sense in zip(speeds, self._sense, strict=True)]
        )

    def wheel_angles(self) -> tuple[float, float]:
        """Mean accumulated angles of the wheels of each side (left, right) [rad]."""
        turned = [s[0] * sense for s, sense in zip(self._wheel_states(), self._sense, strict=True)]
        left, right = turned[: self._sides[0]], turned[self._sides[0] :]
        return sum_in_order(left) / len(left), sum_in_order(right) / len(right)

    def state(self) -> BodyState:
        """The true pose of ``base_link``."""
        position, turn = bullet.multiplyTransforms(*self._base_pose(), *self._offset)
        return position, turn

    def _collides(self, other: int) -> bool:
        return other not in self._floor
