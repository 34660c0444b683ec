"""Small things in rendered images: seen in time, nothing where there is only floor."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest
from flow_scene import Board, board_image
from perceive_calls import perceive
from perceive_images import save

from navfw.flow import grid_points
from navfw.numerics import Image
from navfw.perceive.floor_motion import FloorMotion
from navfw.perceive.overlay import COLOURS
from navfw.perceive.small_things import (
    SmallThing,
    SmallThings,
    _Placed,
    _Plane,
    nearest_clause,
    without_feet,
)
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, Frame, Percept, Pose

HEIGHT = 0.35
CAMERA = CameraModel(
    width=320, height=240, hfov=math.pi / 2, mount_height=HEIGHT, mount_forward=0.0
)
STEP = 0.07
WHOLE = np.ones((12, 16), np.bool_)


def images(
    *boards: Board, pitch: float = 0.0, mirror: float = 0.0, number: int = 12
) -> list[Image]:
    """Images of a drive ahead by ``STEP`` [m] each, from x = 0, as a lens shows them."""
    noise, drive = np.random.default_rng(5), []
    camera = CAMERA.model_copy(update={"pitch": pitch, "width": 640, "height": 480})
    below = camera.model_copy(update={"mount_height": 2.0 * HEIGHT})
    for k in range(number):
        pose = Pose(STEP * k, 0.0, 0.0)
        image = board_image(camera, pose, boards=boards).astype(np.float64)
        image += mirror * (board_image(below, Pose(pose.x, 3.0, 0.0)) - image)
        small = cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)
        image = cv2.GaussianBlur(small, (0, 0), 0.6) + noise.normal(0.0, 2.0, (240, 320))
        drive.append(np.clip(image, 0, 255).astype(np.uint8))
    return drive


def found(
    drive: list[Image], pitch: float = 0.0, way: float = STEP
) -> list[tuple[SmallThing, ...] | None]:
    """What is found in each image but the first, with the floor's motion as it is."""
    search = SmallThings(CAMERA.focal / CAMERA.width)
    ahead = np.array([0.0, -math.sin(pitch), math.cos(pitch)])
    motion = CameraMotion(np.eye(3), ahead, 0.1)
    floor = FloorMotion(way / HEIGHT, pitch, WHOLE, WHOLE)
    frames = [Frame(0.1 * k, image) for k, image in enumerate(drive)]
    pairs = zip(frames[1:], frames, strict=False)
    return [search.find(now, past, motion, floor) for now, past in pairs]


@pytest.mark.parametrize("seed", range(5))
def test_what_has_a_height_moves_by_its_homography(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pitch, height = rng.uniform(-0.2, 0.4), rng.uniform(-0.5, 0.6)
    plane = _Plane((240, 320), 150.0, FloorMotion(0.1, pitch, WHOLE, WHOLE))
    empty = np.zeros((240, 320), np.float32)
    turn = np.asarray(cv2.Rodrigues(rng.normal(0.0, 0.05, 3))[0], np.float64)
    now = _Placed(empty, empty, turn, rng.normal(0.0, 0.3, 3))
    past = _Placed(empty, empty, np.eye(3), rng.normal(0.0, 0.3, 3))
    # a point at this height above the floor, one height below the camera now
    down = np.array([0.0, math.cos(pitch), math.sin(pitch)])
    ahead = np.array([0.0, -math.sin(pitch), math.cos(pitch)])
    point = (1.0 - height) * down + rng.uniform(2.0, 4.0) * ahead
    point[0] += rng.uniform(-1.0, 1.0)
    before = past.rotation.T @ (now.rotation @ point + now.place - past.place)
    u, v = 150.0 * point[:2] / point[2] + (159.5, 119.5)
    top = 240 - plane.shape[0]
    seen = plane.homography(now, past, height / (1.0 - height)) @ (u, v - top, 1.0)
    expected = 150.0 * before[:2] / before[2] + (159.5, 119.5)
    assert seen[:2] / seen[2] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("height", "width", "side"),
    [(0.08, 0.12, -0.15), (0.12, 0.1, -0.2), (0.5, 0.06, 0.1)],
    ids=["cup", "can", "post"],
)
@pytest.mark.parametrize("pitch", [0.0, 0.15])
def test_a_small_thing_is_seen_where_it_stands(
    height: float, width: float, side: float, pitch: float
) -> None:
    seen = found(images(Board(1.4, side, width=width, height=height), pitch=pitch), pitch)[-1]
    assert seen
    far, nearest = 1.4 - 11 * STEP, seen[0]
    assert nearest.distance * HEIGHT == pytest.approx(math.hypot(far, side), rel=0.2)
    assert nearest.bearing == pytest.approx(math.atan2(side, far), abs=0.08)
    assert nearest.width * HEIGHT < 1.5 * width
    assert 0.015 < nearest.height * HEIGHT < 1.5 * height
    left, top, right, low = nearest.box
    assert left < 0.5 - 0.5 * side / far < right
    assert 0.45 < top < low < 1.0


