"""The camera's motion between two poses of the robot: exact, with lever arm and pitch."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Odometry, Pose, wrap_angle

#: Standard deviation of the gyro's error once its bias is removed, a constant rate [rad/s].
YAW_RATE_SIGMA = 0.003
#: Standard deviation of the wheels' slip, relative to the distance driven.
SLIP = 0.03
#: Standard deviation of the shortest baseline [m]: encoder resolution and play in the wheels.
_TRANSLATION_FLOOR = 5e-4

#: One standard deviation of a turn measured by the wheels, through slip and unequal radii [rad/m].
_WHEELS_YAW_SIGMA = 0.1


def yaw_rotation(angle: float) -> Array:
    """(3, 3) rotation by ``angle`` [rad] about base_link's z axis, counter-clockwise from above."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def pitch_rotation(pitch: float) -> Array:
    """(3, 3) rotation of base_link's axes into level ones, ``pitch`` [rad] being nose down."""
    c, s = math.cos(pitch), math.sin(pitch)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def camera_place(robot: RobotModel, pitch: float) -> Array:
    """Place (3,) of the camera [m] ahead, left and above its height; level axes of base_link.

    The body rocks about the axle of its wheels.
    """
    ahead, above = robot.camera.mount_forward, robot.camera.mount_height - robot.wheel_radius
    if pitch == 0.0:
        return np.array([ahead, 0.0, 0.0])
    c, s = math.cos(pitch), math.sin(pitch)
    return np.array([c * ahead + s * above, 0.0, (c - 1.0) * above - s * ahead])


def camera_motion(
    robot: RobotModel,
    past: Pose,
    now: Pose,
    dt: float,
    *,
    yaw_rate_sigma: float = YAW_RATE_SIGMA,
    slip: float = SLIP,
    places: tuple[Array, Array] | None = None,
) -> CameraMotion:
    """Motion of ``robot``'s camera while its base moves from pose ``past`` to pose ``now``.

    Both poses are in one frame (``odom``). The camera is mounted ``mount_forward`` ahead of the
    axle, so a turn also moves it sideways, and its pitch maps yaw into rotation about two of its
    own axes (METHOD 2.1, 2.2, here without the small-angle approximation). ``dt`` [s] is the time
    between the poses; ``yaw_rate_sigma`` [rad/s] and ``slip`` (relative to the distance driven) are
    the standard deviations of the gyro's and the wheels' errors; that of the point about which the
    robot turns is ``robot.skid``. ``places``, past and now, are those of the camera
    (``camera_place``) of a body that rocks; its images are taken to be level.
    """
    turn = wrap_angle(now.yaw - past.yaw)
    # the camera's displacement in the axes of base_link now; the lever arm turned with the robot
    lever_past, lever = places or (camera_place(robot, 0.0),) * 2
    x, y = now.to_local(past.x, past.y)
    now_from_past = yaw_rotation(-turn)
    displacement = np.array([-x, -y, 0.0]) + lever - product(now_from_past, lever_past)
    base_from_camera = robot.camera.base_from_camera
    translation = product(base_from_camera.T, displacement)
    way = math.sqrt(product(translation, translation))
    skid = robot.skid * abs(turn)
    return CameraMotion(
        rotation=product(base_from_camera.T, now_from_past, base_from_camera),
        translation=translation,
        dt=dt,
        yaw_sigma=yaw_rate_sigma * abs(dt),
        translation_sigma=math.hypot(_TRANSLATION_FLOOR, slip * way, skid),
        skid_sigma=skid,
    )


def with_yaw_sigma(flow: FlowField, odometry: Odometry) -> FlowField:
    """``flow`` with the larger yaw sigma that is due while wheels stand in for a stale gyro."""
    if not odometry.gyro_stale:
        return flow
    sigma = max(flow.motion.yaw_sigma, _WHEELS_YAW_SIGMA * flow.motion.baseline)
    return replace(flow, motion=replace(flow.motion, yaw_sigma=sigma))
