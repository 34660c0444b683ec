"""Robot files, their URDFs, and the robots of missions: names, changes, frames, wrong ones."""

import math
import re
from pathlib import Path

import pytest
from cli_calls import invoke, put_files, refusal, sole_refusal

from navfw.errors import InputError, UnknownNameError
from navfw.missions import prepare
from navfw.missions.missionfile import load_mission
from navfw.missions.session_setup import split_overrides
from navfw.robot import RobotModel, load_robot
from navfw.robot.urdf import read_urdf
from navfw.robot.urdf_measures import robot_assumed
from navfw.sim import SensorParams

MISSION = "start: [1, 1, 0]\ngoals: [{x: 3, y: 1}]\n"
TALL = "description: tall\nradius: 0.25\ncamera: {mount_height: 0.8, pitch: 0.2}\nheight: 0.9\n"
SHIPPED = Path(__file__).parents[2] / "navfw" / "robot" / "robots"
URDF = (SHIPPED / "urdf" / "cart.urdf").read_text()
ROBOT = (SHIPPED / "cart.yaml").read_text().replace("urdf/cart.urdf", "own.urdf")
QUICK = "base: tall\nmax_v: 1.1\ncamera: {rate: 20}\n"


@pytest.fixture
def project(workdir: Path) -> Path:
    """A project with two robots, the second based on the first, and one with a URDF."""
    robots = {"tall.yaml": TALL, "quick.yaml": QUICK, "own.urdf": URDF, "own.yaml": ROBOT}
    put_files(workdir / "robots", robots)
    (workdir / "navfw.toml").touch()
    return workdir


def robot_of(folder: Path, text: str, *options: str) -> RobotModel:
    """The robot of a mission with ``text`` in its file and these arguments of ``--set``."""
    file = folder / "mission.yaml"
    file.write_text(MISSION + text)
    return load_mission(file, split_overrides(options)[0]).spec.robot


def test_the_default_robot_has_the_default_values_or_those_of_the_project(project: Path) -> None:
    default = RobotModel(odometry=SensorParams.preset("default").sheet)
    assert robot_of(project, "") == default
    assert robot_of(project, "robot:\n") == default
    assert robot_of(project, "robot: default\n") == default
    (project / "robots" / "default.yaml").write_text("radius: 0.2\n")
    assert robot_of(project, "").radius == 0.2


def test_a_robot_has_the_values_of_its_base_and_a_mission_changes_it(project: Path) -> None:
    quick = load_robot("quick")
    assert (quick.radius, quick.max_v, quick.camera.rate) == (0.25, 1.1, 20.0)
    assert (quick.camera.mount_height, quick.description) == (0.8, "tall")
    assert robot_of(project, "robot: tall\n").radius == 0.25
    changed = robot_of(project, "robot: {base: quick, max_v: 0.7, camera: {width: 320}}\n")
    assert (changed.max_v, changed.radius, changed.camera.width) == (0.7, 0.25, 320)
    assert changed.camera.mount_height == 0.8
    assert robot_of(project, "robot: {max_v: 0.7}\n").radius == RobotModel().radius
    (project / "beside.yaml").write_text("base: quick\nmax_v: 0.9\n")
    assert robot_of(project, "robot: ./beside.yaml\n").max_v == 0.9


def test_options_choose_and_change_the_robot(project: Path) -> None:
    text = "robot: {base: tall, max_v: 0.3}\n"
    assert robot_of(project, text, "robot.max_w=1").max_v == 0.3
    # a robot chosen by an option takes the place of all that the mission says of it
    chosen = robot_of(project, text, "robot=quick", "robot.max_w=1")
    assert (chosen.max_v, chosen.max_w) == (1.1, 1.0)
    assert robot_of(project, "robot: tall\n", "robot.max_v=0.2").max_v == 0.2
    assert robot_of(project, "robot: tall\n", "robot.base=quick").max_v == 1.1


