"""Localisation of moving objects: segmentation, foot point on the floor, and velocity."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.egomotion import camera_motion
from navfw.movers import direction_sigma, locate_moving_objects, segment_motion
from navfw.movers.localization import _quantile
from navfw.numerics import Array
from navfw.robot import RobotModel, SideViews
from navfw.signals import CameraMotion, FlowField, Pose

ROBOT = RobotModel()
CAMERA = ROBOT.camera
X, Y = np.meshgrid((np.arange(40) - 19.5) * 4.0, (np.arange(18) - 2.5) * 4.0)
POINTS = np.stack([X, Y], axis=-1)
DT = 0.2


def flow_of(
    nearness: Array,
    motion: CameraMotion,
    own: tuple[float, float],
    robot: RobotModel = ROBOT,
) -> Array:
    """Exact derotated flow at POINTS of objects with ``nearness`` and velocity ``own`` [m/s].

    ``own`` is (ahead, left) in base_link.
    """
    s = motion.translation - robot.camera.base_from_camera.T @ np.array([*own, 0.0]) * DT
    lever = POINTS * s[2] - CAMERA.focal * s[:2]
    return np.asarray(lever * (nearness / (1.0 + s[2] * nearness))[..., None])


def driven(way: float) -> CameraMotion:
    return camera_motion(ROBOT, Pose(0, 0, 0), Pose(way, 0, 0), DT)


def scene(
    way: float,
    body: tuple[float, float, float],
    own: tuple[float, float],
    noise: float = 0.0,
    robot: RobotModel = ROBOT,
) -> FlowField:
    """Floor and an upright board ``body`` (depth, left, width) [m] that moves by ``own`` [m/s]."""
    motion = camera_motion(robot, Pose(0, 0, 0), Pose(way, 0, 0), DT)
    nearness = np.maximum(Y, 0.0) / CAMERA.focal / CAMERA.mount_height
    vectors = flow_of(nearness, motion, (0.0, 0.0), robot)
    depth, left, width = body
    cells = (np.abs(X * depth / CAMERA.focal + left) < 0.5 * width) & (nearness < 1.0 / depth)
    vectors[cells] = flow_of(np.full_like(X, 1.0 / depth), motion, own, robot)[cells]
    vectors += noise * np.random.default_rng(0).standard_normal(vectors.shape)
    across = np.zeros_like(X)
    lever = POINTS * motion.translation[2] - CAMERA.focal * motion.translation[:2]
    length = np.hypot(lever[..., 0], lever[..., 1])
    known = length > 1e-6
    cross = vectors[..., 0] * lever[..., 1] - vectors[..., 1] * lever[..., 0]
    across[known] = np.abs(cross[known]) / length[known]
    sigma = np.hypot(0.2, direction_sigma(motion) * np.hypot(*np.moveaxis(vectors, -1, 0)))
    return FlowField(
        1.0,
        POINTS,
        vectors,
        np.ones(X.shape),
        np.full(X.shape, 0.2),
        motion,
        derotated=True,
        inconsistency=1.0 * (across > 3.0 * np.hypot(sigma, 0.1)),
    )


@pytest.mark.parametrize("way", [0.0, 0.04, 0.1, -0.03])
@pytest.mark.parametrize("depth", [0.8, 1.5, 3.0])
def test_nothing_is_detected_in_a_static_scene(way: float, depth: float) -> None:
    assert locate_moving_objects(scene(way, (depth, 0.2, 0.5), (0.0, 0.0)), CAMERA) == ()
    assert (
        locate_moving_objects(scene(way, (depth, 0.2, 0.5), (0.0, 0.0), noise=0.15), CAMERA) == ()
    )


@settings(max_examples=60, deadline=None)
@given(
    way=st.sampled_from([0.0, 0.03, 0.08]),
    depth=st.floats(0.9, 1.8),
    left=st.floats(-0.4, 0.4),
    speed=st.floats(0.3, 0.6),
    toward=st.sampled_from([1.0, -1.0]),
)
def test_a_crossing_object_is_located_with_its_velocity(
    way: float, depth: float, left: float, speed: float, toward: float
) -> None:
    found = locate_moving_objects(scene(way, (depth, left, 0.5), (0.0, toward * speed)), CAMERA)
    assert len(found) == 1
    detection = found[0]
    assert detection.bearing == pytest.approx(math.atan2(left, depth), abs=0.12)
    assert detection.distance * math.cos(detection.bearing) == pytest.approx(depth, rel=0.15)
    ahead, aside = detection.velocity()
    assert aside == pytest.approx(toward * speed, rel=0.25)
    assert abs(ahead) < 0.2
    assert detection.time == 1.0


def test_four_cells_with_errors_of_half_a_pixel_tell_as_much_as_one_of_half_a_pixel() -> None:
    flow = scene(0.03, (1.2, 0.1, 0.5), (0.0, 0.5))
    (detection,) = locate_moving_objects(flow, CAMERA)
    assert flow.inconsistency is not None
    cells = int((flow.inconsistency > 0.0).sum())
    depth = detection.distance * math.cos(detection.bearing)
    per_speed = CAMERA.focal * DT / depth  # [px / (m/s)]
    sigma = 0.5 / per_speed / math.sqrt(cells / 4.0)
    assert detection.information[1, 1] == pytest.approx(1.0 / sigma**2, rel=0.35)


def test_an_object_at_constant_bearing_is_detected_by_flow_below_the_floors() -> None:
    # straight ahead of the robot, faster than it: no flow across epipolar lines, none outward
    found = locate_moving_objects(scene(0.08, (1.2, 0.0, 0.5), (0.7, 0.0)), CAMERA)
    assert len(found) == 1
    assert found[0].velocity()[0] > 0.4


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("way", [0.0, 0.04])
def test_detections_of_a_side_view_are_in_the_frame_of_the_robot(side: int, way: float) -> None:
    camera = RobotModel(side_views=SideViews()).side_cameras[side]
    flow = scene(way, (1.2, 0.0, 0.5), (0.5, 0.0), robot=ROBOT.with_camera(camera))
    (detection,) = locate_moving_objects(flow, camera)
    assert detection.bearing == pytest.approx(camera.turn, abs=0.1)
    assert detection.distance == pytest.approx(1.2, rel=0.15)
    ahead, left = detection.velocity()
    assert ahead == pytest.approx(0.5, rel=0.35)
    assert abs(left) < 0.25


def test_small_floating_or_very_fast_regions_are_no_objects() -> None:
    flow = scene(0.08, (1.2, 0.0, 0.5), (0.0, 0.0))
    assert flow.inconsistency is not None
    for rows, cols in ((slice(5, 7), slice(10, 12)), (slice(0, 3), slice(5, 15))):
        odd = flow.inconsistency.copy()
        odd[rows, cols] = 1.0
        assert locate_moving_objects(dataclasses.replace(flow, inconsistency=odd), CAMERA) == ()
    assert locate_moving_objects(scene(0.08, (1.2, 0.0, 0.5), (0.0, 4.0)), CAMERA) == ()


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=50),
    st.floats(0.0, 1.0),
)
def test_quantiles_are_those_of_numpy(values: list[float], share: float) -> None:
    expected = float(np.quantile(values, share))
    assert _quantile(np.array(values), share) == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_flow_with_rotation_is_refused() -> None:
    flow = dataclasses.replace(scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4)), derotated=False)
    with pytest.raises(ValueError, match="derotated"):
        locate_moving_objects(flow, CAMERA)


@pytest.mark.parametrize(("depth", "speed"), [(0.9, 0.3), (0.9, 0.5), (1.3, 0.5)])
def test_an_approaching_object_seems_nearer_than_the_floor_at_its_foot(
    depth: float, speed: float
) -> None:
    # about as fast as the robot, a little aside: no flow across epipolar lines, more outward
    found = locate_moving_objects(scene(0.09, (depth, 0.25, 0.5), (-speed, 0.0)), CAMERA)
    assert len(found) == 1
    assert found[0].distance == pytest.approx(depth, rel=0.3)
    assert found[0].velocity()[0] < -0.1


@given(depth=st.floats(0.5, 3.0), left=st.floats(-0.8, 0.8), way=st.floats(0.03, 0.12))
@settings(max_examples=40, deadline=None)
def test_static_objects_do_not_seem_nearer_than_the_floor_at_their_foot(
    depth: float, left: float, way: float
) -> None:
    flow = scene(way, (depth, left, 0.5), (0.0, 0.0), noise=0.1)
    assert not segment_motion(flow, CAMERA.fall_per_depth(flow.points), CAMERA).any()


def test_patches_keep_their_place() -> None:
    # every cell marked as moving is on the crossing object
    flow = scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4))
    moving = segment_motion(flow, CAMERA.fall_per_depth(flow.points), CAMERA)
    body = (np.abs(X * 1.2 / CAMERA.focal) < 0.25) & (1.2 * CAMERA.focal > Y)
    assert moving.any()
    assert not (moving & ~body).any()


def located(depth: float) -> float:
    """Distance [m] along the camera's axis of an object that crosses at ``depth`` [m]."""
    (detection,) = locate_moving_objects(scene(0.0, (depth, 0.0, 0.3), (0.0, 0.4)), CAMERA)
    return detection.distance * math.cos(detection.bearing)


