"""The planner: waypoints of a mission, and passages that reports close, reopen or endanger."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from papfis_maps import belief, goal, joined, line, next_waypoint, office, row
from param_ranges import check_ranges

from navfw.errors import MapError
from navfw.papfis import Papfis, Router
from navfw.robot import RobotModel
from navfw.signals import PassageReport, PassageStatus, Waypoint
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import Place, PlaceKind, TopoMap

ROOT = Path(__file__).parents[2]
ROBOT = RobotModel()
PLAN = SceneGeometry.from_world(load_world(ROOT / "worlds" / "office" / "world.yaml"))
LAB = goal(14.2, 7.8, "lab")
Point = tuple[float, float]


def planner(topo_map: TopoMap, *goals: Waypoint, **params: float) -> Papfis:
    papfis = Papfis(ROBOT, Papfis.Params(**params))
    papfis.reset()
    papfis.start(topo_map, goals)
    return papfis


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


def test_parameters_are_within_their_ranges() -> None:
    ways = "passing (0, 10], door_passing (0, 10], beside_door_passing (0, 10]"
    ranges = f"aversion [0, 100], avoidance [0, 1e6], {ways}, passing_reach (0, 10]"
    ranges += ", replan_distance (0, 10], max_off_map [0.1, 1000], closing_votes [1, 100]"
    check_ranges(Papfis.Params, f"{ranges}, vote_interval [0, 60], closed_for (0, 86400]")


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


# --- passage reports, on a way start - near - far - end and a detour over north -------------------

AT = {"start": (0, 0), "near": (3, 0), "far": (6, 0), "end": (9, 0), "north": (4.5, 4)}
PLACES = START, NEAR, FAR, END, NORTH = [Place(name, *at) for name, at in AT.items()]
STRAIGHT = row(START, NEAR, FAR, END, width=1.5)
RING = TopoMap("ring", PLACES, [*STRAIGHT.passages, *line(NEAR, NORTH, FAR, width=1.5)])
NEAR_FAR = ("near", "far")


class Drive:
    """A planner under way, with a passage report once a second."""

    def __init__(self, topo_map: TopoMap, *first: Waypoint, **params: float) -> None:
        self.papfis = planner(topo_map, *first, goal(9, 0, "end"), **params)
        self.time, self.at = 0.0, (0.0, 0.0)

    def go(self, x: float, y: float) -> Waypoint:
        self.at = (x, y)
        return self._update()

    def report(
        self,
        status: PassageStatus,
        times: int = 1,
        ends: tuple[str, str] = NEAR_FAR,
        drops: tuple[Point, ...] = (),
    ) -> Waypoint:
        for _ in range(times):
            self.time += 1.0
            queries = [q for q in self.papfis.queries if frozenset(q.passage) == frozenset(ends)]
            passages = tuple((query, status) for query in queries)
            self.papfis.observe(PassageReport(self.time, passages, drops))
            self._update()
        return self._update()

    def wait(self, seconds: float) -> Waypoint:
        self.time += seconds
        return self._update()

    @property
    def ahead(self) -> list[str]:
        return [waypoint.place for waypoint in self.papfis.path]

    @property
    def closed(self) -> list[str]:
        return [str(passage) for passage in self.papfis.closed]

    @property
    def router(self) -> Router:
        assert self.papfis._tour is not None
        return self.papfis._tour.router

    def _update(self) -> Waypoint:
        waypoint = self.papfis.update(replace(belief(*self.at), time=self.time))
        assert waypoint is not None
        return waypoint


def on_the_way(topo_map: TopoMap, **params: float) -> Drive:
    drive = Drive(topo_map, **params)
    drive.go(0, 0)
    drive.go(2.9, 0)
    assert drive.ahead == ["far", "end"]
    return drive


def test_the_planner_queries_the_legs_within_range() -> None:
    drive = Drive(RING)
    drive.go(0, 0)
    assert [query.passage for query in drive.papfis.queries] == [("start", "near")]
    drive.go(2.0, 0)
    first, second = drive.papfis.queries
    assert (first.start, first.end, first.width) == ((2.0, 0.0), (3.0, 0.0), 1.5)
    assert (second.passage, second.start) == (("near", "far"), (3.0, 0.0))


def test_three_votes_close_a_passage_and_change_the_route() -> None:
    drive = on_the_way(RING)
    assert drive.report("closed", 2).place == "far"
    assert drive.report("closed").place == "north"
    assert drive.ahead == ["north", "far", "end"]
    assert drive.closed == ["near - far"]
    assert (drive.papfis.no_route_reason, drive.papfis.replans) == (None, 1)
    assert drive.papfis.explain()["closed"] == [["near", "far"]]


def test_votes_within_the_interval_count_once() -> None:
    drive = on_the_way(RING, vote_interval=10.0)
    drive.report("closed", 20)  # of which two are ten seconds apart
    assert not drive.closed
    drive.report("closed")
    assert drive.closed


def test_open_and_closed_votes_cancel_and_unknown_has_no_effect() -> None:
    drive = on_the_way(RING)
    for _ in range(10):
        drive.report("closed", 2)
        drive.report("unknown", 5)
        drive.report("open", 2)
    assert not drive.closed


def test_a_closed_passage_is_open_again_later_at_a_higher_cost() -> None:
    drive = on_the_way(RING, closed_for=60.0)
    before = drive.router.costs.of(RING.passage("near", "far"))
    drive.report("closed", 3)
    drive.wait(59.0)
    assert drive.closed
    drive.wait(2.0)
    assert not drive.closed
    after = drive.router.costs
    assert before < after.of(RING.passage("near", "far")) < 5.0 * before
    assert after.explain(RING.passage("near", "far"))["inputs"]["uncertainty"] == 1.0
    assert drive.ahead == ["north", "far", "end"]  # the new route is kept


def test_without_another_route_the_old_one_is_kept_and_the_passage_named() -> None:
    drive = on_the_way(STRAIGHT)
    for votes, seconds in ((3, 0.0), (0, 61.0)):  # by reports, or when the time is over
        assert drive.report("closed", 3).place == "far"
        assert drive.papfis.no_route_reason == "the only route to end is closed: near - far"
        drive.report("open", votes)
        assert drive.wait(seconds).place == "far"
        assert not drive.papfis.no_route_reason
        assert not drive.closed
    drive.report("closed", 3)
    drive.wait(61.0)
    assert drive.closed  # for twice as long, as nothing showed it to be open
    drive.wait(60.0)
    assert not drive.closed


def test_a_free_leg_back_does_not_reopen_a_passage() -> None:
    drive = on_the_way(RING)
    drive.go(4.5, 0)
    drive.report("closed", 3)
    assert drive.ahead == ["near", "north", "far", "end"]
    assert drive.papfis.queries[0].end == (3.0, 0.0)  # in the closed passage, but back
    drive.report("open", 10)
    assert drive.closed == ["near - far"]


def test_an_obstacle_is_seen_to_be_gone_from_within_two_metres() -> None:
    drive = on_the_way(STRAIGHT)
    drive.go(5.0, 0)
    drive.report("closed", 3)
    for x, closed in ((2.9, True), (3.5, False)):  # the obstacle is at 5.4
        drive.go(x, 0)
        drive.report("open", 10)
        assert bool(drive.closed) is closed


def test_a_robot_in_a_closed_passage_leaves_it_by_the_end_behind_it() -> None:
    """At three quarters of the passage the far end is nearer, but behind the obstacle."""
    drive = on_the_way(RING)
    drive.go(5.2, 0)
    assert drive.report("closed", 3).place == "near"
    assert drive.ahead == ["near", "north", "far", "end"]


def test_a_drop_in_a_passage_changes_the_route_and_one_beside_it_does_not() -> None:
    drive = on_the_way(RING)
    drive.report("open", drops=((4.5, -1.5),))
    assert drive.ahead == ["far", "end"]
    drive.report("open", drops=((4.5, 0.4),))
    assert drive.ahead == ["north", "far", "end"]
    explained = drive.router.costs.explain(RING.passage("near", "far"))
    assert (explained["avoided"], explained["inputs"]["danger"]) == (True, 1.0)
    only = on_the_way(STRAIGHT)
    only.report("open", drops=((4.5, 0.0),))
    assert (only.ahead, only.papfis.no_route_reason) == (["far", "end"], None)


def test_reset_reopens_closed_passages() -> None:
    drive = on_the_way(RING)
    drive.report("closed", 3)
    drive.papfis.reset()
    drive.papfis.start(RING, [goal(9, 0, "end")])
    drive.go(2.9, 0)
    assert drive.ahead == ["far", "end"]
    assert not drive.closed


def test_later_goals_are_planned_without_closed_passages() -> None:
    drive = Drive(STRAIGHT, goal(3, 0, "near"))
    drive.go(0, 0)
    drive.go(1.0, 0)
    drive.router.close(drive.router.topo_map.passage("near", "far"))
    assert drive.go(2.9, 0).place == "far"  # the old route is kept
    assert drive.papfis.no_route_reason == "the only route to end is closed: near - far"


@pytest.mark.parametrize("closed", ["ab", "abc", "abcd", "abcde"])
def test_at_most_three_closed_passages_are_named(closed: str) -> None:
    places = (Place(name, 1.8 * k, 0) for k, name in enumerate("abcde"))
    drive = Drive(row(*places, END, width=1.5))
    drive.go(0, 0)
    for ends in pairwise(closed[1:]):
        drive.router.close(drive.router.topo_map.passage(*ends))
    drive.report("closed", 3, ("a", "b"))
    names = [f"{a} - {b}" for a, b in pairwise(closed)]
    listed = ", ".join([*names[:3], "..."] if len(names) > 3 else names)
    assert drive.papfis.no_route_reason == f"the only route to end is closed: {listed}"


@pytest.mark.parametrize("start", [(0.0, 0.0), (2.9, 0.0)])
def test_an_empty_report_changes_nothing(start: tuple[float, float]) -> None:
    drive = Drive(RING)
    drive.go(*start)
    before = drive.ahead
    drive.papfis.observe(PassageReport(1.0))
    drive.wait(1.0)
    assert drive.ahead == before
