"""World files: shipped ones are valid, errors have file, line and key."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from navfw.errors import ConfigError, WorldError
from navfw.sim import SceneGeometry, WorldSpec, load_world, solids_of

WORLDS = Path(__file__).parents[2] / "worlds"

ROOM = """\
name: room
x: [0, 4]
y: [0, 4]
walls:
  - name: divider
    points: [[2, 0], [2, 4]]
    openings:
      - {name: gap, at: [2, 2], width: 1.0}
boxes:
  - name: crate
    at: [1, 1]
    size: [0.5, 0.5, 0.5]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "world.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["empty", "paper-room", "office"])
def test_shipped_worlds_load(name: str) -> None:
    assert load_world(WORLDS / name / "world.yaml").name == name


def test_wall_is_cut_by_its_opening(tmp_path: Path) -> None:
    world = load_world(write(tmp_path, ROOM))
    pieces = [s for s in solids_of(world) if s.name == "divider"]
    assert [s.kind for s in pieces] == ["wall", "lintel", "wall"]
    assert [s.shape.bounds[1::2] for s in pieces] == [(0.0, 1.5), (1.5, 2.5), (2.5, 4.0)]
    assert pieces[1].bottom == 2.05


def test_closed_door_fills_its_gap(tmp_path: Path) -> None:
    text = ROOM + "doors: [{name: leaf, opening: gap, state: %s}]\n"
    opened = load_world(write(tmp_path, text % "open"))
    closed = load_world(write(tmp_path, text % "closed"))
    assert SceneGeometry.from_world(opened).clearance(2, 2) == pytest.approx(0.5)
    assert SceneGeometry.from_world(closed).clearance(2, 2) < 0.0


@pytest.mark.parametrize(
    ("old", "new", "line", "parts"),
    [
        ("at: [2, 2], width", "at: [2.2, 2], width", 8, ["walls[0].openings[0].at", "gap"]),
        ("at: [2, 2], width", "at: [2, 3.8], width", 8, ["walls[0].openings[0].at", "divider"]),
        ("at: [1, 1]", "at: [1.8, 1]", 11, ["boxes[0].at", "'crate' overlaps 'divider'"]),
        ("at: [1, 1]", "at: [5, 1]", 11, ["boxes[0].at", "lies off the floor"]),
        ("name: crate", "name: divider", 10, ["boxes[0].name", "taken by walls[0].name"]),
        ("points: [[2, 0], [2, 4]]", "points: [[2, 0], [2, 9]]", 6, ["walls[0].points[1]"]),
        ("    at: [1, 1]", "    texture: wod\n    at: [1, 1]", 11, ["did you mean 'wood'?"]),
    ],
)
def test_impossible_worlds(tmp_path: Path, old: str, new: str, line: int, parts: list[str]) -> None:
    path = write(tmp_path, ROOM.replace(old, new))
    with pytest.raises(WorldError) as caught:
        load_world(path)
    assert caught.value.file == str(path)
    assert caught.value.line == line
    for part in parts:
        assert part in str(caught.value)


def test_unknown_opening_of_a_door(tmp_path: Path) -> None:
    path = write(tmp_path, ROOM + "doors: [{name: leaf, opening: gapp}]\n")
    with pytest.raises(WorldError, match="did you mean 'gap'"):
        load_world(path)


def test_overlapping_openings(tmp_path: Path) -> None:
    second = "\n      - {name: other, at: [2, 2.6], width: 0.5}"
    path = write(tmp_path, ROOM.replace("width: 1.0}", "width: 1.0}" + second))
    with pytest.raises(WorldError, match="'other' overlaps 'gap'"):
        load_world(path)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("size: [0.5, 0.5, 0.5]", "size: [0.5, -0.5, 0.5]", 12),
        ("x: [0, 4]", "x: [4, 0]", 2),
        ("width: 1.0", "widht: 1.0", 8),
    ],
)
def test_schema_errors_name_the_line(tmp_path: Path, old: str, new: str, line: int) -> None:
    path = write(tmp_path, ROOM.replace(old, new))
    with pytest.raises(ConfigError, match=f"world.yaml:{line}"):
        load_world(path)


def test_all_problems_are_reported_together(tmp_path: Path) -> None:
    text = ROOM.replace("at: [1, 1]", "at: [9, 1]").replace("at: [2, 2]", "at: [3, 2]")
    with pytest.raises(WorldError) as caught:
        load_world(write(tmp_path, text))
    assert "boxes[0].at" in str(caught.value)
    assert "walls[0].openings[0].at" in str(caught.value)


def test_office_is_drivable() -> None:
    """Doors 0.9 to 1.0 m wide, furniture 0.85 m from them, every room reachable."""
    office = load_world(WORLDS / "office" / "world.yaml")
    plan = SceneGeometry.from_world(office)
    furniture = SceneGeometry(plan.bounds, tuple(s for s in plan.solids if s.kind != "wall"))
    openings = [o for wall in office.walls for o in wall.openings]
    assert len(openings) == 9
    assert all(0.9 <= o.width <= 1.0 for o in openings)
    points = np.array([o.at for o in openings])
    assert furniture.clearances(points).min() > 0.85
    # also for a robot with a radius of 0.4 m
    for room in office.rooms:
        middle = (0.5 * sum(room.x), 0.5 * sum(room.y))
        if plan.clearance(*middle) < 0.4:
            middle = (room.x[0] + 1.5, room.y[1] - 1.2)
        assert plan.shortest_path((1.2, 1.2), middle, 0.4)[0] > 1.0


def test_lobby_to_lab_is_long_enough() -> None:
    plan = SceneGeometry.from_world(load_world(WORLDS / "office" / "world.yaml"))
    length, _ = plan.shortest_path((1.2, 1.2), (14.6, 8.8), 0.18)
    assert 15.0 < length < 20.0
    assert plan.clearance(14.6, 8.8) > 0.6


def test_worlds_without_file_are_checked() -> None:
    from navfw.sim import check_world

    with pytest.raises(WorldError, match="unknown texture"):
        check_world(WorldSpec(name="a", x=(0, 1), y=(0, 1), floor="lava"))


def test_errors_name_the_file_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (
        "name: a\nx: [0, 9]\ny: [0, 9]\nwalls: [{name: w, points: [[1, 1], [2, 2]], texture: t}]\n"
    )
    (tmp_path / "world.yaml").write_text(text)
    with pytest.raises(WorldError, match=r"^world\.yaml:4: walls\[0\]\.texture: unknown texture"):
        load_world(tmp_path / "world.yaml")
