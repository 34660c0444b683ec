"""The planner: the waypoints of a mission."""

import json
import math
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from papfis_maps import belief, goal, joined, next_waypoint, office, planner, row

from navfw.errors import MapError
from navfw.papfis.papfis import Papfis
from navfw.robot import RobotModel
from navfw.signals import Waypoint
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import Place, PlaceKind, TopoMap

ROOT = Path(__file__).parents[2]
ROBOT = RobotModel()
PLAN = SceneGeometry.from_world(load_world(ROOT / "worlds" / "office" / "world.yaml"))
LAB = goal(14.2, 7.8, "lab")
Point = tuple[float, float]


def walk(papfis: Papfis, start: Point, step: float = 0.05) -> tuple[list[Point], list[Waypoint]]:
    """Go straight to every waypoint with an exact belief: the track and the waypoints."""
    at, track = start, [start]
    waypoints: list[Waypoint] = []
    for _ in range(2000):
        ahead = papfis.update(belief(*at))
        if ahead is None:
            return track, waypoints
        if not waypoints or waypoints[-1] != ahead:
            waypoints.append(ahead)
        share = step / math.dist(at, (ahead.x, ahead.y))
        at = (at[0] + share * (ahead.x - at[0]), at[1] + share * (ahead.y - at[1]))
        track.append(at)
    raise AssertionError(f"not there after {len(track)} steps: {at}")


def test_the_track_from_lobby_to_lab_is_free_and_crosses_two_doors() -> None:
    papfis = planner(office(), LAB)
    track, waypoints = walk(papfis, (1.2, 1.2))
    doors = [w for w in waypoints if w.kind == "door"]
    assert [door.place for door in doors] == ["lobby-door", "lab-door"]
    assert all((door.tolerance, door.width) == (0.25, 0.95) for door in doors)
    assert (waypoints[-1].kind, waypoints[-1].place, waypoints[-1].final) == ("goal", "lab", True)
    assert math.dist(track[-1], (LAB.x, LAB.y)) <= LAB.tolerance
    assert float(PLAN.clearances(np.array(track)).min()) > ROBOT.radius
    assert papfis.replans == 0
    assert papfis.path == []


@pytest.mark.parametrize("seed", range(3))
def test_no_track_crosses_a_wall(seed: int) -> None:
    walls = SceneGeometry(PLAN.bounds, tuple(s for s in PLAN.solids if s.kind == "wall"))
    rng = np.random.default_rng(seed)
    points = rng.uniform((0.3, 0.3), (15.7, 9.7), (200, 2))
    points = points[PLAN.clearances(points) > 0.3][:20]
    for start, end in zip(points[::2].tolist(), points[1::2].tolist(), strict=True):
        track, _ = walk(planner(office(), goal(*end)), tuple(start))
        assert float(walls.clearances(np.array(track)).min()) > 0.0, (start, end)


def test_the_path_has_the_waypoints_ahead_up_to_the_last_goal() -> None:
    papfis = planner(office(), goal(9.9, 8.1, "kitchen"), LAB)
    head = papfis.update(belief(1.2, 1.2))
    ahead = papfis.path
    assert ahead[0] == head
    assert [w.place for w in ahead if w.final] == ["kitchen", "lab"]
    assert ahead[-1].final
    # the tolerance is smaller just before and after doors
    tolerances = {w.place: w.tolerance for w in ahead}
    assert tolerances["lobby-entrance"] == tolerances["corridor-lobby"] == 0.35
    assert tolerances["corridor-meeting"] == 0.6
    before = len(ahead)
    papfis.update(belief(ahead[0].x, ahead[0].y))
    assert len(papfis.path) < before


def test_goals_are_visited_in_order() -> None:
    lobby = goal(3.0, 2.0, "lobby")
    _, waypoints = walk(planner(office(), LAB, lobby, LAB), (9.0, 5.0))
    assert [w.place for w in waypoints if w.final] == ["lab", "lobby", "lab"]


def test_no_goal_counts_as_reached_by_an_uncertain_estimate() -> None:
    lobby = goal(3.0, 2.0, "lobby")
    papfis = planner(office(), lobby, LAB, max_goal_sigma=0.5)
    for _ in range(2):
        ahead = papfis.update(belief(3.0, 2.0, sigma=0.6))
        assert ahead is not None
        assert (ahead.place, ahead.final) == ("lobby", True), "it stays the waypoint"
    onward = papfis.update(belief(3.0, 2.0, sigma=0.4))
    assert onward is not None
    assert onward.place != "lobby"


def test_a_goal_without_a_place_is_reached_through_its_room() -> None:
    _, waypoints = walk(planner(office(), goal(7.4, 6.6)), (4.5, 5.0))
    assert [w.place for w in waypoints][-3:] == ["office-b-door", "office-b-entrance", "goal"]


