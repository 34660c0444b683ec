"""Rotations against SciPy's, image points turned by them, derotation, and reduced images."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from flow_scene import exact_field, rotational_flow, turn_about
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from navfw.camera_geometry.image_reduction import reduce_frame
from navfw.camera_geometry.rotations import (
    derotate,
    rotate_points,
    rotation_matrix,
    rotation_vector,
    turn_point,
    turning_slope,
    undo_turn,
)
from navfw.egomotion.pairing import camera_motion
from navfw.flow import grid_points
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel, SideViews
from navfw.signals import CameraMotion, Frame, Pose

CAMERA = CameraModel()
FOCAL = 80.0
ANGLE = st.floats(-1.7, 1.7)
VECTOR = st.tuples(ANGLE, ANGLE, ANGLE).map(np.array)
POINTS = np.random.default_rng(0).uniform(-70.0, 70.0, (5, 4, 2))


@given(VECTOR, st.sampled_from([1.0, 1e-4, 1e-9, 1e-13]))
def test_matrices_and_vectors_are_those_of_scipy(vector: np.ndarray, scale: float) -> None:
    vector = vector * scale
    matrix = rotation_matrix(vector)
    assert matrix == pytest.approx(Rotation.from_rotvec(vector).as_matrix(), abs=1e-15)
    assert rotation_vector(matrix) == pytest.approx(vector, abs=1e-12, rel=1e-7)


def test_a_quarter_turn_is_counter_clockwise() -> None:
    turn = rotation_matrix(np.array([0.0, 0.0, np.pi / 2]))
    assert turn @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


@given(VECTOR.map(lambda vector: 0.2 * vector))
def test_points_turn_as_by_opencv_in_any_layout(vector: np.ndarray) -> None:
    turn = rotation_matrix(vector)
    camera = np.diag([FOCAL, FOCAL, 1.0])
    expected = cv2.perspectiveTransform(POINTS, camera @ turn @ np.linalg.inv(camera))
    assert rotate_points(POINTS, turn, FOCAL) == pytest.approx(expected, abs=1e-9)
    rows = rotate_points(POINTS.transpose(1, 0, 2), np.asfortranarray(turn), FOCAL)
    assert rows == pytest.approx(expected.transpose(1, 0, 2), abs=1e-9)
    x, y = POINTS[1, 2].tolist()
    one = turn_point(x, y, turn, FOCAL)
    assert one == pytest.approx(expected[1, 2], abs=1e-9)


def test_rays_turned_behind_the_camera_have_no_image() -> None:
    turned = rotate_points(np.zeros((1, 2)), rotation_matrix(np.array([0.0, np.pi, 0.0])), FOCAL)
    assert np.isnan(turned).all()


@given(VECTOR.map(lambda vector: 0.05 * vector))
def test_flow_of_a_turn_alone_is_undone(vector: np.ndarray) -> None:
    turn, points = rotation_matrix(vector), POINTS.reshape(-1, 2)
    vectors = points - rotate_points(points, turn.T, FOCAL)
    assert undo_turn(points, vectors, turn, FOCAL) == pytest.approx(0.0, abs=1e-9)


@given(VECTOR, st.floats(-70.0, 70.0), st.floats(-70.0, 70.0))
def test_the_slope_is_the_derivative_of_the_turn(vector: np.ndarray, x: float, y: float) -> None:
    small = 1e-6
    ends = [turn_point(x, y, rotation_matrix(s * vector), FOCAL) for s in (-small, small)]
    slope = (np.array(ends[1]) - np.array(ends[0])) / (2.0 * small)
    assert turning_slope(x, y, vector, FOCAL) == pytest.approx(slope, abs=1e-3)


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


@pytest.mark.parametrize(
    ("width", "height", "factor"),
    [
        *((160, 120, 1), (96, 72, 1), (200, 150, 1), (320, 240, 2), (640, 480, 4)),
        *((480, 360, 3), (1280, 720, 5), (1920, 1080, 10), (752, 480, 1), (641, 480, 1)),
    ],
)
def test_the_factor_is_the_largest_that_keeps_160_columns(
    width: int, height: int, factor: int
) -> None:
    assert CameraModel(width=width, height=height).reduction == factor


def test_a_pixel_is_the_mean_of_those_in_its_place() -> None:
    image = np.random.default_rng(5).integers(0, 256, (240, 320)).astype(np.uint8)
    frame = Frame(1.5, image, (image[:, :80], image[:, 80:160]))
    assert reduce_frame(frame, 1) is frame
    reduced = reduce_frame(frame, 2)
    mean = image.reshape(120, 2, 160, 2).mean(axis=(1, 3))
    assert np.abs(reduced.image - mean).max() <= 0.5
    assert [side.shape for side in reduced.sides] == [(120, 40), (120, 40)]
    assert reduced.time == frame.time


def test_the_reduced_camera_sees_the_same_rays() -> None:
    camera = CameraModel(width=640, height=480, hfov=1.1, pitch=0.1)
    robot = RobotModel(camera=camera, side_views=SideViews(width=160))
    reduced = robot.with_reduced_images()
    assert (reduced.camera.width, reduced.camera.height) == (160, 120)
    assert 4.0 * reduced.camera.focal == pytest.approx(camera.focal)
    assert reduced.side_views is not None
    assert reduced.side_views.width == 40
    assert reduced.camera.pitch == camera.pitch
    assert RobotModel().with_reduced_images() == RobotModel()
