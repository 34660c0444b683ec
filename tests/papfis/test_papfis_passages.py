"""Passages that reports close: on a way start - near - far - end, and a detour over north."""

from dataclasses import replace
from itertools import pairwise

import pytest
from papfis_maps import belief, goal, line, planner, row

from navfw.papfis.routes import Router
from navfw.signals import PassageReport, PassageStatus, Waypoint
from navfw.topomap import Place, TopoMap

Point = tuple[float, float]
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
        covered: tuple[Point, ...] = (),
        openings: tuple[tuple[Point, Point], ...] = (),
    ) -> Waypoint:
        for _ in range(times):
            self.time += 1.0
            queries = [q for q in self.papfis.queries if frozenset(q.passage) == frozenset(ends)]
            passages = tuple((query, status) for query in queries)
            report = PassageReport(self.time, passages, drops, covered, openings=openings)
            self.papfis.observe(report)
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
    drive.go(-1, 0)
    legs = [query.passage for query in drive.papfis.queries]
    assert legs == [("start", "near"), ("near", "far")]
    drive.go(2.0, 0)
    first, second, _ = drive.papfis.queries
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
    for _ in range(5):
        drive.go(3.2, 0.0)
        drive.report("closed", 2)
        drive.go(3.7, 0.0)
        drive.report("unknown", 5)
        drive.report("open", 2)
    assert not drive.closed


def test_a_passage_in_which_the_robot_stands_for_long_is_closed() -> None:
    drive = on_the_way(RING)
    drive.go(4.5, 0)
    drive.report("unknown", 24)
    assert not drive.closed
    drive.report("unknown", 2)
    assert drive.closed == ["near - far"]


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


def test_a_door_moves_to_the_opening_that_two_reports_have_beside_it_and_stays_there() -> None:
    before, after = Place("before", 3.4, 0), Place("after", 4.6, 0)
    door = Place("door", 4, 0, "door")
    drive = Drive(row(START, before, door, after, END, width=0.9))
    drive.go(2.0, 0)
    normals = [query.normal for query in drive.papfis.queries]
    assert normals == [None, (-1.0, 0.0), None, None]
    opening = (((4.0, 0.0), (4.0, 0.4)),)
    for times, y in ((1, 0.0), (2, 0.4)):  # a single report, then two in a row
        drive.report("unknown", times, openings=opening)
        drive.report("unknown")
        assert [waypoint.y for waypoint in drive.papfis.path] == [y, y, y, 0.0]
    assert drive.papfis.notes == "door is 0.4 m to the left of the map's"
    drive.go(2.0, 3.0)  # off the path: planned anew
    assert [waypoint.y for waypoint in drive.papfis.path if waypoint.kind == "door"] == [0.4]


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


def test_a_waypoint_on_which_something_stands_is_passed_over_after_two_reports() -> None:
    drive = on_the_way(STRAIGHT)
    drive.report("unknown", covered=(AT["far"],))
    drive.report("unknown")
    drive.report("unknown", covered=(AT["far"],))
    assert drive.ahead == ["far", "end"], "two reports, but not in a row"
    drive.report("unknown", covered=(AT["far"], AT["end"]))
    assert drive.ahead == ["end"]
    drive.report("unknown", 4, covered=(AT["end"],))
    assert drive.ahead == ["end"], "a goal is not passed over"


def test_a_door_on_which_something_stands_is_not_passed_over() -> None:
    drive = Drive(row(START, NEAR, replace(FAR, kind="door"), END, width=1.5))
    drive.go(0, 0)
    drive.go(2.9, 0)
    drive.report("unknown", 4, covered=(AT["far"],))
    assert drive.ahead == ["far", "end"]


def test_a_covered_door_does_not_count_as_a_report_on_the_waypoint_behind_it() -> None:
    drive = Drive(row(START, replace(NEAR, kind="door"), FAR, END, width=1.5))
    drive.go(0, 0)
    drive.report("unknown", covered=(AT["near"],))
    drive.go(5.0, 3.0)  # off the path: planned anew, without the door
    for ahead in (["far", "end"], ["end"]):
        drive.report("unknown", covered=(AT["far"],))
        assert drive.ahead == ahead
