"""World files: shipped ones are valid, errors have file, line and key; landmark plates."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from sim_worlds import PERFECT, TICK, drive, loaded

from navfw.config import find
from navfw.config.document import parse_yaml
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError, WorldError
from navfw.features.landmark_appearance import landmark_kind
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import SceneGeometry, Simulation, WorldSpec, load_world
from navfw.sim.event_actions import CameraFault
from navfw.sim.solids import solids_of
from navfw.sim.world_check import check_world
from navfw.topomap import load_map

WORLDS = Path(__file__).parents[2] / "worlds"

ROOM = """\
name: room
x: [0, 4]
y: [0, 4]
walls:
  - name: divider
    points: [[2, 0], [2, 4]]
    openings:
      - {name: gap, at: [2, 2], width: 1.0}
boxes:
  - name: crate
    at: [1, 1]
    size: [0.5, 0.5, 0.5]
movers:
  - {name: anna, path: [[0.5, 3], [1.5, 3]], speed: 0.5}
drops:
  - {name: pit, x: [3, 3.5], y: [0.5, 1.5], depth: 0.8}
landmarks:
  - {name: mark, id: 1, at: [1.95, 0.7], yaw: 3.1416}
"""


def test_wall_is_cut_by_its_opening(tmp_path: Path) -> None:
    world = loaded(tmp_path, ROOM)
    pieces = [s for s in solids_of(world) if s.name == "divider"]
    assert [s.kind for s in pieces] == ["wall", "lintel", "wall"]
    assert [s.shape.bounds[1::2] for s in pieces] == [(0.0, 1.5), (1.5, 2.5), (2.5, 4.0)]
    assert pieces[1].bottom == 2.05


def test_closed_door_fills_its_gap(tmp_path: Path) -> None:
    text = ROOM + "doors: [{name: leaf, opening: gap, state: %s}]\n"
    opened = loaded(tmp_path, text % "open")
    closed = loaded(tmp_path, text % "closed")
    assert SceneGeometry.from_world(opened).clearance(2, 2) == pytest.approx(0.5)
    assert SceneGeometry.from_world(closed).clearance(2, 2) < 0.0


AT, PATH, MARK = "at: [2, 2], width", "[[0.5, 3], [1.5, 3]]", "[1.95, 0.7]"


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        # walls, openings, furniture
        (AT, "at: [2.2, 2], width", 8, r"walls\[0\].openings\[0\].at: the opening 'gap'"),
        (AT, "at: [2, 3.8], width", 8, r"openings\[0\].at: .* line of wall 'divider'"),
        ("1.0}", "1.0}\n      - {name: b, at: [2, 2.6], width: 0.5}", 9, "'b' overlaps 'gap'"),
        ("at: [1, 1]", "at: [1.8, 1]", 11, r"boxes\[0\].at: 'crate' overlaps 'divider'"),
        ("at: [1, 1]", "at: [1e3, 1e3]", 10, r"boxes\[0\]: beyond 20 m, .* millimetres\?"),
        ("at: [1, 1]", "at: [5, 1]", 11, r"boxes\[0\].at: .* lies off the floor"),
        ("name: crate", "name: divider", 10, r"boxes\[0\].name: .* taken by walls\[0\].name"),
        ("[[2, 0], [2, 4]]", "[[2, 0], [2, 9]]", 6, r"walls\[0\].points\[1\]: .* off the floor"),
        ("    at: [1, 1]", "    texture: wod\n    at: [1, 1]", 11, r"did you mean 'wood'\?"),
        ("movers:", "doors: [{name: leaf, opening: gapp}]\nmovers:", 13, "did you mean 'gap'"),
        ("size: [0.5, 0.5, 0.5]", "size: [0.5, -0.5, 0.5]", 12, r"boxes\[0\].size\[1\]"),
        ("x: [0, 4]", "x: [4, 0]", 2, "x: must ascend"),
        ("width: 1.0", "widht: 1.0", 8, r"did you mean 'width'\?"),
        # movers
        (PATH, "[[1, 3], [1, 0.5]]", 14, "'anna' would walk through 'crate'"),
        (PATH, "[[0.5, 3], [-7, 3]]", 14, r"point \[-7.0, 3.0\] lies off the floor"),
        (PATH, "[[1, 3], [1, 3]]", 14, "consecutive points of path are equal"),
        (PATH, "[[3.3, 3], [3.3, 0.2]]", 14, r"movers\[0\].path: 'anna' would walk into 'pit'"),
        ("name: anna", "name: crate", 14, "'crate' is taken by boxes"),
        ("speed: 0.5", "speed: 0", 14, r"movers\[0\].speed"),
        ("speed: 0.5", "texture: silk", 14, "unknown texture 'silk'"),
        ("speed: 0.5", "walk: circle", 14, r"movers\[0\].walk"),
        # drops
        ("x: [3, 3.5]", "x: [3, 7]", 16, r"drops\[0\].x: 'pit' extends beyond the floor, x"),
        ("x: [3, 3.5]", "x: [1.5, 3]", 16, "'divider' would have no floor under it at 'pit'"),
        ("name: pit", "name: divider", 16, r"drops\[0\].name: the body name 'divider' is taken"),
        ("depth: 0.8", "texture: ston", 16, r"drops\[0\].texture: .* did you mean 'stone'\?"),
        ("depth: 0.8", "walls: drak", 16, r"drops\[0\].walls: .* did you mean 'dark'\?"),
        ("depth: 0.8", "depth: 0", 16, r"drops\[0\].depth: expected a number"),
        ("0.8}", "0.8}\n  - {name: b, x: [3.2, 3.9], y: [1, 2]}", 17, "'b' overlaps 'pit'"),
        # landmarks
        ("6}", "6}\n  - {name: b, id: 1, at: [1.95, 3.2], yaw: 3}", 19, "id: a second aruco-1"),
        ("6}", "6}\n  - {name: mark, id: 2, at: [1.95, 3.2], yaw: 3}", 19, "'mark' is taken by"),
        ("name: mark", "name: divider", 18, r"landmarks\[0\].name: .* 'divider' is taken by"),
        (MARK, "[1.5, 0.3]", 18, r"landmarks\[0\].at: .*not mounted on a face.*0.45 m away"),
        (MARK, "[1.95, 1.4]", 18, r"landmarks\[0\].at: 'mark' is not mounted on a face"),
        (MARK, "[0.75, 1]", 18, r"landmarks\[0\].at: 'mark' is not mounted on a face"),
        ("yaw: 3.1416", "yaw: 0", 18, r"landmarks\[0\].at: 'mark' lies inside 'divider'"),
        (MARK, "[9, 0.7]", 18, r"landmarks\[0\].at: 'mark' .* lies off the floor"),
        ("6}", "6, z: 0.1}", 18, r"landmarks\[0\].z: .* at least 0.19"),
        ("id: 1", "id: 1000", 18, "0 to 999"),
    ],
)
def test_impossible_worlds(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    assert ROOM.count(old) == 1
    with pytest.raises((ConfigError, WorldError), match=message) as caught:
        loaded(tmp_path, ROOM.replace(old, new))
    assert caught.value.file == str(tmp_path / "world.yaml")
    assert caught.value.line == line


def test_all_problems_are_reported_together(tmp_path: Path) -> None:
    text = ROOM.replace("at: [1, 1]", "at: [9, 1]").replace("at: [2, 2]", "at: [3, 2]")
    with pytest.raises(WorldError) as caught:
        loaded(tmp_path, text)
    assert "boxes[0].at" in str(caught.value)
    assert "walls[0].openings[0].at" in str(caught.value)


def test_office_is_drivable() -> None:
    """Doors 0.9 to 1 m wide, furniture 0.85 m from them, rooms reachable, the lab far away."""
    office = load_world(WORLDS / "office" / "world.yaml")
    plan = SceneGeometry.from_world(office)
    furniture = SceneGeometry(plan.bounds, tuple(s for s in plan.solids if s.kind != "wall"))
    openings = [o for wall in office.walls for o in wall.openings]
    assert len(openings) == 9
    assert all(0.9 <= o.width <= 1.0 for o in openings)
    points = np.array([o.at for o in openings])
    assert furniture.clearances(points).min() > 0.85
    # also for a robot with a radius of 0.4 m
    for room in office.rooms:
        middle = (0.5 * sum(room.x), 0.5 * sum(room.y))
        if plan.clearance(*middle) < 0.4:
            middle = (room.x[0] + 1.5, room.y[1] - 1.2)
        assert plan.shortest_path((1.2, 1.2), middle, 0.4)[0] > 1.0
    assert 15.0 < plan.shortest_path((1.2, 1.2), (14.6, 8.8), 0.18)[0] < 20.0
    assert plan.clearance(14.6, 8.8) > 0.6


def test_errors_name_the_file_relative_to_the_working_directory_if_there_is_one(
    workdir: Path,
) -> None:
    wall = "{name: w, points: [[1, 1], [2, 2]], texture: t}"
    with pytest.raises(WorldError, match=r"^world\.yaml:4: walls\[0\]\.texture: unknown texture"):
        loaded(Path(), f"name: a\nx: [0, 9]\ny: [0, 9]\nwalls: [{wall}]\n")
    with pytest.raises(WorldError, match="unknown texture"):
        check_world(WorldSpec(name="a", x=(0, 1), y=(0, 1), floor="lava"))


ROBOT = RobotModel()

WALLED = """
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


