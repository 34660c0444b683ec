"""How a building differs from its map: doors, openings, things that are gone; the corrected map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfw.errors import InputError
from navfw.mapping import MapChange, changes_between, corrected_map
from navfw.signals import GrownGrid, Pose
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

CELL = 0.05
PLACES = [
    Place("west", 2.0, 3.0),
    Place("door", 4.0, 3.0, "door"),
    Place("east", 6.0, 3.0),
]
PASSAGES = [Passage("west", "door", 2.0, 0.9), Passage("door", "east", 2.0, 0.9)]
Gap = tuple[float, float]


def building(*gaps: Gap, table: bool = True) -> np.ndarray:
    """Return where two rooms of 4 x 6 m are occupied; the wall between has ``gaps`` along y."""
    cells = np.zeros((120, 160), dtype=np.bool_)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = True, True, True, True
    cells[:, 79:82] = True
    for low, high in gaps:
        cells[round(low / CELL) : round(high / CELL), 79:82] = False
    if table:
        cells[90:104, 30:50] = True
    return cells


def given(plan: bool = True) -> TopoMap:
    cells = np.where(building((2.55, 3.45)), OCCUPIED, FREE).astype(np.int8)
    floor = OccupancyMap(cells, CELL, Pose(0.0, 0.0, 0.0)) if plan else None
    return TopoMap("two", PLACES, PASSAGES, floor_plan=floor)


def seen(cells: np.ndarray, within: float = 99.0) -> GrownGrid:
    """Return the grid of a robot at the door that has seen ``cells`` up to ``within`` [m]."""
    y, x = np.ogrid[: cells.shape[0], : cells.shape[1]]
    evidence = np.where(cells, 96, -48).astype(np.int8)
    evidence[np.hypot(CELL * x - 4.0, CELL * y - 3.0) > within] = 0
    return GrownGrid(evidence, (0.5 * CELL, 0.5 * CELL), CELL)


def found(cells: np.ndarray, plan: bool = True) -> list[tuple[str, str]]:
    return [(change.kind, change.what) for change in changes_between(given(plan), seen(cells))]


@pytest.mark.parametrize("plan", [True, False])
def test_doors_that_are_as_in_the_map_closed_or_moved(plan: bool) -> None:
    assert found(building((2.55, 3.45)), plan) == []
    assert found(building(), plan) == [("closed", "door")]
    moved = changes_between(given(plan), seen(building((3.3, 4.2))))
    assert [(change.kind, change.what) for change in moved] == [("moved", "door")]
    assert (moved[0].x, moved[0].y) == pytest.approx((4.0, 3.75), abs=0.06)


def test_one_edge_shows_where_a_door_is_now() -> None:
    for gap, moved in (((3.1, 4.0), True), ((2.55, 3.45), False)):
        grid = seen(building(gap))
        evidence = grid.log_odds.copy()
        evidence[round((gap[0] + 0.7) / CELL) :] = 0  # the other edge was not seen
        changes = changes_between(given(), replace(grid, log_odds=evidence))
        assert [change.kind for change in changes] == ["moved"] * moved
        for change in changes:
            assert change.y == pytest.approx(3.55, abs=0.06)
            assert change.certainty == pytest.approx(0.75, abs=0.02)


def test_what_was_not_seen_is_not_reported() -> None:
    for cells in (building(), building((0.5, 1.4)), building((2.55, 3.45), table=False)):
        assert changes_between(given(), seen(cells, within=0.2)) == []


def test_openings_and_furniture_of_the_plan() -> None:
    assert found(building((2.55, 3.45), (0.5, 1.4))) == [("new", "an opening")]
    gone = changes_between(given(), seen(building((2.55, 3.45), table=False)))
    assert [change.kind for change in gone] == ["gone"]
    assert (gone[0].x, gone[0].y) == pytest.approx((2.0, 4.85), abs=0.1)


def test_a_corrected_map_has_the_changes() -> None:
    grid = seen(building((0.5, 1.4), table=False))
    topo_map = given()
    changes = changes_between(topo_map, grid)
    assert sorted(change.kind for change in changes) == ["closed", "gone", "new"]
    made = corrected_map(topo_map, grid, changes, 0.18, "kept")
    assert made.name == "kept"
    assert "door" not in made.places
    assert len(made.parts) == 1  # joined by the new opening
    opening = made.places["opening-1"]
    assert (opening.x, opening.y) == pytest.approx((4.0, 0.95), abs=0.1)
    assert made.floor_plan is not None
    assert not made.floor_plan.occupied[92:102, 33:47].any()
    assert changes_between(made, grid) == []
    by_names = {(change.kind, change.what) for change in changes_between(topo_map, made)}
    assert {("closed", "door"), ("gone", "a thing"), ("new", "way from east to west")} == by_names


def test_a_moved_door_moves_in_the_map_with_its_passages() -> None:
    grid, topo_map = seen(building((3.3, 4.2))), given()
    made = corrected_map(topo_map, grid, changes_between(topo_map, grid), 0.18, "kept")
    door = made.places["door"]
    assert (door.x, door.y) == pytest.approx((4.0, 3.75), abs=0.06)
    assert all(p.length >= made.places[p.a].distance(door.x, door.y) - 1e-9 for p in made.passages)


def test_ways_that_the_planner_found_replace_the_opening_they_lead_through() -> None:
    grid = seen(building((2.55, 3.45), (0.5, 1.4)))
    track = [(3.0, 1.0), (4.0, 1.0), (5.0, 1.0)]
    changes = changes_between(given(), grid, [PASSAGES[0]], [("way from west to east", track)])
    assert [(change.kind, change.what) for change in changes] == [
        ("closed", "west - door"),
        ("new", "way from west to east"),
    ]
    assert changes[1].y == pytest.approx(0.95, abs=0.1)
    mapped = ("way from west to east", [(3.0, 3.0), (5.0, 3.0)])
    assert changes_between(given(), seen(building((2.55, 3.45))), [], [mapped]) == []
    moved = changes_between(
        given(), seen(building((3.3, 4.2))), [], [(mapped[0], [(3, 3.7), (5, 3.7)])]
    )
    assert [change.kind for change in moved] == ["moved"]


@pytest.mark.parametrize(("free", "certain"), [(-12, None), (-20, 0.625), (-48, 1.0)])
def test_an_opening_is_as_certain_as_what_was_seen_of_it(free: int, certain: float | None) -> None:
    grid = seen(building((2.55, 3.45), (0.5, 1.4)))
    evidence = np.where(grid.occupied, 96, free).astype(np.int8)
    evidence[:, 84:] = 0  # seen from the west alone
    changes = changes_between(given(), replace(grid, log_odds=evidence))
    assert [(c.kind, c.what) for c in changes] == [("new", "an opening")] * (certain is not None)
    for change in changes:
        assert change.certainty == pytest.approx(certain)
        assert change.detail == "0.9 m wide"


def test_maps_that_share_nothing_are_compared_by_plan_or_refused() -> None:
    other = TopoMap("other", [Place("elsewhere", 1.0, 1.0)], [])
    with pytest.raises(InputError, match="shares few places"):
        changes_between(given(), other)
    cells = np.where(building(), OCCUPIED, FREE).astype(np.int8)
    plan = OccupancyMap(cells, CELL, Pose(0.0, 0.0, 0.0))
    later = TopoMap("later", [Place("elsewhere", 1.0, 1.0)], [], floor_plan=plan)
    assert [change.what for change in changes_between(given(), later)] == ["door"]
    assert str(MapChange("closed", "door", 4.0, 3.0, 0.9, time=12.0)) == (
        "closed door at (4.0, 3.0), seen at 12 s, 90% certain"
    )
