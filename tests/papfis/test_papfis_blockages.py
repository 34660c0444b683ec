"""Passages closed, reopened and marked dangerous by passage reports change the route."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
from papfis_maps import belief, goal, joined, line

from navfw.papfis import Papfis, Router
from navfw.robot import RobotModel
from navfw.signals import PassageReport, PassageStatus, Waypoint
from navfw.topomap import Place, TopoMap

ROBOT = RobotModel()

# start - near - far - end in a row, and a detour over north
PLACES = {
    name: Place(name, x, y)
    for name, x, y in (
        ("start", 0, 0),
        ("near", 3, 0),
        ("far", 6, 0),
        ("end", 9, 0),
        ("north", 4.5, 4),
    )
}


def ring(detour: bool = True, **values: float) -> TopoMap:
    start, near, far, end, north = PLACES.values()
    passages = line(start, near, far, end, width=1.5)
    if detour:
        passages += [joined(near, north, width=1.5, **values), joined(north, far, width=1.5)]
    return TopoMap("ring", PLACES.values(), passages)


class Drive:
    """A planner under way, with a passage report once a second."""

    def __init__(self, topo_map: TopoMap, params: Papfis.Params | None = None) -> None:
        self.papfis = Papfis(ROBOT, params)
        self.papfis.reset()
        self.papfis.start(topo_map, [goal(9, 0, "end")])
        self.time = 0.0
        self.at = (0.0, 0.0)

    def go(self, x: float, y: float) -> Waypoint:
        self.at = (x, y)
        return self._update()

    def report(
        self,
        status: PassageStatus,
        ends: tuple[str, str],
        times: int = 1,
        drops: tuple[tuple[float, float], ...] = (),
    ) -> Waypoint:
        for _ in range(times):
            self.time += 1.0
            queries = [q for q in self.papfis.queries if frozenset(q.passage) == frozenset(ends)]
            passages = tuple((query, status) for query in queries)
            self.papfis.observe(PassageReport(self.time, passages, drops))
            ahead = self._update()
        return ahead

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


def on_the_way(topo_map: TopoMap, params: Papfis.Params | None = None) -> Drive:
    drive = Drive(topo_map, params)
    drive.go(0, 0)
    drive.go(2.9, 0)
    assert drive.ahead == ["far", "end"]
    return drive


def test_the_planner_queries_the_legs_within_range() -> None:
    drive = Drive(ring())
    drive.go(0, 0)
    assert [query.passage for query in drive.papfis.queries] == [("start", "near")]
    drive.go(2.0, 0)
    first, second = drive.papfis.queries
    assert (first.start, first.end, first.width) == ((2.0, 0.0), (3.0, 0.0), 1.5)
    assert (second.passage, second.start) == (("near", "far"), (3.0, 0.0))


def test_three_votes_close_a_passage_and_change_the_route() -> None:
    drive = on_the_way(ring())
    assert drive.report("closed", ("near", "far"), 2).place == "far"
    assert drive.report("closed", ("near", "far")).place == "north"
    assert drive.ahead == ["north", "far", "end"]
    assert drive.closed == ["near - far"]
    assert (drive.papfis.no_route_reason, drive.papfis.replans) == (None, 1)
    assert drive.papfis.explain()["closed"] == [["near", "far"]]


def test_votes_within_the_interval_count_once() -> None:
    drive = on_the_way(ring(), Papfis.Params(vote_interval=10.0))
    drive.report("closed", ("near", "far"), 20)  # of which two are ten seconds apart
    assert not drive.closed
    drive.report("closed", ("near", "far"))
    assert drive.closed


def test_open_and_closed_votes_cancel_and_unknown_has_no_effect() -> None:
    drive = on_the_way(ring())
    for _ in range(10):
        drive.report("closed", ("near", "far"), 2)
        drive.report("unknown", ("near", "far"), 5)
        drive.report("open", ("near", "far"), 2)
    assert not drive.closed


def test_a_closed_passage_is_open_again_later_at_a_higher_cost() -> None:
    drive = on_the_way(ring(), Papfis.Params(closed_for=60.0))
    before = drive.router.costs.of(ring().passage("near", "far"))
    drive.report("closed", ("near", "far"), 3)
    drive.wait(59.0)
    assert drive.closed
    drive.wait(2.0)
    assert not drive.closed
    after = drive.router.costs
    assert before < after.of(ring().passage("near", "far")) < 5.0 * before
    assert after.explain(ring().passage("near", "far"))["inputs"]["uncertainty"] == 1.0
    assert drive.ahead == ["north", "far", "end"]  # the new route is kept


def test_without_another_route_the_old_one_is_kept_and_the_passage_named() -> None:
    drive = on_the_way(ring(detour=False))
    assert drive.report("closed", ("near", "far"), 3).place == "far"
    assert drive.papfis.no_route_reason == "the only route to end is closed: near - far"
    drive.report("open", ("near", "far"), 3)
    assert not drive.papfis.no_route_reason
    assert not drive.closed
    later = on_the_way(ring(detour=False))
    later.report("closed", ("near", "far"), 3)
    assert later.papfis.no_route_reason
    assert later.wait(61.0).place == "far", "it is open again when the time is over"
    assert not later.papfis.no_route_reason


def test_a_free_leg_back_does_not_reopen_a_passage() -> None:
    drive = on_the_way(ring())
    drive.go(4.5, 0)
    drive.report("closed", ("near", "far"), 3)
    assert drive.ahead == ["near", "north", "far", "end"]
    assert drive.papfis.queries[0].end == (3.0, 0.0)  # in the closed passage, but back
    drive.report("open", ("near", "far"), 10)
    assert drive.closed == ["near - far"]


def test_a_robot_in_a_closed_passage_leaves_it_by_the_end_behind_it() -> None:
    """At three quarters of the passage the far end is nearer, but behind the obstacle."""
    drive = on_the_way(ring())
    drive.go(5.2, 0)
    assert drive.report("closed", ("near", "far"), 3).place == "near"
    assert drive.ahead == ["near", "north", "far", "end"]


def test_a_drop_in_a_passage_changes_the_route_and_one_beside_it_does_not() -> None:
    drive = on_the_way(ring())
    drive.report("open", ("near", "far"), drops=((4.5, -1.5),))
    assert drive.ahead == ["far", "end"]
    drive.report("open", ("near", "far"), drops=((4.5, 0.4),))
    assert drive.ahead == ["north", "far", "end"]
    explained = drive.router.costs.explain(ring().passage("near", "far"))
    assert (explained["avoided"], explained["inputs"]["danger"]) == (True, 1.0)
    only = on_the_way(ring(detour=False))
    only.report("open", ("near", "far"), drops=((4.5, 0.0),))
    assert (only.ahead, only.papfis.no_route_reason) == (["far", "end"], None)


def test_a_dangerous_passage_is_used_when_the_safe_one_is_closed() -> None:
    drive = on_the_way(ring(danger=1.0))
    assert drive.report("closed", ("near", "far"), 3).place == "north"
    assert any(passage["avoided"] for passage in drive.papfis.explain()["passages"])


def test_reset_reopens_closed_passages() -> None:
    drive = on_the_way(ring())
    drive.report("closed", ("near", "far"), 3)
    drive.papfis.reset()
    drive.papfis.start(ring(), [goal(9, 0, "end")])
    drive.go(2.9, 0)
    assert drive.ahead == ["far", "end"]
    assert not drive.closed


def test_later_goals_are_planned_without_closed_passages() -> None:
    papfis = Papfis(ROBOT)
    papfis.reset()
    papfis.start(ring(detour=False), [goal(3, 0, "near"), goal(9, 0, "end")])
    drive = Drive(ring(detour=False))
    drive.papfis = papfis
    drive.go(0, 0)
    drive.go(1.0, 0)
    drive.router.close(drive.router.topo_map.passage("near", "far"))
    assert drive.go(2.9, 0).place == "far"  # the old route is kept
    assert papfis.no_route_reason == "the only route to end is closed: near - far"


@pytest.mark.parametrize("closed", ["ab", "abc", "abcd", "abcde"])
def test_at_most_three_closed_passages_are_named(closed: str) -> None:
    row = [*(Place(name, 1.8 * k, 0) for k, name in enumerate("abcde")), PLACES["end"]]
    drive = Drive(TopoMap("row", row, line(*row, width=1.5)))
    drive.go(0, 0)
    for ends in pairwise(closed[1:]):
        drive.router.close(drive.router.topo_map.passage(*ends))
    drive.report("closed", ("a", "b"), 3)
    names = [f"{a} - {b}" for a, b in pairwise(closed)]
    listed = ", ".join([*names[:3], "..."] if len(names) > 3 else names)
    assert drive.papfis.no_route_reason == f"the only route to end is closed: {listed}"


@pytest.mark.parametrize("start", [(0.0, 0.0), (2.9, 0.0)])
def test_an_empty_report_changes_nothing(start: tuple[float, float]) -> None:
    drive = Drive(ring())
    drive.go(*start)
    before = drive.ahead
    drive.papfis.observe(PassageReport(1.0))
    drive.wait(1.0)
    assert drive.ahead == before
