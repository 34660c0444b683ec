"""Gazebo worlds as people publish them: included models, frames, degrees, what stands still."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from cli_calls import invoke, put_files, refusal

from navfw.errors import ConfigError, InputError
from navfw.missions import prepare
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.worldgen.gazebo_import import import_world
from navfw.worldgen.sdf_reader import SdfWorld, read_sdf

FUEL = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/"
STEM = "0 0 0.5 0 0 0"


def box(size: str) -> str:
    return f"<box><size>{size}</size></box>"


def model(name: str, shape: str, more: str = "<static>1</static>", at: str = STEM) -> str:
    collision = f"<collision name='c'><pose>{at}</pose><geometry>{shape}</geometry></collision>"
    return f"<model name='{name}'>{more}<link name='l'>{collision}</link></model>"


def world(*parts: str, version: str = "1.6") -> str:
    body = "\n".join(parts)
    return f"<sdf version='{version}'>\n<world name='w'>\n{body}\n</world></sdf>"


def config(*files: str) -> str:
    names = "".join(f"<sdf version='1.{n}'>{file}</sdf>" for n, file in enumerate(files, 4))
    return f"<model><name>m</name>{names}</model>"


def include(uri: str, *more: str) -> str:
    return f"<include><uri>{uri}</uri>{''.join(more)}</include>"


def pose(text: str, attributes: str = "") -> str:
    return f"<pose {attributes}>{text}</pose>"


SHELF = f"<sdf version='1.6'>{model('shelf', box('1 0.4 1'))}</sdf>"


def places(content: SdfWorld) -> list[tuple[float, ...]]:
    """x, y and yaw of each shape."""
    found: list[tuple[float, ...]] = []
    for part in content.shapes:
        yaw = part.shape.yaw if isinstance(part.shape, Rectangle) else 0.0
        found.append((part.shape.x, part.shape.y, yaw))
    return found


def read(folder: Path, text: str, models: str | None = None) -> SdfWorld:
    (folder / "hall.world").write_text(text)
    return read_sdf(folder / "hall.world", None if models is None else folder / models)


@pytest.mark.parametrize(
    ("uri", "place"),
    [
        ("model://shelf", "models/shelf/model.sdf"),
        ("model://shelf", "../models/shelf/model.sdf"),  # worlds/ and models/ side by side
        ("model://shelf", "own/shelf/model.sdf"),
        ("model://shelf/model.sdf", "own/shelf/model.sdf"),
        ("file://models/shelf", "models/shelf/model.sdf"),
        ("models/shelf/model.sdf", "models/shelf/model.sdf"),
        (" model://shelf\n ", "models/shelf/model.sdf"),
        (f"{FUEL}Shelf", "own/shelf/3/model.sdf"),
        (
            "https://fuel.ignitionrobotics.org/1.0/Mo/models/shelf%20big/2",
            "own/shelf big/model.sdf",
        ),
    ],
)
def test_included_models_are_found(tmp_path: Path, uri: str, place: str) -> None:
    folder = tmp_path / "worlds"
    put_files(folder, {place: SHELF})
    again = include(uri, "<name>b</name>", pose("4 -1.5 0 0 0 0"))
    content = read(folder, world(include(uri, pose("4 1.5 0 0 0 1.5708")), again), "own")
    assert content.unsupported == []
    assert places(content) == [pytest.approx((4, 1.5, 1.5708)), pytest.approx((4, -1.5, 0))]
    assert [part.name for part in content.shapes] == ["shelf", "b"]


def test_variables_of_gazebo_name_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put_files(
        tmp_path, {"far/shelf/v7.sdf": SHELF, "far/shelf/model.config": config("x.sdf", "v7.sdf")}
    )
    put_files(tmp_path, {"far/shelf/x.sdf": "<sdf/>"})
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", f"/nowhere:{tmp_path / 'far'}")
    assert len(read(tmp_path, world(include("model://shelf"))).shapes) == 1


def test_a_model_that_is_not_there_is_named_once_with_the_folders(tmp_path: Path) -> None:
    (tmp_path / "hall.world").write_text(world(include("model://shelf"), include(f"{FUEL}Depot")))
    words = ("world", "import", tmp_path / "hall.world", "--out", tmp_path / "out")
    said = refusal(*words, "--start", "0,0,0", "--goal", "3,0")
    assert "line 3: the included model 'model://shelf': not found" in said
    assert f"line 4: the included model '{FUEL}Depot': not found" in said
    assert said.count("name the folder that has the models with --models or GAZEBO_MODEL_PATH") == 1
    assert "gz fuel download -u URL gets those" in said


def test_the_ground_and_the_sun_are_the_worlds_own(tmp_path: Path) -> None:
    uris = ["model://ground_plane", "model://sun", f"{FUEL}Ground%20Plane", f"{FUEL}Sun/2"]
    content = read(tmp_path, world(*map(include, uris)))
    assert (content.shapes, content.unsupported) == ([], [])
    assert "ground plane: the floor, at z = 0" in str(content.assumed[0])


@pytest.mark.parametrize(
    ("attributes", "numbers", "place"),
    [
        ("degrees='true'", "1 2 0 0 0 90", (1, 2, math.pi / 2)),
        ("degrees='true' rotation_format='euler_rpy'", "1 2 0 0 0 -45", (1, 2, -math.pi / 4)),
        ("rotation_format='quat_xyzw'", "1 2 0\n0 0 2 2", (1, 2, math.pi / 2)),
        ("", "", (0, 0, 0)),
        ("relative_to='corner'", "1 0 0 0 0 0", (3, 1, math.pi / 2)),
        ("relative_to='post'", "1 0 0 0 0 0", (5, 1, math.pi)),
        ("relative_to='post::l'", "0 0 0 0 0 0", (5, 2, -math.pi / 2)),
        ("frame='corner'", "1 0 0 0 0 0", (3, 1, math.pi / 2)),
        ("relative_to='world'", "1 0 0 0 0 0", (1, 0, 0)),
    ],
)
def test_poses_in_degrees_by_quaternion_and_in_other_frames(
    tmp_path: Path, attributes: str, numbers: str, place: tuple[float, ...]
) -> None:
    corner = "<frame name='corner'><pose>3 0 0 0 0 1.5707963</pose></frame>"
    post = "<model name='post'><static>1</static><pose>6 1 0 0 0 3.1415927</pose>"
    post += "<link name='l'><pose>1 -1 0 0 0 1.5707963</pose></link></model>"
    wall = model("wall", box("3 0.2 1"), "<static>1</static>" + pose(numbers, attributes))
    ((x, y, yaw),) = places(read(tmp_path, world(corner, post, wall, version="1.9")))
    assert (x, y) == pytest.approx(place[:2], abs=1e-6)
    assert math.cos(yaw - place[2]) == pytest.approx(1.0)


def test_frames_within_a_model(tmp_path: Path) -> None:
    """A chain: link b on joint j of link a, a collision on a frame of it, placed by that frame."""
    text = (
        "<model name='m' placement_frame='tip'><static>1</static><pose>10 0 0 0 0 0</pose>"
        "<link name='a'><pose>1 0 0 0 0 0</pose></link><link name='b'>"
        "<pose relative_to='j'>0 1 0 0 0 0</pose><collision name='c'>"
        f"<pose relative_to='tip'>0 0 0.5 0 0 0</pose><geometry>{box('1 2 1')}</geometry>"
        f"</collision><collision name='d'><geometry>{box('1 1 1')}</geometry></collision></link>"
        "<joint name='j' type='fixed'><parent>a</parent><child>a</child>"
        "<pose>0 0 0 0 0 1.5707963</pose></joint>"
        "<frame name='tip' attached_to='b'><pose>0 2 0 0 0 0</pose></frame></model>"
    )
    tip, link = places(read(tmp_path, world(text, version="1.8")))
    assert tip[:2] == pytest.approx((10.0, 0.0))
    assert link[:2] == pytest.approx((10.0, -2.0), abs=1e-6)


def test_a_placement_frame_of_an_include_and_nested_includes(tmp_path: Path) -> None:
    inner = model("inner", box("1 1 1")).replace(
        "</link>", "</link><frame name='end'><pose>0.5 0 0 0 0 0</pose></frame>"
    )
    row = "<model name='row'>" + include("model://inner", pose("0 3 0 0 0 0")) + "</model>"
    put_files(
        tmp_path / "models",
        {"inner/model.sdf": f"<sdf>{inner}</sdf>", "row/model.sdf": f"<sdf>{row}</sdf>"},
    )
    end = "<placement_frame>end</placement_frame>"
    aws = "<model name='a'>" + include("model://row") + pose("1 1 0 0 0 1.5707963") + "</model>"
    text = world(include("model://inner", end, pose("2 0 0 0 0 0")), aws)
    first, second = places(read(tmp_path, text))
    assert first[:2] == pytest.approx((1.5, 0.0))
    assert second[:2] == pytest.approx((-2.0, 1.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            pose("1 0 0 0 0 0", "relative_to='corne'"),
            "hall.world:3: pose: unknown frame 'corne'",
        ),
        (pose("1 0 0 0 0", "degrees='true'"), "pose: expected 6 numbers, got '1 0 0 0 0'"),
        (pose("1 0 0 0 0 0", "rotation_format='quat_xyzw'"), "pose: expected 7 numbers"),
        (pose("1 0 0 0 0 0 0", "rotation_format='quat_xyzw'"), "a quaternion other than 0"),
        (
            pose("1 0 0 0 0 0", "rotation_format='quat_wxyz'"),
            "quat_xyzw, got 'quat_wxyz'",
        ),
        (pose("0 0 0 0 0 0 1", "rotation_format='quat_xyzw' degrees='true'"), "no degrees with"),
        (pose("0 0 0 0 0 0", "relative_to='wall'"), "the frame 'wall' depends on itself"),
    ],
)
def test_poses_that_mean_nothing(tmp_path: Path, text: str, message: str) -> None:
    corner = "<frame name='corner'/>"
    with pytest.raises(ConfigError, match=message):
        read(tmp_path, world(model("wall", box("1 1 1"), text) + corner, version="1.9"))


def test_models_that_include_each_other_or_are_damaged(tmp_path: Path) -> None:
    loop = "<sdf><model name='m'>" + include("model://m") + "</model></sdf>"
    put_files(
        tmp_path,
        {
            "models/m/model.sdf": loop,
            "models/r/model.sdf": "<robot name='r'/>",
            "models/d/model.sdf": SHELF.replace("1 0.4 1", "1 0.4"),
            "models/d/model.config": "<model",
        },
    )
    for name, message in {
        "m": "the model .model://m. includes itself",
        "r": r"r/model.sdf:1: expected <sdf> with a <model>, got <robot>",
        "d": r"d/model.sdf:1: box.size: expected 3 numbers, got '1 0.4'",
    }.items():
        with pytest.raises(ConfigError, match=message):
            read(tmp_path, world(include(f"model://{name}")))


def test_what_is_not_static_stands_still_and_robots_and_actors_are_left_out(tmp_path: Path) -> None:
    drive = "<plugin name='diff_drive' filename='libgazebo_ros_diff_drive.so'/>"
    state = "<state world_name='w'><model name='cart'><pose>4 5 0 0 0 0</pose></model></state>"
    parts = (
        model("cart", box("1 1 1"), ""),
        model("crate", box("1 1 1"), ""),
        state,
        model("burger", box("0.2 0.2 1"), drive),
        "<actor name='walker'/>",
    )
    content = read(tmp_path, world(*parts))
    assert [part.name for part in content.shapes] == ["cart", "crate"]
    assert places(content)[0][:2] == (4.0, 5.0)
    assert [str(one) for one in content.assumed] == [
        "cart: where <state> has them, as Gazebo starts there",
        "cart, crate: standing still, as not static in the file",
        "burger: left out, as a plugin drives it",
        "walker: left out, as they walk",
    ]


SOLIDS = {
    "sphere": ("<sphere><radius>0.5</radius></sphere>", STEM, (0.5, 0.5, 1.0)),
    "capsule": (
        "<capsule><radius>0.2</radius><length>0.6</length></capsule>",
        STEM,
        (0.2, 0.2, 1.0),
    ),
    "cone": ("<cone><radius>0.4</radius><length>1</length></cone>", STEM, (0.4, 0.4, 1.0)),
    "ellipsoid": ("<ellipsoid><radii>1 0.5 0.5</radii></ellipsoid>", STEM, (1.0, 0.5, 1.0)),
    "lying": (
        "<cylinder><radius>0.5</radius><length>2</length></cylinder>",
        f"0 0 0.5 0 {math.pi / 2} 0",
        (1.0, 0.5, 1.0),
    ),
    "ramp": (box("2 1 0.1"), "0 0 0.5 0 0.5 0", (0.9, 0.5, 1.02)),
}


def reach(shape: Shape) -> tuple[float, float]:
    """How far a shape reaches along x and y from the origin."""
    if isinstance(shape, Circle):
        return shape.radius, shape.radius
    x, y = np.abs(shape.corners).max(axis=0).tolist()
    return x, y


@pytest.mark.parametrize("what", SOLIDS)
def test_round_and_leaning_shapes_become_upright_parts(tmp_path: Path, what: str) -> None:
    shape, at, (half_x, half_y, top) = SOLIDS[what]
    content = read(tmp_path, world(model("thing", shape, at=at)))
    assert content.unsupported == []
    found = [max(reach(part.shape)[axis] for part in content.shapes) for axis in (0, 1)]
    assert found == pytest.approx([half_x, half_y], abs=0.06)
    assert max(part.top for part in content.shapes) == pytest.approx(top, abs=0.03)


def test_planes_and_meshes_of_other_formats_are_named(tmp_path: Path) -> None:
    plane = "<plane><normal>0 0 {}</normal></plane>"
    (tmp_path / "shelf.glb").touch()
    parts = (
        model("floor", plane.format(0.5), at="0 0 0 0 0 0"),
        model("stage", plane.format(1)),
        model("shelf", "<mesh><uri>shelf.glb</uri></mesh>"),
    )
    stage, shelf = read(tmp_path, world(*parts)).unsupported
    assert "<plane> of the model 'stage' at z = 0.5 m, the floor is at 0" in stage
    assert "'shelf.glb' of the model 'shelf': not one of .dae, .obj, .stl" in shelf


def test_thin_boards_are_solids_and_what_lies_on_the_floor_is_none(tmp_path: Path) -> None:
    file = tmp_path / "hall.world"
    trimesh.creation.box((0.5, 0.5, 0.01)).export(tmp_path / "board.stl")
    mesh = model("mesh", "<mesh><uri>board.stl</uri></mesh>", at="3 0 0.4 0 0 0")
    mat = model("mat", box("1 1 0.01"), at="0 0 0.005 0 0 0")
    file.write_text(world(model("board", box("1 1 0.01"), at="0 0 0.3 0 0 0"), mat, mesh))
    boards = import_world(file, start=(-2.0, 2.0, 0.0), goal=(2.0, 2.0)).world.boxes
    assert [(b.name, b.base, b.size[2]) for b in boards] == [
        ("board", 0.295, 0.02),
        ("mesh", pytest.approx(0.395), 0.02),
    ]


def test_the_floor_is_the_slab_on_which_start_and_goal_are(tmp_path: Path) -> None:
    slab = model("ground", box("4 20 0.2"), at="-1 0 -0.05 0 0 0")
    slab += model("more", box("4 20 0.2"), at="3 0 -0.05 0 0 0")
    post = model(
        "post", "<cylinder><radius>0.1</radius><length>1</length></cylinder>", at="3 3 0.55 0 0 0"
    )
    (tmp_path / "hall.world").write_text(world(slab, post))
    made = import_world(tmp_path / "hall.world", start=(0, 0, 0), goal=(2, 0))
    assert [box.name for box in made.world.boxes] == []
    assert (made.world.cylinders[0].base, made.world.cylinders[0].height) == (0.0, 1.0)
    assert "floor: at z = 0.05 m, as start and goal are on 'ground'" in map(str, made.assumed)


def aws(folder: Path) -> Path:
    """A world in the structure of AWS' warehouse: each model includes one, whose body is a mesh."""
    make: Any = trimesh.creation
    meshes: dict[str, Any] = {
        "Wall_01": make.annulus(4.0, 4.2, 2.5, sections=4),
        "Shelf_01": make.box((0.9, 3.0, 2.0)),
        "Ground_01": make.box((14.0, 14.0, 0.12)),
    }
    parts = []
    for name, at in (("Wall_01", "0 0 1.25"), ("Ground_01", "0 0 -0.03"), ("Shelf_01", "0 1.5 1")):
        home = folder / "models" / name
        (home / "meshes").mkdir(parents=True)
        meshes[name].export(home / "meshes" / f"{name}_collision.DAE", file_type="dae")
        uri = f"model://{name}/meshes/{name}_collision.DAE"
        mesh = f"<mesh><uri>{uri}</uri><scale>1 1 1</scale></mesh>"
        body = model(name, mesh, "", "0 0 0 0 -0 0").replace("<pose>", "<pose frame=''>")
        sdf = body.replace("</model>", "<static>true</static></model>")
        put_files(home, {"model.sdf": f"<sdf version='1.6'>{sdf}</sdf>"})
        put_files(home, {"model.config": config("model.sdf")})
        inner = include(f"model://{name}")
        parts.append(f"<model name='{name}_001'>{inner}<pose frame=''>{at} 0 0 0</pose></model>")
    put_files(folder, {"worlds/small.world": world(*parts, "<light name='l' type='point'/>")})
    return folder / "worlds" / "small.world"


