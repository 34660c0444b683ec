from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flow_scene import cell_truth, exact_field, room, turn_about
from hypothesis import given
from hypothesis import strategies as st

from navfw.egomotion import RefinementParams, camera_motion, refine
from navfw.flow import Dis
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Pose

ROBOT = RobotModel()
WIDE = 0.02


def measured(
    camera: CameraModel, yaw: float, pitch: float, step: Pose, seed: int = 0
) -> tuple[FlowField, CameraMotion]:
    """Exact flow with a wrong measured motion (yaw and pitch too small by these), and the true."""
    true = camera_motion(RobotModel(camera=camera), Pose(0, 0, 0), step, 0.2)
    depth = np.random.default_rng(seed).uniform(0.8, 5.0, (12, 16))
    field = exact_field(camera, true, depth)
    up = camera.base_from_camera[2]
    wrong = turn_about(0, -pitch) @ _about(up, yaw) @ true.rotation
    return dataclasses.replace(
        field, motion=dataclasses.replace(true, rotation=wrong, yaw_sigma=WIDE)
    ), true


def _about(axis: Array, angle: float) -> Array:
    x, y, z = axis * angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + cross + 0.5 * cross @ cross)


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


def test_moved_and_missing_vectors_give_these_numbers() -> None:
    camera = CameraModel(pitch=0.2)
    flow, _ = measured(camera, 0.003, -0.001, Pose(0.08, 0.003, 0.02))
    vectors = flow.vectors.copy()
    vectors[3:5, 3:6] += [0.3, 0.4]
    vectors[8, 8:10] += [2.0, 3.0]
    vectors[0, 0] = np.nan
    confidence = np.linspace(0.2, 1.0, vectors[..., 0].size).reshape(flow.shape)
    result = refine(dataclasses.replace(flow, vectors=vectors, confidence=confidence), camera)
    angles = (result.yaw, result.pitch, result.yaw_sigma, result.pitch_sigma)
    assert angles == pytest.approx((3.0070769e-3, -1.0417744e-3, 4.1945241e-4, 3.7423506e-4))
    assert np.nansum(result.residual) == pytest.approx(-4.0373920)
    assert np.nansum(result.allowed) == pytest.approx(22.714657)
    assert (~result.consistent).sum() == 6
    field = result.apply(dataclasses.replace(flow, confidence=confidence), camera)
    assert field.confidence.sum() == pytest.approx(111.077075)
    assert field.inconsistency is not None
    assert field.inconsistency.sum() == pytest.approx(0.76963351)


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
    wrong = dataclasses.replace(
        true, rotation=_about(camera.base_from_camera[2], 0.004) @ true.rotation, yaw_sigma=0.004
    )
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