def test_the_error_data_of_a_robot_file_take_precedence(project: Path) -> None:
    (project / "robots" / "slippery.yaml").write_text("odometry: {slip: 0.1}\n")
    sheet = robot_of(project, "robot: slippery\nsensors: {preset: poor}\n").odometry
    assert sheet.slip == 0.1
    assert sheet.gyro_noise == SensorParams.preset("poor").sheet.gyro_noise


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ("robot: tal\n", r"mission.yaml:3: robot: unknown robot 'tal': did you mean 'tall'"),
        ("robot: ./none.yaml\n", r"mission.yaml:3: robot: .*none.yaml"),
        ("robot: {max_w: 1, base: qick}\n", r"mission.yaml:3: robot: .* did you mean 'quick'"),
        ("robot: 3\n", r"mission.yaml:3: robot: expected"),
        ("robot: {base: 3}\n", r"mission.yaml:3: robot.base: unknown key"),
        ("robot: {base: tall, max_q: 1}\n", r"mission.yaml:3: robot.max_q: unknown key"),
        ("robot: {base: tall, track: 0.6}\n", r"track 0.6 m is wider than the body"),
    ],
)
def test_wrong_robots_of_missions(project: Path, robot: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        robot_of(project, robot)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("radius: -1\n", "robots/wrong.yaml:1: radius: expected a number >= 0.03"),
        ("radios: 0.2\n", "robots/wrong.yaml:1: radios: unknown key; did you mean 'radius'"),
        ("base: wrong\n", "robots/wrong.yaml:1: base: the robot is based on itself"),
        ("base: tal\n", "robots/wrong.yaml:1: base: unknown robot 'tal': did you mean 'tall'"),
        ("", "robots/wrong.yaml: the file is empty"),
    ],
)
def test_wrong_robot_files(project: Path, text: str, message: str) -> None:
    (project / "robots" / "wrong.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        load_robot("wrong")
    with pytest.raises(InputError, match=message):
        robot_of(project, "robot: wrong\n")


def test_an_unknown_robot_of_an_option(project: Path) -> None:
    with pytest.raises(UnknownNameError, match="--set robot=tal: unknown robot 'tal'"):
        robot_of(project, "", "robot=tal")
    for command in (["run", "empty", "straight"], ["suite", "rooms", "--seeds", "0:1"]):
        message = "--robot: unknown robot 'tal': did you mean 'tall'"
        assert message in refusal(*command, "--robot", "tal")


def test_the_camera_is_at_its_link_unless_the_robot_file_has_a_mount(project: Path) -> None:
    camera = load_robot("own").camera
    mount = (camera.mount_forward, camera.mount_height, camera.pitch)
    assert mount == pytest.approx((0.16, 0.38, 0.08))
    (project / "robots" / "own.yaml").write_text(ROBOT + "camera: {mount_height: 0.5, rate: 15}\n")
    camera = load_robot("own").camera
    assert (camera.mount_height, camera.rate) == (0.5, 15.0)
    assert camera.mount_forward == pytest.approx(0.16)


def test_a_robot_based_on_another_has_its_urdf(project: Path) -> None:
    (project / "fast.yaml").write_text("base: own\nmax_v: 0.9\n")
    robot = load_robot("./fast.yaml")
    assert robot.urdf is not None
    assert robot.urdf.file == str(project / "robots" / "own.urdf")


def test_frames_follow_the_chain_of_joints(project: Path) -> None:
    child = '\n    <child link="camera"/>'
    turned = URDF.replace('xyz="0 -0.13 0.075"', 'xyz="0 -0.13 0.075" rpy="0 0 1.5707963"')
    turned = turned.replace(f'"base_link"/>{child}', f'"right_wheel"/>{child}')
    file = project / "robots" / "own.urdf"
    file.write_text(turned)
    frame = read_urdf(file).frame_of("camera")
    assert frame[:3, 3] == pytest.approx([0.0, -0.13 + 0.16, 0.075 + 0.38], abs=1e-6)
    assert math.atan2(frame[1, 0], frame[0, 0]) == pytest.approx(0.5 * math.pi)


MESH = '<mesh filename="meshes/hull.stl"/>'
BOX = '<box size="0.44 0.32 0.18"/>'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[left_axle]", "[left_axl]", r"own.yaml:5: urdf.left\[0\]: unknown movable joint .* did"),
        ("[left_axle]", "[camera_mount]", r"urdf.left\[0\]: unknown movable joint of the URDF"),
        ("[right_axle]", "[left_axle]", r"own.yaml:6: urdf.right\[0\]: .* named twice"),
        ("camera: camera", "camera: kamera", r"own.yaml:8: urdf.camera: unknown link .* 'camera'"),
        ("rear_caster_mount", "rear_castor", r"own.yaml:7: urdf.casters\[1\]: unknown joint"),
        ("own.urdf", "none.urdf", r"own.yaml:4: urdf.file: .*none.urdf"),
        ("own.urdf", "pybullet_data:x.urdf", r"own.yaml:4: urdf.file: .*x.urdf"),
        (
            "radius: 0.075",
            "radius: 0.1",
            r"wheel_radius: wheels of 0.1 m, but .* radius of 0.075 m",
        ),
        ("track", "radius: 0.3\ntrack", r"radius 0.3 m is not half the footprint's width"),
    ],
)
def test_wrong_robot_files_with_a_urdf(project: Path, old: str, new: str, message: str) -> None:
    assert old in ROBOT
    (project / "robots" / "own.yaml").write_text(ROBOT.replace(old, new))
    with pytest.raises(InputError, match=message):
        prepare("empty", "straight", overrides=["robot=own"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<axis xyz="0 1 0"/>', '<axis xyz="1 0 0"/>', "the axis of 'left_axle' is not across"),
        ('type="continuous"', 'type="ball"', "'left_axle': expected a type of .* got 'ball'"),
        ('xyz="0.16 0 0.38"', 'xyz="0.16 nan 0.38"', "expected 3 numbers, got '0.16 nan 0.38"),
        ('<robot name="cart">', "<robot name='cart'", "own.urdf:.*it is not XML"),
        ("<?xml", "<!DOCTYPE x []><?xml", "own.urdf:1: "),
    ],
)
def test_wrong_urdfs(project: Path, old: str, new: str, message: str) -> None:
    assert old in URDF
    (project / "robots" / "own.urdf").write_text(URDF.replace(old, new))
    with pytest.raises(InputError, match=message) as raised:
        load_robot("own")
    assert "own.yaml" in str(raised.value)