def turtlebot(folder: Path) -> Path:
    """A world in the structure of TurtleBot3's: a static model around an included one."""
    posts = "".join(
        f"<collision name='p{x}{y}'><pose>{x} {y} 0.25 0 0 0</pose><geometry><cylinder><radius>"
        "0.15</radius><length>0.5</length></cylinder></geometry></collision>"
        for x in (-1.1, 0, 1.1)
        for y in (-1.1, 0, 1.1)
    )
    wall = (
        "<collision name='head'><pose>3.5 0 -0.5 0 0 0</pose><geometry><mesh><uri>"
        "model://hexagon/meshes/wall.dae</uri><scale>0.25 0.25 0.25</scale></mesh></geometry>"
        "</collision>"
    )
    home = folder / "models" / "hexagon"
    (home / "meshes").mkdir(parents=True)
    trimesh.creation.box((1.0, 8.0, 8.0)).export(home / "meshes" / "wall.dae")
    link = f"<link name='symbol'>{posts}{wall}</link>"
    sdf = f"<sdf version='1.5'><model name='ros_symbol'><static>1</static>{link}</model></sdf>"
    put_files(home, {"model.sdf": sdf, "model.config": config("model.sdf")})
    outer = f"<model name='hexagon'><static>1</static>{include('model://hexagon')}</model>"
    ground = include(f"{FUEL}Ground Plane") + include(f"{FUEL}Sun")
    put_files(folder, {"worlds/small.world": world(ground, outer, version="1.8")})
    return folder / "worlds" / "small.world"


