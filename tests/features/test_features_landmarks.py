"""Markers and posters in rendered scenes with known poses; geometry; unknown ids; bad files."""

import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from navfw_benchmarks.bench.landmark_recognition import view_of
from navfw_benchmarks.plugins.posters import Landmarks, Posters, poster_image

from navfw.errors import ConfigError
from navfw.features.landmark_appearance import landmark_kind, marker_dictionary
from navfw.features.recognizers import Aruco, is_upright, locate, locate_with_covariance
from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, Pose
from navfw.sim import SensorParams, Simulation, WorldSpec
from navfw.sim.worldspec import LandmarkPlateSpec, WallSpec
from navfw.topomap import Landmark, Place, TopoMap

ROBOT = RobotModel()
LARGE = ROBOT.model_copy(update={"camera": ROBOT.landmark_view})
MARKER = LandmarkPlateSpec(name="marker", id=7, at=(9.9, 4.0), yaw=math.pi)
POSTER = LandmarkPlateSpec(name="poster", kind="poster", id=3, at=(9.9, 8.0), yaw=math.pi, size=0.5)


@pytest.fixture(scope="module")
def hall() -> Iterator[Simulation]:
    outline = ((0.05, 0.05), (9.95, 0.05), (9.95, 11.95), (0.05, 11.95), (0.05, 0.05))
    world = WorldSpec(
        name="hall",
        x=(0, 10),
        y=(0, 12),
        ceiling="ceiling",
        walls=(WallSpec(name="wall", points=outline),),
        landmarks=(MARKER, POSTER),
    )
    with Simulation(world, LARGE, Pose(2, 6, 0), 0, SensorParams.preset("perfect")) as simulation:
        yield simulation


def noisy(image: Image, rng: np.random.Generator) -> Frame:
    grey = np.clip(np.rint(image + 2.0 * rng.standard_normal(image.shape)), 0, 255)
    return Frame(1.5, grey.astype(np.uint8))


def with_square(picture: Image, side: int) -> Image:
    """A grey image of the landmark camera with ``picture``, scaled to ``side`` [px], in it."""
    image = np.full((96, 480), 110, np.uint8)
    square = image[2 : 2 + side, 200 : 200 + side]
    square[:] = cv2.resize(picture, (side, side), interpolation=cv2.INTER_AREA)
    return image


def of_posters(*ids: int) -> TopoMap:
    marks = [Landmark(f"p{i}", "poster", i, 0.0, 0.0, 0.0, size=0.5) for i in ids]
    return TopoMap("m", [Place("here", 0.0, 0.0)], [], None, marks)


