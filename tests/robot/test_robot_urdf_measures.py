"""What is read from URDF and xacro files: measures, cameras, packages, meshes, expressions."""

import os
import re
from pathlib import Path
from xml.etree.ElementTree import Element

import pytest
from cli_calls import invoke, put_files, refusal
from hypothesis import given
from hypothesis import strategies as st

from navfw.config import foreign_files
from navfw.errors import InputError
from navfw.missions import prepare
from navfw.robot import load_robot
from navfw.robot.urdf import read_urdf
from navfw.robot.urdf_measures import robot_assumed, robot_notes
from navfw.robot.xacro_expansion import _check_expression

WHEEL = """<link name="{side}_wheel"><collision><origin rpy="1.5707963 0 0"/>
  <geometry><cylinder radius="0.07" length="0.03"/></geometry></collision>
  <inertial><mass value="0.3"/>
  <inertia ixx="0.0008" iyy="0.0014" izz="0.0008" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{side}_joint" type="continuous"><parent link="base"/><child link="{side}_wheel"/>
  <origin xyz="0.02 {y} 0.05"/><axis xyz="0 1 0"/></joint>
"""
BODY = """<link name="base"><collision><origin xyz="0 0 0.1"/>
  <geometry><box size="0.4 0.3 0.1"/></geometry></collision>
  <inertial><mass value="5"/><origin xyz="0 0 0.05"/>
  <inertia ixx="0.05" iyy="0.07" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="ball"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
<joint name="castor_joint" type="fixed"><parent link="base"/><child link="ball"/>
  <origin xyz="-0.15 0 0"/></joint>
"""
CAMERA = """<link name="camera_link"/>
<joint name="camera_joint" type="fixed"><parent link="base"/><child link="camera_link"/>
  <origin xyz="0.18 0 0.3" rpy="0 0.1 0"/></joint>
<gazebo reference="camera_link"><sensor name="c" type="camera"><update_rate>15.0</update_rate>
  <camera><horizontal_fov>1.2</horizontal_fov>
  <image><width>320</width><height>240</height></image></camera></sensor></gazebo>
"""
WHEELS = WHEEL.format(side="left", y=0.14) + WHEEL.format(side="right", y=-0.14)
URDF = f"<robot name='bot'>{BODY}{WHEELS}{CAMERA}</robot>"
XACRO = """<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:include filename="$(find bot_description)/urdf/parts.xacro"/>
<xacro:property name="half" value="${0.28 / 2}"/>
%s<xacro:wheel side="left" y="${half}"/><xacro:wheel side="right" y="${-half}"/>%s</robot>
"""
PARTS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="wheel" params="side y">%s</xacro:macro></robot>
"""
BOX = '<box size="0.4 0.3 0.1"/>'
DAMAGED = {
    "bad.dae": "<COLLADA/>",
    "bad.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9999999\n",
    "empty.dae": "",
}
TRIANGLE = "solid x\nfacet normal 0 0 1\nouter loop\n" + "vertex 0 0 0\n" * 3
TRIANGLE += "endloop\nendfacet\nendsolid\n"


@pytest.fixture
def project(workdir: Path) -> Path:
    parts = PARTS % re.sub(r"\{(\w+)\}", r"${\1}", WHEEL)
    files = {
        "navfw.toml": "",
        "bot.urdf": URDF,
        "bot.urdf.xacro": XACRO % (BODY, CAMERA),
        "ros/bot_description/urdf/parts.xacro": parts,
        "robots/own.yaml": "urdf: {file: ../bot.urdf}\n",
    }
    put_files(workdir, files)
    return workdir


@pytest.mark.parametrize("file", ["bot.urdf", "bot.urdf.xacro", "own"])
def test_a_urdf_alone_makes_a_robot(
    project: Path, monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere{os.pathsep}{project / 'ros'}")
    robot = load_robot(file)
    assert robot.urdf is not None
    assert (robot.urdf.left, robot.urdf.right) == (("left_joint",), ("right_joint",))
    assert (robot.urdf.casters, robot.urdf.camera) == (("castor_joint",), "camera_link")
    assert (robot.wheel_radius, robot.track) == (0.07, 0.28)
    assert robot.footprint is not None
    body = (robot.footprint.front, robot.footprint.rear, robot.footprint.width)
    assert body == pytest.approx((0.18, 0.22, 0.31))
    assert robot.height == pytest.approx(0.32)  # the camera's; the floor is 2 cm below the base
    camera = robot.camera
    assert (camera.width, camera.height, camera.hfov, camera.rate) == (320, 240, 1.2, 15.0)
    mount = (camera.mount_forward, camera.mount_height, camera.pitch)
    assert mount == pytest.approx((0.16, 0.32, 0.1))
    assert robot_notes(robot) == ()
    # a mission's robot has the same values
    spec = prepare("empty", "straight", overrides=[f"robot={file}"]).mission.spec
    assert (spec.robot.track, spec.robot.camera) == (robot.track, robot.camera)


def test_what_the_robot_file_says_otherwise_holds_and_is_told(project: Path) -> None:
    text = "urdf: {file: ../bot.urdf}\ntrack: 0.31\ncamera: {hfov: 1.0, mount_height: 0.5}\n"
    (project / "robots" / "own.yaml").write_text(text)
    robot = load_robot("own")
    assert (robot.track, robot.camera.hfov, robot.camera.mount_height) == (0.31, 1.0, 0.5)
    assert [note.split("bot.urdf: ")[1] for note in robot_notes(robot)] == [
        "track is 0.28, the robot has 0.31",
        "camera.hfov is 1.2, the robot has 1",
    ]
    answer = invoke("run", "empty", "straight", "--robot", "own", "--set", "mission.timeout=0.2")
    assert "bot.urdf: track is 0.28, the robot has 0.31" in answer.stderr


def test_four_wheels_skid_and_carried_ones_are_casters(project: Path) -> None:
    rear = WHEELS.replace("left_", "back_left_").replace("right_", "back_right_")
    swivel = """<link name="fork"/><joint name="swivel" type="continuous"><parent link="base"/>
    <child link="fork"/><axis xyz="0 0 1"/></joint>"""
    carried = WHEEL.format(side="rolling", y=0.05).replace('"base"', '"fork"')
    rear = rear.replace("0.02 ", "-0.2 ")
    more = rear + swivel + carried + "</robot>"
    (project / "bot.urdf").write_text(URDF.replace("</robot>", more))
    robot = load_robot("bot.urdf")
    assert robot.urdf is not None
    assert robot.urdf.left == ("left_joint", "back_left_joint")
    assert robot.urdf.casters == ("castor_joint", "swivel", "rolling_joint")
    assert (robot.skid, robot.urdf.side_friction) == (0.08, 0.2)


def test_without_a_camera_one_is_supposed_and_told(project: Path) -> None:
    (project / "bot.urdf").write_text(URDF.replace(CAMERA, ""))
    robot = load_robot("bot.urdf")
    assert (robot.camera.mount_height, robot.height) == (0.35, 0.35)
    (assumed,) = robot_assumed(robot)
    assert str(assumed) == (
        "camera: 0.35 m above the floor, as bot.urdf has none (camera.mount_height)"
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (BOX, '<mesh filename="a.stl"/>', r"bot.urdf:\d+: mesh 'a.stl' does not exist; copy"),
        (
            BOX,
            '<mesh filename="empty.stl"/>',
            r"mesh 'empty.stl': empty.stl: has no triangles; export",
        ),
        (BOX, '<mesh filename="none.stl"/>', r"mesh 'none.stl': none.stl: "),
        (BOX, '<mesh filename="none.obj"/>', r"none.obj: has no triangles; export"),
        (
            BOX,
            '<mesh filename="bad.obj"/>',
            r"bad.obj:4: expected the number of a vertex from 1 to",
        ),
        (BOX, '<mesh filename="bad.dae"/>', r"mesh 'bad.dae': bad.dae: "),
        (BOX, '<mesh filename="file:///no/a.stl"/>', r"mesh 'file:///no/a.stl' does not exist"),
        (BOX, '<mesh filename="package://b/a.stl"/>', r"name the folder with its package in urdf"),
        ('name="right_joint" type="continuous"', 'name="x" type="fixed"', "no wheels in pairs"),
    ],
)
def test_urdfs_that_make_no_robot(project: Path, old: str, new: str, message: str) -> None:
    assert old in URDF
    meshes = {"empty.stl": "", "none.stl": "solid x\nendsolid x\n" + 80 * " ", "full.stl": TRIANGLE}
    put_files(project, {**meshes, **DAMAGED, "none.obj": "# no face\nv 0 0 0\n"})
    (project / "bot.urdf").write_text(URDF.replace(old, new))
    with pytest.raises(InputError, match=message):
        load_robot("bot.urdf")
    assert "bot.urdf" in refusal("run", "empty", "straight", "--robot", "bot.urdf")


@pytest.mark.parametrize("name", ["gone.dae", *DAMAGED])
def test_a_mesh_that_is_only_seen_may_be_missing_or_damaged(project: Path, name: str) -> None:
    """PyBullet would end the process on it."""
    put_files(project, DAMAGED)
    seen = f'<visual><geometry><mesh filename="{name}"/></geometry></visual></link>'
    (project / "bot.urdf").write_text(URDF.replace("</link>", seen, 1))
    with prepare("empty", "straight", overrides=["robot=bot.urdf"]).simulation() as sim:
        assert sim.read().frame is not None


@pytest.mark.parametrize("root", ["ros", "ros/bot_description", "install"])
def test_packages_are_found_by_the_robot_file_and_by_ament(
    project: Path, monkeypatch: pytest.MonkeyPatch, root: str
) -> None:
    mesh = 'package://bot_description/meshes/hull.stl"/>'
    (project / "bot.urdf").write_text(URDF.replace(BOX, f'<mesh filename="{mesh}'))
    body = "footprint: {front: 0.2, rear: 0.2, width: 0.3}\n"
    said = f", packages: [../{root}]"
    folder = "ros"
    if root == "install":
        folder, said = "install/share", ""
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(project / "install"))
    put_files(project, {f"{folder}/bot_description/meshes/hull.stl": TRIANGLE})
    (project / "robots" / "own.yaml").write_text(f"urdf: {{file: ../bot.urdf{said}}}\n{body}")
    with prepare("empty", "straight", overrides=["robot=own"]).simulation() as sim:
        assert sim.read().frame is not None


def test_a_urdf_is_parsed_once_and_a_changed_one_again(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parsed: list[str] = []

    def counted(content: bytes, name: str, what: str) -> Element:
        parsed.append(name)
        return foreign_files.parse_xml(content, name, what)

    monkeypatch.setattr("navfw.robot.urdf.parse_xml", counted)
    (project / "bot.urdf").write_text(URDF.replace("'bot'", "'once'"))
    session = prepare("empty", "straight", overrides=["robot=bot.urdf"])
    robot_notes(session.mission.spec.robot)
    with session.simulation():
        assert len(parsed) == 1
    (project / "bot.urdf").write_text(URDF.replace("0.14", "0.15"))
    assert load_robot("bot.urdf").track == pytest.approx(0.3)
    assert len(parsed) == 2


def test_an_included_file_that_changed_is_read_again(project: Path) -> None:
    file = project / "bot.urdf.xacro"
    assert read_urdf(file, (str(project / "ros"),)).wheel_radii["left_wheel"] == 0.07
    parts = project / "ros" / "bot_description" / "urdf" / "parts.xacro"
    parts.write_text(parts.read_text().replace("0.07", "0.075"))
    assert read_urdf(file, (str(project / "ros"),)).wheel_radii["left_wheel"] == 0.075


def test_files_beside_the_xacro_file_are_read_from_any_folder(workdir: Path) -> None:
    joint = '<joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>'
    part = f'<robot><link name="b"/>{joint}</robot>'
    value = "${xacro.load_yaml('size.yaml')['w']}"
    body = f'<xacro:include filename="sub/part.xacro"/><link name="{value}"/></robot>'
    put_files(
        workdir,
        {
            "bot/urdf/sub/part.xacro": part,
            "bot/urdf/size.yaml": "w: c\n",
            "bot/urdf/bot.xacro": XACRO.partition("\n")[0] + body,
        },
    )
    assert read_urdf(workdir / "bot/urdf/bot.xacro").links == ("b", "c")


HARMLESS = ("radians(5)", "a.b['c'] + 1", "x if y == 'z' else [1, 2][0]", "max(1, 2) * pi ** 2")
HARMFUL = (
    "().__class__",
    "(x for x in [1]).gi_frame",
    "[x for x in [1]]",
    "lambda: 1",
    "'{0.__class__}'.format(1)",
    "xacro._x",
    "(y := 1)",
    "f'{x}'",
)


def test_expressions_calculate_and_do_no_more() -> None:
    for text in HARMLESS:
        _check_expression(text)
    for text in HARMFUL:
        with pytest.raises(ValueError, match="is not allowed"):
            _check_expression(text)


@given(st.text(max_size=30))
def test_any_text_is_checked_without_running_it(text: str) -> None:
    try:
        _check_expression(text)
    except (ValueError, SyntaxError):
        return
    assert "_" not in re.sub(r"\w_|'[^']*'|\"[^\"]*\"|#.*|\d_\d", "", text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("${().__class__}", "xacro: .*__class__ is not allowed"),
        ("${python.vars(python.type(1))}", "xacro: .*python"),
        ("$(eval 1 + 1)", r"\$\(eval ...\) is not allowed"),
        ("$(find nowhere)", "package 'nowhere' not found: name its folder in urdf.packages"),
        ("${1 +}", "xacro: .*1 +"),
        ("${'a' * 10 ** 10}", "xacro: "),
        ("<xacro:macro name='m' params=''><xacro:m/></xacro:macro><xacro:m/>", "xacro: "),
        ("<xacro:include filename='none.xacro'/>", "xacro: .*none.xacro"),
    ],
)
def test_xacro_that_is_refused(project: Path, text: str, message: str) -> None:
    value = text if text.startswith("<") else f'<link name="{text}"/>'
    head = '<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    (project / "bad.xacro").write_text(f"{head}{value}</robot>")
    (project / "xacrodoc.py").write_text("raise SystemExit('code of the folder was run')\n")
    with pytest.raises(InputError, match=message) as raised:
        load_robot("bad.xacro")
    assert "code of the folder" not in str(raised.value)
