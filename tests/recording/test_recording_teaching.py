"""Teaching: a recorded drive becomes a map that can be driven; what cannot is refused by reason."""

import json
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from bag_samples import image, imu, joints, write_bag
from cli_calls import answer, invoke, output, refusal
from scripted_run import FakeSimulator

from navfw.config import find
from navfw.errors import ConfigError
from navfw.localization.place_probabilities import load_table
from navfw.missions import prepare
from navfw.missions.run_report import write_run
from navfw.plugins import default_registry
from navfw.recording import Bag, RunFolder, ros_image
from navfw.recording.teaching import Taught, TeachingDrive, recorded_drive, teach
from navfw.robot import RobotModel
from navfw.signals import Encoders, Pose, SensorReading, Twist
from navfw.sim import SceneGeometry, load_world
from navfw.stack import MappingStack
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


def parts(drive: list[SensorReading]) -> list[tuple[int, int, str]]:
    """First and last reading of each part of a drive, and why it ended."""
    empty = TopoMap("none", [Place("start", 0.0, 0.0)], [])
    stack = MappingStack.load(find("stack", "explore"), ROBOT, empty, default_registry())
    stack.start(Pose(0.0, 0.0, 0.0), [])
    for reading in drive:
        stack.step(reading)
    times = [reading.time for reading in drive]
    return [(times.index(p.begin), times.index(p.end), p.why) for p in stack.parts]


def stripped(reading: SensorReading, *missing: str) -> SensorReading:
    """A reading without some sensors."""
    if "gyro" in missing:
        rates = replace(reading.inertial, roll_rate=np.nan, pitch_rate=np.nan, yaw_rate=np.nan)
        reading = replace(reading, inertial=rates)
    if "wheels" in missing:
        reading = replace(reading, encoders=Encoders(reading.time, 7, 7))
    return replace(reading, frame=None) if "camera" in missing else reading


def taught(drive: TeachingDrive, readings: list[SensorReading]) -> Taught:
    return teach([replace(drive, readings=lambda: readings)], "taught")


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("taught") / "run", "paper-room", "through-the-door")


@pytest.mark.thorough
def test_a_taught_map_fits_the_world_and_is_driven(drive: Path, tmp_path: Path) -> None:
    target = tmp_path / "maps" / "taught.yaml"
    done = invoke("map", "teach", drive, "--out", target, "--name", "5=dock", "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert summary["parts"][0]["map"] == "taught"
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


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("elsewhere") / "run"
    return recorded(folder, "office", "lobby-to-lab", "mission.timeout=25")


@pytest.mark.slow
def test_drives_in_different_buildings_give_two_maps(
    drive: Path, elsewhere: Path, tmp_path: Path
) -> None:
    (tmp_path / "both-2.yaml").write_text("name: of somebody else\n")
    done = invoke("map", "teach", drive, elsewhere, "--out", tmp_path / "both.yaml")
    assert done.exit_code == 0, done.output
    assert "2 maps, both and both-3: what they show does not certainly overlap" in done.stdout
    assert f"{elsewhere / 'run.mcap'}: 0.0 to" in done.stdout
    assert "in both-3" in done.stdout
    assert (tmp_path / "both-2.yaml").read_text() == "name: of somebody else\n"
    maps = [load_map(tmp_path / f"{name}.yaml") for name in ("both", "both-3")]
    for topo_map, world in zip(maps, ("paper-room", "office"), strict=True):
        plan = SceneGeometry.from_world(load_world(Path(f"worlds/{world}/world.yaml")))
        walls = topo_map.floor_plan
        assert walls is not None
        surfaces = np.abs(plan.clearances(walls.centres(*np.nonzero(walls.occupied))))
        assert np.percentile(surfaces, 90) < 0.15


@pytest.mark.slow
def test_parts_of_a_drive_that_do_not_overlap_give_maps_of_their_own(
    drive: Path, elsewhere: Path
) -> None:
    first, second = recorded_drive(drive), recorded_drive(elsewhere)
    before = first.readings()
    after = [replace(r, time=r.time + 100.0) for r in second.readings()]
    made = teach([replace(first, readings=lambda: [*before, *after])], "m", [(110.0, "desk")])
    assert [part.in_map for part in made.parts] == ["m", "m-2"]
    assert "a gap of" in made.parts[0].why
    assert "desk" in made.maps[1].topo_map.places
    assert "desk" not in made.maps[0].topo_map.places
    alone = teach([first], "m").maps[0].topo_map.floor_plan
    plan = made.maps[0].topo_map.floor_plan
    assert alone is not None
    assert plan is not None
    assert np.array_equal(plan.cells, alone.cells)  # what came after is not in it


@pytest.mark.slow
def test_two_drives_through_the_same_rooms_become_one_map(tmp_path: Path) -> None:
    folders = [
        recorded(tmp_path / f"run{seed}", "office", "kitchen-tour", seed=seed) for seed in (0, 1)
    ]
    drives = [recorded_drive(folder) for folder in folders]
    first, both = teach(drives[:1], "one"), teach(drives, "both")
    assert [part.in_map for part in both.parts] == ["both", "both"]
    plans = first.maps[0].topo_map.floor_plan, both.maps[0].topo_map.floor_plan
    sizes = [0 if plan is None else int(plan.free.sum()) for plan in plans]
    assert 0.9 * sizes[0] < sizes[1] < 1.15 * sizes[0]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "missing",
    [("wheels", "gyro"), *(pytest.param((k,), marks=pytest.mark.slow) for k in ("wheels", "gyro"))],
)
def test_the_floor_takes_the_place_of_missing_sensors(
    missing: tuple[str, ...], drive: Path
) -> None:
    whole = recorded_drive(drive)
    made = taught(whole, [stripped(reading, *missing) for reading in whole.readings()])
    said = f"{whole.file}: "
    said += (
        "no wheels: the scale is by the camera's height of 0.35 m"
        if "wheels" in missing
        else "no gyro"
    )
    assert made.notes[0].startswith(said)
    full = teach([whole], "full")
    assert made.parts[0].path == pytest.approx(full.parts[0].path, rel=0.01)
    pairs = zip(made.maps[0].keys, full.maps[0].keys, strict=True)
    assert max(math.dist((a.pose.x, a.pose.y), (b.pose.x, b.pose.y)) for a, b in pairs) < 0.1
    walls, plan = made.maps[0].topo_map.floor_plan, load_world(Path("worlds/paper-room/world.yaml"))
    assert walls is not None
    away = SceneGeometry.from_world(plan).clearances(walls.centres(*np.nonzero(walls.occupied)))
    assert np.percentile(np.abs(away), 90) < 0.15


