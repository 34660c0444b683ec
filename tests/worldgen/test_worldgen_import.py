"""Import of Gazebo worlds: supported shapes, errors, the resulting world and mission."""

import json
import math
import os
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import answer, invoke, refusal, sole_refusal

from navfw.errors import ConfigError, InputError, WorldError
from navfw.missions import prepare
from navfw.signals import Pose
from navfw.sim import SceneGeometry, load_world
from navfw.sim.shapes import Circle, Rectangle
from navfw.worldgen.gazebo_import import import_world, reference_length
from navfw.worldgen.sdf_reader import read_sdf

POLE_HEIGHT = 1.0

GROUND = """
<model name='ground_plane'><static>1</static><link name='link'><collision name='collision'>
<geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link>
</model><light name='sun' type='directional'/><physics type='ode'/>"""


def model(name: str, geometry: str, pose: str = "0 0 0 0 0 0", static: str = "1") -> str:
    return (
        f"<model name='{name}'><static>{static}</static><pose>{pose}</pose><link name='link'>"
        f"<collision name='c'><geometry>{geometry}</geometry></collision></link></model>"
    )


def cylinder(radius: float = 0.2, length: float = 1.0) -> str:
    return f"<cylinder><radius>{radius}</radius><length>{length}</length></cylinder>"


def box(size: str = "1 2 3") -> str:
    return f"<box><size>{size}</size></box>"


def sdf(tmp_path: Path, *parts: str) -> Path:
    path = tmp_path / "hall.world"
    body = "\n".join((GROUND, *parts))
    path.write_text(
        f"<?xml version='1.0'?>\n<sdf version='1.6'><world name='w'>{body}</world></sdf>"
    )
    return path


def test_shapes_and_poses(tmp_path: Path) -> None:
    nested = (
        "<model name='outer'><static>true</static><pose>1 2 0 0 0 1.5707963267948966</pose>"
        "<link name='a'><pose>1 0 0.5 0 0 0</pose>"
        f"<collision name='b'><pose>0 1 0 0 0 0.25</pose><geometry>{box()}</geometry></collision>"
        f"<collision name='c'><geometry>{cylinder(0.3, 1.0)}</geometry></collision></link>"
        f"{model('inner', cylinder(0.1), '0 0 0 0 0 0', '0')}</model>"
    )
    found = read_sdf(sdf(tmp_path, nested))
    assert found.unsupported == []
    first, second, inner = found.shapes
    # at (1, 2), turned left; then (1, 0) ahead, then (0, 1) to the left
    assert isinstance(first.shape, Rectangle)
    assert (first.shape.x, first.shape.y) == pytest.approx((0.0, 3.0))
    assert first.shape.yaw == pytest.approx(math.pi / 2 + 0.25)
    assert (first.shape.half_x, first.shape.half_y) == (0.5, 1.0)
    assert (first.bottom, first.top) == (-1.0, 2.0)
    assert isinstance(second.shape, Circle)
    assert astuple(second.shape) == pytest.approx((1.0, 3.0, 0.3))
    assert (inner.name, inner.shape.x, inner.shape.y) == ("outer-inner", 1.0, 2.0)
    assert len({shape.name for shape in found.shapes}) == 3


def test_box_may_rest_on_any_face(tmp_path: Path) -> None:
    path = sdf(tmp_path, model("plank", box("1 2 3"), f"0 0 1 {math.pi / 2} 0 0.3"))
    (plank,) = read_sdf(path).shapes
    # rolled about x: the edge of 2 m is vertical, those of 1 m and 3 m are horizontal
    assert plank.top - plank.bottom == pytest.approx(2.0)
    assert isinstance(plank.shape, Rectangle)
    assert sorted((plank.shape.half_x, plank.shape.half_y)) == pytest.approx([0.5, 1.5])
    world = import_world(path, start=(-5, 0, 0), goal=(5, 1)).world
    turned = Pose(0.0, 0.0, 0.3)
    corners = sorted(turned.to_parent(x, y) for x in (-0.5, 0.5) for y in (-1.5, 1.5))
    (solid,) = SceneGeometry.from_world(world).solids
    np.testing.assert_allclose(sorted(solid.shape.corners.tolist()), corners, atol=1e-3)


