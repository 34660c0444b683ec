"""The robust fit that the estimates of the camera's motion share, and the loop's as its case."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from flow_scene import exact_field, turn_about
from hypothesis import given
from hypothesis import strategies as st

from navfw.camera_geometry import rotation_matrix, turn_point
from navfw.egomotion import (
    EgomotionPrior,
    MotionKind,
    PointMotion,
    RefinementParams,
    camera_motion,
    epipolar_residual,
    estimate_egomotion,
    fit_reweighted,
    refine,
)
from navfw.egomotion.epipolar_kernels import fit_motion
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Pose

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
            vector = x - px, y - py
            ends.append(
                epipolar_residual((x, y), vector, FOCAL, translation, 4.0, UNIT, np.zeros(3))
            )
        assert row[axis] == pytest.approx((ends[1] - ends[0]) / 2e-6, abs=1e-3)


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


def drive(yaw: float, pitch: float) -> tuple[CameraModel, FlowField, CameraMotion]:
    """Flow with noise, the measured motion in it wrong by these angles [rad]; the true motion."""
    camera = CameraModel(pitch=0.1)
    true = camera_motion(RobotModel(camera=camera), Pose(0, 0, 0), Pose(0.08, 0.001, 0.02), 0.2)
    rng = np.random.default_rng(3)
    field = exact_field(camera, true, rng.uniform(0.8, 5.0, (12, 16)))
    wrong = turn_about(0, -pitch) @ rotation_matrix(yaw * camera.base_from_camera[2])
    return (
        camera,
        dataclasses.replace(
            field,
            vectors=field.vectors + rng.normal(0.0, 0.1, field.vectors.shape),
            sigma=np.full(field.shape, 0.1),
            motion=dataclasses.replace(true, rotation=wrong @ true.rotation, yaw_sigma=0.01),
        ),
        true,
    )


def test_the_refinement_is_the_fit_of_all_with_the_rest_known() -> None:
    camera, flow, true = drive(0.003, -0.002)
    params = RefinementParams(overlap=1.0, direction_sigma=0.0, pitch_sigma=0.01)
    loop = refine(flow, camera, params)
    assert loop.yaw == pytest.approx(0.003, abs=5e-4)
    points = np.array(flow.points.reshape(-1, 2))
    axes = np.stack([-camera.base_from_camera[2], UNIT[0], camera.base_from_camera[0]])
    known: Array = axes.T @ np.diag([0.01**-2, 0.01**-2, 1e12]) @ axes
    direction = np.array(flow.motion.translation) / flow.motion.baseline
    rotation, found, matrix, _ = fit_motion(
        points,
        points - flow.vectors.reshape(-1, 2),
        np.array(flow.sigma.ravel()),
        np.array(flow.confidence.ravel()),
        camera.focal,
        (np.array(flow.motion.rotation), direction),
        (np.array(flow.motion.rotation), known),
        (direction, UNIT * 1e14),
        12,
    )
    assert found == pytest.approx(direction, abs=1e-6)
    assert rotation == pytest.approx(loop.motion.rotation, abs=2e-6)
    assert (
        np.abs(rotation - true.rotation).max() < 0.3 * np.abs(rotation - flow.motion.rotation).max()
    )
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
