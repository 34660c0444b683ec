"""Rotation, focus of expansion and floor, found in flow computed from geometry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.flow.grid import grid_points
from navfw.flow.ideal import true_vectors
from navfw.perceive.gyro_columns import RATES
from navfw.perceive.pair_motion import (
    assumed_motion,
    estimate_rotation,
    expansion_focus,
    forward_share,
)
from navfw.perceive.scale import ScaleEstimator, floor_ratio
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, FlowField

CAMERA = CameraModel(hfov=math.radians(65.0), mount_height=0.9, mount_forward=0.0)
POINTS = grid_points(CAMERA, 12, 16)
SMALL = st.floats(-0.02, 0.02)


def flow_of(nearness: Array, motion: CameraMotion, sigma: float = 0.05) -> FlowField:
    shape = nearness.shape
    return FlowField(
        time=0.1,
        points=POINTS,
        vectors=true_vectors(POINTS, nearness, motion, CAMERA.focal),
        confidence=np.ones(shape),
        sigma=np.full(shape, sigma),
        motion=assumed_motion(CAMERA, 1.0, 0.1, np.zeros(3), False),
    )


def corridor(half: float = 0.9, end: float = 6.0) -> Array:
    """Nearness of walls on both sides, a wall ahead, and the floor."""
    side = np.abs(POINTS[..., 0]) / CAMERA.focal / half
    floor = POINTS[..., 1] / CAMERA.focal / CAMERA.mount_height
    return np.asarray(np.maximum.reduce([side, floor, np.full(side.shape, 1.0 / end)]))


@settings(max_examples=40)
@given(SMALL, SMALL, SMALL, st.floats(0.03, 0.10))
def test_small_turns_are_found_in_the_flow(
    roll: float, pitch: float, yaw: float, way: float
) -> None:
    rotation_vector = assumed_motion(CAMERA, 0.0, 0.1, np.array([roll, pitch, yaw]), True)
    truth = replace(rotation_vector, translation=np.array([0.0, 0.0, way]))
    found = estimate_rotation(flow_of(corridor(), truth), CAMERA, frozenset()).motion
    # what is left moves no point of the image by as much as a quarter of a pixel
    left = found.rotation @ truth.rotation.T
    assert np.abs(left - np.eye(3)).max() < 0.25 / CAMERA.focal


def test_roll_is_left_alone_where_a_gyro_measured_it() -> None:
    rotation_vector = np.array([0.01, 0.0, 0.0])
    truth = assumed_motion(CAMERA, 0.05, 0.1, rotation_vector, True)
    flow = replace(flow_of(corridor(), truth), motion=truth)
    found = estimate_rotation(flow, CAMERA, frozenset(RATES)).motion
    assert found.rotation == pytest.approx(truth.rotation, abs=2e-4)


def test_gyro_and_simulator_agree_on_signs() -> None:
    # turning left, the world moves to the right in the image; nose down, it moves up
    left = assumed_motion(CAMERA, 0.0, 0.1, np.array([0.0, 0.0, 0.05]), True)
    assert true_vectors(np.zeros((1, 2)), np.zeros(1), left, CAMERA.focal)[0, 0] > 1.0
    down = assumed_motion(CAMERA, 0.0, 0.1, np.array([0.0, 0.05, 0.0]), True)
    assert true_vectors(np.zeros((1, 2)), np.zeros(1), down, CAMERA.focal)[0, 1] < -1.0
    right_side_down = assumed_motion(CAMERA, 0.0, 0.1, np.array([0.05, 0.0, 0.0]), True)
    moved = true_vectors(np.array([[50.0, 0.0]]), np.zeros(1), right_side_down, CAMERA.focal)
    assert moved[0, 1] < -1.0


@given(st.floats(-0.3, 0.3), st.floats(-0.2, 0.2))
def test_focus_of_expansion_is_where_the_camera_goes(right: float, down: float) -> None:
    heading = np.array([right, down, 1.0])
    motion = CameraMotion(np.eye(3), 0.06 * heading / np.linalg.norm(heading), 0.1)
    flow = replace(flow_of(corridor(), motion), derotated=True)
    focus = expansion_focus(flow)
    assert focus is not None
    assert focus.x == pytest.approx(CAMERA.focal * right, abs=0.5)
    assert focus.y == pytest.approx(CAMERA.focal * down, abs=0.5)


def test_no_focus_without_motion_or_with_parallel_flow() -> None:
    flow = flow_of(corridor(), assumed_motion(CAMERA, 0.06, 0.1, np.zeros(3), False))
    assert expansion_focus(replace(flow, vectors=np.zeros_like(flow.vectors))) is None
    assert expansion_focus(replace(flow, vectors=np.ones_like(flow.vectors))) is None
    assert expansion_focus(replace(flow, confidence=np.zeros(flow.shape))) is None


def test_forward_backward_and_neither() -> None:
    ahead = flow_of(corridor(), assumed_motion(CAMERA, 0.06, 0.1, np.zeros(3), False))
    assert forward_share(ahead, CAMERA.focal) == 1.0
    assert forward_share(replace(ahead, vectors=-ahead.vectors), CAMERA.focal) == 0.0
    aside = replace(ahead, vectors=np.tile([3.0, 0.0], (*ahead.shape, 1)))
    assert forward_share(aside, CAMERA.focal) == pytest.approx(0.5, abs=0.1)


@given(st.floats(0.02, 0.12), st.floats(0.5, 1.5))
def test_floor_ties_way_to_height(way: float, height: float) -> None:
    nearness = np.maximum(POINTS[..., 1] / CAMERA.focal / height, 1.0 / 20.0)
    flow = flow_of(nearness, assumed_motion(CAMERA, way, 0.1, np.zeros(3), True), sigma=0.01)
    ratio = floor_ratio(replace(flow, derotated=True), CAMERA)
    assert ratio == pytest.approx(way / height, rel=0.02)


@given(st.floats(0.5, 2.0))
def test_a_wall_is_no_floor(distance: float) -> None:
    nearness = np.full(POINTS.shape[:2], 1.0 / distance)
    flow = flow_of(nearness, assumed_motion(CAMERA, 0.08, 0.1, np.zeros(3), True), sigma=0.01)
    assert floor_ratio(replace(flow, derotated=True), CAMERA) is None


def test_scale_from_what_is_known() -> None:
    assert ScaleEstimator(0.5, 1.2).update(0.9).source == "speed"
    assert ScaleEstimator(0.5, 1.2).update(0.9).height == 1.2
    from_speed = ScaleEstimator(0.5, None)
    assert not from_speed.update(None).floor
    assert from_speed.update(0.4).height == pytest.approx(1.25)
    assert from_speed.update(None).height == pytest.approx(1.25)  # remembered
    from_height = ScaleEstimator(None, 1.2).update(0.5)
    assert from_height.source == "height"
    assert from_height.speed == pytest.approx(0.6)
    nothing = ScaleEstimator(None, None).update(None)
    assert not nothing.metric
    assert not nothing.floor
