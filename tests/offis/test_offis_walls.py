"""Walls, their slopes and gaps, obstacles too near to be matched at the image's borders, images
without information, and all sixteen cells of the paper's Table 1 (METHOD R11).
"""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from flow_scene import blurred_noise, pair_of, turn_about
from hypothesis import given, settings
from hypothesis import strategies as st
from offis_scenes import Scene, Wall, corner, corridor, door, ideal_flow, wall_ahead

from navfw.egomotion.refinement import refine
from navfw.flow import grid_points
from navfw.flow.block_matching import BlockMatching
from navfw.numerics import Array, Image
from navfw.offis import Offis
from navfw.offis.elementary_situations import TABLE
from navfw.offis.fuzzy_systems import infer, load_system
from navfw.offis.grid_geometry import GridGeometry, find_blind_borders
from navfw.offis.nearness import Nearness, triangulate
from navfw.offis.walls import Walls, find_walls, slopes_of_walls
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Label, Percept, Twist

ROBOT = RobotModel()
CAMERA = ROBOT.camera
GEOMETRY = GridGeometry.of(grid_points(CAMERA, 12, 16), 2, ROBOT, 2.0, 2.2)
ONES = np.ones((12, 16))


def walls_of(scene: Scene, pitch: float = 0.0) -> Walls:
    """Walls fitted to exact nearness above the horizon."""
    robot = RobotModel(camera=CameraModel(pitch=pitch))
    geometry = GridGeometry.of(grid_points(robot.camera, 12, 16), 2, robot, 2.0, 2.2)
    nearness = 1.0 / scene.depth(geometry.points, robot.camera)
    seen = Nearness(nearness, 0.01 * ONES, ONES)
    return find_walls(geometry, seen, geometry.upward.ravel().astype(float))


def walls_of_values(nearness: Array, weight: Array | None = None, sigma: float = 0.01) -> Walls:
    seen = Nearness(nearness.reshape(12, 16), sigma * ONES, ONES)
    return find_walls(GEOMETRY, seen, np.ones(192) if weight is None else weight)


@given(angle=st.floats(-0.7, 0.7), distance=st.floats(0.5, 4.0), pitch=st.floats(-0.25, 0.25))
@settings(max_examples=40, deadline=None)
def test_the_fit_finds_angle_and_distance(angle: float, distance: float, pitch: float) -> None:
    endless = replace(wall_ahead(distance, angle, half=1e3), low=-99.0, high=99.0)
    walls = walls_of(Scene((endless,), floor=None), pitch)
    np.testing.assert_allclose(walls.incline, [angle, -angle], atol=1e-3)
    np.testing.assert_allclose(walls.front, 1.0 / distance, rtol=1e-3)
    assert walls.shared == pytest.approx(1.0)
    assert (walls.support == 1.0).all()


@pytest.mark.parametrize(
    ("degrees", "left", "right"),
    [
        (0.0, "[1 1]", "[1 1]"),
        (35.0, "[2 1]", "[2 1]"),
        (75.0, "[3 1]", "[3 1]"),
        (-35.0, "[1 2]", "[1 2]"),
        (-75.0, "[1 3]", "[1 3]"),
    ],
)
def test_all_five_codes(degrees: float, left: str, right: str) -> None:
    # one endless plane shows both halves the same code: the larger digit is the nearer side
    angle = math.radians(degrees)
    nearness = -math.sin(angle) * GEOMETRY.lateral + math.cos(angle) * GEOMETRY.ahead
    walls = walls_of_values(nearness)
    assert slopes_of_walls(walls).codes == (left, right)


@pytest.mark.parametrize("count", [3, 12, 24])
def test_things_in_front_of_a_wall_do_not_turn_its_plane(count: int) -> None:
    rng = np.random.default_rng(count)
    nearness = np.full(192, 0.5)
    nearness[rng.choice(192, count, replace=False)] = rng.uniform(1.0, 5.0, count)
    walls = walls_of_values(nearness, sigma=0.02)
    np.testing.assert_allclose(walls.incline, 0.0, atol=math.radians(1.0))
    np.testing.assert_allclose(walls.front, 0.5, rtol=0.01)


def test_two_walls_are_not_taken_for_one() -> None:
    assert walls_of(Scene(corner(1.8))).shared == 0.0
    assert walls_of(Scene(corridor())).shared == 0.0
    np.testing.assert_allclose(walls_of(Scene(corner(1.8))).incline, math.pi / 4, atol=0.02)


