"""Cells of the image: nearness from flow, height above the floor, labels; regions of cells."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from offis_scenes import Scene, box, ideal_flow, motion, wall_ahead

from navfw.flow import grid_points
from navfw.numerics import Array
from navfw.offis.grid_geometry import FloorModel, floor_nearness
from navfw.offis.nearness import Nearness, triangulate
from navfw.offis.percept_kernels import SIGMA_LIMIT
from navfw.offis.pyramid import Channels, Pyramid, position
from navfw.robot import CameraModel
from navfw.signals import Label

CAMERA = CameraModel()
FOCAL = CAMERA.focal
TOP = 0.45
ONES = np.ones((12, 16))


@given(
    distance=st.floats(0.5, 6.0),
    angle=st.floats(-0.8, 0.8),
    forward=st.floats(0.02, 0.10) | st.floats(-0.10, -0.02),
    left=st.floats(-0.03, 0.03),
    pitch=st.floats(-0.3, 0.3),
)
@settings(max_examples=40, deadline=None)
def test_nearness_is_exact_on_ideal_flow(
    distance: float, angle: float, forward: float, left: float, pitch: float
) -> None:
    camera = CameraModel(pitch=pitch)
    scene = Scene((wall_ahead(distance, angle),), ceiling=2.4)
    moved = motion(forward, left, camera)
    flow, depth = ideal_flow(scene, camera, moved)
    seen = triangulate(flow, camera.focal)
    known = seen.confidence > 0.0
    e = flow.points * moved.translation[2] - camera.focal * moved.translation[:2]
    # only cells at the focus of expansion may be unknown
    assert known[np.hypot(e[..., 0], e[..., 1]) > 0.05].all()
    np.testing.assert_allclose(seen.nearness[known], 1.0 / depth[known], rtol=1e-9)


def test_sigma_is_the_standard_deviation_of_the_nearness() -> None:
    rng = np.random.default_rng(7)
    scene = Scene((wall_ahead(1.5, 0.3),), ceiling=2.4)
    errors = []
    for _ in range(60):
        flow, depth = ideal_flow(scene, sigma=0.1, noise=rng)
        seen = triangulate(flow, FOCAL)
        far_from_foe = np.hypot(*np.moveaxis(flow.points, -1, 0)) > 15.0
        good = far_from_foe & (seen.confidence > 0.0)
        errors.append(((seen.nearness - 1.0 / depth) / seen.sigma)[good])
    z = np.concatenate(errors)
    assert abs(z.mean()) < 0.1
    assert 0.85 < z.std() < 1.1


def test_yaw_and_translation_errors_are_covered_by_sigma() -> None:
    rng = np.random.default_rng(3)
    yaw_sigma, translation_sigma = 0.004, 0.004
    true = motion()
    scores = []
    for _ in range(80):
        flow, depth = ideal_flow(Scene((wall_ahead(1.2),), ceiling=2.4), moved=true, sigma=0.01)
        x, y = flow.points[..., 0], flow.points[..., 1]
        yaw = rng.normal(0.0, yaw_sigma)
        drift = yaw * np.stack([FOCAL + x * x / FOCAL, x * y / FOCAL], -1)
        factor = 1.0 + rng.normal(0.0, translation_sigma) / true.baseline
        measured = replace(
            true,
            translation=true.translation * factor,
            yaw_sigma=yaw_sigma,
            translation_sigma=translation_sigma,
        )
        seen = triangulate(replace(flow, vectors=flow.vectors + drift, motion=measured), FOCAL)
        good = (np.abs(x) > 25.0) & (seen.confidence > 0.0)
        scores.append(((seen.nearness - 1.0 / depth) / seen.sigma)[good])
    assert 0.8 < np.concatenate(scores).std() < 1.2


def test_cells_at_the_focus_of_expansion_are_kept_but_doubted() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(1.0),)), sigma=0.2)
    seen = triangulate(flow, FOCAL)
    middle = np.s_[5:7, 7:9]
    assert (seen.confidence[middle] > 0.0).all()
    assert (seen.confidence[middle] < 0.5).all()
    assert (seen.sigma[middle] > 0.4).all()
    assert seen.sigma[middle].min() > 4.0 * seen.sigma[0, 0]
    assert seen.confidence[0, 0] > 0.8


def test_inconsistent_vectors_are_rejected() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(1.0),)))
    vectors = flow.vectors.copy()
    vectors[2, 3] *= -1.0  # towards the focus of expansion
    vectors[2, 12] = vectors[2, 12][::-1] * [1.0, -1.0]  # across
    vectors[9, 3] = np.nan
    seen = triangulate(replace(flow, vectors=vectors), FOCAL)
    for cell in ((2, 3), (2, 12), (9, 3)):
        assert seen.confidence[cell] == 0.0
        assert seen.sigma[cell] == SIGMA_LIMIT
    assert np.isfinite(seen.nearness).all()
    assert (seen.confidence > 0.0).sum() == flow.confidence.size - 3


def test_without_translation_nothing_is_known_and_rotation_is_refused() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(1.0),)), moved=motion(0.0))
    assert (triangulate(flow, FOCAL).confidence == 0.0).all()
    with pytest.raises(ValueError, match="derotated"):
        triangulate(replace(flow, derotated=False), FOCAL)


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


def test_without_confidence_all_is_unknown_else_rays_upward_pass_over_a_low_top() -> None:
    for confidence, top, part, expected in (
        (0.0 * ONES, TOP, np.s_[:], Label.UNKNOWN),
        (ONES, 0.2, np.s_[:6], Label.ABOVE),
    ):
        seen = Nearness(ONES, 0.01 * ONES, confidence)
        _, label = FloorModel(CAMERA, top).classify(grid_points(CAMERA, 12, 16), seen)
        assert (label[part] == expected).all()


def test_floor_nearness_is_what_an_empty_floor_shows() -> None:
    camera = CameraModel(pitch=0.2)
    points = grid_points(camera, 12, 16)
    depth = Scene().depth(points, camera)
    np.testing.assert_allclose(floor_nearness(points, camera), 1.0 / depth, atol=1e-12)
    assert floor_nearness(points, camera).max() == pytest.approx(1.0 / depth.min())


def regions(pyramid: Pyramid) -> dict[str, list[int]]:
    return dict(zip(pyramid.names, pyramid.rectangles.tolist(), strict=True))


def sizes(pyramid: Pyramid, prefix: str) -> set[tuple[int, int]]:
    found = [r for name, r in regions(pyramid).items() if name.startswith(prefix)]
    return {(bottom - top, right - left) for top, bottom, left, right in found}


def test_the_papers_grids_split_as_in_the_paper() -> None:
    even, odd = Pyramid((12, 16), 2), Pyramid((10, 15), 2)
    assert sizes(even, "P") == {(6, 8)}
    assert sizes(even, "sP") == {(3, 4)}
    assert sizes(odd, "P") == {(5, 8)}
    assert sizes(odd, "sP") == {(3, 4)}
    region = regions(odd)  # odd sides share the middle row and column
    assert region["P2"] == [0, 5, 0, 8]
    assert region["P1"] == [0, 5, 7, 15]
    assert region["sP22"] == [0, 3, 0, 4]
    assert region["sP24"] == [2, 5, 4, 8]


def test_names_and_positions_follow_the_quadrants() -> None:
    region = regions(Pyramid((12, 16), 3))
    assert region["P1"] == [0, 6, 8, 16]
    assert region["P3"] == [6, 12, 0, 8]
    assert region["sP41"] == [6, 9, 12, 16]
    assert region["sP413"][2:] == [12, 14]
    assert position("P1") == "upper right"
    assert position("sP23") == "upper left"
    assert position("sP341") == "lower left"


def test_children_are_named_after_their_parent_if_the_grid_has_room() -> None:
    pyramid = Pyramid((12, 16), 3)
    for index, name in enumerate(pyramid.names[:20]):
        first = pyramid.first_child(index)
        assert first is not None
        children = [child[-2:] for child in pyramid.names[first : first + 4]]
        assert children == [name[-1] + digit for digit in "1234"]
    assert pyramid.first_child(20) is None
    with pytest.raises(ValueError, match="3 x 16"):
        Pyramid((3, 16), 2)


@given(st.integers(0, 2**31), st.sampled_from([(12, 16), (10, 15), (5, 7)]))
@settings(max_examples=25, deadline=None)
def test_statistics_are_those_of_numpy(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(1.0, 0.3, (3, *shape))
    weights = rng.uniform(0.1, 1.0, (3, *shape)) * (rng.random((3, *shape)) < 0.8)
    known = (rng.random(shape) < 0.7).astype(float)
    pyramid = Pyramid(shape, 2)
    got = pyramid.statistics(Channels(values, weights, known))
    for i, (top, bottom, left, right) in enumerate(pyramid.rectangles):
        part = np.s_[top:bottom, left:right]
        assert got.known[i] == pytest.approx(known[part].mean())
        assert got.objects[i] == pytest.approx((weights[0][part] > 0).mean())
        for channel, (mean, variance) in enumerate(
            [(got.mean, got.variance), (got.mu_u, got.var_u), (got.mu_v, got.var_v)]
        ):
            x, w = values[channel][part], weights[channel][part]
            if w.sum() == 0.0:
                continue
            expected = np.average(x, weights=w)
            assert mean[i] == pytest.approx(expected)
            assert variance[i] == pytest.approx(np.average((x - expected) ** 2, weights=w))


def test_nearest_is_the_mean_of_the_nearest_eighth() -> None:
    values = np.full((3, 12, 16), 0.5)
    values[0, 0, :6] = [3.0, 2.0, 2.0, 2.0, 2.0, 1.0]  # six of the 48 cells of P2
    got = Pyramid((12, 16), 1).statistics(Channels(values, np.ones_like(values), ONES))
    assert got.nearest[1] == pytest.approx(12.0 / 6.0)
    assert got.nearest[0] == pytest.approx(0.5)


def test_a_lone_cell_weighs_less_than_a_patch() -> None:
    values, weights = np.zeros((2, 3, 12, 16))
    values[0, 1, 1] = 2.0
    weights[:, 1, 1] = 1.0
    got = Pyramid((12, 16), 1).statistics(Channels(values, weights, ONES))
    assert 0.0 < got.nearest[1] < 1.0
