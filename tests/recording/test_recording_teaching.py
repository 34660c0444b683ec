"""Teaching: a recorded drive becomes a map that can be driven; what cannot is refused by reason."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from bag_samples import image, imu, joints, write_bag
from cli_calls import answer, invoke, output, refusal
from scripted_run import FakeSimulator

from navfw.errors import ConfigError
from navfw.localization.place_probabilities import load_table
from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.recording import Bag, RunFolder, ros_image
from navfw.recording.teaching import _check_sensors, _parts, recorded_drive, teach
from navfw.robot import RobotModel
from navfw.signals import Encoders, Pose, SensorReading, Twist
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import Passage, Place, TopoMap, load_map
from navfw.topomap.map_check import check_map
from navfw.topomap.map_formats import save_map
from navfw.topomap.occupancy_map import OccupancyMap

ROBOT = RobotModel()


def recorded(folder: Path, world: str, mission: str, *overrides: str, seed: int = 0) -> Path:
    """The folder of a recorded run."""
    session = prepare(world, mission, seed=seed, overrides=list(overrides))
    result = session.run(record=True)
    with RunFolder(folder) as target:
        write_run(result, target)
    assert target.final is not None
    return target.final


def readings(seconds: float, turn: float = 0.0) -> list[SensorReading]:
    """What a robot reads that drives ahead at 0.3 m/s, turning."""
    simulator = FakeSimulator(Pose(0.0, 0.0, 0.0))
    simulator.drive(*ROBOT.wheel_speeds(Twist(0.3, turn)))
    found = []
    for _ in range(round(seconds * 60)):
        found.append(simulator.read())
        simulator.advance(1.0 / 60.0)
    return found


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("taught") / "run", "paper-room", "through-the-door")


@pytest.mark.thorough
def test_a_taught_map_fits_the_world_and_is_driven(drive: Path, tmp_path: Path) -> None:
    target = tmp_path / "maps" / "taught.yaml"
    done = invoke("map", "teach", drive, "--out", target, "--name", "5=dock", "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert summary["parts"][0]["used"]
    assert summary["parts"][0]["ended_by"] == ""
    topo_map = load_map(target)
    assert "dock" in topo_map.places
    assert topo_map.floor_plan is not None
    assert check_map(topo_map) == []
    plan = SceneGeometry.from_world(load_world(Path("worlds/paper-room/world.yaml")))
    walls = topo_map.floor_plan
    surfaces = np.abs(plan.clearances(walls.centres(*np.nonzero(walls.occupied))))
    assert np.percentile(surfaces, 90) < 0.15
    again = invoke("map", "teach", drive, "--out", target)
    assert again.exit_code == 2
    assert "--force" in again.output


@pytest.mark.thorough
def test_drives_in_different_buildings_are_not_joined(drive: Path, tmp_path: Path) -> None:
    other = recorded(tmp_path / "other", "office", "lobby-to-lab", "mission.timeout=25")
    done = invoke("map", "teach", drive, other, "--out", tmp_path / "both.yaml")
    assert done.exit_code == 2
    assert "does not certainly overlap" in done.output
    assert not (tmp_path / "both.yaml").exists()


@pytest.mark.thorough
def test_two_drives_through_the_same_rooms_become_one_map(tmp_path: Path) -> None:
    folders = [
        recorded(tmp_path / f"run{seed}", "office", "kitchen-tour", seed=seed) for seed in (0, 1)
    ]
    drives = [recorded_drive(folder) for folder in folders]
    first, both = teach(drives[:1], "one"), teach(drives, "both")
    assert [part.used for part in both.parts] == [True, True]
    plans = first.topo_map.floor_plan, both.topo_map.floor_plan
    sizes = [0 if plan is None else int(plan.free.sum()) for plan in plans]
    assert 0.9 * sizes[0] < sizes[1] < 1.15 * sizes[0]


def test_an_undisturbed_drive_is_one_part() -> None:
    drive = readings(20.0, 0.5)
    assert [(a, b, why) for a, b, why in _parts(drive, ROBOT)] == [(0, len(drive) - 1, "")]


def test_a_gap_splits_the_drive() -> None:
    drive = readings(10.0)
    cut = [*drive[:200], *drive[300:]]
    assert [(a, b) for a, b, _ in _parts(cut, ROBOT)] == [(0, 199), (200, len(cut) - 1)]
    assert "a gap of 1.7 s" in next(_parts(cut, ROBOT))[2]


def test_a_jump_of_the_wheels_splits_the_drive() -> None:
    drive = readings(6.0)
    jumped = [
        reading
        if k < 100
        else replace(reading, encoders=replace(reading.encoders, left=reading.encoders.left + 5000))
        for k, reading in enumerate(drive)
    ]
    assert [(a, b) for a, b, _ in _parts(jumped, ROBOT)] == [(0, 99), (100, len(drive) - 1)]


def test_a_dark_camera_splits_the_drive() -> None:
    drive = readings(12.0)
    dark = [
        replace(r, frame=replace(r.frame, image=np.zeros_like(r.frame.image)))
        if r.frame is not None and 2.0 < r.time < 9.0
        else r
        for r in drive
    ]
    parts = list(_parts(dark, ROBOT))
    assert "no image shows anything" in parts[0][2]
    assert len(parts) >= 2


def test_a_robot_that_was_carried_splits_the_drive() -> None:
    drive = readings(10.0)
    carried = [
        replace(
            reading,
            encoders=Encoders(reading.time, 0, 0),
            inertial=replace(reading.inertial, yaw_rate=1.0 if 5.0 < reading.time < 6.0 else 0.0),
        )
        for reading in drive
    ]
    assert any("carried" in why for _, _, why in _parts(carried, ROBOT))


@pytest.mark.parametrize("missing", ["gyro", "wheels", "camera"])
def test_a_recording_without_a_sensor_is_refused_by_name(missing: str) -> None:
    drive = readings(2.0)
    if missing == "gyro":
        drive = [replace(r, inertial=replace(r.inertial, yaw_rate=np.nan)) for r in drive]
    elif missing == "wheels":
        drive = [replace(r, encoders=Encoders(r.time, 7, 7)) for r in drive]
    else:
        drive = [replace(r, frame=None) for r in drive]
    with pytest.raises(ConfigError, match=f"a map needs (a )?{missing}"):
        _check_sensors(drive, Path("run.mcap"))


@pytest.mark.parametrize("text", ["dock", "x=dock", "3=", "3=a b"])
def test_a_name_without_time_is_refused(text: str, tmp_path: Path) -> None:
    done = invoke("map", "teach", tmp_path, "--out", tmp_path / "m.yaml", "--name", text)
    assert done.exit_code == 2
    assert "expected T=PLACE" in done.output


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive past markers, recorded with the images for landmarks."""
    folder = tmp_path_factory.mktemp("marked") / "run"
    session = prepare("office", "lobby-to-lab", stack="landmarks", overrides=["mission.timeout=20"])
    with RunFolder(folder) as target:
        write_run(session.run(record=True), target)
    return folder


