"""Maps of what was observed: rooms, doors and dangers; two maps joined; bounds of memory."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from map_server import served_map
from mapping_scenes import ROBOT, ROOM, ROUND, drifted, drive, inside, poses_along

from navfw.mapping import GrowingMap, join, made_map
from navfw.mapping.map_making import cleaned_grid
from navfw.signals import GrownGrid, Pose
from navfw.signals.grown_grid import Evidence
from navfw.topomap.map_check import check_map
from navfw.topomap.map_formats import save_map
from navfw.topomap.occupancy_map import save_ros_map

LONG = ((0.0, 0.0), (4.0, 0.0), (5.0, -1.0), (5.0, 1.0), (4.0, 0.0), (0.0, 0.0), (-1.0, 1.0))


def driven(path: tuple[tuple[float, float], ...], start: Pose | None = None) -> GrowingMap:
    """The map of a drive along ``path``, in whose frame it began at ``start``."""
    growing = GrowingMap(ROBOT)
    growing.reset(start)
    drive(growing, ROOM, list(poses_along(path)))
    return growing


def test_two_rooms_and_their_door_are_found() -> None:
    growing = driven(ROUND)
    topo_map = made_map("pair", growing.grid, ROBOT.radius)
    doors = [place for place in topo_map.places.values() if place.kind == "door"]
    assert len(doors) == 1
    assert doors[0].distance(2.0, 0.0) < 0.1
    assert check_map(topo_map) == []
    plan = topo_map.floor_plan
    assert plan is not None
    walls = plan.centres(*np.nonzero(plan.occupied))
    around = [(a - 0.06, b + 0.06, c - 0.06, d + 0.06) for a, b, c, d in ROOM]
    assert inside(around, *walls.T).all()


@pytest.mark.parametrize("suffix", [".png", ".pgm"])
def test_a_saved_map_opens_in_map_server(tmp_path: Path, suffix: str) -> None:
    growing = driven(ROUND, Pose(0.3, -0.2, 0.4))  # walls are askew: a mirrored image is found out
    topo_map = made_map("pair", growing.grid, ROBOT.radius)
    assert topo_map.floor_plan is not None
    save_map(topo_map, tmp_path / "pair.yaml")
    file = tmp_path / "plans" / "pair.yaml"
    save_ros_map(topo_map.floor_plan, file, suffix)
    served, clean = served_map(file), cleaned_grid(growing.grid)
    assert np.array_equal(served.data == 100, clean.occupied)
    assert np.array_equal(served.data == 0, clean.free)
    assert np.array_equal(served.data == -1, clean.unseen)
    assert served.resolution == clean.cell
    corner = np.array(clean.origin) - 0.5 * clean.cell  # of the lower left pixel
    assert served.origin == pytest.approx((*corner, 0.0))
    rows, columns = np.nonzero(served.data == 100)
    walls = corner + (np.column_stack([columns, rows]) + 0.5) * served.resolution
    around = [(a - 0.06, b + 0.06, c - 0.06, d + 0.06) for a, b, c, d in ROOM]
    assert inside(around, *Pose(0.3, -0.2, 0.4).points_to_local(walls).T).all()


def test_a_robot_too_wide_for_the_door_gets_one_room() -> None:
    growing = driven(ROUND)
    narrow = made_map("pair", growing.grid, ROBOT.radius)
    wide = made_map("pair", growing.grid, 0.5)
    assert len({place.x > 2.0 for place in narrow.places.values()}) == 2
    assert len({place.x > 2.0 for place in wide.places.values()}) == 1


def test_passages_past_missing_floor_are_a_danger() -> None:
    growing = driven(ROUND)
    safe = made_map("pair", growing.grid, ROBOT.radius)
    assert all(passage.danger == 0.0 for passage in safe.passages)
    marked = made_map("pair", growing.grid, ROBOT.radius, np.array([[2.0, 0.0]]))
    for passage in marked.passages:
        ends = [marked.place(name) for name in (passage.a, passage.b)]
        through = min(end.x for end in ends) < 1.5 and max(end.x for end in ends) > 2.4
        assert passage.danger == 1.0 or not through
    assert any(passage.danger == 1.0 for passage in marked.passages)
    assert any(passage.danger == 0.0 for passage in marked.passages)


@settings(max_examples=25)
@given(st.integers(0, 2**16))
def test_cleaning_never_frees_what_is_surely_occupied(seed: int) -> None:
    rng = np.random.default_rng(seed)
    evidence: Evidence = np.full((30, 40), -40, np.int8)
    spots = rng.integers(2, (28, 38), (20, 2))
    evidence[spots[:, 0], spots[:, 1]] = rng.choice(np.array([30, 70, 100, 0]), 20)
    clean = cleaned_grid(GrownGrid(evidence, (0.0, 0.0), 0.05))
    lone = [
        (i, j)
        for i, j in spots.tolist()
        if evidence[i, j] == 100 and (evidence[i - 4 : i + 5, j - 4 : j + 5] > 0).sum() == 1
    ]
    assert all(clean.occupied[spot] for spot in lone)
    assert not (clean.free & (evidence == 100))[tuple(np.array(lone, int).reshape(-1, 2).T)].any()


@pytest.mark.thorough
def test_a_map_in_another_frame_is_joined_where_it_belongs() -> None:
    first, second = driven(LONG), driven(LONG, Pose(7.0, -3.0, 1.0))
    count = len(first.keys)
    assert join(first, second)
    assert len(first.keys) == count + len(second.keys)
    for key in first.keys[count:]:
        true = key.submap.key  # odometry is exact here, and begins at the same place
        assert math.dist((key.pose.x, key.pose.y), (true.x, true.y)) < 0.1


@pytest.mark.thorough
def test_maps_of_different_rooms_are_not_joined() -> None:
    other = GrowingMap(ROBOT)
    boxes = ((-3.0, 3.0, -3.0, -3.0), (-3.0, 3.0, 1.0, 1.0), (3.0, 3.0, -3.0, 1.0))
    drive(other, boxes, list(poses_along(((-2.0, -1.0), (2.0, -1.0), (2.0, 0.0), (-2.0, 0.0)))))
    first = driven(LONG)
    count = len(first.keys)
    assert not join(first, other)
    assert len(first.keys) == count


@pytest.mark.thorough
def test_memory_per_metre_is_bounded() -> None:
    growing = GrowingMap(ROBOT)
    truth = list(poses_along(ROUND * 3))
    drive(growing, ROOM, truth, drifted(truth, 0.0002))
    kept = sum(key.submap.evidence.nbytes for key in growing.keys)
    kept += sum(cloud.points.nbytes * 2 + cloud.sigma.nbytes for cloud in growing.clouds)
    metres = growing.keys[-1].path
    assert kept / metres < 40_000  # 200 MB after 5 km