def test_landmarks_may_be_mounted_on_boxes_or_stand_free(tmp_path: Path) -> None:
    on_box = "  - {name: a, id: 1, at: [2, 4.5], z: 0.2, yaw: -1.5708, size: 0.2}\n"
    free = "  - {name: b, id: 1, kind: poster, at: [3, 3], yaw: 1, free: true}\n"
    assert len(loaded(tmp_path, WALLED + on_box + free).landmarks) == 2


ON_WALL = "  - {name: a, id: 1, at: [4.95, 2.5], yaw: 3.1416}\n"
MARKED = validate(parse_yaml(WALLED + ON_WALL), WorldSpec)
BARE = MARKED.model_copy(update={"landmarks": ()})


def simulated(world: WorldSpec, *, landmark_frames: bool = False) -> Simulation:
    return Simulation(world, ROBOT, Pose(3.0, 2.5, 0.0), 1, landmark_frames=landmark_frames)


def test_a_plate_changes_only_its_own_pixels() -> None:
    with simulated(MARKED) as with_plate, simulated(BARE) as without:
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
        image, plain = (sim.render_from(behind)[0] for sim in (with_plate, without))
        np.testing.assert_array_equal(image, plain)


def test_a_plate_is_drawn_upright_and_not_mirrored() -> None:
    large = ROBOT.model_copy(update={"camera": ROBOT.landmark_view})
    with Simulation(MARKED, large, Pose(3.0, 2.5, 0.0), 0, PERFECT) as simulation:
        image, _ = simulation.render_from(Pose(3.7, 2.5, 0.0))
    aruco, distance = landmark_kind("aruco"), 1.25 - 0.1 - 0.006
    side = round(aruco.plate_side(0.25) / distance * large.camera.focal)
    plate = cv2.resize(aruco.plate_image(1), (side, side), interpolation=cv2.INTER_AREA)
    scores = []
    for turned in (plate, plate[:, ::-1], plate[::-1], np.rot90(plate)):
        match = cv2.matchTemplate(image, np.ascontiguousarray(turned), cv2.TM_CCOEFF_NORMED)
        scores.append(float(match.max()))
    assert scores[0] > 0.9
    assert scores[0] > max(scores[1:]) + 0.1


