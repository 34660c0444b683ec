"""Meshes of Gazebo worlds: their collision geometry as solids, where they are found, bad files."""

import math
from dataclasses import astuple
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cli_calls import answer, refusal

from navfw.errors import ConfigError, InputError, WorldError
from navfw.missions import prepare
from navfw.numerics import Array
from navfw.sim import SceneGeometry
from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.upright_parts import UprightPart, mesh_solids
from navfw.worldgen import sdf_reader
from navfw.worldgen.gazebo_import import ImportedWorld, import_world

MAX_PARTS = 4000

POINT = tuple[float, float]


def quad(*corners: tuple[float, float, float]) -> Array:
    """The two triangles of a quadrangle."""
    return np.array([[corners[i] for i in ids] for ids in ((0, 1, 2), (0, 2, 3))], float)


def strip(outer: list[POINT], inner: list[POINT], low: float, high: float) -> Array:
    """Triangles of a closed wall between two lines of as many points, from ``low`` to ``high``."""
    pairs = list(zip(outer, inner, strict=True))
    quads, sides = [], [pairs[0], pairs[-1]]
    for (a, b), (c, d) in pairwise(pairs):
        quads += [quad(*((*p, level) for p in (a, c, d, b))) for level in (low, high)]
        sides += [(a, c), (b, d)]
    quads += [quad((*p, low), (*q, low), (*q, high), (*p, high)) for p, q in sides]
    return np.concatenate(quads)


def block(x: POINT, y: POINT, z: POINT) -> Array:
    return strip([(x[0], y[0]), (x[1], y[0])], [(x[0], y[1]), (x[1], y[1])], *z)


ELL = strip([(0, 0), (2, 0), (2, 3)], [(0, 1), (1, 1), (1, 3)], 0.0, 1.5)
"""An L of 2 x 3 m with legs of 1 m."""
HOUSE = np.concatenate(
    [
        strip(
            [(2.4, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1.6, 0)],
            [(2.4, 0.2), (3.8, 0.2), (3.8, 3.8), (0.2, 3.8), (0.2, 0.2), (1.6, 0.2)],
            -0.5,
            2.5,
        ),
        block((1.6, 2.4), (0.0, 0.2), (2.0, 2.5)),
    ]
)
"""Walls around 4 x 4 m with a door 0.8 m wide, which has a lintel at 2 m, and a foundation."""


def turned(triangles: Array, yaw: float) -> Array:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.asarray(triangles @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))


def distance(parts: list[UprightPart], points: Array, height: float) -> Array:
    """Distance [m] of points (n, 2) to the solids at ``height``; negative inside of one."""
    distances = [p.shape.distance(points) for p in parts if p.bottom <= height <= p.top]
    return np.min(distances, axis=0) if distances else np.full(len(points), np.inf)


def grid(low: float, high: float, step: float = 0.07) -> Array:
    axis = np.arange(low, high, step)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_block_becomes_one_rectangle(yaw: float) -> None:
    (part,) = mesh_solids(turned(block((1, 3), (2, 2.5), (0.2, 1.1)), yaw))
    assert isinstance(part.shape, Rectangle)
    assert (part.bottom, part.top) == pytest.approx((0.2, 1.1))
    middle = turned(np.array([[2.0, 2.25, 0.0]]), yaw)[0]
    assert (part.shape.x, part.shape.y) == pytest.approx(tuple(middle[:2]), abs=1e-4)
    assert sorted((part.shape.half_x, part.shape.half_y)) == pytest.approx([0.25, 1.0], abs=1e-4)
    assert math.cos(4.0 * (part.shape.yaw - yaw)) == pytest.approx(1.0, abs=1e-4)


def test_a_drum_becomes_one_circle() -> None:
    drum = trimesh.creation.cylinder(radius=0.3, height=1.0, sections=24)
    drum.apply_translation((1.0, -2.0, 0.4))
    (part,) = mesh_solids(np.asarray(drum.triangles))
    assert isinstance(part.shape, Circle)
    assert (part.shape.x, part.shape.y, part.shape.radius) == pytest.approx((1, -2, 0.3), abs=0.004)
    assert (part.bottom, part.top) == pytest.approx((0.0, 0.9))  # the floor crosses it


@pytest.mark.parametrize("yaw", [0.0, 0.3, 2.0])
def test_a_concave_outline_becomes_several_rectangles(yaw: float) -> None:
    parts = mesh_solids(turned(ELL, yaw))
    assert len(parts) == 2
    points = grid(-1.0, 4.0)
    legs = [Rectangle(1.0, 0.5, 1.0, 0.5), Rectangle(1.5, 1.5, 0.5, 1.5)]
    true = np.min([leg.distance(points) for leg in legs], axis=0)
    flat = np.column_stack([points, np.zeros(len(points))])
    found = distance(parts, turned(flat, yaw)[:, :2], 1.0)
    near = np.abs(true) < 0.8
    assert np.all(found[near & (true < -0.05)] < 0.0)
    assert np.abs(found - true)[near & (true > 0.0)].max() < 0.05