def test_a_door_is_a_gap_in_its_wall_and_a_wall_has_none() -> None:
    for distance in (0.9, 1.5, 2.3):
        assert walls_of(Scene(door(distance))).gap > 0.2
        assert walls_of(Scene((wall_ahead(distance),))).gap < 0.0
    assert walls_of(Scene(corner(2.0))).gap < 0.03


def test_the_frame_of_a_near_door_steps_forward_on_both_sides() -> None:
    frame = (Wall((0.7, 4.0), (0.7, 0.5)), Wall((0.7, -0.5), (0.7, -4.0)), wall_ahead(3.0))
    walls = walls_of(Scene(frame))
    assert (walls.step > 0.2).all() or walls.opening > 0.2
    one_side = walls_of(Scene((frame[0], wall_ahead(3.0))))
    assert one_side.step[0] > 0.2
    assert one_side.gap < 0.0


def test_no_cells_no_support() -> None:
    walls = walls_of_values(np.ones(192), np.zeros(192))
    assert (walls.support == 0.0).all()
    assert slopes_of_walls(walls).codes == ("unknown", "unknown")


def test_walls_of_noisy_flow_keep_their_angle() -> None:
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(40):
        flow, _ = ideal_flow(Scene((wall_ahead(2.0, 0.4),)), sigma=0.15, noise=rng)
        seen = triangulate(flow, CAMERA.focal)
        weight = seen.confidence.ravel() * GEOMETRY.wall_share * GEOMETRY.upward
        errors.append(find_walls(GEOMETRY, seen, weight).incline[0] - 0.4)
    assert np.abs(np.median(errors)) < math.radians(1.5)
    assert np.percentile(np.abs(errors), 90) < math.radians(6.0)


def blinded(flow: FlowField, left: int = 0, right: int = 0) -> FlowField:
    """``flow`` without matches in some columns at its borders."""
    confidence = flow.confidence.copy()
    confidence[:, :left] = 0.0
    confidence[:, confidence.shape[1] - right :] = 0.0
    return replace(flow, confidence=confidence)


def hidden(flow: FlowField) -> Array:
    return find_blind_borders(flow, GEOMETRY, CAMERA.focal, 8.0).hidden


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("columns", [2, 3])
def test_several_blind_columns_hide_something_near(side: str, columns: int) -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    found = hidden(blinded(flow, **{side: columns}))
    at = np.s_[:columns] if side == "left" else np.s_[16 - columns :]
    assert (found[1, at] > 0.9).all()
    assert found[1].sum() == pytest.approx(found[1, at].sum())
    # a point there moves by more than 8 px, which bounds its nearness from below
    innermost = abs(flow.points[0, columns - 1, 0])
    assert found[0].max() >= 8.0 / (innermost * flow.motion.baseline)


def test_one_blind_column_needs_fast_flow_beside_it() -> None:
    slow, _ = ideal_flow(Scene((wall_ahead(3.0),)))
    fast, _ = ideal_flow(Scene((wall_ahead(0.5),)))
    assert hidden(blinded(slow, left=1))[1].max() == 0.0
    assert hidden(blinded(fast, left=1))[1, 0] > 0.9
    assert hidden(slow)[1].max() == 0.0
    # a blind image hides nothing in particular
    middle, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    assert hidden(blinded(middle, left=8, right=8))[1].max() == 0.0


def test_what_the_past_camera_did_not_see_hides_nothing() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.0),)))
    # the camera turned to the left: its left border was outside the past image
    turned = replace(flow, motion=replace(flow.motion, rotation=turn_about(1, 0.2)))
    assert hidden(blinded(turned, left=2))[1].max() == 0.0
    assert hidden(blinded(turned, right=2))[1].max() > 0.9


def test_the_nearest_object_may_be_the_one_that_was_not_matched() -> None:
    flow, _ = ideal_flow(Scene((wall_ahead(2.5),)), sigma=0.1)
    percept = Offis(ROBOT).perceive(blinded(flow, left=2), Twist(0.3, 0.0))
    assert set(percept.obstacles["layer1"]) <= {"P2", "P3"}
    assert set(percept.obstacles["layer1"].values()) == {"near"}
    explained = percept.explain()["border"]["left"]
    assert explained["inputs"]["blind"] == 2.0
    assert explained["rules"][0]["rule"] == "IF blind IS several THEN border IS near"
    # unknown cells stay unknown in the metric part
    assert (percept.confidence[:, :2] == 0.0).all()


