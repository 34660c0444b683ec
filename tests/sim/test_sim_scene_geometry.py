"""Shapes, clearances and shortest paths against exact geometry; furniture from files."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cli_calls import put_file
from hypothesis import given, settings
from hypothesis import strategies as st
from sim_worlds import drive, loaded

from navfw.errors import ConfigError, InputError, WorldError
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import SceneGeometry, Simulation, WorldSpec
from navfw.sim.furniture_meshes import furniture_mesh
from navfw.sim.shapes import Circle, Rectangle, Shape, gap_between, overlap_depth
from navfw.sim.upright_parts import furniture_parts
from navfw.sim.worldspec import BoxSpec, CylinderSpec, OpeningSpec, WallSpec

RADIUS = 0.18
places = st.floats(-2.0, 2.0)
sizes = st.floats(0.1, 1.0)
rectangles = st.builds(Rectangle, places, places, sizes, sizes, st.floats(-3.0, 3.0))
circles = st.builds(Circle, places, places, sizes)


def outline(shape: Shape) -> Array:
    """Points on the outline (N, 2)."""
    if isinstance(shape, Circle):
        angle = np.linspace(0, 2 * math.pi, 721)
        return np.stack(
            [shape.x + shape.radius * np.cos(angle), shape.y + shape.radius * np.sin(angle)], axis=1
        )
    corners = shape.corners
    share = np.linspace(0, 1, 401)[:, None]
    sides = zip(corners, np.roll(corners, -1, 0), strict=True)
    return np.vstack([a + share * (b - a) for a, b in sides])


@given(rectangles | circles, places, places)
@settings(max_examples=60, deadline=None)
def test_distance_is_that_to_the_outline(shape: Shape, x: float, y: float) -> None:
    signed = float(shape.distance(np.array([[x, y]]))[0])
    nearest = float(np.linalg.norm(outline(shape) - (x, y), axis=1).min())
    assert abs(signed) == pytest.approx(nearest, abs=0.01)


@given(rectangles | circles, rectangles | circles)
@settings(max_examples=80, deadline=None)
def test_overlap_agrees_with_sampled_points(a: Shape, b: Shape) -> None:
    depth = overlap_depth(a, b)
    assert depth == pytest.approx(overlap_depth(b, a), abs=1e-9)
    axis = np.linspace(-3.5, 3.5, 141)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    both = bool(((a.distance(grid) < 0) & (b.distance(grid) < 0)).any())
    if both:
        assert depth > 0.0
    elif depth > 0.15:
        pytest.fail(f"no common point found, but they overlap by {depth}")


@pytest.mark.parametrize(
    ("a", "b", "gap"),
    [
        (Circle(0, 0, 0.5), Circle(2, 0, 0.5), 1.0),
        (Circle(0, 0, 0.5), Rectangle(2, 0, 0.5, 3.0), 1.0),
        (Rectangle(0, 0, 1, 1), Rectangle(3, 0, 1, 1), 1.0),
        (Rectangle(0, 0, 1, 1), Rectangle(3, 3, 1, 1), np.sqrt(2.0)),
        (Rectangle(0, 0, 1, 1), Rectangle(0, 3, 1, 1, np.pi / 4), 2.0 - np.sqrt(2.0)),
        (Rectangle(0, 0, 3, 0.1), Rectangle(0, 0, 0.1, 3), -3.1),
    ],
)
def test_gap_between(a: Shape, b: Shape, gap: float) -> None:
    assert gap_between(a, b) == pytest.approx(gap)
    assert gap_between(b, a) == pytest.approx(gap)


def field(**solids: object) -> SceneGeometry:
    data = {"name": "field", "x": (-5, 5), "y": (-5, 5), **solids}
    return SceneGeometry.from_world(WorldSpec.model_validate(data))


COLUMN = field(cylinders=(CylinderSpec(name="column", at=(0, 0), radius=1.0),))


@pytest.mark.parametrize("radius", [0.18, 0.5])
def test_shortest_path_around_a_column(radius: float) -> None:
    length, path = COLUMN.shortest_path((-3, 0), (3, 0), radius)
    wide = 1.0 + radius
    tangent = math.sqrt(9.0 - wide**2)
    exact = 2 * tangent + wide * (math.pi - 2 * math.acos(wide / 3.0))
    assert exact * 0.998 < length < exact * 1.01
    assert COLUMN.clearances(path).min() > radius - 0.002


def test_the_distance_field_has_the_lengths_of_the_shortest_paths() -> None:
    distances = COLUMN.distance_field((3.0, 0.0), RADIUS)
    ends = np.random.default_rng(0).uniform(-4.5, 4.5, (40, 2))
    free = [(x, y) for x, y in ends.tolist() if COLUMN.clearance(x, y) > RADIUS + 0.05]
    assert len(free) > 25
    for at in free:
        exact = COLUMN.shortest_path(at, (3.0, 0.0), RADIUS)[0]
        assert distances.at(*at) == pytest.approx(exact, rel=0.03, abs=0.06)
    # inside the column: as at the nearest place that the robot can take
    assert 1.8 <= distances.at(0.0, 0.0) <= distances.at(-1.25, 0.0)
    assert math.isfinite(distances.at(9.0, 9.0))


def divided(width: float) -> SceneGeometry:
    gap = OpeningSpec(name="gap", at=(0, 2), width=width)
    wall = WallSpec(name="wall", points=((0, -5), (0, 5)), openings=(gap,))
    return field(walls=(wall,))


def test_shortest_path_needs_free_ends_and_a_gap_wide_enough() -> None:
    assert divided(0.9).shortest_path((-2, 0), (2, 0), RADIUS)[0] > 5.0
    for width, start, goal, message in (
        (0.3, (-2, 0), (2, 0), "cannot be reached"),
        (0.9, (-2, 0), (0, 0), r"the goal \(0, 0\) is .* from 'wall'"),
        (0.9, (-7, 0), (2, 0), r"the start .* must lie on the floor"),
    ):
        with pytest.raises(WorldError, match=message):
            divided(width).shortest_path(start, goal, RADIUS)


def test_clearance_and_configuration_space() -> None:
    plan = field(boxes=(BoxSpec(name="box", at=(1, 1), size=(1, 1, 1)),))
    assert plan.clearance(3.5, 1) == pytest.approx(2.0)
    assert plan.clearance(1, 1) == pytest.approx(-0.5)
    assert plan.nearest_name(3, 3) == "box"
    grid = plan.configuration_space(cell=0.1)
    assert grid.occupied.sum() == 100
    centres = grid.centres(*np.nonzero(grid.occupied))
    assert np.abs(centres - 1.0).max() == pytest.approx(0.45)


def test_solids_above_the_robot_are_not_in_the_plan() -> None:
    shelf = BoxSpec(name="shelf", at=(1, 1), size=(1, 1, 0.3), base=1.2)
    assert field(boxes=(shelf,)).clearance(1, 1) == math.inf


THINGS = Path(__file__).parents[2] / "worlds" / "lounge" / "things"
ARMCHAIR = str(THINGS / "armchair.obj")

WORLD = """\
name: room
x: [0, 6]
y: [0, 6]
boxes: [{name: crate, at: %s, size: [0.4, 0.4, 0.4]}]
meshes:
  - {name: thing, file: %s, at: [3, 3]%s}