@pytest.mark.thorough
def test_markers_become_landmarks_where_they_are(marked: Path, tmp_path: Path) -> None:
    table = tmp_path / "situations.yaml"
    done = answer("map", "teach", marked, "--out", tmp_path / "m.yaml", "--situations", table)
    topo_map = load_map(tmp_path / "m.yaml")
    assert done["landmarks"] == len(topo_map.landmarks) >= 2
    true = {mark.id: mark.at for mark in load_world(Path("worlds/office/world.yaml")).landmarks}
    for mark in topo_map.landmarks.values():
        assert np.hypot(mark.x - true[mark.id][0], mark.y - true[mark.id][1]) < 0.15
    assert load_table(table).observations["room"] > 10


@pytest.mark.thorough
def test_a_bag_and_a_folder_of_the_same_drive_give_its_map(drive: Path, tmp_path: Path) -> None:
    answer("export", drive, "--to", tmp_path / "bag")
    bag, folder = Bag(tmp_path / "bag"), tmp_path / "folder"
    folder.mkdir()
    times = ["time,file"]
    for number, shown in enumerate(bag.each_image()):
        cv2.imwrite(str(folder / f"{number:04d}.png"), ros_image(shown.message, shown.name))
        times.append(f"{shown.time + 50.0},{number:04d}.png")
    gyro = ["time,yaw_rate", *(f"{row[0] + 50.0},{row[3]}" for row in bag.gyro)]
    wheels = ["time,left,right", *(f"{r[0] + 50.0},{r[1]},{r[2]}" for r in bag.joints)]
    for name, lines in (("times", times), ("gyro", gyro), ("wheels", wheels)):
        (folder / f"{name}.csv").write_text("\n".join(lines))
    plans = []
    for source in (drive, tmp_path / "bag", folder):
        target = tmp_path / "maps" / f"of-{source.name}.yaml"
        answer("map", "teach", source, "--out", target)
        plan = load_map(target).floor_plan
        assert plan is not None
        plans.append(float(plan.free.sum()))
    assert plans[1] == pytest.approx(plans[0], rel=0.1)
    assert plans[2] == pytest.approx(plans[1], rel=0.05)
    (folder / "gyro.csv").unlink()
    said = refusal("map", "teach", folder, "--out", tmp_path / "none.yaml")
    assert "a map needs a gyro: there is no gyro.csv" in said


