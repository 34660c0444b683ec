"""Stixels: one distance explains a whole column of cells above the foot point."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.egomotion import camera_motion
from navfw.movers import find_stixels
from navfw.robot import CameraModel, RobotModel
from navfw.signals import FlowField, Pose, Stixels

X, Y = np.meshgrid((np.arange(40) - 19.5) * 4.0, (np.arange(18) - 2.5) * 4.0)
POINTS = np.stack([X, Y], axis=-1)


def scene(
    boards: list[tuple[float, float, float]],
    way: float = 0.08,
    noise: float = 0.0,
    pitch: float = 0.0,
    seed: int = 0,
) -> tuple[FlowField, CameraModel]:
    """Floor and upright ``boards`` at (ahead of the camera, left, width) [m], after ``way`` [m]."""
    robot = RobotModel(camera=CameraModel(pitch=pitch))
    camera = robot.camera
    motion = camera_motion(robot, Pose(0, 0, 0), Pose(way, 0, 0), 0.2)
    nearness = np.maximum(camera.fall_per_depth(POINTS), 0.0) / camera.mount_height
    ahead = math.cos(pitch) - Y / camera.focal * math.sin(pitch)
    for distance, left, width in boards:
        depth = distance / ahead
        hit = (np.abs(X / camera.focal * depth + left) < 0.5 * width) & (nearness < 1.0 / depth)
        nearness = np.where(hit, 1.0 / depth, nearness)
    lever = POINTS * motion.translation[2] - camera.focal * motion.translation[:2]
    vectors = lever * (nearness / (1.0 + motion.translation[2] * nearness))[..., None]
    vectors += noise * np.random.default_rng(seed).standard_normal(vectors.shape)
    known = np.ones(X.shape)
    flow = FlowField(1.0, POINTS, vectors, known, 0.2 * known, motion, derotated=True)
    return flow, camera


def stixels_of(flow: FlowField, camera: CameraModel) -> Stixels:
    stixels = find_stixels(flow, camera)
    assert stixels is not None
    return stixels


@settings(max_examples=60, deadline=None)
@given(
    distance=st.floats(0.5, 0.9),
    aside=st.floats(-0.6, 0.6),
    way=st.sampled_from([0.08, 0.12, -0.08]),
    pitch=st.sampled_from([-0.05, 0.0, 0.1]),
)
def test_a_pole_is_located(distance: float, aside: float, way: float, pitch: float) -> None:
    stixels = stixels_of(*scene([(distance, aside * distance, 0.15)], way, pitch=pitch))
    sure = stixels.confidence > 0.5
    assert sure.any()
    assert stixels.nearness[sure] == pytest.approx(1.0 / distance, rel=0.06)
    # slopes to the left are positive, and no other columns than the pole's have confidence
    half = 0.5 * 0.15 / distance + 4.0 / CameraModel().focal
    assert (np.abs(stixels.slope[sure] - aside) < half).all()
    assert (stixels.sigma[sure] > 0.0).all()


def test_a_pole_straight_ahead_is_found_where_single_vectors_are_short() -> None:
    found = 0
    for seed in range(20):
        flow, camera = scene([(0.9, 0.0, 0.15)], noise=0.15, seed=seed)
        stixels = stixels_of(flow, camera)
        middle = np.abs(stixels.slope) < 0.06
        found += bool((stixels.confidence[middle] > 0.3).any())
        wrong = (stixels.confidence > 0.3) & (stixels.nearness > 1.4 / 0.9)
        assert np.count_nonzero(wrong) <= 1
    assert found >= 16


@pytest.mark.parametrize("seed", range(5))
def test_there_are_no_near_stixels_on_empty_floor(seed: int) -> None:
    stixels = stixels_of(*scene([], noise=0.15, seed=seed))
    assert not ((stixels.confidence > 0.0) & (stixels.nearness > 0.6)).any()


def test_the_nearer_of_two_hides_the_other() -> None:
    stixels = stixels_of(*scene([(1.6, 0.0, 0.8), (0.8, 0.0, 0.15)]))
    sure = (stixels.confidence > 0.5) & (np.abs(stixels.slope) < 0.05)
    assert stixels.nearness[sure] == pytest.approx(1.0 / 0.8, rel=0.06)


@pytest.mark.parametrize("translation", [(0.0, 0.0, 0.1), (0.05, 0.02, 0.08), (-0.1, 0.0, 0.01)])
def test_an_error_of_the_yaw_counts_as_the_flow_that_it_makes(
    translation: tuple[float, float, float],
) -> None:
    flow, camera = scene([(0.7, 0.2, 0.4)])
    way = np.array(translation)
    lever = POINTS * way[2] - camera.focal * way[:2]
    away = lever / np.linalg.norm(lever, axis=-1, keepdims=True)
    vectors = lever * (1.5 / (1.0 + way[2] * 1.5))  # a wall at 1/1.5 m
    # the image of a point after a small turn of the camera about its vertical axis
    turn = 1e-5
    ahead = camera.focal * math.cos(turn) - X * math.sin(turn)
    turned = np.stack([camera.focal * math.sin(turn) + X * math.cos(turn), Y], axis=-1)
    rate = (turned * (camera.focal / ahead)[..., None] - POINTS) / turn
    confidences = []
    for yaw_sigma in (0.0, 0.005, 0.01, 0.02, 0.03, 0.05):
        motion = dataclasses.replace(flow.motion, translation=way, yaw_sigma=0.0)
        exact = dataclasses.replace(
            flow, vectors=vectors, motion=dataclasses.replace(motion, yaw_sigma=yaw_sigma)
        )
        wide = np.hypot(flow.sigma, yaw_sigma * np.sum(rate * away, axis=-1))
        same = dataclasses.replace(flow, vectors=vectors, motion=motion, sigma=wide)
        found, expected = stixels_of(exact, camera), stixels_of(same, camera)
        assert np.array_equal(found.nearness, expected.nearness)
        assert found.confidence == pytest.approx(expected.confidence, abs=2e-4)
        confidences.append(found.confidence)
    partly = (np.array(confidences) > 0.05) & (np.array(confidences) < 0.95)
    assert np.count_nonzero(partly) > 10, "the comparison is not of zeros and ones alone"


def test_there_are_no_stixels_without_baseline_with_steep_cameras_or_few_cells() -> None:
    assert find_stixels(*scene([(0.8, 0.0, 0.15)], way=0.01)) is None
    assert find_stixels(*scene([(0.8, 0.0, 0.15)], pitch=0.4)) is None
    flow, camera = scene([(0.8, 0.0, 0.15)])
    few = np.where(np.arange(18)[:, None] < 14, 0.0, flow.confidence)
    stixels = stixels_of(dataclasses.replace(flow, confidence=few), camera)
    assert not stixels.confidence.any()


def test_flow_with_rotation_is_refused() -> None:
    flow, camera = scene([])
    with pytest.raises(ValueError, match="derotated"):
        find_stixels(dataclasses.replace(flow, derotated=False), camera)