@pytest.mark.parametrize(("made", "goal"), [(aws, "2,-1.5"), (turtlebot, "2.0,0.55")])
def test_worlds_like_those_of_aws_and_turtlebot_are_imported_and_driven(
    tmp_path: Path, made: object, goal: str
) -> None:
    assert callable(made)
    path, out = made(tmp_path), tmp_path / "out"
    start = "-2,-1.5,0" if made is aws else "-2.0,0.55,0"
    words = ("world", "import", path, "--out", out, f"--start={start}", f"--goal={goal}", "--json")
    data = json.loads(invoke(*words).stdout)
    assert data["skipped"] == []
    assert [one["what"] for one in data["assumed"]] == (
        ["floor"] if made is aws else ["ground plane"]
    )
    assert (data["meshes"], data["cylinders"]) == ((3, 0) if made is aws else (1, 9))
    with prepare(out, "cross").simulation() as sim:
        for _ in range(60):
            sim.drive(4.0, 4.0)
            sim.advance(1.0 / 60.0)
        assert sim.contacts == ()
    drive = invoke("run", out, "cross", "--json", "--out", tmp_path / "run")
    assert json.loads(drive.stdout)["outcome"] == "reached"
    assert json.loads(drive.stdout)["collisions"] == 0


def test_a_model_alone_is_a_world(tmp_path: Path) -> None:
    (tmp_path / "model.sdf").write_text(SHELF)
    made = import_world(tmp_path / "model.sdf", start=(-2, 0, 0), goal=(2, 0))
    assert len(made.world.boxes) == 1


def test_no_model_is_read_from_elsewhere(tmp_path: Path) -> None:
    put_files(tmp_path, {"secret/model.sdf": SHELF})
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    for uri in ("../../secret", "model://../../secret", str(tmp_path / "secret"), ""):
        (folder / "hall.world").write_text(world(include(uri)))
        with pytest.raises(InputError, match="not found"):
            import_world(folder / "hall.world", start=(-2, 0, 0), goal=(2, 0))