def test_a_table_is_free_below_its_top() -> None:
    legs = [
        block((x, x + 0.06), (y, y + 0.06), (0, 0.72)) for x in (0.0, 1.34) for y in (0.0, 0.74)
    ]
    top = block((-0.05, 1.45), (-0.05, 0.85), (0.72, 0.75))
    parts = mesh_solids(np.concatenate([*legs, top]))
    assert len(parts) == 5
    assert sorted(part.bottom for part in parts) == pytest.approx([0.0] * 4 + [0.72], abs=0.011)
    assert distance(parts, np.array([[0.7, 0.4]]), 0.3)[0] > 0.3
    assert distance(parts, np.array([[0.7, 0.4]]), 0.74)[0] < 0.0


def test_a_house_keeps_its_door_and_lintel() -> None:
    parts = mesh_solids(HOUSE)
    numbers = [(*astuple(part.shape)[:4], part.bottom, part.top) for part in parts]
    sums = [18.09, 16.15, 14.86, 0.99, 8.0, 20.0]
    assert np.sum(numbers, axis=0) == pytest.approx(sums, abs=1e-6)
    way = np.column_stack([np.full(50, 2.0), np.linspace(-2.0, 2.0, 50)])
    assert distance(parts, way, 1.0).min() == pytest.approx(0.4, abs=0.03)
    assert distance(parts, way, 2.2).min() < 0.0
    around = np.array([[0.1, 2.0], [3.9, 2.0], [2.0, 3.9], [1.0, 0.1], [3.0, 0.1]])
    assert np.all(distance(parts, around, 1.0) < 0.0)


def test_open_surfaces_are_thin() -> None:
    sheet = quad((0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1))
    top = quad((0, 1, 0.7), (1, 1, 0.7), (1, 2, 0.7), (0, 2, 0.7))
    wall, plate = mesh_solids(np.concatenate([sheet, top]))
    assert isinstance(wall.shape, Rectangle)
    assert sorted((wall.shape.half_x, wall.shape.half_y)) == pytest.approx([0.01, 1.0], abs=1e-3)
    assert (plate.bottom, plate.top) == pytest.approx((0.68, 0.7))
    assert distance([plate], np.array([[0.5, 1.5]]), 0.69)[0] == pytest.approx(-0.5, abs=0.01)


def test_what_is_below_the_floor_or_above_the_world_is_left_out() -> None:
    assert mesh_solids(block((0, 1), (0, 1), (-2, -0.1))) == []
    assert mesh_solids(block((0, 1), (0, 1), (20.5, 22))) == []
    (tower,) = mesh_solids(block((0, 1), (0, 1), (1, 300)))
    assert (tower.bottom, tower.top) == (1.0, 20.0)


def test_curved_meshes_have_few_solids() -> None:
    ball = trimesh.creation.icosphere(radius=1.0).triangles
    parts = mesh_solids(ball + np.array([0.0, 0.0, 0.5]))
    assert len(parts) == 18
    assert sum(astuple(part.shape)[2] for part in parts) == pytest.approx(13.6820926)
    for part in parts:
        widest = math.sqrt(1.0 - min(abs(part.bottom - 0.5), abs(part.top - 0.5), 0.99) ** 2)
        assert isinstance(part.shape, Circle)
        assert part.shape.radius == pytest.approx(widest, abs=0.06)


def test_too_many_parts_are_refused() -> None:
    side = math.isqrt(MAX_PARTS) + 2
    posts = [block((x, x + 0.1), (y, y + 0.1), (0, 1)) for x in range(side) for y in range(side)]
    with pytest.raises(WorldError, match="more than 4000 solids; simplify"):
        mesh_solids(0.3 * np.concatenate(posts))


def obj(path: Path, triangles: Array) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    trimesh.Trimesh(triangles.reshape(-1, 3), faces).export(path)
    return path


def sdf(folder: Path, uri: str, more: str = "", pose: str = "0 0 0 0 0 0") -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / "hall.world"
    path.write_text(
        "<?xml version='1.0'?>\n<sdf version='1.6'><world name='w'>\n"
        f"<model name='house'><static>1</static><pose>{pose}</pose><link name='l'>"
        "<collision name='c'>\n"
        f"<geometry><mesh><uri>{uri}</uri>{more}</mesh></geometry></collision></link></model>"
        "</world></sdf>"
    )
    return path


def imported(path: Path, models: Path | None = None) -> ImportedWorld:
    return import_world(path, start=(2.0, -2.0, 1.57), goal=(2.0, 2.0), models=models)


