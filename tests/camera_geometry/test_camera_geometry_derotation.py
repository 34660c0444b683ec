from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from flow_scene import exact_field, turn_about
from hypothesis import given
from hypothesis import strategies as st

from navfw.camera_geometry import derotate, rotational_flow
from navfw.egomotion import camera_motion
from navfw.flow import grid_points
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Pose

CAMERA = CameraModel()


@given(
    x=st.floats(-0.2, 0.2),
    y=st.floats(-0.05, 0.05),
    turn=st.floats(-0.2, 0.2),
    heading=st.floats(-3.0, 3.0),
    pitch=st.floats(-0.5, 0.5),
    forward=st.floats(-0.2, 0.3),
    seed=st.integers(0, 10),
)
def test_what_remains_is_exactly_the_flow_of_pure_translation(
    x: float, y: float, turn: float, heading: float, pitch: float, forward: float, seed: int
) -> None:
    camera = CameraModel(pitch=pitch, mount_forward=forward)
    past = Pose(3.0, -2.0, heading)
    motion = camera_motion(RobotModel(camera=camera), past, past.compose(Pose(x, y, turn)), 0.1)
    depth = np.random.default_rng(seed).uniform(0.7, 6.0, (12, 16))
    flow = derotate(exact_field(camera, motion, depth), camera)

    # METHOD 2.5: d = e / (Z + s_z) in current axes
    s = motion.translation
    lines = flow.points * s[2] - camera.focal * s[:2]
    np.testing.assert_allclose(flow.vectors, lines / (depth + s[2])[..., None], atol=1e-9)
    assert flow.derotated
    assert derotate(flow, camera) is flow


@given(st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_rotational_flow_is_all_there_is_without_translation(angles: tuple[float, ...]) -> None:
    rotation = turn_about(0, angles[0]) @ turn_about(1, angles[1]) @ turn_about(2, angles[2])
    field = exact_field(CAMERA, CameraMotion(rotation, np.zeros(3), 0.1), np.full((12, 16), 2.0))
    predicted = rotational_flow(field.points, rotation, CAMERA.focal)
    np.testing.assert_allclose(field.vectors, predicted, atol=1e-9)
    np.testing.assert_allclose(derotate(field, CAMERA).vectors, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        # METHOD 2.3 at small angles; the rays turn by +angle, the camera by -angle
        (0, lambda x, y, f: (-x * y / f, -(f + y * y / f))),
        (1, lambda x, y, f: (f + x * x / f, x * y / f)),
        (2, lambda x, y, f: (-y, x)),
    ],
)
def test_small_rotations_agree_with_the_first_order_formula(
    axis: int, expected: Callable[[Array, Array, float], tuple[Array, Array]]
) -> None:
    angle = 1e-5
    points = grid_points(CAMERA, 12, 16)
    flow = rotational_flow(points, turn_about(axis, angle), CAMERA.focal) / angle
    u, v = expected(points[..., 0], points[..., 1], CAMERA.focal)
    np.testing.assert_allclose(flow, np.stack([u, v], axis=-1), atol=5e-3)


def test_a_left_turn_moves_the_image_to_the_right() -> None:
    robot = RobotModel(camera=CameraModel(mount_forward=0.0))
    motion = camera_motion(robot, Pose(0, 0, 0), Pose(0, 0, 0.05), 0.1)
    flow = rotational_flow(np.array([[0.0, 0.0]]), motion.rotation, CAMERA.focal)
    assert flow[0, 0] == pytest.approx(CAMERA.focal * np.tan(0.05))
    assert flow[0, 1] == pytest.approx(0.0)