@pytest.mark.parametrize(
    ("left_out", "why"),
    [("/imu", "sensor_msgs/Imu"), ("/joint_states", "nav_msgs/Odometry"), ("/image", "images")],
)
def test_a_bag_without_a_sensor_is_refused_by_its_topic(
    left_out: str, why: str, tmp_path: Path
) -> None:
    sent = [imu(0.1 * k, (0.0, 0.0, 0.1)) for k in range(20)]
    sent += [joints(0.1 * k, 0.1 * k, 0.1 * k) for k in range(20)]
    sent += [image("/image", 0.1 * k, np.zeros((120, 160), np.uint8), "mono8") for k in range(20)]
    bag = write_bag(tmp_path / "drive.bag", [one for one in sent if one.topic != left_out])
    said = refusal("map", "teach", bag, "--out", tmp_path / "m.yaml")
    assert "drive.bag" in said
    assert why in said
    assert not (tmp_path / "m.yaml").exists()


def test_places_are_named_later(tmp_path: Path) -> None:
    file = tmp_path / "plan.yaml"
    wide = OccupancyMap(np.zeros((60, 80), np.int8), 0.1, Pose(0.0, 0.0, 0.0))
    two = [Place("room-1", 1.0, 3.0), Place("room-2", 7.0, 3.0)]
    save_map(TopoMap("plan", two, [Passage("room-1", "room-2", 6.0, 2.0)], floor_plan=wide), file)
    output("map", "name", file, "room-1", "dock")
    output("map", "name", file, "4,4", "desk")
    named = load_map(file)
    assert list(named.places) == ["dock", "room-2", "desk"]
    assert {passage.ends for passage in named.passages} >= {frozenset(("dock", "room-2"))}
    assert named.part_of("desk") == {"dock", "room-2", "desk"}
    assert "already" in refusal("map", "name", file, "room-2", "dock")
    assert "already" in refusal("map", "name", file, "5,4", "dock")
    assert "not on free ground" in refusal("map", "name", file, "40,4", "far")
    assert "unknown place" in refusal("map", "name", file, "room-9", "far")
    assert [p.name for p in load_map(file).places.values()] == ["dock", "room-2", "desk"]


def test_passages_too_narrow_for_a_larger_robot_are_named(tmp_path: Path) -> None:
    file = tmp_path / "plan.yaml"
    two = [Place("a", 1.0, 3.0), Place("b", 7.0, 3.0)]
    save_map(TopoMap("plan", two, [Passage("a", "b", 6.0, 0.6)]), file)
    assert invoke("map", "check", file).exit_code == 0
    done = invoke("map", "check", file, "--robot", "husky")
    assert done.exit_code == 1
    assert "a - b" in done.stdout
    assert "0.6 m wide" in done.stdout
