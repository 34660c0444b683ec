"""The floor found by its motion, in images of textured planes."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from navfw.flow import grid_points
from navfw.flow.ideal import true_vectors
from navfw.numerics import Array, Image
from navfw.perceive.floor_motion import FloorFinder
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

PITCH = math.radians(12.5)
CAMERA = CameraModel(hfov=math.radians(70.0), mount_height=0.3, mount_forward=0.0, pitch=PITCH)
GRID = (12, 16)
AHEAD = np.array([0.0, -math.sin(PITCH), math.cos(PITCH)])


def texture(seed: int, contrast: float = 40.0) -> Image:
    """An image (height, width) of band-limited noise."""
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (CAMERA.height, CAMERA.width))
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return np.asarray(np.clip(128.0 + contrast * smooth / smooth.std(), 0, 255), dtype=np.uint8)


def moved(past: Image, normal: Array, ratio: float, direction: Array = AHEAD) -> Image:
    """What the camera sees of a plane after a move by ``ratio`` times the plane's distance."""
    width, height, f = CAMERA.width, CAMERA.height, CAMERA.focal
    camera = np.array([[f, 0, 0.5 * (width - 1)], [0, f, 0.5 * (height - 1)], [0, 0, 1.0]])
    plane = camera @ (np.eye(3) + ratio * np.outer(direction, normal)) @ np.linalg.inv(camera)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpPerspective(
        past, plane, (width, height), flags=flags, borderMode=cv2.BORDER_REFLECT
    )
    return np.asarray(warped, dtype=np.uint8)


def floor_normal(pitch: float = PITCH) -> Array:
    return np.array([0.0, math.cos(pitch), math.sin(pitch)])


def after_six_pairs() -> FloorFinder:
    """A finder that has found the floor in six pairs."""
    finder = FloorFinder(CAMERA, GRID, PITCH)
    for seed in range(6):
        past = texture(seed)
        assert finder.find(moved(past, floor_normal(), 0.25), past, MOTION) is not None
        assert not finder.lost
    return finder


MOTION = CameraMotion(np.eye(3), 0.1 * AHEAD, 0.1)


@pytest.mark.parametrize("ratio", [0.08, 0.2, 0.3])
def test_the_way_in_heights_of_the_camera(ratio: float) -> None:
    past = texture(1)
    found = FloorFinder(CAMERA, GRID, PITCH).find(moved(past, floor_normal(), ratio), past, MOTION)
    assert found is not None
    assert found.ratio == pytest.approx(ratio, rel=0.05)
    assert found.proven[-3:].mean() > 0.5
    assert not found.cells[:4].any(), "above the horizon"


@pytest.mark.parametrize("degrees", [12.5, 11.0])
def test_the_pitch_is_learned_from_the_images_and_reviewed(degrees: float) -> None:
    finder, pitch, learned = FloorFinder(CAMERA, GRID, None), math.radians(degrees), set()
    ahead = np.array([0.0, -math.sin(pitch), math.cos(pitch)])
    motion = replace(MOTION, translation=0.1 * ahead)
    for seed in range(20):
        past = texture(seed)
        found = finder.find(moved(past, floor_normal(pitch), 0.25, ahead), past, motion)
        assert (found is not None) == (seed >= 4), "five pairs are needed"
        learned.add(finder.pitch)
    assert finder.pitch == pytest.approx(pitch, abs=math.radians(1.5))
    assert len(learned - {None}) > 1
    assert found is not None
    assert found.ratio == pytest.approx(0.25, rel=0.05)
    assert found.proven.sum() > 80


def test_a_wall_is_no_floor() -> None:
    past = texture(2)
    wall = moved(past, np.array([0.0, -math.sin(PITCH), math.cos(PITCH)]), 0.15)
    assert FloorFinder(CAMERA, GRID, PITCH).find(wall, past, MOTION) is None


@pytest.mark.parametrize("wall_rows", [85, 100, 112])
def test_a_floor_in_front_of_a_wall_is_found_by_a_few_rows(wall_rows: int) -> None:
    past = texture(2)
    now = moved(past, AHEAD, 0.1)
    now[wall_rows:] = moved(past, floor_normal(), 0.25)[wall_rows:]
    motion = FloorFinder(CAMERA, GRID, PITCH).find(now, past, MOTION)
    assert motion is not None
    assert motion.ratio == pytest.approx(0.25, rel=0.05)