"""


def room(
    folder: Path, more: str = "", file: str = "armchair.obj", crate: str = "[5, 5]"
) -> WorldSpec:
    """A world with one thing in its middle."""
    shutil.copytree(THINGS, folder, dirs_exist_ok=True)
    return loaded(folder, WORLD % (crate, file, more))


def test_a_mesh_becomes_the_boxes_and_cylinders_that_it_consists_of() -> None:
    parts = furniture_parts(ARMCHAIR, 1.0, "z")
    low = [part for part in parts if part.bottom == 0.0]
    assert [part.shape.bounds for part in low] == [pytest.approx((-0.4, -0.4, 0.4, 0.4))]
    assert max(part.top for part in parts) == pytest.approx(0.85)
    foot, leg, top = furniture_parts(str(THINGS / "side-table.urdf"), 1.0, "z")
    assert isinstance(leg.shape, Circle)
    assert leg.shape.radius == pytest.approx(0.04, abs=0.01)
    assert (foot.top, leg.top, top.bottom) == pytest.approx((leg.bottom, top.bottom, leg.top))


def test_a_thin_board_has_an_outline_as_well(tmp_path: Path) -> None:
    trimesh.creation.box((1.0, 0.5, 0.01)).export(tmp_path / "board.stl")
    (part,) = furniture_parts(str(tmp_path / "board.stl"), 1.0, "z")
    assert (part.bottom, part.top) == pytest.approx((-0.005, 0.005))
    assert (*part.shape.bounds,) == pytest.approx((-0.5, -0.25, 0.5, 0.25))


def test_scale_and_axes_apply_to_outline_and_mesh() -> None:
    mesh = furniture_mesh(ARMCHAIR, 0.5, "y")
    low, high = mesh.bounds
    # the file's x, y, z become x, -z, y
    assert low == pytest.approx((-0.2, -0.425, -0.2))
    assert high == pytest.approx((0.2, 0.0, 0.2))
    parts = furniture_parts(ARMCHAIR, 0.5, "y")
    assert min(part.shape.bounds[1] for part in parts) == pytest.approx(-0.425, abs=0.01)


def test_the_plan_knows_what_the_robot_touches(tmp_path: Path) -> None:
    world = room(tmp_path, ", yaw: 0.7854")
    plan = SceneGeometry.from_world(world)
    assert plan.clearance(3.0, 3.0) < 0.0
    # a corner of the seat points along x
    assert plan.clearance(4.0, 3.0) == pytest.approx(1.0 - 0.4 * 2**0.5, abs=0.002)
    assert plan.nearest_name(4.0, 3.0) == "thing"
    robot = RobotModel()
    with Simulation(world, robot, Pose(1.5, 3.0, 0.0), 0) as sim:
        drive(sim, 7.0, 6.0, 6.0, until_contact=True)
        assert sim.contacts == ("thing",)
        assert sim.true_pose().x + robot.radius == pytest.approx(3.0 - 0.4 * 2**0.5, abs=0.03)


def test_the_robot_drives_beneath_what_is_above_it(tmp_path: Path) -> None:
    world = room(tmp_path, ", base: 0.6")
    assert SceneGeometry.from_world(world, 0.4).clearance(3.0, 3.0) > 1.0
    with Simulation(world, RobotModel(), Pose(2.0, 3.0, 0.0), 0) as sim:
        drive(sim, 4.0, 6.0, 6.0)
        assert sim.contacts == ()
        assert sim.true_pose().x > 3.0


def test_the_picture_shows_the_mesh_where_it_is(tmp_path: Path) -> None:
    robot, pose = RobotModel(), Pose(1.0, 3.0, 0.0)
    with Simulation(room(tmp_path, ", yaw: 3.14159265"), robot, pose, 0) as sim:
        _, depth = sim.render_from(pose)
    eye = pose.x + robot.camera.mount_forward
    # the seat's front ahead, the back above it, 0.6 m behind the front
    assert depth[62, 80] == pytest.approx(2.6 - eye, abs=0.01)
    seen = depth[:, 80]
    back = seen[(seen > 3.19 - eye) & (seen < 3.21 - eye)]
    assert back.size > 3


@pytest.mark.parametrize(
    ("file", "more", "key", "message"),
    [
        ("armchair.obj", ", base: -0.2", "base", "reaches 0.20 m below the floor; raise base to 0"),
        ("armchair.obj", ", scale: 0.001", "file", "is 0.00085 m large, .*another scale"),
        ("armchair.obj", ", scale: 100", "file", "is 85 m large, expected 0.02 to 50 m"),
        ("armchair.obj", ", texture: clouth", "texture", "unknown texture 'clouth'"),
        ("armchair.obj", ", up: x", "up", "'y'|z or y|one of"),
        ("armchairs.obj", "", "file", "no such file"),
        ("tapestry.png", "", "file", "expected a mesh \\(.dae, .obj, .stl\\), got 'tapestry.png'"),
    ],
)
def test_bad_entries(tmp_path: Path, file: str, more: str, key: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        room(tmp_path, more, file)
    assert caught.value.line == 6
    assert caught.value.key == f"meshes[0].{key}"


def test_meshes_that_overlap_others_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'thing' overlaps 'crate'"):
        room(tmp_path, crate="[3.5, 3.3]")


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ("", "needs one shape in <geometry>, got nothing; known: <box size=>"),
        ("<cone radius='1' length='1'/>", "needs one shape in <geometry>, got <cone>"),
        ("<box size='1 0 1'/>", "size of <box>: expected positive lengths"),
        ("<sphere/>", "needs one shape in <geometry>, got <sphere>; known"),
        ("<sphere radius='0'/>", "radius of <sphere>: expected positive lengths"),
        ("<mesh filename='armchair.obj' scale='1 -1 1'/>", "expected positive scales; mirror"),
        ("<mesh filename='stool.obj'/>", "'stool.obj' does not exist"),
    ],
)
def test_bad_urdfs(tmp_path: Path, geometry: str, message: str) -> None:
    shape = f"<collision><geometry>{geometry}</geometry></collision>"
    put_file(tmp_path, "thing.urdf", f"<robot name='r'><link name='l'>{shape}</link></robot>")
    with pytest.raises(ConfigError, match=message):
        room(tmp_path, file="thing.urdf")


def test_urdfs_without_shapes_and_capsules(tmp_path: Path) -> None:
    link = "<robot name='r'><link name='l'>{}</link></robot>"
    file = str(put_file(tmp_path, "thing.urdf", link.format("")))
    with pytest.raises(ConfigError, match="no link has a collision shape; add <collision>"):
        furniture_mesh(file, 1.0, "z")
    shape = "<{0}><geometry><capsule radius='0.2' length='0.5'/></geometry></{0}>"
    for tag in ("collision", "visual"):
        put_file(tmp_path, "thing.urdf", link.format(shape.format(tag)))
        mesh = furniture_mesh(file, 1.0, "z")
        assert mesh.bounds[1] == pytest.approx((0.2, 0.2, 0.45), abs=0.002)
        assert not mesh.open_edges


def test_urdf_spheres_and_meshes_take_their_place(tmp_path: Path) -> None:
    shutil.copy(ARMCHAIR, tmp_path)
    text = (
        "<robot name='r'><link name='a'><collision><geometry><sphere radius='0.1'/></geometry>"
        "</collision></link><link name='b'><collision><origin xyz='0 0 1'/><geometry>"
        f"<mesh filename='package://{tmp_path.name}/armchair.obj' scale='2 1 1'/></geometry>"
        "</collision></link>"
        "<joint name='j' type='continuous'><parent link='a'/><child link='b'/>"
        "<origin xyz='3 0 0' rpy='0 0 1.57079632679'/></joint></robot>"
    )
    low, high = furniture_mesh(str(put_file(tmp_path, "thing.urdf", text)), 1.0, "z").bounds
    assert low == pytest.approx((-0.1, -0.8, -0.1), abs=1e-6)
    assert high == pytest.approx((3.4, 0.8, 1.85), abs=1e-6)
