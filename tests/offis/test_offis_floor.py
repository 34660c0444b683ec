from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from offis_scenes import Scene, box, grid_points, ideal_flow, motion, wall_ahead

from navfw.numerics import Array
from navfw.offis import FloorModel, Nearness, floor_nearness, triangulate
from navfw.robot import CameraModel
from navfw.signals import Label

CAMERA = CameraModel()
TOP = 0.45


def labels_of(
    scene: Scene,
    camera: CameraModel = CAMERA,
    sigma: float = 0.05,
    noise: np.random.Generator | None = None,
) -> tuple[Array, npt.NDArray[np.int8], Array, Nearness]:
    flow, depth = ideal_flow(scene, camera, motion(camera=camera), sigma=sigma, noise=noise)
    seen = triangulate(flow, camera.focal)
    height, label = FloorModel(camera, TOP).classify(flow.points, seen)
    rays = np.concatenate([flow.points / camera.focal, np.ones((*flow.shape, 1))], -1)
    true_height = camera.mount_height + depth * (rays @ camera.base_from_camera.T)[..., 2]
    return height, label, true_height, seen


@given(pitch=st.floats(-0.2, 0.5), distance=st.floats(0.6, 4.0), angle=st.floats(-0.6, 0.6))
@settings(max_examples=30, deadline=None)
def test_height_is_exact_on_ideal_flow(pitch: float, distance: float, angle: float) -> None:
    camera = CameraModel(pitch=pitch)
    height, _, truth, seen = labels_of(Scene((wall_ahead(distance, angle),)), camera)
    known = (seen.confidence > 0.0) & np.isfinite(truth)
    np.testing.assert_allclose(height[known], truth[known], atol=1e-6)


@given(pitch=st.floats(-0.2, 0.5), sigma=st.floats(0.01, 0.3), seed=st.integers(0, 9999))
@settings(max_examples=30, deadline=None)
def test_few_labels_differ_from_the_truth(pitch: float, sigma: float, seed: int) -> None:
    camera = CameraModel(pitch=pitch)
    scene = Scene((*box(1.0, 0.4, 0.4, 0.8), wall_ahead(2.5)), ceiling=2.4)
    rng = np.random.default_rng(seed)
    _, label, truth, _ = labels_of(scene, camera, sigma=sigma, noise=rng)
    # at two and three sigma, on about a hundred tested cells
    assert ((label == Label.OBSTACLE) & (np.abs(truth) < 0.01)).sum() <= 10
    assert ((label == Label.DROP) & (truth > -0.01)).sum() <= 2
    assert ((label == Label.ABOVE) & (truth < TOP)).sum() <= 10
    assert ((label == Label.FLOOR) & (truth > 0.25)).sum() <= 3


def test_labels_of_a_room() -> None:
    scene = Scene((*box(1.0, 0.4, 0.4, 0.8), wall_ahead(2.5)), ceiling=2.4)
    _, label, truth, seen = labels_of(scene)
    known = seen.confidence > 0.3
    assert (label[known & (np.abs(truth) < 0.01)] == Label.FLOOR).mean() > 0.9
    assert (label[known & (truth > 0.08) & (truth < TOP - 0.03)] == Label.OBSTACLE).mean() > 0.9
    assert (label[known & (truth > TOP + 0.05)] == Label.ABOVE).mean() > 0.9


def test_a_hole_in_the_floor_is_a_drop() -> None:
    scene = Scene((wall_ahead(3.0),), holes=((0.5, 1.5, -2.0, 2.0),))
    _, label, truth, _ = labels_of(scene)
    assert (label[truth < -0.1] == Label.DROP).mean() > 0.8
    assert not (label[truth > -0.05] == Label.DROP).any()


def test_without_confidence_everything_is_unknown() -> None:
    points = grid_points(CAMERA)
    nothing = Nearness(np.ones((12, 16)), np.full((12, 16), 0.01), np.zeros((12, 16)))
    _, label = FloorModel(CAMERA, TOP).classify(points, nothing)
    assert (label == Label.UNKNOWN).all()


def test_all_rays_upward_of_a_camera_above_the_top_pass_over() -> None:
    points = grid_points(CAMERA)
    seen = Nearness(np.ones((12, 16)), np.full((12, 16), 0.01), np.ones((12, 16)))
    _, label = FloorModel(CAMERA, top=0.2).classify(points, seen)
    assert (label[:6] == Label.ABOVE).all()


def test_floor_nearness_is_what_an_empty_floor_shows() -> None:
    camera = CameraModel(pitch=0.2)
    points = grid_points(camera)
    depth = Scene().depth(points, camera)
    np.testing.assert_allclose(floor_nearness(points, camera), 1.0 / depth, atol=1e-12)
    assert floor_nearness(points, camera).max() == pytest.approx(1.0 / depth.min())
