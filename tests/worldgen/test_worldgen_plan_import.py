"""Import of floor plans: world, map and missions, and what is refused."""

from __future__ import annotations

import hashlib
import json
import math
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_plans import PLANS
from typer.testing import CliRunner

from navfw.cli import app
from navfw.errors import InputError
from navfw.missions import chosen_stack, load_mission
from navfw.signals import Pose
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import FREE, OccupancyMap, check_map, load_map, map_text, save_ros_map
from navfw.worldgen import ImportedPlan, import_plan


@cache
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


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("thick-walls", "5ddf2a033506"),
        ("long-corridors", "1e2402d17722"),
        ("open-hall", "8b692feaa24a"),
        ("curved-walls", "fa96a32dc1db"),
        ("clutter", "bfd4c8ccb5dd"),
    ],
)
def test_a_plan_gives_always_the_same_world(name: str, digest: str) -> None:
    made = imported(name)
    missions = [mission.model_dump_json() for mission in made.missions.values()]
    text = "".join([made.world.model_dump_json(), map_text(made.topo_map), *missions])
    assert hashlib.sha256(text.encode()).hexdigest().startswith(digest)


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


def test_doors_in_slanted_walls() -> None:
    places = imported("clutter").topo_map.places.values()
    assert sum(place.kind == "door" for place in places) == 3


def test_columns_in_a_hall_are_no_doors() -> None:
    places = imported("open-hall").topo_map.places.values()
    assert "door" not in {place.kind for place in places}
    assert all(place.name.startswith("hall") for place in places)


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


def test_the_command(tmp_path: Path) -> None:
    save_ros_map(PLANS["thick-walls"](), tmp_path / "hall.yaml")
    out = ["--out", str(tmp_path / "w")]
    result = CliRunner().invoke(
        app, ["world", "import", str(tmp_path / "hall.yaml"), *out, "--json"]
    )
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    assert (data["walls"], data["doors"]) == (16, 6)
    assert math.isclose(data["size_m"][0], 16.8)
    image = ["world", "import", str(tmp_path / "hall.png"), *out]
    for options, message in (
        ([], "give --resolution"),
        (["--resolution", "0"], "expected 0.001 to 10 m"),
        (["--resolution", "0.05", "--start", "1,2,3"], "--start: is not for .png files"),
        (["--resolution", "0.05", "--speckle", "9"], "--speckle"),
    ):
        result = CliRunner().invoke(app, [*image, *options])
        assert result.exit_code == 2, options
        assert message in result.output
    assert cv2.imwrite(str(tmp_path / "hall.bmp"), np.full((80, 120), 255, np.uint8))
    bare = ["world", "import", str(tmp_path / "hall.bmp"), *out, "--resolution", "0.1"]
    result = CliRunner().invoke(app, bare)
    assert result.exit_code == 0, result.output
    assert "4 walls, 12 x 8 m" in result.output