@pytest.mark.thorough
def test_without_wheels_a_drive_is_split_where_the_floor_is_not_seen(drive: Path) -> None:
    whole = recorded_drive(drive)
    blind = [
        replace(r, frame=replace(r.frame, image=np.full_like(r.frame.image, 90)))
        if r.frame is not None and 6.0 < r.time < 7.0
        else r
        for r in (stripped(r, "wheels") for r in whole.readings())
    ]
    made = taught(whole, blind)
    assert "a gap of 1." in made.parts[0].why
    assert made.parts[0].end == pytest.approx(6.0, abs=0.1)


def test_an_undisturbed_drive_is_one_part() -> None:
    drive = readings(20.0, 0.5)
    assert [(a, b, why) for a, b, why in parts(drive)] == [(0, len(drive) - 1, "")]


def test_a_gap_splits_the_drive() -> None:
    drive = readings(10.0)
    cut = [*drive[:200], *drive[300:]]
    assert [(a, b) for a, b, _ in parts(cut)] == [(0, 199), (200, len(cut) - 1)]
    assert "a gap of 1.7 s" in parts(cut)[0][2]


def test_a_jump_of_the_wheels_splits_the_drive() -> None:
    drive = readings(6.0)
    jumped = [
        reading
        if k < 100
        else replace(reading, encoders=replace(reading.encoders, left=reading.encoders.left + 5000))
        for k, reading in enumerate(drive)
    ]
    assert [(a, b) for a, b, _ in parts(jumped)] == [(0, 99), (100, len(drive) - 1)]


def test_a_dark_camera_splits_the_drive() -> None:
    drive = readings(12.0)
    dark = [
        replace(r, frame=replace(r.frame, image=np.zeros_like(r.frame.image)))
        if r.frame is not None and 2.0 < r.time < 9.0
        else r
        for r in drive
    ]
    found = parts(dark)
    assert "no image shows anything" in found[0][2]
    assert len(found) >= 2


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
    assert any("carried" in why for _, _, why in parts(carried))


@pytest.mark.parametrize("missing", ["gyro", "wheels", "camera"])
def test_a_sensor_that_nothing_replaces_is_named(missing: str) -> None:
    drive = TeachingDrive(Path("run.mcap"), ROBOT, lambda: ())
    plain = [
        replace(r, frame=replace(r.frame, image=np.full_like(r.frame.image, 90)))
        if r.frame is not None
        else r
        for r in readings(2.0)
    ]
    with pytest.raises(ConfigError, match=f"run.mcap: a map needs (a )?{missing}") as refused:
        taught(drive, [stripped(reading, missing) for reading in plain])
    assert missing == "camera" or "found in 0% of the images" in str(refused.value)


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


@pytest.mark.slow
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
    for table, said in (
        ("gyro", "no gyro: turns are by"),
        ("wheels", "no wheels: the scale is by"),
    ):
        (folder / f"{table}.csv").unlink()
        done = answer("map", "teach", folder, "--out", tmp_path / "maps" / f"no-{table}.yaml")
        assert said in done["notes"][0]
        plan = load_map(tmp_path / "maps" / f"no-{table}.yaml").floor_plan
        assert plan is not None
        assert float(plan.free.sum()) == pytest.approx(plans[2], rel=0.1)


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