@pytest.mark.parametrize("pitch", [0.0, 0.15])
def test_floor_is_known_and_free(pitch: float) -> None:
    seen = found(images(pitch=pitch), pitch)
    assert seen[-8:] == [()] * 8


def test_a_mirror_image_in_the_floor_is_no_thing() -> None:
    assert not any(found(images(mirror=0.3)))


@pytest.mark.parametrize(("wall", "named"), [(0.2, True), (0.45, False)], ids=["far", "its own"])
def test_the_foot_of_a_wall_is_no_small_thing(wall: float, named: bool) -> None:
    """``wall`` is the nearness [1/camera heights] above a thing two camera heights ahead."""
    thing = SmallThing(2.0, 0.0, 0.3, 0.2, (0.4, 0.6, 0.6, 0.7), 2.0)
    points = grid_points(CAMERA, 12, 16)
    nearness = np.where(np.abs(points[..., 0]) < 0.2 * CAMERA.width, wall / HEIGHT, 5.0)
    seen = SimpleNamespace(points=points, nearness=nearness, confidence=np.ones((12, 16)))
    kept = without_feet((thing,), cast(Percept, seen), CAMERA, HEIGHT, 0.0)
    assert kept == ((thing,) if named else ())


def test_nothing_is_known_before_enough_motion_or_without_floor() -> None:
    drive = images(Board(1.2, 0.0, width=0.1, height=0.1), number=10)
    assert found(drive)[0] is None
    assert found(drive[:1] * 10, way=0.0)[-1] is None
    search = SmallThings(CAMERA.focal / CAMERA.width)
    motion = CameraMotion(np.eye(3), np.array([0.0, 0.0, 1.0]), 0.1)
    assert search.find(Frame(0.1, drive[1]), Frame(0.0, drive[0]), motion, None) is None


def test_the_command_says_and_draws_it(tmp_path: Path) -> None:
    drive = images(Board(1.4, -0.2, width=0.1, height=0.12))
    folder = save(tmp_path / "drive", [np.repeat(image[..., None], 3, axis=2) for image in drive])
    options = ("--hfov", "90", "--pitch", "0", "--overlay", tmp_path / "seen")
    views = perceive(folder, *options)
    assert views[0]["small_things"] is None
    view = views[-1]
    assert view["small_things"][0]["distance"] == pytest.approx(0.66 / HEIGHT, rel=0.2)
    assert view["small_things"][0]["bearing_deg"] == pytest.approx(-17.0, abs=4.0)
    assert view["sentence"].startswith("Small thing on the right, 2 camera heights away; ")
    assert view["statements"][0]["what"] == "small"
    for number, framed in ((1, False), (11, True)):
        picture = cv2.imread(str(tmp_path / "seen" / f"view-000{number:02d}.png"))
        assert picture is not None
        assert (picture[:700] == COLOURS["small things"]).all(axis=2).any() == framed


@pytest.mark.parametrize("spoilt", ["blurred", "other", "plain"])
def test_nothing_is_known_where_the_floor_does_not_register(spoilt: str) -> None:
    drive = images(Board(1.2, 0.0, width=0.1, height=0.1), number=10)
    assert found(drive)[-1]
    last = drive[-1]
    drive[-1] = {
        "blurred": np.asarray(cv2.GaussianBlur(last, (0, 0), 1.5), np.uint8),
        "other": np.ascontiguousarray(last[:, ::-1]),
        "plain": np.full_like(last, 120),
    }[spoilt]
    assert found(drive)[-1] is None


@pytest.mark.parametrize(
    ("distance", "bearing", "clause"),
    [
        (2.3, 0.1, "Small thing ahead, 2.5 camera heights away"),
        (3.9, 0.5, "Small thing on the left, 4 camera heights away"),
        (1.1, -0.5, "Small thing on the right, 1 camera heights away"),
    ],
)
def test_the_clause_of_a_sentence(distance: float, bearing: float, clause: str) -> None:
    thing = SmallThing(distance, bearing, 0.1, 0.1, (0.4, 0.5, 0.5, 0.6))
    assert nearest_clause(thing) == clause
