"""Landmark plates in worlds: valid mountings, rendering, and landmark frames."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from sim_worlds import PERFECT, TICK, drive, loaded

from navfw.config import find
from navfw.features import landmark_kind
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import CameraFault, Simulation, WorldSpec, load_world
from navfw.topomap import load_map

ROBOT = RobotModel()

TEXT = """
name: room
x: [0, 8]
y: [0, 6]
walls:
  - {name: outer, points: [[0.05, 0.05], [7.95, 0.05], [7.95, 5.95], [0.05, 5.95], [0.05, 0.05]]}
  - {name: inner, points: [[5, 0.1], [5, 4]], openings: [{name: gap, at: [5, 1], width: 1.0}]}
boxes:
  - {name: box, at: [2, 5], size: [1, 1, 0.4]}
landmarks:
"""


def room(folder: Path, *marks: str) -> WorldSpec:
    return loaded(folder, TEXT + "".join(f"  - {{{mark}}}\n" for mark in marks))


ON_WALL = "name: a, id: 1, at: [4.95, 2.5], yaw: 3.1416"


def test_landmarks_may_be_mounted_on_boxes_or_stand_free(tmp_path: Path) -> None:
    on_box = "name: a, id: 1, at: [2, 4.5], z: 0.2, yaw: -1.5708, size: 0.2"
    free = "name: b, id: 1, kind: poster, at: [3, 3], yaw: 1, free: true"
    assert len(room(tmp_path, on_box, free).landmarks) == 2


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> WorldSpec:
    return room(tmp_path_factory.mktemp("marked"), ON_WALL)


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> WorldSpec:
    return room(tmp_path_factory.mktemp("bare"), ON_WALL).model_copy(update={"landmarks": ()})


def simulated(world: WorldSpec, landmark_frames: bool = False) -> Simulation:
    return Simulation(world, ROBOT, Pose(3.0, 2.5, 0.0), 1, landmark_frames=landmark_frames)


def test_a_plate_changes_only_its_own_pixels(marked: WorldSpec, bare: WorldSpec) -> None:
    with simulated(marked) as with_plate, simulated(bare) as without:
        here = Pose(3.0, 2.5, 0.2)
        (image, depth), (plain, _) = with_plate.render_from(here), without.render_from(here)
        changed = image != plain
        rows, columns = np.nonzero(changed)
        # seen from 1.85 m: a third of a metre, to the right of the middle
        expected = ROBOT.camera.focal * landmark_kind("aruco").plate_side(0.25) / 1.85
        assert np.ptp(rows) + 1 == pytest.approx(expected, abs=2.5)
        assert np.ptp(columns) + 1 == pytest.approx(expected, abs=3.5)
        assert depth[changed].max() < 2.0
        # from its back, and from behind the wall, nothing changes
        behind = Pose(7.0, 2.5, math.pi)
        np.testing.assert_array_equal(
            with_plate.render_from(behind)[0], without.render_from(behind)[0]
        )


def test_a_plate_is_drawn_upright_and_not_mirrored(marked: WorldSpec) -> None:
    large = ROBOT.model_copy(update={"camera": ROBOT.landmark_view})
    with Simulation(marked, large, Pose(3.0, 2.5, 0.0), 0, PERFECT) as simulation:
        image, _ = simulation.render_from(Pose(3.7, 2.5, 0.0))
    side = round(
        landmark_kind("aruco").plate_side(0.25) / (1.25 - 0.1 - 0.006) * large.camera.focal
    )
    plate = cv2.resize(
        landmark_kind("aruco").plate_image(1), (side, side), interpolation=cv2.INTER_AREA
    )
    scores = [
        float(cv2.matchTemplate(image, turned, cv2.TM_CCOEFF_NORMED).max())
        for turned in (plate, plate[:, ::-1], plate[::-1], np.rot90(plate))
        for turned in [np.ascontiguousarray(turned)]
    ]
    assert scores[0] > 0.9
    assert scores[0] > max(scores[1:]) + 0.1


def test_a_plate_has_no_collision_shape(marked: WorldSpec, bare: WorldSpec) -> None:
    tracks = []
    for world in (marked, bare):
        with simulated(world) as simulation:
            touched: list[tuple[float, tuple[str, ...]]] = []
            for _ in range(360):
                drive(simulation, TICK, 8.0, 8.0)
                touched.append((simulation.true_pose().x, simulation.contacts))
        tracks.append(touched)
    assert tracks[0] == tracks[1]
    assert tracks[0][-1][1] == ("inner",)


@pytest.fixture
def with_landmark_frames(marked: WorldSpec) -> Iterator[Simulation]:
    with simulated(marked, landmark_frames=True) as simulation:
        yield simulation


def test_landmark_frames_are_captured_only_when_enabled(
    marked: WorldSpec, with_landmark_frames: Simulation
) -> None:
    with simulated(marked) as usual:
        times = []
        for _ in range(150):
            one, other = with_landmark_frames.read(), usual.read()
            assert other.landmark_frame is None
            assert (one.inertial, one.encoders) == (other.inertial, other.encoders)
            assert (one.frame is None) == (other.frame is None)
            if one.frame is not None and other.frame is not None:
                np.testing.assert_array_equal(one.frame.image, other.frame.image)
            if one.landmark_frame is not None:
                assert one.frame is not None
                wanted = ROBOT.landmark_camera
                assert one.landmark_frame.image.shape == (wanted.height, wanted.width)
                times.append(one.landmark_frame.time)
            with_landmark_frames.advance(TICK)
            usual.advance(TICK)
        assert usual.timings.landmarks == 0.0
    np.testing.assert_allclose(times, np.arange(4) / ROBOT.landmark_camera.rate, atol=1e-6)


def test_camera_faults_apply_to_landmark_frames(with_landmark_frames: Simulation) -> None:
    first = with_landmark_frames.read().landmark_frame
    with_landmark_frames.begin(CameraFault(black=True))
    later = None
    for _ in range(60):
        with_landmark_frames.advance(TICK)
        later = with_landmark_frames.read().landmark_frame or later
    assert first is not None
    assert later is not None
    assert later.image.mean() < 5.0 < first.image.mean()


@pytest.mark.parametrize("name", ["office", "hospital"])
def test_shipped_worlds_and_maps_have_the_same_landmarks(name: str) -> None:
    world, topo_map = load_world(find("world", name)), load_map(find("map", name))
    plates = {(m.name, m.kind, m.id, *m.at, m.z, m.yaw, m.size) for m in world.landmarks}
    marks = topo_map.landmarks.values()
    assert plates == {(m.name, m.kind, m.id, m.x, m.y, m.z, m.yaw, m.size) for m in marks}
    assert len(plates) >= 20