AHEAD = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.07]), 0.2, 0.001, 0.002)
UNKNOWN = "Layer1: nearest object is unknown; Layer2: nearest object is unknown; Front is unknown"


def percept_of(
    past: Image, now: Image, motion: CameraMotion = AHEAD, params: Offis.Params | None = None
) -> Percept:
    raw = BlockMatching(ROBOT).compute(pair_of(past, now, motion))
    flow = refine(raw, ROBOT.camera).apply(raw, ROBOT.camera)
    return Offis(ROBOT, params).perceive(flow, Twist(0.3, 0.0))


def flat(level: float, noise: float, seed: int) -> Image:
    rng = np.random.default_rng(seed)
    image = level + rng.normal(0.0, noise, (120, 160))
    return np.asarray(np.clip(np.rint(image), 0, 255), dtype=np.uint8)


@pytest.mark.parametrize("mode", ["nearness", "paper"])
@pytest.mark.parametrize(
    ("level", "noise"), [(0, 0.0), (0, 2.0), (128, 0.0), (128, 1.0), (255, 0.0)]
)
def test_black_white_and_textureless_images_are_unknown(
    level: float, noise: float, mode: Literal["nearness", "paper"]
) -> None:
    images = flat(level, noise, 1), flat(level, noise, 2)
    percept = percept_of(*images, params=Offis.Params(mode=mode))
    assert (percept.label == Label.UNKNOWN).all()
    assert percept.confidence.max() < 0.15
    assert percept.situations["unknown"] > 0.9
    assert max(d for name, d in percept.situations.items() if name != "unknown") < 0.1
    assert percept.floor_in_front < 0.5
    assert sum(percept.situations.values()) == pytest.approx(1.0)
    assert percept.slopes == {"left": "unknown", "right": "unknown"}
    assert percept.sentence == UNKNOWN
    assert not any(any(degrees.values()) for degrees in percept.quadrants.values())


def test_an_image_that_stands_still_while_the_robot_drives_is_no_wall_ahead() -> None:
    image = blurred_noise(5)
    percept = percept_of(image, image)
    # zero flow: everything is infinitely far, or the lens is covered
    assert percept.sentence.startswith(
        ("Layer1: no object in sight", "Layer1: nearest object is unknown")
    )
    assert "near" not in {t for regions in percept.obstacles.values() for t in regions.values()}


SLOPES = {"very slope": 2.0, "slope": 1.0, "orthogonal": 0.0, "unusual": -1.0}

# rows: left plane, columns: right plane, both very slope, slope, orthogonal, unusual
CELLS = """
door or corridor | door or corner | door or corner | door or unknown
door or corner | door or corner | corner | left slope wall or unknown
door or corner | corner | wall | left wall or unknown
door or unknown | right slope wall or unknown | right wall or unknown | unknown
"""
TABLE_1 = {
    (left, right): cell.strip()
    for left, line in zip(SLOPES, CELLS.strip().splitlines(), strict=True)
    for right, cell in zip(SLOPES, line.split("|"), strict=True)
}


def degrees(left: float, right: float) -> dict[str, float]:
    found = infer(load_system("situation"), {"left": np.array([left]), "right": np.array([right])})
    return {name: float(found.degree("situation", name.replace(" ", "_"))[0]) for name in TABLE}


@pytest.mark.parametrize("cell", TABLE_1, ids=" and ".join)
def test_every_cell_is_concluded_fully_and_alone(cell: tuple[str, str]) -> None:
    found = degrees(*(SLOPES[side] for side in cell))
    assert found.pop(TABLE_1[cell]) == pytest.approx(1.0)
    assert max(found.values()) == pytest.approx(0.0)


def test_between_two_cells_both_hold_in_part_and_either_unusual_code_is_unusual() -> None:
    found = degrees(1.5, 2.0)
    assert found["door or corridor"] == pytest.approx(0.5)
    assert found["door or corner"] == pytest.approx(0.5)
    for unusual in (-1.0, -2.0):
        assert degrees(unusual, unusual)["unknown"] == pytest.approx(1.0)