CART = '<inertia ixx="0.08" iyy="0.14" izz="0.18" ixy="0" ixz="0" iyz="0"/>'
CASTER = '<inertia ixx="0.00005" iyy="0.00005" izz="0.00005" ixy="0" ixz="0" iyz="0"/>'
WHEEL = '<inertia ixx="0.0008" iyy="0.0014" izz="0.0008" ixy="0" ixz="0" iyz="0"/>'


def inertia_notes(robot: RobotModel) -> tuple[str, ...]:
    return tuple(str(note) for note in robot_assumed(robot) if "inertia" in note.what)


@pytest.mark.parametrize(
    ("old", "moments", "told"),
    [
        (
            CART,
            (0.08, 0.14, 0.23, 0.0),
            "'base_link': .*, as no body of 8 kg .* 0.08, 0.14, 0.23 kg",
        ),
        (CART, (0.08, 0.14, -0.1, 0.0), "'base_link'.* -0.1, 0.08, 0.14"),
        (CART, (0.08, 0.14, 0.18, 0.12), "'base_link'.* -0.014, 0.18, 0.23"),
        (CART, (9.0, 9.0, 9.0, 0.0), "'base_link'.* izz = 0.09, 0.15, 0.2"),
        (CART, (1e-6, 1e-6, 1e-6, 0.0), "'base_link'.* 1e-06, 1e-06, 1e-06"),
        (WHEEL, (0.03, 0.03, 0.03, 0.0), "'left_wheel'.* izz = 0.0019, 0.0019, 0.0019"),
        (CART, (0.3, 0.3, 0.3, 0.0), ""),
        (CASTER, (1e-3, 1e-3, 1e-3, 0.0), ""),  # too little to matter
    ],
    ids=["triangle", "negative", "product", "large", "small", "wheel", "possible", "negligible"],
)
def test_an_inertia_that_no_body_can_have_is_told_with_one_that_would_do(
    project: Path, old: str, moments: tuple[float, ...], told: str
) -> None:
    xx, yy, zz, xy = moments
    new = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="0" iyz="0"/>'
    (project / "robots" / "own.urdf").write_text(URDF.replace(old, new))
    notes = inertia_notes(load_robot("own"))
    if told:
        assert re.search(rf"own.urdf:\d+: inertia of link {told}", notes[0])
    else:
        assert notes == ()
    with prepare("empty", "straight", overrides=["robot=own"]).simulation() as sim:
        start = sim.true_pose()
        for _ in range(120):
            sim.drive(4.0, 4.0)
            sim.advance(1.0 / 60.0)
        assert sim.true_pose().x - start.x == pytest.approx(0.6, abs=0.04)


def test_shipped_robots_have_possible_inertias_and_no_missing_mesh() -> None:
    for name in ("default", "cart", "husky", "racecar"):
        assert inertia_notes(load_robot(name)) == ()


def test_a_run_tells_of_an_impossible_inertia(project: Path) -> None:
    (project / "robots" / "own.urdf").write_text(URDF.replace('ixx="0.08"', 'ixx="8"'))
    answer = invoke("run", "empty", "straight", "--robot", "own", "--set", "mission.timeout=0.2")
    assert "assumed: robots/own.urdf:8: inertia of link 'base_link': that of a box" in answer.stderr


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("own.urdf", BOX, MESH, "mesh 'meshes/hull.stl' does not exist; copy it"),
        ("own.yaml", "width: 0.32", "width: 1.2", "no path is 1.2 m wide; too narrow: "),
        ("own.yaml", "rear: 0.22", "rear: 2.5", "lab.yaml:3: start: part of the robot's body at"),
    ],
)
def test_a_run_is_refused_before_it_begins(
    project: Path, file: str, old: str, new: str, message: str
) -> None:
    path = project / "robots" / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    assert message in sole_refusal("run", "office", "lobby-to-lab", "--robot", "own")
    assert not (project / "runs").exists()
