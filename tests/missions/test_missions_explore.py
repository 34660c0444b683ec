"""Explorations: their mission files, options and results, and one of a small world."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from cli_calls import refusal

from navfw import run
from navfw.config import find
from navfw.errors import ConfigError, InputError
from navfw.missions import prepare
from navfw.missions.exploration_result import ReachableFloor
from navfw.missions.missionfile import load_mission
from navfw.missions.true_tour import TrueTour
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Pose
from navfw.sim import SceneGeometry, load_world
from navfw.suite.case import Case

START = "start: [1.0, 1.0, 0.0]\n"


def mission_of(folder: Path, text: str) -> Path:
    file = folder / "explore.yaml"
    file.write_text(START + text)
    return file


def test_an_exploration_knows_its_start_alone(tmp_path: Path) -> None:
    file = mission_of(tmp_path, "map: office\nexplore: {limit: 100, return: false}\n")
    mission = load_mission(file)
    assert list(mission.topo_map.places) == ["start"]
    assert mission.topo_map.passages == ()
    assert [(goal.x, goal.y) for goal in mission.goals] == [(1.0, 1.0)]
    assert mission.spec.timeout == 160.0
    assert mission.spec.success.within == 0.3
    session = prepare("office", file)
    assert session.stack_file.stem == "explore"
    params = session.stack.planner.plugin.params.model_dump()
    assert (params["limit"], params["return_home"]) == (100.0, False)
    assert session.task.success_radius == math.inf


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("explore: {limit: 0}\n", r"explore.yaml:2: explore.limit"),
        ("explore: {limits: 9}\n", r"explore.yaml:2: explore.limits.*did you mean 'limit'"),
        ("explore: {}\ngoals: [{x: 2, y: 1}]\n", "expected either goals, or explore; got both"),
        ("timeout: 9\n", "expected either goals, or explore; got neither"),
        ("explore: {}\nrounds: 2\n", "rounds and explore exclude each other"),
    ],
)
def test_wrong_explorations(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_mission(mission_of(tmp_path, text))


def test_a_stack_that_grows_no_map_cannot_explore() -> None:
    with pytest.raises(InputError, match=r"'default' has no `growing_map: true`.*stack explore"):
        prepare("office", None, stack="default")


def test_wrong_options(tmp_path: Path) -> None:
    there = tmp_path / "there.yaml"
    there.write_text("name: there\n")
    out = "--out-map", str(there)
    assert "there.yaml: exists; choose another" in refusal("run", "office", "--explore", *out)
    assert "a mission or goal, or --explore" in refusal("run", "office", "patrol", "--explore")
    assert "--out-map: expected a name" in refusal("run", "office", "--explore", "--out-map", "a/b")
    said = refusal("run", "office", "patrol", "--out-map", str(tmp_path / "new.yaml"))
    assert "--out-map: is for explorations" in said


def plan_of(world: str) -> SceneGeometry:
    return SceneGeometry.from_world(load_world(find("world", world)))


def test_the_floor_that_can_be_reached_is_measured() -> None:
    robot, plan = RobotModel(), plan_of("lounge")
    ground = ReachableFloor.of(plan, plan, robot, Pose(0.9, 3.9, 0.0))
    assert 40.0 < ground.floor.sum() * ground.grid.cell**2 < 9.0 * 6.0
    assert not (ground.floor & ground.grid.occupied).any()
    assert not (ground.floor & ground.beyond).any()
    rows, columns = ground.floor.shape
    evidence = np.full((rows, columns), -64, np.int8)
    half = 0.5 * ground.grid.cell
    x, y = ground.grid.origin
    everything = GrownGrid(evidence, (x + half, y + half), ground.grid.cell)
    assert not (ground.floor & ground.unseen(everything)).any()
    evidence[:, columns // 2 :] = 0
    left = GrownGrid(evidence, (x + half, y + half), ground.grid.cell)
    shown = 1.0 - (ground.floor & ground.unseen(left)).sum() / ground.floor.sum()
    assert 0.4 < shown < 0.6


@pytest.mark.thorough
def test_the_true_tour_sees_everything() -> None:
    plan, start = plan_of("lounge"), Pose(0.9, 3.9, 0.0)
    tour = TrueTour(plan.configuration_space(0.0), RobotModel(), start)
    length, back = (
        tour.length(back=False),
        TrueTour(plan.configuration_space(0.0), RobotModel(), start).length(back=True),
    )
    assert 10.0 < length < 40.0
    assert length <= back <= length + 15.0


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [30, 31])
def test_the_true_tour_passes_no_wall_that_it_has_not_seen(seed: int) -> None:
    case = Case(0, "corridors", seed, family="corridors", difficulty=(0.0, 1.0))
    session = case.session(default_registry())
    start, robot = session.mission.start, session.mission.spec.robot
    ground = ReachableFloor.of(session.plan, session.passable, robot, start)
    tour = TrueTour(ground.grid, robot, start)
    assert tour.length(back=True) > 40.0
    assert (tour._evidence[ground.floor] < 0).mean() > 0.99


def test_a_small_world_is_explored() -> None:
    result = run("lounge", None, seed=3)
    explored = result.exploration
    assert explored is not None
    assert result.outcome == "reached"
    assert explored.returned
    assert explored.observed_share >= 0.95
    assert explored.path_over_tour <= 1.8
    assert result.shortest_path_m == explored.tour_m
    assert json.loads(json.dumps(result.summary()["exploration"]))["returned"]
    topo_map = result.explored_map("lounge")
    assert any(place.kind == "door" for place in topo_map.places.values())
    assert topo_map.floor_plan is not None
