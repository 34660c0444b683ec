from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.egomotion import camera_motion, yaw_rotation
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose

poses = st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))


def in_camera(robot: RobotModel, pose: Pose, point: Array) -> Array:
    """A point of the world in the axes of the camera of a robot at ``pose``."""
    camera = robot.camera
    base = yaw_rotation(-pose.yaw) @ (point - np.array([pose.x, pose.y, 0.0]))
    mount = np.array([camera.mount_forward, 0.0, camera.mount_height])
    return np.asarray(camera.base_from_camera.T @ (base - mount))


@given(
    past=poses,
    now=poses,
    pitch=st.floats(-0.9, 0.9),
    forward=st.floats(-0.3, 0.3),
    point=st.tuples(*[st.floats(-10, 10)] * 3),
)
def test_static_points_move_as_the_motion_says(
    past: Pose, now: Pose, pitch: float, forward: float, point: tuple[float, ...]
) -> None:
    robot = RobotModel(camera=CameraModel(pitch=pitch, mount_forward=forward))
    motion = camera_motion(robot, past, now, 0.1)
    before = in_camera(robot, past, np.array(point))
    after = in_camera(robot, now, np.array(point))
    np.testing.assert_allclose(motion.rotation @ before - motion.translation, after, atol=1e-9)
    np.testing.assert_allclose(motion.rotation @ motion.rotation.T, np.eye(3), atol=1e-12)


def test_driving_ahead_moves_the_camera_along_its_axis() -> None:
    motion = camera_motion(
        RobotModel(), Pose(1, 2, 0.7), Pose(1, 2, 0.7).compose(Pose(0.1, 0, 0)), 1
    )
    np.testing.assert_allclose(motion.translation, [0.0, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(motion.rotation, np.eye(3), atol=1e-12)


def test_a_camera_ahead_of_the_axle_swings_left_in_a_left_turn() -> None:
    robot = RobotModel(camera=CameraModel(mount_forward=0.1))
    motion = camera_motion(robot, Pose(0, 0, 0), Pose(0, 0, 0.02), 0.1)
    assert motion.translation[0] == pytest.approx(-0.1 * math.sin(0.02))
    assert motion.baseline == pytest.approx(0.002, rel=1e-3)


def test_nose_down_pitch_looks_at_forward_motion_from_above() -> None:
    robot = RobotModel(camera=CameraModel(pitch=0.3))
    motion = camera_motion(robot, Pose(0, 0, 0), Pose(0.1, 0, 0), 0.1)
    # METHOD 2.2: T = (0, -sin a, cos a)
    expected = [0.0, -0.1 * math.sin(0.3), 0.1 * math.cos(0.3)]
    np.testing.assert_allclose(motion.translation, expected, atol=1e-12)


def test_sigmas_grow_with_time_and_way() -> None:
    short = camera_motion(RobotModel(), Pose(0, 0, 0), Pose(0.05, 0, 0), 0.1, slip=0.04)
    long = camera_motion(
        RobotModel(), Pose(0, 0, 0), Pose(0.1, 0, 0), 0.3, yaw_rate_sigma=0.01, slip=0.04
    )
    assert long.yaw_sigma == pytest.approx(0.003)
    assert short.translation_sigma == pytest.approx(math.hypot(5e-4, 0.04 * 0.05))
    assert long.translation_sigma == pytest.approx(math.hypot(5e-4, 0.04 * 0.1))
    skidding = camera_motion(RobotModel(skid=0.05), Pose(0, 0, 0), Pose(0, 0, 0.2), 0.1)
    assert (skidding.yaw_sigma, skidding.skid_sigma) == pytest.approx((0.0003, 0.01))
    way = 0.03 * skidding.baseline
    assert skidding.translation_sigma == pytest.approx(math.hypot(5e-4, way, 0.01))