def test_an_object_with_its_foot_below_the_image_is_nearer_than_the_floor_in_view() -> None:
    lowest = (POINTS[-1, 0, 1] + 2.0) / CAMERA.focal  # at the lower border of the last cells
    in_view = CAMERA.mount_height / lowest
    for depth in (0.3, 0.38, 0.45):
        assert located(depth) == pytest.approx(0.8 * in_view, rel=0.01)


@pytest.mark.parametrize(("border", "factor"), [(8.6, 0.8), (9.4, 1.0)])
def test_the_border_of_the_image_without_flow_is_9_px_wide(border: float, factor: float) -> None:
    # the body's lowest cells are 8 px above the last row, which is moved down
    depth = CAMERA.mount_height * CAMERA.focal / (POINTS[-3, 0, 1] + 2.0)
    flow = scene(0.0, (depth, 0.0, 0.3), (0.0, 0.4))
    points = flow.points.copy()
    points[-1, :, 1] = points[-3, :, 1] + border
    (detection,) = locate_moving_objects(dataclasses.replace(flow, points=points), CAMERA)
    away = detection.distance * math.cos(detection.bearing)
    assert away == pytest.approx(factor * depth, rel=0.01)


@given(st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_the_direction_of_a_short_way_is_uncertain(one: float, other: float) -> None:
    short, long = map(driven, sorted((one, other)))
    assert 0.03 <= direction_sigma(long) <= direction_sigma(short) <= 1.0


def test_three_millimetres_aside_make_the_direction_uncertain() -> None:
    assert direction_sigma(driven(0.0)) == 1.0
    assert direction_sigma(driven(0.1)) == pytest.approx(0.03 + math.atan2(0.003, 0.1), rel=1e-3)
    assert direction_sigma(driven(100.0)) == pytest.approx(0.03, rel=1e-2)


@pytest.mark.parametrize("turn", [-0.12, 0.12])
@pytest.mark.parametrize("farther", [-0.1, 0.0, 0.1])
def test_skidding_wheels_move_no_floor(turn: float, farther: float) -> None:
    """A turn on the spot about another point than base_link: the camera goes another way aside."""
    camera = ROBOT.camera.model_copy(update={"mount_forward": 0.5})
    robot = ROBOT.model_copy(update={"camera": camera})
    nearness = np.maximum(Y, 0.0) / CAMERA.focal / CAMERA.mount_height
    true = camera_motion(robot, Pose(0, 0, 0), Pose(0, -farther * turn, turn), DT)
    vectors = flow_of(nearness, true, (0.0, 0.0), robot)
    found = {}
    for skid in (0.0, 0.08):
        skidding = robot.model_copy(update={"skid": skid})
        believed = camera_motion(skidding, Pose(0, 0, 0), Pose(0, 0, turn), DT)
        flow = dataclasses.replace(
            scene(0.0, (2.0, 9.0, 0.1), (0.0, 0.0)),
            vectors=vectors,
            motion=believed,
            inconsistency=None,
        )
        found[skid] = segment_motion(flow, camera.fall_per_depth(POINTS), camera)
    assert not found[0.08].any()
    assert found[0.0].any() == (farther > 0.0)


def test_the_foot_point_counts_as_out_of_view_down_to_the_border_of_the_flow() -> None:
    # foot points above the lowest two rows of cells are in view; 9 px of border are two rows
    rows = POINTS[:, 0, 1]
    for row, factor in ((-5, 1.0), (-4, 1.0), (-3, 0.8), (-2, 0.8), (-1, 0.8)):
        foot = rows[row] + 2.0  # the body ends between this row and the next
        depth = CAMERA.mount_height * CAMERA.focal / foot
        assert located(depth) == pytest.approx(factor * depth, rel=0.01)