@pytest.mark.parametrize(("ratio", "taken"), [(0.25, True), (0.1, False)])
def test_a_floor_without_proof_moves_about_as_fast_as_before(ratio: float, taken: bool) -> None:
    finder = after_six_pairs()
    faint = np.full((CAMERA.height, CAMERA.width), 128, np.uint8)
    faint[80:, 60:70] = texture(30, contrast=10.0)[80:, 60:70]
    motion = finder.find(moved(faint, floor_normal(), ratio), faint, MOTION)
    assert (motion is not None) is taken
    assert finder.lost is not taken


def test_nothing_is_found_without_texture_or_motion() -> None:
    grey = np.full((CAMERA.height, CAMERA.width), 128, np.uint8)
    assert FloorFinder(CAMERA, GRID, PITCH).find(grey, grey, MOTION) is None
    still = texture(3)
    assert FloorFinder(CAMERA, GRID, PITCH).find(still, still, MOTION) is None


def test_a_floor_with_little_texture_is_reached_from_one_that_has_some() -> None:
    past = texture(4)
    past[70:95, 40:120] = 128
    now = moved(past, floor_normal(), 0.2)
    found = FloorFinder(CAMERA, GRID, PITCH).find(now, past, MOTION)
    assert found is not None
    bare = np.s_[8:9, 6:10]
    assert not found.proven[bare].any()
    assert found.cells[bare].all()
    assert found.ratio == pytest.approx(0.20265539, rel=1e-5)
    assert (found.proven.sum(), found.cells.sum()) == (91, 107)


@pytest.mark.parametrize(("contrast", "nearness"), [(12.0, 0.0), (8.0, 0.1)])
def test_mirror_images_in_a_glossy_floor_do_no_harm(contrast: float, nearness: float) -> None:
    """Lamps deep below a floor of faint texture, in a quarter of its cells."""
    ratio = 0.25
    floor, lamps = texture(6, contrast), texture(7, contrast=60.0)
    glossy = np.zeros((CAMERA.height, CAMERA.width), dtype=np.bool_)
    glossy[70:, 60:100] = True
    past = np.where(glossy, lamps, floor)
    mirrored = moved(lamps, floor_normal(), nearness * ratio)
    now = np.where(glossy, mirrored, moved(floor, floor_normal(), ratio))
    found = FloorFinder(CAMERA, GRID, PITCH).find(now, past, MOTION)
    assert found is not None
    assert found.ratio == pytest.approx(ratio, rel=0.05)
    assert found.proven[8:, :5].mean() > 0.5
    assert not found.proven[8:, 7:9].any(), "a mirror image does not move like the floor"


def test_the_floor_is_missed_when_it_disappears() -> None:
    finder = after_six_pairs()
    assert finder.find(texture(20), texture(21), MOTION) is None
    assert finder.lost


def test_vectors_of_the_floor_obey_its_geometry() -> None:
    past = texture(5)
    found = FloorFinder(CAMERA, GRID, PITCH).find(moved(past, floor_normal(), 0.2), past, MOTION)
    assert found is not None
    points = grid_points(CAMERA, *GRID)
    shape = points.shape[:2]
    empty = FlowField(0.1, points, np.zeros_like(points), np.zeros(shape), np.ones(shape), MOTION)
    flow = found.apply(empty, CAMERA)
    fall = np.maximum(CAMERA.fall_per_depth(points), 0.0)
    exact = true_vectors(points, found.ratio * fall / MOTION.baseline, MOTION, CAMERA.focal)
    assert flow.vectors[found.cells] == pytest.approx(exact[found.cells], abs=1e-6)
    assert (flow.confidence[~found.cells] == 0.0).all()


def test_without_the_floor_nothing_is_said_where_it_may_be() -> None:
    points = grid_points(CAMERA, *GRID)
    shape = points.shape[:2]
    seen = FlowField(0.1, points, np.zeros_like(points), np.ones(shape), np.ones(shape), MOTION)
    elevation = np.degrees(np.arctan(-CAMERA.fall_per_depth(points)))
    left = FloorFinder(CAMERA, GRID, PITCH).without_floor(seen).confidence > 0.0
    assert not left[elevation < 5.0].any(), "the pitch may be wrong by 5 degrees"
    assert left[elevation > 10.0].all()