def test_saved_state_moves_models(tmp_path: Path) -> None:
    state = "<state world_name='w'><model name='post'><pose>4 5 0 0 0 0</pose></model></state>"
    (post,) = read_sdf(sdf(tmp_path, model("post", cylinder()), state)).shapes
    assert (post.shape.x, post.shape.y) == (4.0, 5.0)


UNSUPPORTED = {
    "heightmap": model("hill", "<heightmap><uri>a.png</uri></heightmap>"),
    "polyline": model("fence", "<polyline><point>0 0</point></polyline>"),
    "mesh": model("robot", "<mesh><uri>file://a.dae</uri></mesh>"),
    "plane": model("side", "<plane><normal>1 0 0</normal></plane>"),
    "part": model("wheel", "<mesh><uri>file://a.dae</uri><submesh/></mesh>"),
    "include": "<include><uri>model://cafe_table</uri></include>",
    "population": "<population name='cans'/>",
}


@pytest.mark.parametrize("what", UNSUPPORTED)
def test_unsupported_elements_are_errors_with_line_and_name(tmp_path: Path, what: str) -> None:
    path = sdf(tmp_path, model("post", cylinder(), "3 3 0.5 0 0 0"), UNSUPPORTED[what])
    with pytest.raises(InputError, match="--skip-unsupported") as caught:
        import_world(path, start=(0, 0, 0), goal=(0, 4))
    name = {"include": "cafe_table", "population": "cans"}.get(what)
    assert (name or UNSUPPORTED[what].split("'")[1]) in str(caught.value)
    assert "line 7" in str(caught.value)
    made = import_world(path, start=(0, 0, 0), goal=(0, 4), skip_unsupported=True)
    assert len(made.skipped) == 1
    assert [c.name for c in made.world.cylinders] == ["post"]
    assert made.world.boxes == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("not xml at all", "not XML"),
        ("<sdf><world>", "not XML"),
        ("<robot name='r'/>", "expected an SDF world, got <robot>"),
        ("<sdf version='1.6'/>", "expected one <world>, found 0"),
        ("<sdf><world><model name='m'><pose>1 2 x 0 0 0</pose></model></world></sdf>", "6 numbers"),
        ("<sdf><world><model name='m'><pose>1 2</pose></model></world></sdf>", "6 numbers"),
        ("<sdf><world><model name='m'><pose>nan 0 0 0 0 0</pose></model></world></sdf>", "6 numb"),
        (f"<sdf><world>{model('m', cylinder(-1))}</world></sdf>", "above 0 m"),
        (f"<sdf><world>{model('m', '<box/>')}</world></sdf>", "above 0 m, got none"),
    ],
)
def test_invalid_files_are_errors(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.world"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        read_sdf(path)
    assert "bad.world:1" in str(caught.value)


def test_levels_and_overlaps(tmp_path: Path) -> None:
    path = sdf(
        tmp_path,
        model("post", cylinder(0.2, 1.0), "2 2 0.2 0 0 0"),
        model("beam", box("1 1 0.4"), "3 3 2 0 0 0"),
        model("mine", box(), "4 4 -5 0 0 0"),
        model("wall", box("4 0.2 2"), "0 5 1 0 0 0"),
        model("wall", box("0.2 4 2"), "2 5 1 0 0 0"),
    )
    made = import_world(path, start=(0, 0, 0), goal=(0, 4))
    (post,) = made.world.cylinders
    assert (post.base, post.height) == pytest.approx((0.0, 0.7))
    beam, *walls = made.world.boxes
    assert (beam.base, beam.size[2]) == pytest.approx((1.8, 0.4))
    assert [wall.name for wall in walls] == ["wall", "wall-2"]
    load_world(made.write(tmp_path / "out") / "world.yaml")  # the walls overlap


def test_start_and_goal_must_be_given_and_free(tmp_path: Path) -> None:
    path = sdf(tmp_path, model("post", cylinder(1.0), "2 2 0.5 0 0 0"))
    ends: list[tuple[type[InputError], str, dict[str, Any]]] = [
        (InputError, "give --start and --goal", {}),
        (InputError, "give --goal", {"start": (0, 0, 0)}),
        (WorldError, r"the goal .* 'post'", {"start": (0, 0, 0), "goal": (2, 2)}),
        (InputError, "start", {"start": (0, 0, 99), "goal": (0, 4)}),
    ]
    for error, message, chosen in ends:
        with pytest.raises(error, match=message):
            import_world(path, **chosen)
    sides = [(0, 2, "4.2 0.1 1"), (0, -2, "4.2 0.1 1"), (2, 0, "0.1 4.2 1"), (-2, 0, "0.1 4.2 1")]
    fence = [model(f"fence-{x}{y}", box(size), f"{x} {y} 0.5 0 0 0") for x, y, size in sides]
    with pytest.raises(WorldError, match="cannot be reached"):
        import_world(sdf(tmp_path, *fence), start=(0, 0, 0), goal=(5, 0))


def barn(tmp_path: Path) -> Path:
    """A world like BARN's: poles half below the ground, on a grid of 0.15 m."""
    poles = [
        model(f"unit_cylinder_{i}", cylinder(0.075), f"{-4.425 + 0.15 * i:.3f} 0.075 0 0 0 0")
        for i in range(30)
    ]
    poles.append(model("unit_cylinder_30", cylinder(0.075), "-2.2 7 0 0 0 0"))
    return sdf(tmp_path, *poles)


def test_barn_worlds_have_the_standard_mission(tmp_path: Path) -> None:
    made = import_world(barn(tmp_path))
    assert made.barn
    assert made.mission.start == (-2.25, 3.0, 1.57)
    assert made.mission.timeout == 100.0
    assert made.mission.success.within == 1.0
    assert {pole.height for pole in made.world.cylinders} == {POLE_HEIGHT}
    assert "Added: the poles' height of 1 m, procedural textures" in made.world.description
    assert made.shortest == pytest.approx(10.0, abs=0.1)
    session = prepare(made.write(tmp_path / "out"), "cross")
    assert session.mission.goals[0].x == -2.25
    other = import_world(barn(tmp_path), start=(-1.0, 2.0, 0.0), goal=(-1.0, 8.0))
    assert other.mission.start == (-1.0, 2.0, 0.0)


def test_the_reference_path_runs_from_the_start_over_its_cells_to_the_goal(tmp_path: Path) -> None:
    # straight ahead: column 16 at x = -2.175, rows 0 and 29 at y = 5.075 and 9.425
    np.save(tmp_path / "path_7.npy", np.array([[16, 0], [16, 29]]))
    ends = np.hypot(0.075, 5.075 - 3.0) + np.hypot(0.075, 13.0 - 9.425)
    expected = pytest.approx(ends + 29 * 0.15, abs=1e-3)
    assert reference_length(tmp_path / "world_7.world") == expected
    for without in ("world_8", "depot"):
        assert reference_length(tmp_path / f"{without}.world") is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (np.zeros((3, 3)), "expected finite cells"),
        (np.array(["a"]), "expected finite cells"),
        (np.array([[np.nan, 1.0]]), "expected finite cells"),
        (np.array([{}], dtype=object), "no NumPy array"),
        (None, "no NumPy array"),
    ],
)
def test_a_file_that_holds_no_path_is_refused(
    tmp_path: Path, content: np.ndarray | None, message: str
) -> None:
    file = tmp_path / "path_7.npy"
    if content is None:
        file.write_bytes(b"\x93NUMPY\x01\x00")
    else:
        np.save(file, content, allow_pickle=True)
    with pytest.raises(ConfigError, match=f"path_7.npy.*{message}"):
        reference_length(tmp_path / "world_7.world")


