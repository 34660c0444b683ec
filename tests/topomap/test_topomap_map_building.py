"""Maps built of geometry: doors in place, free passages."""

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import cv2
import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from navfw.errors import MapError
from navfw.sim import SceneGeometry, WorldSpec, load_world
from navfw.topomap import TopoMap
from navfw.topomap.clearance_grid import ClearanceGrid, thinned
from navfw.topomap.map_builder import build_map
from navfw.topomap.map_check import check_map
from navfw.topomap.mapfile import map_text

ROOT = Path(__file__).parents[2]


def ground(*holes: Sequence[float], size: tuple[float, float] = (8.0, 4.0)) -> ClearanceGrid:
    """A floor of that size [m] with solid rectangles (x0, y0, x1, y1) on it."""

    def clearances(x: np.ndarray, y: np.ndarray, reach: float) -> np.ndarray:
        nearest = np.full((len(y), len(x)), reach)
        for x0, y0, x1, y1 in holes:
            dx = np.maximum(np.maximum(x0 - x, x - x1), 0.0)[None, :]
            dy = np.maximum(np.maximum(y0 - y, y - y1), 0.0)[:, None]
            inside = (dx == 0.0) & (dy == 0.0)
            nearest = np.minimum(nearest, np.where(inside, -0.01, np.hypot(dx, dy)))
        return nearest

    return ClearanceGrid.of((0.0, 0.0, *size), clearances)


@cache
def built(name: str) -> tuple[TopoMap, WorldSpec, SceneGeometry]:
    world = load_world(ROOT / "worlds" / name / "world.yaml")
    plan = SceneGeometry.from_world(world)
    rooms = {room.name: (*room.x, *room.y) for room in world.rooms}
    topo_map = build_map(name, ClearanceGrid.of(plan.bounds, plan.near_clearances), rooms=rooms)
    return topo_map, world, plan


WORLDS = ["office", "paper-room", pytest.param("hospital", marks=pytest.mark.slow)]


@pytest.mark.parametrize("name", WORLDS)
def test_a_built_map_fits_its_world(name: str) -> None:
    topo_map, _, plan = built(name)
    assert check_map(topo_map, plan.clearances) == []
    assert len(topo_map.parts) == 1


@pytest.mark.parametrize("name", ["office", pytest.param("hospital", marks=pytest.mark.slow)])
def test_doors_junctions_and_rooms_are_those_of_the_world(name: str) -> None:
    topo_map, world, _ = built(name)
    openings = [opening.at for wall in world.walls for opening in wall.openings]
    doors = [place for place in topo_map.places.values() if place.kind == "door"]
    assert len(doors) == len(openings)
    for x, y in openings:
        assert min(door.distance(x, y) for door in doors) < 0.12, (x, y)
    for door in doors:
        assert len(topo_map.passages_at(door.name)) == 2
    junctions = [place for place in topo_map.places.values() if place.kind == "junction"]
    assert junctions
    assert name != "office" or all(4.2 < place.y < 5.8 for place in junctions)
    for room in world.rooms:
        if "corridor" in room.name:
            continue
        place = topo_map.place(room.name)
        assert room.x[0] < place.x < room.x[1]
        assert room.y[0] < place.y < room.y[1]


def test_two_rooms_and_a_door() -> None:
    halves = ground((3.95, 0, 4.05, 1.5), (3.95, 2.5, 4.05, 4))
    topo_map = build_map("pair", halves)
    (door,) = [place for place in topo_map.places.values() if place.kind == "door"]
    assert door.distance(4.0, 2.0) < 0.1
    beside = [topo_map.place(p.other(door.name)) for p in topo_map.passages_at(door.name)]
    assert sorted(round(place.x, 1) for place in beside) == pytest.approx([3.2, 4.8], abs=0.1)
    assert all(abs(place.y - 2.0) < 0.1 for place in beside)
    assert all(p.doorness == 1.0 for p in topo_map.passages_at(door.name))
    assert max(p.width for p in topo_map.passages_at(door.name)) <= 1.0
    rooms = {"hall": (0.0, 8.0, 0.0, 4.0), "east": (3.0, 8.0, 1.9, 2.1)}
    places = build_map("pair", halves, rooms=rooms).places.values()
    named = {(place.name, place.x) for place in places}
    assert {("hall", 1.98), ("east", 6.03), ("east-1", 3.2), ("east-door", 4.0)} < named


def test_passages_lead_round_both_sides_of_an_obstacle() -> None:
    topo_map = build_map("table", ground((3.0, 1.5, 5.0, 2.5)))
    cycles = nx.cycle_basis(topo_map.graph)
    assert len(cycles) == 1
    around = np.array([(topo_map.place(n).x, topo_map.place(n).y) for n in cycles[0]], np.float32)
    assert cv2.pointPolygonTest(cv2.convexHull(around), (4.0, 2.0), measureDist=False) > 0


BEND = """\
name: bend
places:
  corridor-1: {x: 7.23, y: 0.78, kind: corridor}
  corridor-2: {x: 0.78, y: 3.23, kind: corridor}
  corridor-corner-1: {x: 6.88, y: 3.23, kind: corner}
edges:
- {from: corridor-corner-1, to: corridor-1, width: 0.95}
- {from: corridor-corner-1, to: corridor-2, width: 1.45}
"""


def test_a_bend_has_a_corner() -> None:
    assert map_text(build_map("bend", ground((0, 0, 6.5, 2.5)))) == BEND


@pytest.mark.parametrize(
    ("name", "digest"), [("office", "00b32027b6f0a46c"), ("paper-room", "bca9db6641da2b34")]
)
def test_a_map_is_built_always_the_same(name: str, digest: str) -> None:
    text = map_text(built(name)[0])
    assert hashlib.sha256(text.encode()).hexdigest().startswith(digest), text


def test_gaps_too_narrow_have_no_passage_and_a_full_world_no_map() -> None:
    topo_map = build_map("halves", ground((3.95, 0, 4.05, 1.8), (3.95, 2.2, 4.05, 4)))
    xs = [place.x for place in topo_map.places.values()]
    assert max(xs) < 4.0 or min(xs) > 4.0
    with pytest.raises(MapError, match="no space is free"):
        build_map("full", ground((0, 0, 8, 4)))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
@example(126)  # a round part, which shrinks to 2 x 2 cells
def test_thinning_keeps_the_connectivity(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = cv2.resize(rng.random((6, 8)), (80, 60), interpolation=cv2.INTER_CUBIC) > 0.4
    skeleton = thinned(mask)
    assert not (skeleton & ~mask).any()
    parts = [
        cv2.connectedComponents(each.astype(np.uint8), connectivity=8)[0]
        for each in (mask, skeleton)
    ]
    assert parts[0] == parts[1]
    assert skeleton.sum() < 0.5 * mask.sum() + 10