def test_far_from_the_leg_it_replans() -> None:
    papfis = planner(office(), LAB)
    papfis.update(belief(1.2, 1.2))
    assert next_waypoint(papfis, 1.2, 2.6).place == "lobby"  # 1.4 m off: not yet
    assert papfis.replans == 0
    ahead = next_waypoint(papfis, 9.0, 5.0)  # carried into the corridor
    assert papfis.replans == 1
    assert ahead.place == "corridor-kitchen"
    papfis.update(belief(9.1, 5.0))
    assert papfis.replans == 1


def test_off_the_path_without_a_route_the_old_one_is_kept() -> None:
    a, b, c = Place("a", 0, 0), Place("b", 4, 0), Place("c", 4, 9)
    topo_map = TopoMap("m", [a, b, c], [joined(a, b), joined(b, c, width=0.3)])
    papfis = planner(topo_map, goal(0, 0, "a"))
    for at in ((4.0, 0.0), (4.0, 8.0), (4.0, 8.0)):
        assert next_waypoint(papfis, *at).place == "a"
    assert papfis.replans == 1


@pytest.mark.parametrize("kind", get_args(PlaceKind))
def test_reaching_a_later_waypoint_passes_those_before_it_except_doors(kind: PlaceKind) -> None:
    a, b, c = Place("a", 0, 0), Place("b", 2, 1, kind), Place("c", 4, 0)
    d, e = Place("d", 6, 0, "door"), Place("e", 6.7, 0)
    params = {"passing": 0.9, "beside_door_passing": 0.9, "replan_distance": 5.0}
    papfis = planner(row(a, b, c, d, e, width=0.9), goal(12, 0), **params)
    assert next_waypoint(papfis, 0.0, 0.0).place == "b"
    assert next_waypoint(papfis, 3.5, -0.6).place == ("b" if kind == "door" else "d")
    papfis.update(belief(2.0, 1.0))
    assert next_waypoint(papfis, 3.5, -0.6).place == "d"
    # beside the door, where e is within its tolerance
    assert math.dist((5.99, 0.5), (e.x, e.y)) < 0.9
    assert next_waypoint(papfis, 5.99, 0.5).place == "d"
    assert next_waypoint(papfis, 5.95, 0.1).kind == "goal"


@pytest.mark.parametrize("goals", [(), (goal(1.2, 1.4),)], ids=["none", "at the start"])
def test_without_goals_or_at_the_goal_there_is_no_waypoint(goals: tuple[Waypoint, ...]) -> None:
    papfis = planner(office(), *goals)
    assert papfis.update(belief(1.2, 1.2)) is None
    assert papfis.path == []


def test_the_plan_is_explained_as_plain_data() -> None:
    papfis = planner(office(), LAB)
    assert papfis.explain() == {}
    papfis.update(belief(1.2, 1.2))
    explained = json.loads(json.dumps(papfis.explain()))
    assert explained["places"][-1] == "lab"
    through_door = next(p for p in explained["passages"] if p["to"] == "lobby-door")
    assert "clearance IS fair" in through_door["rules"][0]["rule"]


def test_goals_in_different_parts_or_far_off_the_map_are_an_error() -> None:
    a, b, c, d = (Place(n, x, 0) for n, x in zip("abcd", (0, 2, 4, 6), strict=True))
    topo_map = TopoMap("m", [a, b, c, d], [joined(a, b), joined(c, d)])
    with pytest.raises(MapError, match="does not connect the start"):
        planner(topo_map, goal(6, 0, "d")).update(belief(0.0, 0.1))
    with pytest.raises(MapError, match=r"does not connect the start 'a'.*goal 'd'"):
        planner(topo_map, goal(0, 0, "a"), goal(6, 0, "d"))
    with pytest.raises(MapError, match=r"goal \(16\.00, 30\.00\) is 2\d\.\d m away.*add a place"):
        planner(office(), goal(16, 30))


def test_the_corner_before_a_goal_is_cut_like_any() -> None:
    corner = row(Place("a", 0, 0), Place("b", 2, 0), Place("c", 2, 4))
    papfis = planner(corner, goal(2, 4, "c"), passing=0.5)
    assert next_waypoint(papfis, 0.0, 0.0).place == "b"
    assert next_waypoint(papfis, 1.5, 0.7).place == "c"


def test_a_goal_reached_before_its_last_waypoint_is_passed_like_any() -> None:
    straight = row(Place("a", 0, 0), Place("b", 2, 0), Place("c", 2.5, 0))
    papfis = planner(straight, goal(2.5, 0, "c"), goal(0, 0, "a"), passing=0.7)
    assert next_waypoint(papfis, 0.9, 0.0).place == "b"
    assert next_waypoint(papfis, 2.4, 0.0).place in {"b", "a"}
    assert [waypoint.place for waypoint in papfis.path if waypoint.final] == ["a"]