@pytest.mark.skipif("NAVFW_BARN" not in os.environ, reason="NAVFW_BARN names no folder of worlds")
def test_real_barn_worlds() -> None:
    files = sorted(Path(os.environ["NAVFW_BARN"]).glob("world_*.world"))
    assert files
    for file in files:
        made = import_world(file)
        assert made.barn
        assert 10.0 <= made.shortest <= 12.0


def test_import_command(tmp_path: Path) -> None:
    out = tmp_path / "out"
    data = answer("world", "import", barn(tmp_path), "--out", out)
    assert (data["cylinders"], data["boxes"], data["skipped"], data["barn"]) == (31, 0, [], True)
    assert load_world(out / "world.yaml").name == "hall"
    path = sdf(tmp_path, UNSUPPORTED["heightmap"])
    words = ("world", "import", path, "--out", out, "--start", "-1,0,0.5", "--goal", "2,-3")
    assert "'hill'" in refusal(*words)
    done = invoke(*words, "--skip-unsupported")
    assert done.exit_code == 0, done.stderr
    assert "left out: line" in done.stderr
    for bad in ("1,2,3", "a,b", "1", "nan,1"):
        said = refusal(*words, "--goal", bad)
        assert said == f"navfw: --goal: expected X,Y, got {bad!r}\n"


