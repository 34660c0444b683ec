"""Robust fits of epipolar residuals, and the refinement of the gyro's rotation as their case."""

import dataclasses
import math

import numpy as np
import pytest
from flow_scene import cell_truth, exact_field, room, turn_about
from hypothesis import given
from hypothesis import strategies as st

from navfw.camera_geometry.rotations import derotate, rotation_matrix, turn_point
from navfw.egomotion.epipolar_kernels import (
    _direction_slopes,
    epipolar_residual,
    fit_motion,
    fit_reweighted,
)
from navfw.egomotion.flow_egomotion import (
    EgomotionPrior,
    MotionKind,
    PointMotion,
    estimate_egomotion,
)
from navfw.egomotion.pairing import camera_motion
from navfw.egomotion.refinement import RefinementParams, refine
from navfw.flow.opencv_flow import Dis
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Pose

ROBOT = RobotModel()
WIDE = 0.02
FOCAL = 80.0
UNIT = np.eye(3)
SIDE = st.floats(-70.0, 70.0)
SMALL = st.floats(-3.0, 3.0)


@given(SIDE, SIDE, SMALL, SMALL, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_residual_is_a_distance_and_its_slopes_are_derivatives(
    x: float, y: float, u: float, v: float, right: float, down: float
) -> None:
    translation, row = np.array([right, down, 1.0]), np.zeros(3)
    foe = FOCAL * translation[:2]
    line = np.array([x, y]) - foe
    found = epipolar_residual((x, y), (u, v), FOCAL, translation, 4.0, UNIT, row)
    if np.hypot(*line) < 4.0:
        assert math.isnan(found)
        assert not row.any()
        return
    assert abs(found) == pytest.approx(abs(line[0] * v - line[1] * u) / np.hypot(*line), abs=1e-9)
    for axis in range(3):
        ends = []
        for angle in (-1e-6, 1e-6):
            px, py = turn_point(x - u, y - v, rotation_matrix(angle * UNIT[axis]), FOCAL)
            rest = (x - px, y - py), FOCAL, translation, 4.0, UNIT, np.zeros(3)
            ends.append(epipolar_residual((x, y), *rest))
        assert row[axis] == pytest.approx((ends[1] - ends[0]) / 2e-6, abs=1e-3)


@given(SIDE, SIDE, SMALL, SMALL, st.floats(-0.8, 0.8), st.floats(-0.8, 0.8))
def test_slopes_along_directions_are_derivatives(
    x: float, y: float, u: float, v: float, right: float, down: float
) -> None:
    ahead, slopes, basis = np.array([right, down, 0.6]), np.zeros(2), np.eye(3)[[0, 2]]
    _direction_slopes((x, y), (u, v), FOCAL, ahead, basis, slopes)
    if np.hypot(*(0.6 * np.array([x, y]) - FOCAL * ahead[:2])) < 5.0:
        return
    for axis, slope in zip(basis, slopes, strict=True):
        low, high = (
            epipolar_residual(
                (x, y), (u, v), FOCAL, ahead + off * axis, 4.0, np.zeros((0, 3)), np.zeros(3)
            )
            for off in (-1e-6, 1e-6)
        )
        assert slope == pytest.approx((high - low) / 2e-6, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_fit_is_weighted_least_squares_with_a_prior(count: int) -> None:
    rng = np.random.default_rng(count)
    slopes, truth = rng.normal(size=(60, count)), rng.normal(size=count)
    offsets = -slopes @ truth
    offsets[:5] += 500.0
    offsets[5] = math.nan
    sigma, weight = rng.uniform(0.5, 2.0, 60), rng.uniform(0.2, 1.0, 60)
    weight[6], offsets[6] = 0.0, 1e9
    prior = np.diag(rng.uniform(0.0, 0.1, count))
    found, information = fit_reweighted(offsets, slopes, sigma, weight, prior, 12)
    use = np.isfinite(offsets) & (weight > 0.0)
    off = ((offsets + slopes @ found) / sigma)[use]
    w = weight[use] / sigma[use] ** 2 / (1.0 + (off / 2.385) ** 2)
    matrix = prior + (slopes[use].T * w) @ slopes[use]
    assert information == pytest.approx(matrix, rel=1e-6)
    assert found == pytest.approx(-np.linalg.solve(matrix, (slopes[use].T * w) @ offsets[use]))
    assert found == pytest.approx(truth, abs=0.1), "outliers have next to no weight"


def measured(
    camera: CameraModel,
    yaw: float,
    pitch: float,
    step: Pose,
    noise: float = 0.0,
    yaw_sigma: float = WIDE,
) -> tuple[FlowField, CameraMotion]:
    """Flow with a wrong measured motion (yaw and pitch too small by these), and the true motion."""
    true = camera_motion(RobotModel(camera=camera), Pose(0, 0, 0), step, 0.2)
    rng = np.random.default_rng(0)
    field = exact_field(camera, true, rng.uniform(0.8, 5.0, (12, 16)))
    wrong = turn_about(0, -pitch) @ rotation_matrix(yaw * camera.base_from_camera[2])
    motion = dataclasses.replace(true, rotation=wrong @ true.rotation, yaw_sigma=yaw_sigma)
    vectors = field.vectors + rng.normal(0.0, noise, field.vectors.shape)
    return dataclasses.replace(field, vectors=vectors, motion=motion), true


def test_the_refinement_is_the_fit_of_all_with_the_rest_known() -> None:
    camera = CameraModel(pitch=0.1)
    flow, true = measured(camera, 0.003, -0.002, Pose(0.08, 0.001, 0.02), noise=0.1, yaw_sigma=0.01)
    params = RefinementParams(overlap=1.0, direction_sigma=0.0, pitch_sigma=0.01)
    loop = refine(flow, camera, params)
    assert loop.yaw == pytest.approx(0.003, abs=5e-4)
    points = np.array(flow.points.reshape(-1, 2))
    axes = np.stack([-camera.base_from_camera[2], UNIT[0], camera.base_from_camera[0]])
    known: Array = axes.T @ np.diag([0.01**-2, 0.01**-2, 1e12]) @ axes
    direction = np.array(flow.motion.translation) / flow.motion.baseline
    past, start = points - flow.vectors.reshape(-1, 2), np.array(flow.motion.rotation)
    weights = np.array(flow.sigma.ravel()), np.array(flow.confidence.ravel())
    priors = (start, known), (direction, UNIT * 1e14)
    rotation, found, matrix, _ = fit_motion(
        points, past, *weights, camera.focal, (start, direction), *priors, 12
    )
    assert found == pytest.approx(direction, abs=1e-6)
    assert rotation == pytest.approx(loop.motion.rotation, abs=2e-6)
    assert np.abs(rotation - true.rotation).max() < 0.3 * np.abs(rotation - start).max()
    turns = np.linalg.inv(axes @ matrix[:3, :3] @ axes.T)
    assert math.sqrt(turns[0, 0]) == pytest.approx(loop.yaw_sigma, rel=0.02)
    assert math.sqrt(turns[1, 1]) == pytest.approx(loop.pitch_sigma, rel=0.02)


def test_a_prior_that_turns_all_points_behind_the_camera_leaves_the_motion_unknown() -> None:
    points = np.random.default_rng(0).uniform(-60.0, 60.0, (50, 2))
    motion = PointMotion(points, points - 1.0, np.full(50, 0.1), np.ones(50))
    back = EgomotionPrior(rotation=turn_about(1, math.pi))
    found = estimate_egomotion(motion, FOCAL, back)
    assert found.kind is MotionKind.UNKNOWN
    assert found.heading_sigma == math.inf


# --- refinement ---


@given(
    yaw=st.floats(-0.004, 0.004),
    pitch=st.floats(-0.004, 0.004),
    way=st.sampled_from([0.06, -0.06, 0.1]),
    turn=st.floats(-0.06, 0.06),
    tilt=st.floats(-0.3, 0.3),
)
def test_errors_of_yaw_and_pitch_are_found(
    yaw: float, pitch: float, way: float, turn: float, tilt: float
) -> None:
    camera = CameraModel(pitch=tilt)
    flow, true = measured(camera, yaw, pitch, Pose(way, 0.0, turn))
    sure = RefinementParams(pitch_sigma=WIDE, overlap=1.0, direction_sigma=0.0)
    result = refine(flow, camera, sure)
    assert result.yaw == pytest.approx(yaw, abs=2e-4)
    assert result.pitch == pytest.approx(pitch, abs=2e-4)
    np.testing.assert_allclose(result.motion.rotation, true.rotation, atol=4e-4)
    assert result.motion.yaw_sigma < 0.1 * WIDE
    assert result.consistent.all()


def test_a_moving_object_is_flagged_and_does_not_disturb() -> None:
    flow, _ = measured(ROBOT.camera, 0.003, 0.0, Pose(0.08, 0.0, 0.0))
    vectors = flow.vectors.copy()
    vectors[2:7, 10:14] += [1.5, 2.5]
    result = refine(dataclasses.replace(flow, vectors=vectors), ROBOT.camera)
    assert result.yaw == pytest.approx(0.003, abs=5e-4)
    moving = np.zeros(flow.shape, bool)
    moving[2:7, 10:14] = True
    assert not result.consistent[moving].any()
    assert result.consistent[~moving].all()
    refined = result.apply(flow, ROBOT.camera)
    assert not refined.confidence[moving].any()
    assert refined.derotated


def test_nothing_trusted_means_no_correction() -> None:
    flow, _ = measured(ROBOT.camera, 0.004, 0.002, Pose(0.08, 0.0, 0.0))
    for blind in (
        dataclasses.replace(flow, confidence=np.zeros(flow.shape)),
        dataclasses.replace(flow, motion=dataclasses.replace(flow.motion, translation=np.zeros(3))),
    ):
        result = refine(blind, ROBOT.camera)
        assert (result.yaw, result.pitch) == (0.0, 0.0)
        assert result.motion.yaw_sigma == pytest.approx(WIDE)
        np.testing.assert_array_equal(result.motion.rotation, flow.motion.rotation)


def test_a_trusted_gyro_is_not_overruled() -> None:
    flow, _ = measured(ROBOT.camera, 0.004, 0.0, Pose(0.08, 0.0, 0.0))
    sure = dataclasses.replace(flow.motion, yaw_sigma=1e-7)
    assert abs(refine(dataclasses.replace(flow, motion=sure), ROBOT.camera).yaw) < 1e-6


def test_measured_flow_mends_a_wrong_gyro() -> None:
    camera = ROBOT.camera
    true = camera_motion(ROBOT, Pose(0, 0, 0), Pose(0.06, 0.001, 0.03), 0.2)
    pair, truth = room(camera).pair(true, noise=2.0)
    rotation = rotation_matrix(0.004 * camera.base_from_camera[2]) @ true.rotation
    wrong = dataclasses.replace(true, rotation=rotation, yaw_sigma=0.004)
    flow = Dis(ROBOT).compute(dataclasses.replace(pair, motion=wrong))
    result = refine(flow, camera)
    assert result.yaw == pytest.approx(0.004, abs=0.001)
    assert abs(result.yaw - 0.004) < 3.0 * result.yaw_sigma
    error = flow.vectors - cell_truth(truth, flow.points, camera)
    assert np.median(np.abs(error[flow.confidence > 0.5])) < 0.1


def test_vectors_without_any_error_need_no_division_by_zero() -> None:
    camera = ROBOT.camera
    flow, _ = measured(camera, 0.002, 0.0, Pose(0.06, 0.0, 0.0))
    still = dataclasses.replace(flow.motion, rotation=np.eye(3))
    none = np.zeros(flow.shape)
    exact = dataclasses.replace(flow, motion=still, vectors=0.0 * flow.vectors, sigma=none)
    result = refine(exact, camera)
    assert result.yaw == pytest.approx(0.0, abs=1e-6)
    assert np.isfinite(result.allowed).all()


def test_confidence_falls_with_the_residual_and_is_lost_to_inconsistency() -> None:
    flow, _ = measured(ROBOT.camera, 0.001, 0.0, Pose(0.08, 0.0, 0.0), noise=0.2)
    vectors = flow.vectors + np.random.default_rng(1).choice([0.0, 0.9], flow.vectors.shape)
    flow = dataclasses.replace(flow, vectors=vectors, confidence=np.full(flow.shape, 0.8))
    result = refine(flow, ROBOT.camera)
    refined = result.apply(flow, ROBOT.camera)
    length = np.linalg.norm(derotate(flow, ROBOT.camera).vectors, axis=-1)
    np.testing.assert_allclose(result.allowed, np.hypot(0.1, 0.03 * length))
    off = np.nan_to_num(np.abs(result.residual))
    np.testing.assert_array_equal(result.consistent, off <= 3.0 * result.allowed)
    trust = np.where(result.consistent, np.exp(-((0.5 * off / result.allowed) ** 2)), 0.0)
    np.testing.assert_allclose(refined.confidence, 0.8 * trust)
    odd = ~result.consistent & (off > 3.0 * np.hypot(result.allowed, 0.1))
    np.testing.assert_array_equal(refined.inconsistency, 0.8 * odd)
    assert 10 < np.count_nonzero(odd) < np.count_nonzero(~result.consistent)
