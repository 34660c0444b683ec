"""URDFs of robot files: frames, and every way in which one can be wrong."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.errors import InputError
from navfw.missions import prepare
from navfw.robot import load_robot, read_urdf

SHIPPED = Path(__file__).parents[2] / "navfw" / "robot" / "robots"
URDF = (SHIPPED / "urdf" / "cart.urdf").read_text()
ROBOT = (SHIPPED / "cart.yaml").read_text().replace("urdf/cart.urdf", "own.urdf")


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with a URDF of its own, and a robot that names it."""
    (tmp_path / "navfw.toml").touch()
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "own.urdf").write_text(URDF)
    (tmp_path / "robots" / "own.yaml").write_text(ROBOT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_camera_is_at_its_link(project: Path) -> None:
    camera = load_robot("own").camera
    assert camera.mount_forward == pytest.approx(0.16)
    assert camera.mount_height == pytest.approx(0.38)
    assert camera.pitch == pytest.approx(0.08)


def test_a_mount_in_the_robot_file_takes_precedence(project: Path) -> None:
    (project / "robots" / "own.yaml").write_text(ROBOT + "camera: {mount_height: 0.5, rate: 15}\n")
    camera = load_robot("own").camera
    assert (camera.mount_height, camera.rate) == (0.5, 15.0)
    assert camera.mount_forward == pytest.approx(0.16)


def test_a_robot_based_on_another_has_its_urdf(project: Path) -> None:
    (project / "fast.yaml").write_text("base: own\nmax_v: 0.9\n")
    robot = load_robot("./fast.yaml")
    assert robot.urdf is not None
    assert robot.urdf.file == str(project / "robots" / "own.urdf")
    assert prepare("empty", "straight", overrides=["robot=own"]).stack.robot.urdf == robot.urdf


def test_frames_follow_the_chain_of_joints(project: Path) -> None:
    turned = URDF.replace('xyz="0 -0.13 0.075"', 'xyz="0 -0.13 0.075" rpy="0 0 1.5707963"').replace(
        '<parent link="base_link"/>\n    <child link="camera"/>',
        '<parent link="right_wheel"/>\n    <child link="camera"/>',
    )
    file = project / "robots" / "own.urdf"
    file.write_text(turned)
    frame = read_urdf(file).frame_of("camera")
    assert frame[:3, 3] == pytest.approx([0.0, -0.13 + 0.16, 0.075 + 0.38], abs=1e-6)
    assert math.atan2(frame[1, 0], frame[0, 0]) == pytest.approx(0.5 * math.pi)


MESH = '<mesh filename="meshes/{}"/>'
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
        ("radius: 0.075", "radius: 0.1", r"wheel_radius: 0.1 m, but .* radius of 0.075 m"),
        ("footprint", "# footprint", r"own.yaml:3: urdf: .* needs a footprint"),
        ("track", "radius: 0.3\ntrack", r"radius 0.3 m is not half the footprint's width"),
    ],
)
def test_wrong_robot_files(project: Path, old: str, new: str, message: str) -> None:
    assert old in ROBOT
    (project / "robots" / "own.yaml").write_text(ROBOT.replace(old, new))
    with pytest.raises(InputError, match=message):
        prepare("empty", "straight", overrides=["robot=own"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            BOX,
            MESH.format("hull.stl"),
            r"own.urdf:\d+: mesh 'meshes/hull.stl' does not exist; copy",
        ),
        (BOX, '<mesh filename="package://x/hull.stl"/>', r"mesh 'package://x.* replace the URI"),
        ('<axis xyz="0 1 0"/>', '<axis xyz="1 0 0"/>', "the axis of 'left_axle' is not across"),
        ('<child link="camera"/>', '<child link="eye"/>', "its child link 'eye' does not exist"),
        ('type="continuous"', 'type="ball"', "'left_axle': expected a type of .* got 'ball'"),
        ('xyz="0.16 0 0.38"', 'xyz="0.16 nan 0.38"', "expected 3 finite numbers"),
        ('<robot name="cart">', "<robot name='cart'", "own.urdf:.*it is not XML"),
        ("robot", "model", "expected a URDF <robot>, got <model>"),
        ("<?xml", "<!DOCTYPE x []><?xml", "own.urdf:1: "),
    ],
)
def test_wrong_urdfs(project: Path, old: str, new: str, message: str) -> None:
    assert old in URDF
    (project / "robots" / "own.urdf").write_text(URDF.replace(old, new))
    with pytest.raises(InputError, match=message) as raised:
        load_robot("own")
    assert "own.yaml" in str(raised.value)


def test_a_robot_wider_than_every_way_is_refused() -> None:
    with pytest.raises(InputError, match=r"no way is 0\.98 m wide; take a narrower"):
        prepare("office", "lobby-to-lab", overrides=["robot=cart", "robot.footprint.width=0.98"])


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (
            "own.yaml",
            "[left_axle]",
            "[left_axl]",
            "own.yaml:5: urdf.left[0]: unknown movable joint",
        ),
        (
            "own.urdf",
            BOX,
            MESH.format("hull.stl"),
            "mesh 'meshes/hull.stl' does not exist; copy it",
        ),
        ("own.yaml", "width: 0.32", "width: 1.2", "no way is 1.2 m wide; take a narrower robot"),
        (
            "own.yaml",
            "rear: 0.22",
            "rear: 2.5",
            "lobby-to-lab.yaml:3: start: part of the robot's body at the",
        ),
    ],
)
def test_a_run_is_refused_before_it_begins(
    project: Path, file: str, old: str, new: str, message: str
) -> None:
    path = project / "robots" / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    words = ["run", "office", "lobby-to-lab", "--robot", "own"]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 2
    assert message in answer.stderr
    assert answer.stdout == ""
    assert not (project / "runs").exists()