def test_a_plate_has_no_collision_shape() -> None:
    tracks = []
    for world in (MARKED, BARE):
        with simulated(world) as simulation:
            touched: list[tuple[float, tuple[str, ...]]] = []
            for _ in range(360):
                drive(simulation, TICK, 8.0, 8.0)
                touched.append((simulation.true_pose().x, simulation.contacts))
        tracks.append(touched)
    assert tracks[0] == tracks[1]
    assert tracks[0][-1][1] == ("inner",)


def test_landmark_frames_are_captured_only_when_enabled() -> None:
    with simulated(MARKED, landmark_frames=True) as marked, simulated(MARKED) as usual:
        times = []
        for _ in range(150):
            one, other = marked.read(), usual.read()
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
            marked.advance(TICK)
            usual.advance(TICK)
        assert usual.timings.landmarks == 0.0
    np.testing.assert_allclose(times, np.arange(4) / ROBOT.landmark_camera.rate, atol=1e-6)


def test_camera_faults_apply_to_landmark_frames() -> None:
    with simulated(MARKED, landmark_frames=True) as simulation:
        first = simulation.read().landmark_frame
        simulation.begin(CameraFault(black=True))
        later = None
        for _ in range(60):
            simulation.advance(TICK)
            later = simulation.read().landmark_frame or later
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
