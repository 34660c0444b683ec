"""Suites on maps that are made before: one for a block of seeds, and the same missions on both."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import invoke, output
from suite_plans import planned, suite_file

from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import SceneGeometry, load_world
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.taught_maps import _moved, _placed, _tour, driven_session
from navfw.topomap import Place, TopoMap, load_map

BOTH = """
entries:
  - {world: %s, taught: {%s}}
variants: {taught: , given: {given_map: true}}
"""


def driven(folder: Path, world: str, keys: str, seeds: str) -> tuple[dict[str, Any], TopoMap]:
    """The summary of a suite on both maps, and the map that was made."""
    file, out = suite_file(folder, BOTH % (world, keys)), folder / "out"
    output("suite", file, "--seeds", seeds, "--out", out, "--quiet")
    (made,) = (out / "maps").glob("*/map.yaml")
    return json.loads((out / "summary.json").read_text()), load_map(made)


@pytest.mark.slow
def test_a_small_room_is_taught_once_and_driven_on_both_maps(tmp_path: Path) -> None:
    summary, made = driven(tmp_path, "paper-room", "seeds: 30", "0:2")
    assert summary["success"] == 1.0
    assert made.floor_plan is not None
    rows = SuiteFolder(tmp_path / "out").rows()
    goals = {(row.seed, row.reason.partition(" from ")[2]) for row in rows}
    assert len(goals) == 2, "the goals on both maps differ"


@pytest.mark.slow
def test_a_tour_of_the_office_is_taught_and_driven(tmp_path: Path) -> None:
    summary, made = driven(tmp_path, "office", "source: tour", "0:6")
    assert summary["reached"] >= 11
    assert len(made.landmarks) >= 10
    world = {mark.id: mark.at for mark in load_world(Path("worlds/office/world.yaml")).landmarks}
    off = [np.hypot(m.x - world[m.id][0], m.y - world[m.id][1]) for m in made.landmarks.values()]
    assert np.median(off) < 0.1


def test_seeds_in_turn_share_a_world_and_have_pairs_of_their_own(tmp_path: Path) -> None:
    text = "entries: [{family: rooms, difficulty: [0, 1], taught: {seeds: 2}}]"
    cases = planned(tmp_path, text, range(4)).cases
    assert [case.key.world for case in cases] == ["rooms-0", "rooms-0", "rooms-1", "rooms-1"]
    assert cases[0].columns["difficulty"] == cases[1].columns["difficulty"]
    assert {(case.key.mission, case.key.stack) for case in cases} == {("taught", "floor_plan")}


def test_the_variant_on_the_given_map_has_the_stack_of_the_mission(tmp_path: Path) -> None:
    cases = planned(tmp_path, BOTH % ("paper-room", "")).cases
    assert [(case.variant, case.key.stack) for case in cases] == [
        ("taught", "floor_plan"),
        ("given", "default"),
    ]


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ("world: office, taught: {}, pairs: true", "taught takes the place of missions"),
        ("world: office, taught: {}, explore: {}", "expected explore, or taught"),
        ("world: office, taught: {source: walk}", "source"),
        ("world: lounge, taught: {}", "take source: explore"),
    ],
)
def test_what_cannot_be_taught_is_refused(entry: str, why: str, tmp_path: Path) -> None:
    file = suite_file(tmp_path, f"entries: [{{{entry}}}]")
    done = invoke("suite", file, "--seeds", "0:1", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert why in done.output


def test_an_unknown_start_is_the_same_on_both_maps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = load_map(Path("maps/office.yaml"))  # stands for one that was made
    monkeypatch.setattr("navfw.suite.taught_maps._map_of", lambda *_: given)
    plan = planned(tmp_path, BOTH % ("office", "start: unknown"))
    cases = [replace(case, pictures=tmp_path / "pictures") for case in plan.cases]
    missions = [driven_session(case, default_registry()).mission for case in cases]
    assert [mission.start_known for mission in missions] == [False, False]
    assert missions[0].start == missions[1].start
    assert [(g.x, g.y) for g in missions[0].goals] == [(g.x, g.y) for g in missions[1].goals]


def test_moved_furniture_leaves_a_path_and_stays_in_its_room() -> None:
    world = load_world(Path("worlds/office/world.yaml"))
    ends = Place("a", 1.2, 1.2), Place("b", 13.0, 8.0)
    robot = RobotModel()
    moved = _moved(world, 0.4, 3, ends, robot)
    before, after = (
        {box.name: box.at for box in spec.boxes} | {pole.name: pole.at for pole in spec.cylinders}
        for spec in (world, moved)
    )
    steps = [np.hypot(*np.subtract(after[name], at)) for name, at in before.items()]
    assert sum(step > 0.0 for step in steps) >= 4
    assert max(steps) <= 1.25
    assert after["lobby-plant"] == after["lobby-plant-leaves"]
    SceneGeometry.from_world(moved).shortest_path((1.2, 1.2), (13.0, 8.0), robot.radius)
    assert _moved(world, 0.0, 3, ends, robot) is world


def test_a_tour_visits_every_place_once_in_an_order_of_its_own() -> None:
    topo_map = load_map(Path("maps/office.yaml"))
    tours = [list(_tour(topo_map, Pose(1.2, 1.2, 0.0), seed)) for seed in range(3)]
    wanted = sorted(p.name for p in topo_map.places.values() if p.kind not in {"door", "danger"})
    assert [sorted(tour) for tour in tours] == [wanted] * 3
    assert tours[0] != tours[1]


def test_a_map_is_placed_with_all_that_it_contains() -> None:
    given = load_map(Path("maps/office.yaml"))
    frame = Pose(2.0, -1.0, 0.3)
    placed = _placed(given, frame)
    assert given.floor_plan is not None
    assert placed.floor_plan is not None
    for name, place in given.places.items():
        assert (placed.places[name].x, placed.places[name].y) == frame.to_parent(place.x, place.y)
        kind = given.floor_plan.state(np.array([(place.x, place.y)]))
        x, y = frame.to_parent(place.x, place.y)
        assert placed.floor_plan.state(np.array([(x, y)])) == kind
    assert placed.passages == given.passages
    mark = next(iter(given.landmarks))
    assert placed.landmarks[mark].yaw - given.landmarks[mark].yaw == pytest.approx(0.3)
