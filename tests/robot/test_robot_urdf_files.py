"""URDFs as people have them: broken trees, mesh bodies, wheels with limits, casters, cameras."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh
from cli_calls import invoke, put_files, refusal
from sim_worlds import PERFECT

from navfw.errors import InputError
from navfw.missions import prepare
from navfw.robot import RobotModel, load_robot
from navfw.robot.urdf import read_urdf
from navfw.robot.urdf_measures import robot_assumed, robot_notes
from navfw.signals import Pose
from navfw.sim import Simulation, WorldSpec
from navfw.sim.worldspec import BoxSpec

INERTIAL = (
    '<inertial><mass value="{}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>"
)
BODY = '<box size="0.4 0.26 0.1"/>'
WHEEL = '<cylinder radius="0.06" length="0.03"/>'


def joint(name: str, child: str, kind: str = "fixed", more: str = "", parent: str = "base") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


def link(
    name: str, shape: str = "", mass: float = 0.0, tag: str = "collision", z: str = "0"
) -> str:
    solid = f'<{tag}><origin xyz="0 0 {z}"/><geometry>{shape}</geometry></{tag}>' if shape else ""
    inertial = INERTIAL.format(mass, i=0.01 * mass) if mass else ""
    return f'<link name="{name}">{inertial}{solid}</link>\n'


def wheel(side: str, y: float, kind: str = "continuous", limit: str = "") -> str:
    at = f'<origin xyz="0 {y} 0.06" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/>{limit}'
    return link(f"{side}_wheel", WHEEL, 0.3) + joint(f"{side}_joint", f"{side}_wheel", kind, at)


WHEELS = wheel("left", 0.15) + wheel("right", -0.15)
CASTER = link("ball", '<sphere radius="0.03"/>', 0.1)
CASTER += joint("third_joint", "ball", more='<origin xyz="-0.17 0 0.03"/>')
BASE = link("base", BODY, 5.0, z="0.12")
CAMERA = link("camera_link")
CAMERA += joint("camera_joint", "camera_link", more='<origin xyz="0.2 0 0.3" rpy="0 0.1 0"/>')
SENSOR = """<gazebo reference="{}"><sensor name="c" type="{}"><update_rate>{}</update_rate>{}
<camera><horizontal_fov>1.2</horizontal_fov><image><width>320</width><height>240</height></image>
</camera></sensor></gazebo>"""
USUAL = SENSOR.format("camera_link", "camera", 10, "").replace("1.2", "1.5707963")
USUAL = USUAL.replace("320", "160").replace("240", "120")


def robot(*parts: str) -> str:
    return "<robot name='bot'>\n" + "\n".join(parts) + "</robot>"


GOOD = robot(BASE, WHEELS, CASTER, CAMERA, USUAL)


@pytest.fixture
def folder(workdir: Path) -> Iterator[Path]:
    (workdir / "navfw.toml").touch()
    yield workdir


def drives(file: str) -> float:
    """How far [m] the robot gets in two seconds at 0.24 m/s."""
    with prepare("empty", "straight", overrides=[f"robot={file}"]).simulation() as sim:
        start = sim.true_pose()
        for _ in range(120):
            sim.drive(4.0, 4.0)
            sim.advance(1.0 / 60.0)
        return sim.true_pose().x - start.x


ORPHAN = GOOD.replace("</robot>", '\n<link name="orphan"/></robot>')
TREES = {
    "two roots": (ORPHAN, "bot.urdf:14: link 'orphan' is attached by no joint, and 'base' is"),
    "second joint": (GOOD.replace("right_joint", "left_joint"), "a second joint 'left_joint'"),
    "second link": (GOOD.replace("</robot>", link("ball") + "</robot>"), "a second link 'ball'"),
    "loop": (
        GOOD.replace("</robot>", joint("back", "base", parent="ball") + "</robot>"),
        "joint 'back' closes a loop of the links base, ball",
    ),
    "itself": (
        GOOD.replace("</robot>", link("x") + joint("j", "x", parent="x") + "</robot>"),
        "joint 'j' closes a loop of the links x; remove it",
    ),
    "two parents": (
        GOOD.replace("</robot>", joint("again", "ball", parent="camera_link") + "</robot>"),
        "joint 'again': its child link 'ball' hangs on joint 'third_joint'",
    ),
    "no link": ("<robot name='r'/>", "bot.urdf:1: the robot has no <link>"),
    "no name": (GOOD.replace('link name="ball"', "link"), "a <link> needs a name of 1 to 200"),
    "joint without name": (GOOD.replace('name="third_joint" ', ""), "a <joint> needs a name"),
    "long name": (GOOD.replace("ball", "b" * 2000), "needs a name of 1 to 200 characters"),
    "world": (
        GOOD.replace("</robot>", link("world") + joint("w", "base", parent="world") + "</robot>"),
        "link 'world' holds the robot in place: remove it",
    ),
    "misspelt": (GOOD.replace('child link="ball"', 'child link="bal"'), "did you mean 'ball'"),
    "negative mass": (GOOD.replace('mass value="0.1"', 'mass value="-1"'), "mass above 0 kg, got"),
    "mass nan": (
        GOOD.replace('mass value="0.1"', 'mass value="nan"'),
        "expected 1 number, got 'nan'",
    ),
    "cone": (GOOD.replace("<sphere", "<cone"), r"'ball': its <collision> needs one .* got <cone>"),
    "no radius": (GOOD.replace('radius="0.03"', ""), "got <sphere>; known: .*<sphere radius=>"),
    "negative size": (GOOD.replace('size="0.4', 'size="-0.4'), "bot.urdf:2: link 'base': expected"),
    "no axis": (GOOD.replace('xyz="0 0 1"', 'xyz="0 0 0"'), "'left_joint': expected an axis other"),
    "no geometry": (GOOD.replace('<sphere radius="0.03"/>', ""), "in <geometry>, got nothing"),
}


@pytest.mark.parametrize("what", TREES)
def test_broken_urdfs_are_refused_before_the_simulator_loads_them(folder: Path, what: str) -> None:
    text, message = TREES[what]
    assert text != GOOD
    (folder / "bot.urdf").write_text(text)
    with pytest.raises(InputError, match=message):
        load_robot("bot.urdf")
    assert "bot.urdf" in refusal("run", "empty", "straight", "--robot", "bot.urdf")


def test_what_is_only_seen_or_meant_for_others_does_no_harm(folder: Path) -> None:
    """Shapes and dynamics that PyBullet does not know would make it refuse the file."""
    seen = link("x", "<cone radius='1' length='1'/>", tag="visual") + joint("x_joint", "x")
    text = GOOD.replace("</robot>", f"{seen}<transmission name='t'/></robot>")
    text = text.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics/>', 1)
    (folder / "bot.urdf").write_text("\ufeff" + text)
    assert drives("bot.urdf") == pytest.approx(0.48, abs=0.04)


def test_a_urdf_in_one_long_line_is_driven(folder: Path) -> None:
    """As xacro writes it; PyBullet would cut words and numbers into two."""
    more = "".join(link(f"x{n}") + joint(f"j{n}", f"x{n}") for n in range(120))
    text = GOOD.replace("</robot>", f"{more}</robot>").replace("\n", " ")
    (folder / "bot.urdf").write_text(text)
    assert drives("bot.urdf") == pytest.approx(0.48, abs=0.04)
    more = more.replace('"x', '"y').replace('"j', '"k')
    (folder / "bot.urdf").write_text(text.replace("</robot>", f"{more}</robot>"))
    said = refusal("run", "empty", "straight", "--robot", "bot.urdf")
    assert "bot.urdf: has 244 joints, PyBullet takes 127" in said


def test_a_dummy_root_is_no_second_root(folder: Path) -> None:
    text = GOOD.replace("</robot>", link("foot") + joint("foot_joint", "base", parent="foot"))
    (folder / "bot.urdf").write_text(f"{text}</robot>")
    assert drives("bot.urdf") == pytest.approx(0.48, abs=0.04)


def test_what_the_simulator_prints_of_a_file_is_its_error(folder: Path) -> None:
    slider = '<axis xyz="1 0 0"/>'  # without <limit>, which it needs
    text = GOOD.replace("</robot>", link("x") + joint("slide", "x", "prismatic", slider))
    (folder / "bot.urdf").write_text(f"{text}</robot>")
    said = refusal("run", "empty", "straight", "--robot", "bot.urdf")
    assert "bot.urdf: PyBullet cannot load it: " in said
    assert "PRISMATIC without limits slide" in said


@pytest.mark.parametrize(
    ("inertial", "assumed"),
    [
        ('<inertial><mass value="0.1"/></inertial>', ["the file gives none"]),
        ('<inertial><mass value="0.1"/><inertia ixx="0.1"/></inertial>', ["principal moments"]),
        ('<inertial><origin xyz="0 0 0"/></inertial>', []),
        ('<inertial><mass value="0"/><inertia ixx="0"/></inertial>', []),
    ],
)
def test_a_mass_without_inertia_is_a_box(folder: Path, inertial: str, assumed: list[str]) -> None:
    text = GOOD.replace(INERTIAL.format(0.1, i=0.001), inertial)
    assert text != GOOD
    (folder / "bot.urdf").write_text(text)
    noted = [str(one) for one in robot_assumed(load_robot("bot.urdf"))]
    assert [why in note for why, note in zip(assumed, noted, strict=True)] == [True] * len(assumed)
    assert all("bot.urdf:7: inertia of link 'ball': that of a box" in note for note in noted)
    assert drives("bot.urdf") == pytest.approx(0.48, abs=0.04)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "dae"])
def test_the_footprint_of_a_mesh_is_its_extent_and_it_collides(folder: Path, kind: str) -> None:
    body = trimesh.creation.box((400.0, 260.0, 100.0))
    file = f"body.{kind[:3]}"
    body.export(folder / file, file_type=kind)
    mesh = f'<mesh filename="{file}" scale="0.001 0.001 0.001"/>'
    (folder / "bot.urdf").write_text(GOOD.replace(BODY, mesh))
    shaped = load_robot("bot.urdf")
    (folder / "box.urdf").write_text(GOOD)
    plain = load_robot("box.urdf")
    assert shaped.footprint == plain.footprint
    assert (shaped.height, shaped.camera) == (plain.height, plain.camera)
    assert [str(one) for one in robot_assumed(shaped)] == [
        f"footprint: 0.4 x 0.33 m, as the extent of its shapes, {file} (footprint)"
    ]
    assert robot_assumed(plain) == ()
    assert contacts(shaped) == ("crate",)


def contacts(model: RobotModel) -> tuple[str, ...]:
    """What the robot touches as it drives against a crate."""
    crate = BoxSpec(name="crate", at=(0.6, 0.0), size=(0.3, 2.0, 1.0))
    world = WorldSpec(name="hall", x=(-3, 3), y=(-3, 3), boxes=(crate,))
    with Simulation(world, model, Pose(-0.2, 0.0, 0.0), 0, PERFECT) as sim:
        for _ in range(180):
            sim.drive(4.0, 4.0)
            sim.advance(1.0 / 60.0)
        return sim.contacts


def test_a_mesh_in_millimetres_without_scale_is_refused(folder: Path) -> None:
    trimesh.creation.box((400.0, 260.0, 100.0)).export(folder / "body.stl")
    (folder / "bot.urdf").write_text(GOOD.replace(BODY, '<mesh filename="body.stl"/>'))
    with pytest.raises(InputError, match=r'bot.urdf:2: .*is 400 m large: give scale="0.001'):
        load_robot("bot.urdf")


def test_a_robot_without_collision_shapes_collides_as_it_is_seen(folder: Path) -> None:
    (folder / "bot.urdf").write_text(GOOD.replace("collision", "visual"))
    seen = load_robot("bot.urdf")
    (folder / "solid.urdf").write_text(GOOD)
    solid = load_robot("solid.urdf")
    assert (seen.footprint, seen.wheel_radius) == (solid.footprint, solid.wheel_radius)
    (assumed,) = robot_assumed(seen)
    assert assumed.what == "shapes of base, ball, left_wheel, right_wheel"
    assert contacts(seen) == contacts(solid) == ("crate",)
    # a part with a shape keeps it
    (folder / "bot.urdf").write_text(GOOD.replace(CASTER, link("x", BODY, tag="visual") + CASTER))
    text = GOOD.replace(
        "</robot>", link("x", '<box size="9 9 9"/>', tag="visual") + joint("j", "x")
    )
    (folder / "bot.urdf").write_text(f"{text}</robot>")
    assert load_robot("bot.urdf").footprint == solid.footprint


def test_wheels_of_meshes_have_the_radius_of_their_extent(folder: Path) -> None:
    trimesh.creation.cylinder(0.06, 0.03, sections=64).export(folder / "w.stl")
    (folder / "bot.urdf").write_text(GOOD.replace(WHEEL, '<mesh filename="w.stl"/>'))
    assert load_robot("bot.urdf").wheel_radius == pytest.approx(0.06, abs=1e-5)
    assert drives("bot.urdf") == pytest.approx(0.48, abs=0.04)


SHORT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
LIMITS = [
    '<limit lower="-1e16" upper="1e16" effort="1" velocity="1"/>',
    '<limit effort="10" velocity="10"/>',
    '<limit lower="-6.28" upper="6.28" effort="1" velocity="1"/>',
    "",
]


@pytest.mark.parametrize("limit", LIMITS)
def test_revolute_wheels_without_effective_limits_turn(folder: Path, limit: str) -> None:
    wheels = wheel("left", 0.15, "revolute", limit) + wheel("right", -0.15, "revolute", limit)
    (folder / "bot.urdf").write_text(GOOD.replace(WHEELS, wheels))
    model = load_robot("bot.urdf")
    assert [one.what for one in robot_assumed(model)] == [
        "joint 'left_joint'",
        "joint 'right_joint'",
    ]
    assert drives("bot.urdf") == pytest.approx(0.48, abs=0.04)


TWO = f'{WHEEL}</geometry></collision><collision><geometry><box size="0.1 0.1 0.05"/>'


@pytest.mark.parametrize(
    ("old", "new", "radius", "told"),
    [
        (WHEEL, TWO, 0.06, []),
        (WHEEL, '<box size="0.12 0.12 0.03"/>', 0.06, []),
        (WHEEL, "", 0.05, ["wheel radius: 0.05 m, as no wheel has a shape (wheel_radius)"]),
        (USUAL, "", 0.06, ["images: 90 degrees wide, 160 x 120 pixels, 10 Hz, as no sensor of a"]),
    ],
)
def test_what_no_shape_or_sensor_says_is_told(
    folder: Path, old: str, new: str, radius: float, told: list[str]
) -> None:
    text = GOOD.replace(old, new)
    text = (
        text
        if new
        else text.replace('<collision><origin xyz="0 0 0"/><geometry></geometry></collision>', "")
    )
    (folder / "bot.urdf").write_text(text)
    size = "{front: 0.2, rear: 0.2, width: 0.33}"
    put_files(folder, {"robots/own.yaml": f"urdf: {{file: ../bot.urdf}}\nfootprint: {size}\n"})
    model = load_robot("own")
    assert model.wheel_radius == pytest.approx(radius)
    assert [
        str(one)[: len(start)] for one, start in zip(robot_assumed(model), told, strict=True)
    ] == told


def test_numbers_of_sensors_in_any_notation_and_none_else(folder: Path) -> None:
    text = GOOD.replace("1.5707963</h", "1.0471976e+00</h").replace(">160<", ">640.0<")
    (folder / "bot.urdf").write_text(text)
    camera = load_robot("bot.urdf").camera
    assert (camera.hfov, camera.width) == (1.0471976, 640)
    (folder / "bot.urdf").write_text(GOOD.replace("1.5707963</h", "wide</h"))
    with pytest.raises(InputError, match=r"horizontal_fov: expected 1 number, got 'wide'"):
        load_robot("bot.urdf")


def test_what_reaches_below_the_wheels_is_told(folder: Path) -> None:
    (folder / "bot.urdf").write_text(GOOD.replace("-0.17 0 0.03", "-0.17 0 0.01"))
    (note,) = robot_notes(load_robot("bot.urdf"))
    assert note.endswith("link 'ball' reaches 0.02 m below the wheels, which it may lift")


def test_steered_wheels_are_held_straight(folder: Path) -> None:
    steer = '<origin xyz="0.2 0.1 0.06"/><axis xyz="0 0 1"/>' + SHORT
    front = link("knuckle", mass=0.05) + joint("steer", "knuckle", "revolute", steer)
    front += link("roll", WHEEL, 0.1) + joint(
        *("roll_joint", "roll", "continuous"),
        '<origin rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/>',
        parent="knuckle",
    )
    (folder / "bot.urdf").write_text(GOOD.replace(CASTER, front))
    (told,) = robot_assumed(load_robot("bot.urdf"))
    assert str(told).startswith("joint 'steer': held straight")


@pytest.mark.parametrize(
    ("left", "right", "message"),
    [
        ("left_joint", "right_join", r"urdf.right\[0\]: .*did you mean 'right_joint'"),
        ("right_joint", "left_joint", "'right_joint', a left wheel, is not left of 'left_joint'"),
    ],
)
def test_wheels_that_are_misnamed(folder: Path, left: str, right: str, message: str) -> None:
    sides = f"left: [{left}], right: [{right}]"
    put_files(folder, {"bot.urdf": GOOD, "own.yaml": f"urdf: {{file: bot.urdf, {sides}}}\n"})
    with pytest.raises(InputError, match=message):
        load_robot("own.yaml")


def test_files_that_are_no_robots(folder: Path) -> None:
    sdf = "<sdf version='1.6'><model name='bot'/></sdf>"
    put_files(folder, {"bot.sdf": sdf, "sdf.urdf": sdf})
    assert "bot.sdf:1: expected a mapping ('key: value' lines), got XML" in refusal(
        "run", "empty", "straight", "--robot", "bot.sdf"
    )
    assert "expected a URDF <robot>, got <sdf>" in refusal(
        "run", "empty", "straight", "--robot", "sdf.urdf"
    )


def with_wheels(kind: str, limit: str = "") -> str:
    return GOOD.replace(
        WHEELS, wheel("left", 0.15, kind, limit) + wheel("right", -0.15, kind, limit)
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (with_wheels("revolute", SHORT), "'left_joint' is revolute with limits; 'right_joint' is"),
        (with_wheels("fixed"), "all joints are fixed; wheels have continuous joints"),
        (
            GOOD.replace('xyz="0 0 1"', 'xyz="1 0 0"'),
            "'left_joint' has an axis that is not across the body; 'right_joint'",
        ),
        (GOOD.replace(wheel("left", 0.15), ""), "pairs left and right: 'right_joint' is a wheel"),
    ],
)
def test_a_robot_without_wheels_says_why_each_joint_is_none(
    folder: Path, text: str, message: str
) -> None:
    (folder / "bot.urdf").write_text(text)
    with pytest.raises(InputError, match=message):
        load_robot("bot.urdf")


TROLLEY = link("fork", mass=0.05) + joint(
    "swivel", "fork", "continuous", '<origin xyz="-0.17 0 0.07"/><axis xyz="0 0 1"/>'
)
TROLLEY += link("roll", '<cylinder radius="0.03" length="0.02"/>', 0.1) + joint(
    *("roll_joint", "roll", "continuous"),
    '<origin xyz="-0.03 0 -0.04" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/>',
    parent="fork",
)
LIDAR = link("scan", '<cylinder radius="0.04" length="0.05"/>', 0.1) + joint(
    "spin", "scan", "continuous", '<origin xyz="0 0 0.25"/><axis xyz="0 0 1"/>'
)


def test_swivels_turn_whatever_their_name_and_balls_slide(folder: Path) -> None:
    (folder / "bot.urdf").write_text(GOOD.replace(CASTER, TROLLEY + LIDAR))
    model = load_robot("bot.urdf")
    assert model.urdf is not None
    assert model.urdf.casters == ("swivel", "roll_joint")
    turned = {}
    for name, text in {"swivel": GOOD.replace(CASTER, TROLLEY + LIDAR), "ball": GOOD}.items():
        (folder / "bot.urdf").write_text(text)
        with prepare("empty", "straight", overrides=["robot=bot.urdf"]).simulation() as sim:
            start = sim.true_pose().yaw
            for _ in range(60):
                sim.drive(-2.0, 2.0)
                sim.advance(1.0 / 60.0)
            turned[name] = sim.true_pose().yaw - start
    assert turned["swivel"] == pytest.approx(0.8, abs=0.04)
    assert turned["ball"] == pytest.approx(0.8, abs=0.04)


def test_wheels_hang_on_suspensions_but_not_on_arms(folder: Path) -> None:
    rail = '<axis xyz="0 0 1"/><limit lower="0" upper="0.02" effort="9" velocity="1"/>'
    sprung = GOOD.replace(wheel("left", 0.15), wheel("left", 0.15).replace('"base"', '"drop"'))
    sprung = sprung.replace(
        "</robot>", link("drop", mass=0.1) + joint("d", "drop", "prismatic", rail)
    )
    pan = '<origin xyz="0.1 0.1 0.3"/><axis xyz="0 1 0"/>' + LIMITS[2]
    arm = link("arm", '<box size="0.1 0.05 0.05"/>', 0.2) + joint("lift", "arm", "revolute", pan)
    (folder / "bot.urdf").write_text(f"{sprung}{arm}</robot>")
    model = load_robot("bot.urdf")
    assert model.urdf is not None
    assert (model.urdf.left, model.urdf.right) == (("left_joint",), ("right_joint",))
    assert model.urdf.casters == ("third_joint",)


def camera(name: str, at: str, rpy: str = "0 0 0", pose: str = "", kind: str = "camera") -> str:
    origin = f'<origin xyz="{at}" rpy="{rpy}"/>'
    sensor = SENSOR.format(name, kind, 0 if kind == "depth" else 20, pose and f"<pose{pose}</pose>")
    return link(name) + joint(f"{name}_joint", name, more=origin) + sensor


REAR = camera("rear", "-0.2 0 0.2", "0 0 3.14159")
OPTICAL = "-1.5707963 0 -1.5707963"
NOSE = "-1.7707963 0 -1.5707963"  # an optical frame 0.2 rad down
QUARTER = "1.5707963"


@pytest.mark.parametrize(
    ("cameras", "link_name", "mount", "told"),
    [
        (REAR + camera("front", "0.2 0 0.3", "0 0.1 0"), "front", (0.2, 0.3, 0.1), "others: rear"),
        (
            camera("lens_optical_frame", "0.2 0 0.3", NOSE),
            "lens_optical_frame",
            (0.2, 0.3, 0.2),
            "z",
        ),
        (camera("oc", "0.2 0 0.3", OPTICAL), "oc", (0.2, 0.3, 0.0), "its frame is an optical one"),
        (camera("mast", "0 0 0.3", pose=">0.1 0 0.1 0 0.2 0"), "mast", (0.1, 0.4, 0.2), ""),
        (
            camera("side", "0 0 0.3", f"0 0 {QUARTER}", ">0 0 0 0 0 -1.5707963"),
            *("side", (0.0, 0.3, 0.0), ""),
        ),
        (
            camera("side", "0 0 0.3", f"0 0 {QUARTER}", ' degrees="true">0 0 0 0 0 -90'),
            *("side", (0.0, 0.3, 0.0), ""),
        ),
        (
            camera("d", "0.1 0 0.2", kind="depth") + camera("up", "0 0 0.3", "0 -1.57 0"),
            *("d", (0.1, 0.2, 0.0), "others: up"),
        ),
        (camera("eye", "0.2 0.06 0.3", "0 0 0.04"), "eye", (0.2, 0.3, 0.0), "0.06 m to the left"),
    ],
)
def test_the_camera_that_looks_ahead_is_taken(
    folder: Path, cameras: str, link_name: str, mount: tuple[float, ...], told: str
) -> None:
    (folder / "bot.urdf").write_text(robot(BASE, WHEELS, CASTER, cameras))
    model = load_robot("bot.urdf")
    assert model.urdf is not None
    eye = model.camera
    assert model.urdf.camera == link_name
    assert (eye.mount_forward, eye.mount_height, eye.pitch) == pytest.approx(mount, abs=1e-3)
    assert (eye.width, eye.hfov, eye.rate) == (320, 1.2, 10.0 if link_name == "d" else 20.0)
    assumed = [str(one) for one in robot_assumed(model)]
    assert len(assumed) == bool(told)
    assert not told or told in assumed[0]


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        (REAR, "link 'rear' does not look ahead: yaw 180, pitch -?0 .down., roll 0 degrees; name"),
        (camera("down", "0.1 0 0.3", f"0 {QUARTER} 0"), "'down' does not look ahead: .*pitch 90"),
        (camera("tilted", "0.1 0 0.3", "3.14159 0 0"), "'tilted' does not look ahead: .*roll 180"),
        (link("camera") + joint("c", "camera", more=f'<origin rpy="0 0 {QUARTER}"/>'), "yaw 90"),
    ],
)
def test_a_camera_that_looks_elsewhere_is_refused_by_name(
    folder: Path, cameras: str, message: str
) -> None:
    (folder / "bot.urdf").write_text(robot(BASE, WHEELS, CASTER, cameras))
    with pytest.raises(InputError, match=message):
        load_robot("bot.urdf")
    mount = "camera: {mount_forward: 0.1, mount_height: 0.3, pitch: 0.2}\n"
    put_files(folder, {"robots/own.yaml": f"urdf: {{file: ../bot.urdf}}\n{mount}"})
    assert load_robot("own").camera.pitch == 0.2


XACRO = """<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="eyes" default="false"/>%s
<xacro:if value="$(arg eyes)">%s</xacro:if></robot>"""


def test_arguments_of_xacro_files(folder: Path) -> None:
    eye = CAMERA.replace("0.2 0 0.3", "0.2 0 $(arg height)") + USUAL
    (folder / "bot.xacro").write_text(XACRO % (BASE + WHEELS + CASTER, eye))
    words = ("run", "empty", "straight", "--robot", "bot.xacro", "--set", "mission.timeout=0.1")
    args = ("--xacro-arg", "eyes:=true", "--xacro-arg", "height:=0.45")
    assert "camera: 0.35 m above the floor" in invoke(*words).stderr
    assert json.loads(invoke(*words, *args, "--json").stdout)["assumed"] == []
    put_files(folder, {"robots/own.yaml": "urdf: {file: ../bot.xacro, args: ['eyes:=true']}\n"})
    with pytest.raises(
        InputError, match="Undefined substitution argument height; give --xacro-arg"
    ):
        load_robot("own")
    said = refusal(*words, "--xacro-arg", "eye:=true")
    assert "it uses no argument 'eye'; did you mean 'eyes'?" in said
    assert "expected an argument NAME:=VALUE, got 'eyes=true'" in refusal(
        *words, "--xacro-arg", "eyes=true"
    )
    (folder / "bot.urdf").write_text(GOOD)
    with pytest.raises(InputError, match="is no xacro file: it has no argument"):
        read_urdf(folder / "bot.urdf", args=("a:=b",))
