"""The robot's body in PyBullet: the round one of a RobotModel, or that of the robot's own URDF.

The round body is loaded from a URDF generated from the model: a disc-shaped base on two driven
wheels and two frictionless casters. Wheels and casters collide only with the floor, the base only
with everything else: every contact of the base is a collision. The wheels' collision shapes are
spheres with one contact point each; cylinders would chatter.

A robot's own URDF is driven by its wheel joints, with its inertia and shapes. All links collide
with floor and solids; every contact with anything but the floor is a collision. Links without
inertia get a negligible one, where PyBullet would assume 1 kg; impossible ones get that of a box.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from functools import partial

import numpy as np

from navfw.config.input_file import read_input, shown_path
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product, sum_in_order
from navfw.process.atomic import scratch_folder
from navfw.robot import DrivenUrdf, RobotModel
from navfw.robot.urdf_drive import UrdfDrive, urdf_drive
from navfw.robot.urdf_measures import impossible_inertias
from navfw.robot.urdf_meshes import loadable_urdf
from navfw.signals import Pose, wrap_angle
from navfw.sim.engine import BulletClient, bullet, quaternion, quiet_output
from navfw.sim.physics_world import BODY_GROUP, FLOOR_GROUP, SOLID_GROUP, WHEEL_GROUP

BodyState = tuple[tuple[float, float, float], tuple[float, float, float, float]]
"""Position [m] and orientation (quaternion x, y, z, w) of base_link in the map."""

ContactPoint = tuple[int, float, float, float]
"""PyBullet's id of the body in contact with the robot, and the point (x, y, z) [m, ``map``]."""


class WheeledBody(BulletClient, ABC):
    """The robot with PyBullet's id ``body``: wheel motors, true state and contacts.

    Subclasses load the body, then call ``_bind``. ``_supports`` (n, 2) [m] are the points in
    base_link that rest on the floor, ``_sides`` the numbers of wheels left and right, and
    ``_sense`` is -1 for a wheel whose joint turns backwards as the robot drives ahead.
    """

    body: int
    _supports: Array
    _sides: tuple[int, int] = (1, 1)
    _sense: Sequence[float] = (1.0, 1.0)
    _last: BodyState | None = None

    def _bind(self, wheels: Sequence[int], torque: float, **contacts: int) -> None:
        """Bind the arguments of calls of every tick or physics step once.

        ``wheels`` are the joints driven with at most ``torque`` [N m] each; ``contacts`` restrict
        the contact points.
        """
        at = {"physicsClientId": self._client}
        self._contact_points = partial(bullet.getContactPoints, self.body, **contacts, **at)
        self._base_pose = partial(bullet.getBasePositionAndOrientation, self.body, **at)
        self._wheel_states = partial(bullet.getJointStates, self.body, wheels, **at)
        self._set_motors = partial(
            bullet.setJointMotorControlArray,
            self.body,
            wheels,
            bullet.VELOCITY_CONTROL,
            forces=[torque] * len(wheels),
            **at,
        )

    @abstractmethod
    def state(self) -> BodyState:
        """Return the true pose of ``base_link`` in ``map``."""

    def set_wheel_speeds(self, left: float, right: float) -> None:
        """Set the motors' target speeds [rad/s] of the left and right wheels, forward positive."""
        speeds = [left] * self._sides[0] + [right] * self._sides[1]
        self._set_motors(
            targetVelocities=[s * sense for s, sense in zip(speeds, self._sense, strict=True)]
        )

    def wheel_angles(self) -> tuple[float, float]:
        """Return the mean accumulated angles of the wheels of each side (left, right) [rad]."""
        turned = [s[0] * sense for s, sense in zip(self._wheel_states(), self._sense, strict=True)]
        left, right = turned[: self._sides[0]], turned[self._sides[0] :]
        return sum_in_order(left) / len(left), sum_in_order(right) / len(right)

    def support_points(self) -> Array:
        """Points (n, 3) [m] in ``map`` at which the body rests on the floor."""
        origin, turn = self.state()
        axes = np.array(self._call("getMatrixFromQuaternion", turn)).reshape(3, 3)
        points: Array = origin + product(self._supports, axes[:, :2].T)
        return points

    def roll_pitch_rates(self, now: BodyState, dt: float) -> tuple[float, float]:
        """Return mean rates [rad/s] about the body's x and y axes over the last ``dt`` [s]."""
        (a, b, c, d), (x, y, z, w) = (self._last or now)[1], now[1]
        self._last = now
        if dt == 0.0:
            return 0.0, 0.0
        per_turn = math.copysign(2.0, a * x + b * y + c * z + d * w) / dt
        roll, pitch = d * x - a * w - b * z + c * y, d * y - b * w - c * x + a * z
        return per_turn * roll, per_turn * pitch

    def contacts(self) -> set[ContactPoint]:
        """Return the current contact points that count as collisions."""
        # close pairs without contact are listed too: index 8 is the distance, 9 the normal force
        return {
            (point[2], *point[6])
            for point in self._contact_points()
            if self._collides(point[2]) and (point[8] <= 1e-4 or point[9] > 0.0)
        }

    def _collides(self, other: int) -> bool:
        """Whether contact with the body of that id is a collision."""
        del other
        return True