def test_several_files_are_imported_and_a_damaged_one_costs_itself_alone(tmp_path: Path) -> None:
    files = [barn(tmp_path).rename(tmp_path / f"world_{n}.world") for n in (2, 1)]
    broken = tmp_path / "broken.world"
    broken.write_text("<sdf><world>")
    out = tmp_path / "out"
    words = ("world", "import", files[0], broken, files[1], "--out", out)
    done = invoke(*words, "--json")
    assert done.exit_code == 2
    folders = [made["folder"] for made in json.loads(done.stdout)]
    assert folders == [str(out / "world_2"), str(out / "world_1")]
    assert sorted(path.name for path in out.iterdir()) == ["world_1", "world_2"]
    assert done.stderr.splitlines()[-1].startswith(f"navfw: {broken}:1: expected an SDF world")
    assert "import: 3 of 3 files" in done.stderr
    again = invoke(*words, "--quiet")
    assert len(again.stderr.splitlines()) == 1
    assert again.stdout.count("navfw run ") == 2


def test_two_files_of_one_name_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    file, out = barn(tmp_path), tmp_path / "out"
    (tmp_path / "other").mkdir()
    twin = tmp_path / "other" / file.name
    twin.write_bytes(file.read_bytes())
    refused = sole_refusal("world", "import", file, twin, "--out", out)
    assert f"{twin}: a second file called '{file.stem}'" in refused
    assert not out.exists()


def test_generate_command(tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("world", "new", "clutter", "--seed", "4", "--difficulty", "0.25", "--out", out)
    data = answer(*words)
    assert (data["family"], data["seed"], data["map"]) == ("clutter", 4, False)
    assert prepare(out, data["mission"]).shortest == pytest.approx(data["shortest_path_m"])
    assert "navfw run" in invoke(*words).stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rooom"], "unknown family plugin 'rooom': did you mean 'rooms'?"),
        (["rooms", "--seed", "-3"], "seed: expected a seed from 0"),
        (["rooms", "--difficulty", "1.01"], "difficulty: expected 0 to 1, got 1.01"),
        (["rooms", "--difficulty", "easy"], "--difficulty"),
    ],
)
def test_generate_reports_invalid_arguments(words: list[str], message: str, tmp_path: Path) -> None:
    assert message in refusal("world", "new", *words, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()