def corners_of(camera: CameraModel, x: float, y: float, yaw: float, side: float) -> Array:
    """Exact image corners (4, 2) of an upright square at (x, y) [m] in base_link."""
    across = np.array([math.sin(yaw), -math.cos(yaw), 0.0]) * 0.5 * side
    up = np.array([0.0, 0.0, 0.5 * side])
    middle = np.array([x - camera.mount_forward, y, 0.1])
    # in the image the left side is opposite to the direction of "across"
    points = [middle + sx * across + sz * up for sx, sz in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    seen = np.array(points) @ camera.base_from_camera
    found: Array = camera.focal * seen[:, :2] / seen[:, 2:]
    return found


@given(
    away=st.floats(0.6, 8.0),
    aside=st.floats(-0.6, 0.6),
    turned=st.floats(-1.2, 1.2),
    pitch=st.floats(-0.3, 0.3),
)
def test_bearing_and_range_are_exact_at_any_orientation(
    away: float, aside: float, turned: float, pitch: float
) -> None:
    camera = ROBOT.landmark_view.model_copy(update={"pitch": pitch})
    x, y = away * math.cos(aside) + camera.mount_forward, away * math.sin(aside)
    corners = corners_of(camera, x, y, math.pi + aside + turned, 0.25)
    assert is_upright(corners) or abs(pitch) > 0.1
    bearing, reach = locate(corners, 0.25, camera)
    # both sides are exact, and the centre is their mean
    assert bearing == pytest.approx(math.atan2(y, x), abs=2e-2 / away**2)
    assert reach == pytest.approx(math.hypot(x, y), rel=2e-2 / away**2)


def test_covariance_is_that_of_corners_moved_at_random() -> None:
    camera, rng = ROBOT.landmark_view, np.random.default_rng(3)
    corners = corners_of(camera, 3.0, 0.5, math.pi - 0.4, 0.25)
    _, covariance = locate_with_covariance(corners, 0.25, camera, 0.4)
    drawn = locate(corners + 0.4 * rng.standard_normal((20_000, 4, 2)), 0.25, camera)
    spread = np.cov(drawn.T)
    # the floors for errors other than the corners' are added
    floors = np.diag([math.radians(0.3) ** 2, (0.01 * math.hypot(3.0, 0.5)) ** 2])
    np.testing.assert_allclose(covariance - floors, spread, rtol=0.1, atol=3e-6)


def test_markers_are_detected_consistently_with_their_covariance(hall: Simulation) -> None:
    recognizer, rng = Aruco(ROBOT), np.random.default_rng(1)
    found, chi = 0, []
    views = [(d, a) for d in (1.0, 1.5, 2.0, 3.0, 3.5) for a in (0.0, 0.5, 0.75)] * 4
    for distance, angle in views:
        turn, aside = angle * rng.choice((-1, 1)), rng.uniform(-0.5, 0.5)
        image, bearing, away = view_of(hall, MARKER, distance, turn, aside)
        for seen in recognizer.recognize(noisy(image, rng)):
            if seen.identity != "aruco-7":
                continue
            found += 1
            assert seen.time == 1.5
            error = np.array([seen.bearing - bearing, seen.range - away])
            assert abs(error[0]) < math.radians(1.0)
            chi.append(float(error @ np.linalg.solve(seen.covariance, error)))
    assert found >= 0.95 * len(views)
    # two degrees of freedom: mean 2 for exact covariances
    assert 0.5 < float(np.mean(chi)) < 3.0
    assert float(np.mean(np.array(chi) < 9.21)) >= 0.97


def test_large_markers_are_not_lost_to_their_rims() -> None:
    """METHOD 4.6: the outline of the white plate must not replace that of the marker."""
    recognizer, rng = Aruco(ROBOT), np.random.default_rng(2)
    plate = landmark_kind("aruco").plate_image(7)
    for side in (32, 48, 64, 80, 90):
        (seen,) = recognizer.recognize(noisy(with_square(plate, side), rng))
        assert seen.identity == "aruco-7"
        # the black square is six eighths of the plate
        height = 0.25 * ROBOT.landmark_view.focal / (0.75 * side)
        assert seen.range == pytest.approx(height + 0.1, rel=0.05)


def test_markers_that_are_not_upright_are_rejected() -> None:
    plate = np.asarray(np.rot90(landmark_kind("aruco").plate_image(7)), np.uint8)
    assert Aruco(ROBOT).recognize(Frame(0.0, with_square(plate, 60))) == ()


def test_posters_are_detected_without_confusions(hall: Simulation) -> None:
    recognizer, rng = Posters(ROBOT), np.random.default_rng(4)
    recognizer.set_map(of_posters(*range(8)))
    others = Posters(ROBOT)
    others.set_map(of_posters(*range(20, 28)))
    found = 0
    views = [(d, a) for d in (1.2, 2.0, 2.5) for a in (0.0, 0.4)] * 2
    for distance, angle in views:
        image, bearing, away = view_of(hall, POSTER, distance, angle, rng.uniform(-0.3, 0.3))
        frame = noisy(image, rng)
        seen = recognizer.recognize(frame)
        assert {s.identity for s in seen} <= {"poster-3"}
        assert others.recognize(frame) == ()
        for detection in seen:
            found += 1
            assert detection.bearing == pytest.approx(bearing, abs=math.radians(1.0))
            assert detection.range == pytest.approx(away, rel=0.1)
    assert found >= 0.8 * len(views)


def test_both_kinds_are_detected_with_unmapped_ids_too(hall: Simulation) -> None:
    both = Landmarks(ROBOT)
    both.set_map(of_posters(3))  # marker 7 is in no map
    for plate, away, identity in ((MARKER, 2.0, "aruco-7"), (POSTER, 1.5, "poster-3")):
        image, _, _ = view_of(hall, plate, away, 0.0, 0.0)
        assert [seen.identity for seen in both.recognize(Frame(0.0, image))] == [identity]


def test_a_poster_can_be_any_picture(tmp_path: Path) -> None:
    picture = np.asarray(cv2.GaussianBlur(poster_image(99), (0, 0), 1.0), np.uint8)
    file = tmp_path / "photo.png"
    cv2.imwrite(str(file), picture)
    recognizer = Posters(ROBOT, Posters.Params(images={5: str(file)}))
    (seen,) = recognizer.recognize(Frame(0.0, with_square(picture, 80)))
    assert seen.identity == "poster-5"


@pytest.mark.parametrize("content", [None, b"no picture"])
def test_a_poster_file_that_is_not_a_picture_is_an_error(
    tmp_path: Path, content: bytes | None
) -> None:
    file = tmp_path / "photo.png"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ConfigError, match=r"photo\.png"):
        Posters(ROBOT, Posters.Params(images={5: str(file)}))


def test_empty_frames_have_no_landmarks() -> None:
    both = Landmarks(ROBOT)
    both.set_map(of_posters(1, 2))
    for grey in (0, 128, 255):
        assert both.recognize(Frame(0.0, np.full((96, 480), grey, np.uint8))) == ()


def test_smaller_dictionaries_are_the_first_part_of_larger_ones() -> None:
    large = marker_dictionary(1000).bytesList
    for ids in (50, 100, 250):
        np.testing.assert_array_equal(marker_dictionary(ids).bytesList, large[:ids])
    with pytest.raises(ValueError, match="1000"):
        marker_dictionary(1001)
