from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import Passage, Place, TopoMap, check_map, load_map

ROOT = Path(__file__).parents[2]
A, B, C = Place("a", 0, 0), Place("b", 4, 0), Place("c", 8, 0)


def wall(x: float) -> Callable[[Array], Array]:
    """A wall of zero thickness at x [m], for y above -1 m."""

    def clearances(points: Array) -> Array:
        beside = np.maximum(-1.0 - points[:, 1], 0.0)
        return np.asarray(np.hypot(points[:, 0] - x, beside))

    return clearances


def found(
    topo_map: TopoMap, clearances: Callable[[Array], Array] | None = None
) -> set[tuple[str, str]]:
    return {(problem.kind, problem.where) for problem in check_map(topo_map, clearances)}


@pytest.mark.parametrize("length", [90.0, 150.0, 1e4, 2e6])
def test_an_obstacle_is_found_on_a_passage_of_any_length(length: float) -> None:
    a, b = Place("a", 0.0, 3.0), Place("b", length, 3.0)
    asked = 0

    def post(points: Array) -> Array:
        """A post of 0.1 m, 0.15 m beside the passage."""
        nonlocal asked
        asked += len(points)
        return np.asarray(np.hypot(points[:, 0] - 0.7 * length, points[:, 1] - 3.25) - 0.1)

    (problem,) = check_map(TopoMap("m", [a, b], [Passage("a", "b", length)]), post)
    assert problem.kind == "blocked"
    assert "0.15 m of clearance" in problem.message
    assert asked < 1_000_000


def test_parts_without_a_passage_are_apart() -> None:
    assert found(TopoMap("m", [A, B, C], [Passage("a", "b", 4.0)])) == {("apart", "c")}


def test_narrow_passages_and_the_places_behind_them() -> None:
    narrow = 2.0 * RobotModel().radius
    passages = [Passage("a", "b", 4.0), Passage("b", "c", 4.0, width=narrow)]
    problems = found(TopoMap("m", [A, B, C], passages))
    assert problems == {("narrow", "b - c"), ("unreachable", "c")}


def test_places_at_one_point() -> None:
    twin = Place("twin", 4.01, 0.0)
    passages = [Passage("a", "b", 4.0), Passage("b", "twin", 0.5)]
    assert found(TopoMap("m", [A, B, twin], passages)) == {("duplicate", "twin")}


def test_walls_across_passages_and_near_places() -> None:
    topo_map = TopoMap("m", [A, B, C], [Passage("a", "b", 4.0), Passage("b", "c", 4.0)])
    assert found(topo_map, wall(2.0)) == {("blocked", "a - b")}
    at_b = {("in-wall", "b"), ("blocked", "a - b"), ("blocked", "b - c")}
    assert found(topo_map, wall(4.1)) == at_b


def test_curved_passages_are_not_checked_for_clearance() -> None:
    assert found(TopoMap("m", [A, B], [Passage("a", "b", 9.0)]), wall(2.0)) == set()


def test_widths_above_the_free_width() -> None:
    low = Place("low", 0, -1.5), Place("down", 4, -1.5)
    wide, fair = (TopoMap("m", low, [Passage("low", "down", 4.0, width=w)]) for w in (1.2, 1.0))
    assert found(wide, wall(2.0)) == {("width", "low - down")}
    assert found(fair, wall(2.0)) == set()
    (problem,) = check_map(wide, wall(2.0))
    assert "1.2 m wide in the map, 1.00 m in the world at (1.99, -1.50)" in problem.message


# --- the shipped maps ----------------------------------------------------------------------------

MARGIN = 0.05


def load(name: str) -> tuple[TopoMap, SceneGeometry]:
    world = load_world(ROOT / "worlds" / name / "world.yaml")
    return load_map(ROOT / "maps" / f"{name}.yaml"), SceneGeometry.from_world(world)


@pytest.mark.parametrize("name", ["office", "hospital", "paper-room", "empty"])
def test_the_shipped_maps_have_no_problems_and_passages_as_wide_as_mapped(name: str) -> None:
    topo_map, plan = load(name)
    assert check_map(topo_map, plan.clearances) == []
    assert len(topo_map.parts) == 1
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