_MASS = 6.0
"""Mass of the robot without wheels [kg]."""
_WHEEL_MASS = 0.3
"""Mass of one wheel [kg]."""
_WHEEL_TORQUE = 1.2
"""Torque limit of one wheel's motor [N m]: four times that of the hardest usual braking."""
_CENTRE_OF_MASS = 0.06
"""Height of the centre of mass above the floor [m]: low, because of the batteries."""
_CASTER_RADIUS = 0.02
"""Radius of a caster [m]."""
_CASTER_AHEAD = 0.75
"""Distance of the casters ahead of and behind the axle, as a share of the base's radius."""


def _cylinder_inertia(mass: float, radius: float, height: float) -> tuple[float, float]:
    """(across, along) moments of inertia of a solid cylinder about its axis."""
    return mass * (3 * radius**2 + height**2) / 12.0, 0.5 * mass * radius**2


def _inertial(mass: float, ix: float, iy: float, iz: float, z: float = 0.0) -> str:
    return (
        f'<inertial><origin xyz="0 0 {z}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ix}" iyy="{iy}" izz="{iz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _robot_urdf(robot: RobotModel) -> str:
    """The robot's URDF: ``base_link`` has its origin on the floor below the middle of the axle."""
    r, clearance = robot.radius, 0.02
    height = robot.height - clearance
    across, along = _cylinder_inertia(_MASS, r, 0.5 * robot.height)
    wheel_across, wheel_along = _cylinder_inertia(_WHEEL_MASS, robot.wheel_radius, 0.03)
    caster_x = _CASTER_AHEAD * r
    casters = "".join(
        f'<link name="{side}_caster">{_inertial(0.02, 1e-5, 1e-5, 1e-5)}<collision><geometry>'
        f'<sphere radius="{_CASTER_RADIUS}"/></geometry></collision></link>'
        f'<joint name="{side}_caster_mount" type="fixed"><parent link="base_link"/>'
        f'<child link="{side}_caster"/><origin xyz="{x} 0 {_CASTER_RADIUS}"/></joint>'
        for side, x in (("front", caster_x), ("rear", -caster_x))
    )
    wheels = "".join(
        f'<link name="{side}_wheel">'
        f"{_inertial(_WHEEL_MASS, wheel_across, wheel_along, wheel_across)}"
        f'<visual><origin rpy="{math.pi / 2} 0 0"/><geometry><cylinder '
        f'radius="{robot.wheel_radius}" length="0.03"/></geometry></visual>'
        f'<collision><geometry><sphere radius="{robot.wheel_radius}"/></geometry></collision>'
        f'</link><joint name="{side}_axle" type="continuous"><parent link="base_link"/>'
        f'<child link="{side}_wheel"/><origin xyz="0 {y} {robot.wheel_radius}"/>'
        f'<axis xyz="0 1 0"/></joint>'
        for side, y in (("left", 0.5 * robot.track), ("right", -0.5 * robot.track))
    )
    base = (
        f'<link name="base_link">{_inertial(_MASS, across, across, along, _CENTRE_OF_MASS)}'
        f'<visual><origin xyz="0 0 {clearance + 0.5 * height}"/><geometry><cylinder radius="{r}" '
        f'length="{height}"/></geometry><material name="body"><color rgba="0.2 0.35 0.6 1"/>'
        f"</material></visual>"
        f'<collision><origin xyz="0 0 {clearance + 0.5 * height}"/><geometry><cylinder '
        f'radius="{r}" length="{height}"/></geometry></collision></link>'
    )
    return f'<?xml version="1.0"?><robot name="navfw_robot">{base}{wheels}{casters}</robot>'


class RobotBody(WheeledBody):
    """The round robot with two wheels and two casters, built from its ``RobotModel``."""

    def __init__(self, robot: RobotModel, client: int, start: Pose) -> None:
        super().__init__(client)
        with scratch_folder("robot") as folder:
            path = folder / "robot.urdf"
            path.write_text(_robot_urdf(robot), encoding="utf-8")
            # without self collision (the default) and with our own inertias
            self.body = int(
                self._call(
                    "loadURDF",
                    str(path),
                    [start.x, start.y, 0.0],
                    quaternion(start.yaw),
                    flags=bullet.URDF_USE_INERTIA_FROM_FILE,
                )
            )
        joints = {
            self._call("getJointInfo", self.body, j)[1].decode(): j
            for j in range(self._call("getNumJoints", self.body))
        }
        half, caster = 0.5 * robot.track, _CASTER_AHEAD * robot.radius
        self._supports = np.array([[0.0, half], [0.0, -half], [caster, 0.0], [-caster, 0.0]])
        self._bind([joints["left_axle"], joints["right_axle"]], _WHEEL_TORQUE, linkIndexA=-1)
        self._set_contacts(joints)
        self.set_wheel_speeds(0.0, 0.0)

    def _set_contacts(self, joints: dict[str, int]) -> None:
        for link in (-1, *joints.values()):
            self._call("changeDynamics", self.body, link, linearDamping=0.0, angularDamping=0.0)
        self._call("setCollisionFilterGroupMask", self.body, -1, BODY_GROUP, SOLID_GROUP)
        self._call("changeDynamics", self.body, -1, lateralFriction=0.4, restitution=0.0)
        for name, link in joints.items():
            self._call("setCollisionFilterGroupMask", self.body, link, WHEEL_GROUP, FLOOR_GROUP)
            friction = 0.0 if "caster" in name else 1.2
            self._call(
                "changeDynamics",
                self.body,
                link,
                lateralFriction=friction,
                rollingFriction=0.0,
                spinningFriction=0.0,
                restitution=0.0,
                jointDamping=0.0,
            )

    def state(self) -> BodyState:
        """Return the true pose of ``base_link`` in ``map``."""
        centre, turn = self._base_pose()
        x, y, z, w = turn
        # PyBullet reports the centre of mass: base_link is below it on the body's z axis
        offset = -_CENTRE_OF_MASS
        origin = (
            centre[0] + offset * 2.0 * (x * z + w * y),
            centre[1] + offset * 2.0 * (y * z - w * x),
            centre[2] + offset * (1.0 - 2.0 * (x * x + y * y)),
        )
        return origin, turn


# --- a robot's own URDF -----------------------------------------------------------------------

_NO_MASS = 1e-3
"""Mass given to a link without inertia [kg]; PyBullet would fix one without mass to the world."""
_NO_INERTIA = 1e-6
"""Moments of inertia given to a link without inertia [kg m^2]."""
_BULLET_ERROR = r"b3Error\[[^\]]*\]:\s*(.*?)\s*(?=b3(?:Error|Warning)\[|$)"
"""Pattern of the errors that PyBullet prints."""
_MAX_JOINTS = 127
"""Largest number of joints, fixed ones included, of a body in PyBullet."""
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
        self.body = self._load(drive, start)
        joints, links = self._names()
        wheels = [joints[name] for name in (*drive.left, *drive.right)]
        self._sides = (len(drive.left), len(drive.right))
        self._sense = [drive.sense[name] for name in (*drive.left, *drive.right)]
        self._supports = drive.supports
        boxes = impossible_inertias(robot, drive.model)
        self._set_dynamics(drive, joints, links, wheels, boxes)
        self._set_grip(robot.urdf, joints, wheels)
        self._bind(wheels, robot.urdf.torque)
        # base_link in the frame that PyBullet reports, which is that of the base's inertia
        inertial = self._call("getDynamicsInfo", self.body, -1)[3:5]
        to_root = bullet.invertTransform(*inertial)
        self._offset = bullet.multiplyTransforms(*to_root, drive.origin.tolist(), [0, 0, 0, 1])
        self.set_wheel_speeds(0.0, 0.0)

    def _load(self, drive: UrdfDrive, start: Pose) -> int:
        if (count := len(drive.model.joints)) > _MAX_JOINTS:
            what = f"has {count} joints, PyBullet takes {_MAX_JOINTS}: join links that never move"
            raise ConfigError(what, file=shown_path(drive.model.file))
        x, y = start.to_parent(-float(drive.origin[0]), -float(drive.origin[1]))
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        at = [x, y, -float(drive.origin[2])]
        with scratch_folder("robot") as folder:
            loaded, printed = str(loadable_urdf(drive.model, folder)), folder / "printed"
            try:
                with quiet_output(printed):
                    return int(
                        self._call("loadURDF", loaded, at, quaternion(start.yaw), flags=flags)
                    )
            except bullet.error:
                text = read_input(printed).decode("utf-8", "replace")
                said = " ".join(re.findall(_BULLET_ERROR, text, re.DOTALL)) or "it says no reason"
                raise ConfigError(
                    f"PyBullet cannot load it: {said}", file=shown_path(drive.model.file)
                ) from None

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
        boxes: Mapping[str, tuple[object, tuple[float, ...]]],
    ) -> None:
        for name, link in links.items():
            self._call("changeDynamics", self.body, link, linearDamping=0.0, angularDamping=0.0)
            if name not in drive.model.inertials:
                none = [_NO_INERTIA] * 3
                self._call(
                    "changeDynamics", self.body, link, mass=_NO_MASS, localInertiaDiagonal=none
                )
            if name in boxes:
                inertia = boxes[name][1]
                self._call("changeDynamics", self.body, link, localInertiaDiagonal=inertia)
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

    def state(self) -> BodyState:
        """Return the true pose of ``base_link`` in ``map``."""
        position, turn = bullet.multiplyTransforms(*self._base_pose(), *self._offset)
        return position, turn

    def set_level(self) -> None:
        """Make the present attitude the level one, for ``base_link`` and the camera on it."""
        state = self.state()
        back = bullet.invertTransform([0, 0, 0], state[1])
        level = bullet.multiplyTransforms(*back, [0, 0, 0], quaternion(pose_of(state).yaw))
        self._offset = bullet.multiplyTransforms(*self._offset, *level)

    def _collides(self, other: int) -> bool:
        return other not in self._floor


def make_body(
    robot: RobotModel, client: int, start: Pose, floor: Collection[int]
) -> RobotBody | UrdfBody:
    """Load the robot in the PyBullet client ``client``; ``floor`` are the floor bodies' ids."""
    if robot.urdf is None:
        return RobotBody(robot, client, start)
    return UrdfBody(robot, client, start, floor)


def pose_of(state: BodyState) -> Pose:
    """Return the planar pose of a body state."""
    (at_x, at_y, _), (x, y, z, w) = state
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return Pose(at_x, at_y, wrap_angle(yaw))
