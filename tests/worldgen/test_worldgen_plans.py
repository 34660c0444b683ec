"""Floor plans: worlds, maps and missions of them, few walls, export, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from cli_calls import answer, output, refusal
from drawn_plans import PLANS, hall_of_columns, with_noise
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.config import find
from navfw.errors import InputError
from navfw.missions.missionfile import load_mission
from navfw.missions.session_setup import chosen_stack
from navfw.numerics import Mask
from navfw.signals import Pose
from navfw.sim import SceneGeometry, load_world
from navfw.sim.plan_walls import wall_rectangles
from navfw.sim.shapes import Rectangle
from navfw.topomap import load_map
from navfw.topomap.map_check import check_map
from navfw.topomap.occupancy_map import FREE, OccupancyMap, load_ros_map, save_ros_map
from navfw.worldgen.plan_cleaning import cleaned
from navfw.worldgen.plan_exchange import ImportedPlan, exported_plan, import_plan

CELL = 0.05


def touched_by(free: Mask) -> Mask:
    """The cells that are not free and touch free ground."""
    return (cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~free


def imported(name: str) -> ImportedPlan:
    return import_plan(PLANS[name](), name)


def test_openings_in_thick_walls_are_doors_between_named_rooms(tmp_path: Path) -> None:
    made = imported("thick-walls")
    folder = made.write(tmp_path / "thick")
    topo_map = load_map(folder / "map.yaml")
    doors = [place for place in topo_map.places.values() if place.kind == "door"]
    assert {door.name for door in doors} == {f"corridor-room-{n}-door" for n in range(1, 7)}
    for n in range(1, 7):
        assert topo_map.place(f"room-{n}").kind == "room"
        assert topo_map.place(f"corridor-room-{n}-door").y == pytest.approx(
            7.7 if n <= 3 else 4.3, abs=0.1
        )
    assert topo_map.landmarks == {}
    plan = SceneGeometry.from_world(load_world(folder / "world.yaml"))
    assert check_map(topo_map, plan.clearances) == []
    assert topo_map.floor_plan is not None
    assert topo_map.floor_plan.free.sum() == PLANS["thick-walls"]().free.sum()
    assert max(made.lengths.values()) > 15.0
    for name in made.missions:
        mission = load_mission(folder / "missions" / f"{name}.yaml")
        assert chosen_stack(mission).stem == "floor_plan"
        assert mission.check(plan) > 3.0


@pytest.mark.parametrize("name", ["thick-walls", "long-corridors"])
def test_long_ways_on_the_map_are_nearly_the_shortest(name: str) -> None:
    made = imported(name)
    plan = SceneGeometry.from_world(made.world)
    name, length = max(made.lengths.items(), key=lambda item: item[1])
    mission = made.missions[name]
    start = made.topo_map.place(name.split("-to-")[0])
    goal = made.topo_map.place(str(mission.goals[0]))
    shortest = plan.shortest_path((start.x, start.y), (goal.x, goal.y), 0.18)[0]
    assert length > 10.0
    assert length < 1.1 * shortest


def test_slanted_walls_have_doors_and_columns_in_a_hall_are_none() -> None:
    places = imported("clutter").topo_map.places.values()
    assert sum(place.kind == "door" for place in places) == 3
    places = imported("open-hall").topo_map.places.values()
    assert "door" not in {place.kind for place in places}
    assert all(place.name.startswith("hall") for place in places)
    assert len(places) <= 4  # at the kiosk's ends and corner: 39 with those of the columns


@pytest.mark.parametrize(("columns", "most"), [(4.0, 1), (3.0, 1), (1.5, 2)])
def test_a_hall_of_columns_is_one_place_with_its_doors(columns: float, most: int) -> None:
    plan = hall_of_columns(columns)
    made = import_plan(plan, "columns")
    topo_map = made.topo_map
    doors = [place.name for place in topo_map.places.values() if place.kind == "door"]
    beside = {passage.other(door) for door in doors for passage in topo_map.passages_at(door)}
    in_hall = {name for name in topo_map.places if name.split("-")[0] == "hall"}
    assert len(doors) == 3
    assert "hall" in in_hall - beside
    assert len(in_hall - beside) <= most
    assert check_map(topo_map, SceneGeometry.from_world(made.world).clearances) == []


def two_pieces(gap: float = 0.0) -> OccupancyMap:
    """12 x 7.6 and 7.3 x 7.6 m side by side, joined by an opening of ``gap`` [m]."""
    cells = np.full((160, 400), FREE, np.int8)
    cells[:4], cells[-4:], cells[:, :4], cells[:, -4:], cells[:, 244:250] = (100,) * 5
    cells[80 : 80 + round(gap / CELL), 244:250] = FREE
    return OccupancyMap(cells, CELL, Pose(0.0, 0.0, 0.0))


@pytest.mark.parametrize("gap", [0.0, 0.4])
def test_the_piece_with_a_point_is_taken(gap: float) -> None:
    plan = two_pieces(gap)  # the robot does not fit through 0.4 m
    large, small = import_plan(plan, "x"), import_plan(plan, "x", inside=(15.0, 1.0))
    assert [area for area, _ in large.clean.pieces] == pytest.approx([91.2, 55.5], abs=0.3)
    assert small.clean.pieces == large.clean.pieces[::-1]
    assert all(place.x < 12.0 for place in large.topo_map.places.values())
    assert all(place.x > 12.5 for place in small.topo_map.places.values())
    for point, message in (
        ((12.3, 3.0), "expected a point of free ground, (12.3, 3) is 0.13 m from it"),
        ((30.0, 3.0), "nearest is (19.78, 2.98), in a piece of"),
    ):
        with pytest.raises(InputError) as caught:
            import_plan(plan, "x", inside=point)
        assert message in str(caught.value)


def drawn_plan(*, rows: int = 280, columns: int = 380, at: int = 90) -> npt.NDArray[np.int8]:
    """Two rooms of 18 m^2 with a door between them, on a white sheet; from the top row down."""
    cells = np.full((rows, columns), FREE, np.int8)
    house = cells[at : at + 100, 110:270]
    house[:2], house[-2:], house[:, :2], house[:, -2:] = (100,) * 4
    house[:40, 79:81], house[60:, 79:81] = 100, 100
    return cells


@pytest.mark.parametrize("frame", [None, 0, 15])
@pytest.mark.parametrize("at", [0, 90])
def test_the_white_around_a_drawing_is_not_the_building(frame: int | None, at: int) -> None:
    cells = drawn_plan(at=at)
    if frame is not None and at:
        inside = cells[frame : 280 - frame, frame : 380 - frame]
        inside[:2], inside[-2:], inside[:, :2], inside[:, -2:] = (100,) * 4
    plan = OccupancyMap(cells, CELL, Pose(0.0, 0.0, 0.0))
    clean = cleaned(plan)
    area, (x, y) = clean.pieces[0]
    assert area == pytest.approx(37.1, abs=0.3)
    assert (5.5 < x < 13.5, 0.05 * at < y < 0.05 * at + 5.0) == (True, True)
    assert "are outside of the walls" in str(clean.assumed[-1])
    assert clean.picture is not None
    assert (clean.picture[::-1][at + 50, 150] == (80, 170, 60)).all()
    assert (clean.picture[::-1][at + 50, 350] == (70, 150, 240)).all()
    large = cleaned(plan, inside=(15.0, 5.0))
    assert large.pieces[0][0] > 100.0
    assert (large.assumed, large.picture) == ((), None)


def test_a_loop_around_closed_rooms_is_no_outside() -> None:
    cells = np.full((300, 400), FREE, np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = (100,) * 4
    cells[60:240, 60:340] = 100
    cells[62:238, 62:338] = FREE
    slam = np.pad(cells, 30, constant_values=-1)
    for drawn in (cells, slam):
        clean = cleaned(OccupancyMap(drawn, CELL, Pose(0.0, 0.0, 0.0)))
        if drawn is slam:
            assert clean.pieces[0][0] == pytest.approx(165.0, abs=5.0)
            assert "it is the largest of 2" in str(clean.assumed[0])
    small = np.full((200, 400), FREE, np.int8)  # a hall, cut off on all sides, with a closet
    small[50:90, 150:190] = 100
    small[52:88, 152:188] = FREE
    clean = cleaned(OccupancyMap(small, CELL, Pose(0.0, 0.0, 0.0)))
    assert clean.pieces[0][0] > 190.0
    assert "ground along the border of the image" in str(clean.assumed[0])


def test_missions_are_long_unless_the_plan_is_small() -> None:
    hall = import_plan(two_pieces(), "x")
    assert list(hall.topo_map.places) == ["hall"]
    plan = SceneGeometry.from_world(hall.world)
    assert 5.0 <= hall.lengths["to-hall"] < 9.0
    start = hall.missions["to-hall"].start
    assert isinstance(start, tuple)
    x, y, _ = start
    assert plan.clearance(x, y) > 0.18
    assert all(length >= 5.0 for length in imported("clutter").lengths.values())
    small = plan_of(free=True).cells[:60, :60]
    assert import_plan(OccupancyMap(small, CELL, Pose(0, 0, 0)), "x").lengths["to-room"] < 5.0


def test_the_origin_moves_and_turns_world_and_map() -> None:
    straight = PLANS["thick-walls"]()
    at = Pose(3.0, -2.0, 0.6)
    turned = OccupancyMap(straight.cells, straight.resolution, at)
    walls, moved = (import_plan(plan, "x").world.walls for plan in (straight, turned))
    assert len(walls) == len(moved)
    for wall, other in zip(walls, moved, strict=True):
        assert other.thickness == wall.thickness
        for point, there in zip(wall.points, other.points, strict=True):
            assert at.to_parent(*point) == pytest.approx(there, abs=0.01)


def refused(plan: OccupancyMap) -> str:
    with pytest.raises(InputError) as caught:
        import_plan(plan, "bad")
    return str(caught.value)


def plan_of(free: bool, resolution: float = 0.05, x: float = 0.0) -> OccupancyMap:
    cells = np.full((100, 100), FREE if free else 100, np.int8)
    return OccupancyMap(cells, resolution, Pose(x, 0, 0), Path("p.yaml"))


def test_plans_that_cannot_be_right() -> None:
    assert "p.yaml: the plan has no free ground" in refused(plan_of(free=False))
    assert "p.yaml: resolution: cells of 0.5 m are too coarse" in refused(plan_of(True, 0.5))
    small = refused(plan_of(True, 0.002))
    assert "no space is free" in small
    assert "0.2 x 0.2 m; is the resolution of 0.002 m per pixel right?" in small
    assert "p.yaml: origin: the plan spans x 599 to 606" in refused(plan_of(True, x=600.0))


def test_the_command_for_imports(tmp_path: Path) -> None:
    save_ros_map(PLANS["thick-walls"](), tmp_path / "hall.yaml")
    out = ("--out", tmp_path / "w")
    data = answer("world", "import", tmp_path / "hall.yaml", *out)
    assert (data["walls"], data["doors"]) == (16, 6)
    assert math.isclose(data["size_m"][0], 16.8)
    for options, message in (
        ((), "give --resolution"),
        (("--resolution", "0"), "expected 0.001 to 10 m"),
        (("--resolution", "0.05", "--start", "1,2,3"), "--start: is not for .png files"),
        (("--resolution", "0.05", "--speckle", "9"), "--speckle"),
    ):
        assert message in refusal("world", "import", tmp_path / "hall.png", *out, *options)
    hall = ("world", "import", tmp_path / "hall.yaml", *out)
    named = ("--name", "9,6=main", "--name", "2,2=dock", "--name", "3,4.8=gate")
    assert "dock" in str(answer(*hall, *named)["missions"])
    topo_map = load_map(tmp_path / "w" / "map.yaml")
    assert [topo_map.place(name).y > 4.6 for name in ("main", "dock", "gate")] == [1, 0, 1]
    for words, message in (
        (("--name", "2,2"), "expected X,Y=NAME"),
        (("--name", "2=dock"), "expected X,Y, got '2'"),
        (("--name", "2,2=dock", "--name", "9,6=dock"), "'dock' is given twice"),
        (("--name", "2,2=dock", "--name", "2.1,2=bay"), "'dock' and 'bay' are one place"),
        (("--name", "0.1,2=dock"), "'dock': (0.1, 2) is not in the free ground"),
        (("--inside", "0.1,2"), "expected a point of free ground"),
    ):
        assert message in refusal(*hall, *words)
    assert cv2.imwrite(str(tmp_path / "hall.bmp"), np.full((80, 120), 255, np.uint8))
    written = output("world", "import", tmp_path / "hall.bmp", *out, "--resolution", "0.1")
    assert "4 walls, 12 x 8 m" in written


@pytest.mark.parametrize("name", ["office", "paper-room"])
def test_a_world_exported_and_imported_has_the_same_free_ground(name: str) -> None:
    plan = exported_plan(load_world(find("world", name)))
    made = import_plan(plan, name, speckle=0.0, gap=0.0)
    ground = made.topo_map.floor_plan
    assert ground is not None
    # at the centres of the same cells: a second grid would have another origin
    at = plan.centres(*np.nonzero(np.ones(plan.cells.shape, np.bool_)))
    clearance = SceneGeometry.from_world(made.world).clearances(at).reshape(plan.cells.shape)
    inside = cv2.distanceTransform(ground.free.astype(np.uint8), cv2.DIST_L2, 5)
    assert inside[ground.free & (clearance < 0.0)].max(initial=0.0) < 2.0
    # what was solid beside free ground is solid, or within a cell, diagonally at most
    assert clearance[touched_by(ground.free)].max() < 1.5 * plan.resolution


def test_walls_only_leaves_out_furniture() -> None:
    world = load_world(find("world", "office"))
    all_, walls = exported_plan(world), exported_plan(world, walls_only=True)
    assert walls.occupied.sum() < all_.occupied.sum()
    assert not (walls.occupied & ~all_.occupied).any()
    box = world.boxes[0]
    assert all_.state(np.array([box.at])).tolist() == [100]
    assert walls.state(np.array([box.at])).tolist() == [0]


def test_the_command_for_exports(tmp_path: Path) -> None:
    out, command = tmp_path / "plan.yaml", ("map", "export", "paper-room", "--out")
    assert answer(*command, out, "--resolution", "0.1")["cells"] == [90, 50]
    assert load_ros_map(out).resolution == 0.1
    assert (tmp_path / "plan.pgm").read_bytes().startswith(b"P5")
    for options, message in (
        ((out, "--resolution", "0.0015"), "choose a larger resolution"),
        ((out, "--resolution", "0"), "expected 0.001 to 10 m"),
        ((out, "--image", "jpg"), "expected an image of .pgm"),
        ((tmp_path / "plan.txt",), "expected a .yaml file"),
    ):
        assert message in refusal(*command, *options)


def inside(walls: list[Rectangle], shape: tuple[int, ...], grow: float = 0.0) -> Mask:
    """The cells with their centre in a rectangle, or within ``grow`` cells of one."""
    i, j = np.indices(shape)
    centres = np.stack([(j + 0.5) * CELL, (i + 0.5) * CELL], axis=-1).reshape(-1, 2)
    distance = np.min([wall.distance(centres) for wall in walls], axis=0)
    found: Mask = (distance <= grow * CELL + 1e-9).reshape(shape)
    return found


def check(free: Mask) -> int:
    """Check that walls are where the plan has them, within a cell; returns their number."""
    free = np.pad(free, 2)
    walls = wall_rectangles(free, CELL)
    away = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5)
    covered = inside(walls, free.shape)
    assert away[covered].max(initial=0.0) < 2.0, "a wall stands on free ground"
    assert not (touched_by(free) & ~inside(walls, free.shape, 1.5)).any(), "a wall is missing"
    return len(walls)


FEW = {"thick-walls": 16, "long-corridors": 23, "open-hall": 13, "curved-walls": 60, "clutter": 10}


@pytest.mark.parametrize(("name", "most"), FEW.items())
def test_few_walls_are_where_the_plan_has_them(name: str, most: int) -> None:
    assert check(PLANS[name]().free) <= most


@pytest.mark.parametrize("name", ["thick-walls", "open-hall"])
def test_noise_does_not_become_a_wall_of_pixels(name: str) -> None:
    plan = PLANS[name]()
    noisy = cleaned(with_noise(plan, np.random.default_rng(3))).plan
    assert len(wall_rectangles(noisy.free, CELL)) <= 1.5 * len(wall_rectangles(plan.free, CELL))


@st.composite
def drawings(draw: st.DrawFn) -> Mask:
    """Free ground of some rectangles and slanted quadrangles, with solid ones in it."""
    free = np.zeros((70, 90), np.uint8)
    for value in (1, 1, 1, 0, 0):
        at = np.array([draw(st.integers(15, 75)), draw(st.integers(15, 55))])
        size = (draw(st.integers(8, 40)), draw(st.integers(8, 40)))
        box = cv2.boxPoints((at.tolist(), size, draw(st.sampled_from([0.0, 0.0, 17.0, 45.0]))))
        cv2.fillPoly(free, [np.round(box).astype(np.int32)], value)
    opened = cv2.morphologyEx(free, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0


@settings(max_examples=40, deadline=None)
@given(drawings())
def test_walls_cover_what_is_not_free_within_a_cell(free: Mask) -> None:
    if free.any():
        check(free)


def test_walls_of_one_pixel() -> None:
    free = np.ones((60, 80), np.bool_)
    free[:, 40] = False
    free[25:45, 40] = True
    free[[0, -1]] = free[:, [0, -1]] = False
    walls = wall_rectangles(free, CELL)
    assert len(walls) == 6
    thin = [wall for wall in walls if min(wall.half_x, wall.half_y) < CELL]
    assert [min(2 * wall.half_x, 2 * wall.half_y) for wall in thin] == pytest.approx([CELL] * 2)


def test_speckles_vanish_and_gaps_are_closed() -> None:
    plan = PLANS["open-hall"]()
    cells = plan.cells.copy()
    cells[40:42, 50] = 100  # two cells, in free ground
    cells[60:80, 60] = 100  # a thin wall stays
    spotted = type(plan)(cells, plan.resolution, plan.origin)
    free = cleaned(spotted).plan.free
    assert free[40:42, 50].all()
    assert not free[60:80, 60].any()
    assert not cleaned(spotted, speckle=0).plan.free[40:42, 50].any()
    wall = np.zeros((40, 60), np.int8)
    wall[:, 30:32] = 100
    wall[20:22, 30:32] = 0
    split = type(plan)(wall, 0.05, plan.origin)
    for gap in (0.15, 0.2):  # an odd and an even number of cells: one side is left
        assert cleaned(split, gap=gap).plan.free.sum() == 40 * 30
    assert cleaned(split, gap=0).plan.free.sum() == 40 * 58 + 4