@pytest.mark.parametrize("kind", ["obj", "stl", "dae"])
def test_a_robot_drives_into_a_house(tmp_path: Path, kind: str) -> None:
    obj(tmp_path / "meshes" / f"house.{kind}", HOUSE)
    made = imported(sdf(tmp_path, f"file://meshes/house.{kind}"))
    assert made.meshes == 1
    assert made.shortest == pytest.approx(4.0, abs=0.01)
    assert "upright parts of a mesh" in made.world.description
    plan = SceneGeometry.from_world(made.world, 0.4)
    with pytest.raises(WorldError, match="cannot be reached"):
        plan.shortest_path((2.0, -2.0), (2.0, 2.0), 0.42)


def test_sheets_of_all_heights_stay_in_the_world(tmp_path: Path) -> None:
    level = quad((5, 1, 0), (6, 1, 0), (6, 2, 0), (5, 2, 0))
    heights = np.arange(0.1, 1.0, 0.1)
    sheets = [level + np.array([0.0, 1.5 * n, height]) for n, height in enumerate(heights)]
    obj(tmp_path / "tops.obj", np.concatenate(sheets))
    boxes = imported(sdf(tmp_path, "tops.obj")).world.boxes
    assert sorted(box.base + box.size[2] for box in boxes) == pytest.approx(heights.tolist())
    assert {box.size[2] for box in boxes} == {0.02}


def test_scale_and_pose(tmp_path: Path) -> None:
    obj(tmp_path / "b.obj", block((-0.5, 0.5), (-0.5, 0.5), (0, 1)))
    # rolled about x: what was up is ahead along -y
    pose = f"6 1 0.5 {math.pi / 2} 0 0"
    (box,) = imported(sdf(tmp_path, "b.obj", "<scale>2 1 3</scale>", pose)).world.boxes
    assert box.at == pytest.approx((6.0, -0.5), abs=1e-3)
    assert (box.base, box.size[2]) == pytest.approx((0.0, 1.0), abs=1e-3)
    assert sorted(box.size[:2]) == pytest.approx([2.0, 3.0], abs=1e-3)


def test_the_unit_of_a_collada_file_counts(tmp_path: Path) -> None:
    file = obj(tmp_path / "b.dae", 100.0 * block((5, 6), (0, 2), (0, 1)))
    unit = '<unit name="centimeter" meter="0.01"/></asset>'
    text = file.read_text()
    assert text.count("</asset>") == 1
    assert "<unit" not in text
    file.write_text(text.replace("</asset>", unit))
    (box,) = imported(sdf(tmp_path, "b.dae")).world.boxes
    assert sorted(box.size) == pytest.approx([1.0, 1.0, 2.0], abs=1e-3)


def test_models_are_looked_up_in_folders(tmp_path: Path) -> None:
    world = tmp_path / "world"
    path = sdf(world, "model://hut/meshes/b.obj")
    with pytest.raises(InputError, match=r"(?s)line 4: the mesh 'model:.*--models"):
        imported(path)
    obj(tmp_path / "far" / "hut" / "meshes" / "b.obj", block((5, 6), (0, 2), (0, 1)))
    assert len(imported(path, tmp_path / "far").world.boxes) == 1
    obj(world / "models" / "hut" / "meshes" / "b.obj", block((5, 6), (0, 2), (0, 2)))
    assert imported(path, tmp_path / "far").world.boxes[0].size[2] == 2.0


@pytest.mark.parametrize("uri", ["", "../secret.obj", "/etc/b.obj", "http://x.y/b.obj", "no.obj"])
def test_no_mesh_is_read_from_elsewhere(tmp_path: Path, uri: str) -> None:
    world = tmp_path / "world"
    world.mkdir()
    obj(tmp_path / "secret.obj", block((5, 6), (0, 2), (0, 1)))
    (world / "link.obj").symlink_to(tmp_path / "secret.obj")
    for name in (uri, "link.obj"):
        with pytest.raises(InputError, match=r"not found\nlooked in .*; name the folder"):
            imported(sdf(world, name))


def test_meshes_have_a_bounded_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    obj(tmp_path / "house.obj", HOUSE)
    path = sdf(tmp_path, "house.obj")
    monkeypatch.setattr(sdf_reader, "_MAX_TRIANGLES", 20)
    with pytest.raises(ConfigError, match=r"house\.obj: has more than 20 triangles; simplify"):
        imported(path)


def test_command(tmp_path: Path) -> None:
    obj(tmp_path / "far" / "hut" / "b.obj", HOUSE)
    path, out = sdf(tmp_path / "world", "model://hut/b.obj"), tmp_path / "out"
    words = f"world import {path} --out {out} --start 2,-2,1.57 --goal 2,2".split()
    assert "line 4" in refusal(*words)
    assert answer(*words, "--models", tmp_path / "far")["meshes"] == 1
    assert prepare(out, "cross").shortest == pytest.approx(4.0, abs=0.01)
