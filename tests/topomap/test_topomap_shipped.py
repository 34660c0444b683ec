"""The shipped maps, compared with the geometry of their worlds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from navfw.robot import RobotModel
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import TopoMap, load_map

ROOT = Path(__file__).parents[2]
MARGIN = 0.05


def load(name: str) -> tuple[TopoMap, SceneGeometry]:
    world = load_world(ROOT / "worlds" / name / "world.yaml")
    return load_map(ROOT / "maps" / f"{name}.yaml"), SceneGeometry.from_world(world)


@pytest.mark.parametrize("name", ["office", "hospital", "paper-room", "empty"])
def test_every_passage_is_free_for_the_robot_and_as_wide_as_mapped(name: str) -> None:
    topo_map, plan = load(name)
    radius = RobotModel().radius
    assert topo_map.passages
    for passage in topo_map.passages:
        a, b = topo_map.place(passage.a), topo_map.place(passage.b)
        share = np.linspace(0.0, 1.0, 2 + int(passage.length / 0.02))[:, None]
        line = np.array([a.x, a.y]) * (1 - share) + np.array([b.x, b.y]) * share
        free = float(plan.clearances(line).min())
        assert free >= radius + MARGIN, f"{passage}: {free:.2f} m free"
        if math.isfinite(passage.width):
            assert 0.5 * passage.width <= free + 1e-6, f"{passage}: {2 * free:.2f} m wide"


@pytest.mark.parametrize("name", ["office", "hospital", "paper-room", "empty"])
def test_the_maps_are_connected(name: str) -> None:
    topo_map, _ = load(name)
    assert len(topo_map.parts) == 1


@pytest.mark.parametrize("name", ["office", "hospital", "paper-room"])
def test_doors_are_approached_straight(name: str) -> None:
    """Every door has places before and behind it, in line: robots cross it at a right angle."""
    topo_map, _ = load(name)
    doors = [place for place in topo_map.places.values() if place.kind == "door"]
    assert doors
    for door in doors:
        before, behind = (
            topo_map.place(p.other(door.name)) for p in topo_map.passages_at(door.name)
        )
        assert math.dist((before.x, before.y), (behind.x, behind.y)) == pytest.approx(
            before.distance(door.x, door.y) + behind.distance(door.x, door.y)
        )
        assert before.distance(door.x, door.y) >= 0.75
