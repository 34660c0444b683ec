"""Movers: what nothing at rest can show, where its feet are, and how fast it goes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.egomotion.camera_motion import camera_motion
from navfw.movers.localization import _quantile, locate_moving_objects
from navfw.movers.motion_segmentation import direction_sigma, segment_motion
from navfw.robot import RobotModel, SideViews
from navfw.signals import Array, CameraMotion, FlowField, Pose

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
    """Exact derotated flow at POINTS of things with ``nearness`` that go ``own`` (ahead, left)."""
    s = motion.translation - robot.camera.base_from_camera.T @ np.array([*own, 0.0]) * DT
    lever = POINTS * s[2] - CAMERA.focal * s[:2]
    return np.asarray(lever * (nearness / (1.0 + s[2] * nearness))[..., None])


def scene(
    way: float,
    thing: tuple[float, float, float],
    own: tuple[float, float],
    noise: float = 0.0,
    robot: RobotModel = ROBOT,
) -> FlowField:
    """A floor, and a thing at (depth, left, width) [m] of the camera that walks ``own`` [m/s]."""
    motion = camera_motion(robot, Pose(0, 0, 0), Pose(way, 0, 0), DT)
    nearness = np.maximum(Y, 0.0) / CAMERA.focal / CAMERA.mount_height
    vectors = flow_of(nearness, motion, (0.0, 0.0), robot)
    depth, left, width = thing
    body = (np.abs(X * depth / CAMERA.focal + left) < 0.5 * width) & (nearness < 1.0 / depth)
    vectors[body] = flow_of(np.full_like(X, 1.0 / depth), motion, own, robot)[body]
    vectors += noise * np.random.default_rng(0).standard_normal(vectors.shape)
    across = np.zeros_like(X)
    lever = POINTS * motion.translation[2] - CAMERA.focal * motion.translation[:2]
    length = np.hypot(lever[..., 0], lever[..., 1])
    known = length > 1e-6
    cross = vectors[..., 0] * lever[..., 1] - vectors[..., 1] * lever[..., 0]
    across[known] = np.abs(cross[known]) / length[known]
    sigma = np.hypot(0.2, direction_sigma(motion.baseline) * np.hypot(*np.moveaxis(vectors, -1, 0)))
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
def test_nothing_moves_in_a_world_at_rest(way: float, depth: float) -> None:
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
def test_who_crosses_is_seen_where_it_stands_and_as_fast_as_it_goes(
    way: float, depth: float, left: float, speed: float, toward: float
) -> None:
    movers = locate_moving_objects(scene(way, (depth, left, 0.5), (0.0, toward * speed)), CAMERA)
    assert len(movers) == 1
    mover = movers[0]
    assert mover.bearing == pytest.approx(math.atan2(left, depth), abs=0.12)
    assert mover.distance * math.cos(mover.bearing) == pytest.approx(depth, rel=0.15)
    ahead, aside = mover.velocity()
    assert aside == pytest.approx(toward * speed, rel=0.25)
    assert abs(ahead) < 0.2
    assert mover.time == 1.0


def test_who_keeps_its_bearing_falls_short_of_the_floor() -> None:
    # straight ahead of the robot, going on before it and faster: no flow across, none outward
    movers = locate_moving_objects(scene(0.08, (1.2, 0.0, 0.5), (0.7, 0.0)), CAMERA)
    assert len(movers) == 1
    assert movers[0].velocity()[0] > 0.4


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("way", [0.0, 0.04])
def test_who_is_seen_aside_has_its_bearing_and_velocity_from_ahead(side: int, way: float) -> None:
    camera = RobotModel(side_views=SideViews()).side_cameras[side]
    flow = scene(way, (1.2, 0.0, 0.5), (0.5, 0.0), robot=ROBOT.with_camera(camera))
    (mover,) = locate_moving_objects(flow, camera)
    assert mover.bearing == pytest.approx(camera.turn, abs=0.1)
    assert mover.distance == pytest.approx(1.2, rel=0.15)
    ahead, left = mover.velocity()
    assert ahead == pytest.approx(0.5, rel=0.35)
    assert abs(left) < 0.25


def test_what_is_small_or_hangs_in_the_air_or_is_too_fast_is_none() -> None:
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


def test_rotation_has_to_be_gone() -> None:
    flow = dataclasses.replace(scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4)), derotated=False)
    with pytest.raises(ValueError, match="derotated"):
        locate_moving_objects(flow, CAMERA)


@pytest.mark.parametrize(("depth", "speed"), [(0.9, 0.3), (0.9, 0.5), (1.3, 0.5)])
def test_who_comes_straight_on_outgrows_the_floor_at_its_feet(depth: float, speed: float) -> None:
    # as fast as the robot or nearly so, a little aside: no flow across, only more of it outward
    movers = locate_moving_objects(scene(0.09, (depth, 0.25, 0.5), (-speed, 0.0)), CAMERA)
    assert len(movers) == 1
    assert movers[0].distance == pytest.approx(depth, rel=0.3)
    assert movers[0].velocity()[0] < -0.1


@given(depth=st.floats(0.5, 3.0), left=st.floats(-0.8, 0.8), way=st.floats(0.03, 0.12))
@settings(max_examples=40, deadline=None)
def test_what_stands_at_any_place_does_not_outgrow_the_floor(
    depth: float, left: float, way: float
) -> None:
    flow = scene(way, (depth, left, 0.5), (0.0, 0.0), noise=0.1)
    assert not segment_motion(flow, CAMERA.fall_per_depth(flow.points), CAMERA).any()


def test_patches_are_found_where_they_are() -> None:
    # walks across: every cell that contradicts is the walker's
    flow = scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4))
    odd = segment_motion(flow, CAMERA.fall_per_depth(flow.points), CAMERA)
    body = (np.abs(X * 1.2 / CAMERA.focal) < 0.25) & (1.2 * CAMERA.focal > Y)
    assert odd.any()
    assert not (odd & ~body).any()
