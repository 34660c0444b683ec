"""The way changes with what is seen of it: barred, open again, dangerous."""

from __future__ import annotations

from dataclasses import replace

import pytest
from papfis_maps import belief, goal, joined, line

from navfw.papfis import Papfis
from navfw.robot import RobotModel
from navfw.signals import Belief, PassageReport, PassageStatus, Waypoint
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
    """A planner on its way, told what there is to see once a second."""

    def __init__(self, topo_map: TopoMap, **params: float) -> None:
        self.papfis = Papfis(ROBOT, Papfis.Params(**params))
        self.papfis.reset()
        self.papfis.start(topo_map, [goal(9, 0, "end")])
        self.time = 0.0
        self.at = (0.0, 0.0)

    def go(self, x: float, y: float) -> Waypoint | None:
        self.at = (x, y)
        return self.papfis.update(self._belief())

    def see(
        self,
        state: PassageStatus,
        ends: tuple[str, str],
        times: int = 1,
        drops: tuple[tuple[float, float], ...] = (),
    ) -> Waypoint | None:
        head = None
        for _ in range(times):
            self.time += 1.0
            queries = [q for q in self.papfis.queries if frozenset(q.passage) == frozenset(ends)]
            self.papfis.observe(PassageReport(self.time, tuple((q, state) for q in queries), drops))
            head = self.papfis.update(self._belief())
        return head

    def wait(self, seconds: float) -> Waypoint | None:
        self.time += seconds
        return self.papfis.update(self._belief())

    @property
    def ahead(self) -> list[str]:
        return [waypoint.place for waypoint in self.papfis.path]

    def _belief(self) -> Belief:
        return replace(belief(*self.at), time=self.time)


def on_the_way(topo_map: TopoMap, **params: float) -> Drive:
    drive = Drive(topo_map, **params)
    drive.go(0, 0)
    drive.go(2.9, 0)
    assert drive.ahead == ["far", "end"]
    return drive


def test_the_planner_asks_about_the_legs_within_reach() -> None:
    drive = Drive(ring())
    drive.go(0, 0)
    assert [query.passage for query in drive.papfis.queries] == [("start", "near")]
    drive.go(2.0, 0)
    first, second = drive.papfis.queries
    assert (first.start, first.end, first.width) == ((2.0, 0.0), (3.0, 0.0), 1.5)
    assert (second.passage, second.start) == (("near", "far"), (3.0, 0.0))


def test_a_passage_seen_barred_three_times_is_gone_round() -> None:
    drive = on_the_way(ring())
    assert drive.see("closed", ("near", "far"), 2).place == "far"
    assert drive.see("closed", ("near", "far")).place == "north"
    assert drive.ahead == ["north", "far", "end"]
    assert [str(passage) for passage in drive.papfis.closed] == ["near - far"]
    assert (drive.papfis.no_route_reason, drive.papfis.replans) == (None, 1)
    assert drive.papfis.explain()["closed"] == [["near", "far"]]


def test_looks_in_short_succession_count_once() -> None:
    drive = on_the_way(ring(), vote_interval=10.0)
    drive.see("closed", ("near", "far"), 20)  # of which two are ten seconds apart
    assert not drive.papfis.closed
    drive.see("closed", ("near", "far"))
    assert drive.papfis.closed


def test_open_looks_speak_against_closed_ones_and_unknown_for_nothing() -> None:
    drive = on_the_way(ring())
    for _ in range(10):
        drive.see("closed", ("near", "far"), 2)
        drive.see("unknown", ("near", "far"), 5)
        drive.see("open", ("near", "far"), 2)
    assert not drive.papfis.closed


def test_a_closed_passage_is_tried_again_later_but_not_liked() -> None:
    drive = on_the_way(ring(), closed_for=60.0)
    before = drive.papfis._router.costs.of(ring().passage("near", "far"))
    drive.see("closed", ("near", "far"), 3)
    drive.wait(59.0)
    assert drive.papfis.closed
    drive.wait(2.0)
    assert not drive.papfis.closed
    after = drive.papfis._router.costs
    assert before < after.of(ring().passage("near", "far")) < 5.0 * before
    assert after.explain(ring().passage("near", "far"))["inputs"]["uncertainty"] == 1.0
    assert drive.ahead == ["north", "far", "end"]  # no reason to turn round


def test_without_another_way_the_old_plan_holds_and_the_passage_is_named() -> None:
    drive = on_the_way(ring(detour=False))
    assert drive.see("closed", ("near", "far"), 3).place == "far"
    assert drive.papfis.no_route_reason == "the only route to end is closed: near - far"
    drive.see("open", ("near", "far"), 3)
    assert drive.papfis.no_route_reason is None
    assert not drive.papfis.closed


def test_the_free_way_back_does_not_reopen_a_passage() -> None:
    drive = on_the_way(ring())
    drive.go(4.5, 0)
    drive.see("closed", ("near", "far"), 3)
    assert drive.ahead == ["near", "north", "far", "end"]
    assert drive.papfis.queries[0].end == (3.0, 0.0)  # in the barred passage, but back
    drive.see("open", ("near", "far"), 10)
    assert [str(passage) for passage in drive.papfis.closed] == ["near - far"]


def test_a_shut_way_is_open_again_when_the_time_is_over() -> None:
    drive = on_the_way(ring(detour=False), closed_for=30.0)
    drive.see("closed", ("near", "far"), 3)
    assert drive.papfis.no_route_reason
    assert drive.wait(31.0).place == "far"
    assert drive.papfis.no_route_reason is None


def test_who_stands_in_a_barred_passage_leaves_it_the_way_he_came() -> None:
    """At three quarters of the way the far end is nearer, but behind what bars the way."""
    drive = on_the_way(ring())
    drive.go(5.2, 0)
    assert drive.see("closed", ("near", "far"), 3).place == "near"
    assert drive.ahead == ["near", "north", "far", "end"]


def test_a_drop_on_the_way_is_gone_round_and_one_beside_it_is_not() -> None:
    drive = on_the_way(ring())
    drive.see("open", ("near", "far"), drops=((4.5, -1.5),))
    assert drive.ahead == ["far", "end"]
    drive.see("open", ("near", "far"), drops=((4.5, 0.4),))
    assert drive.ahead == ["north", "far", "end"]
    told = drive.papfis._router.costs.explain(ring().passage("near", "far"))
    assert (told["avoided"], told["inputs"]["danger"]) == (True, 1.0)


def test_a_drop_on_the_only_way_shuts_nothing() -> None:
    drive = on_the_way(ring(detour=False))
    drive.see("open", ("near", "far"), drops=((4.5, 0.0),))
    assert drive.ahead == ["far", "end"]
    assert drive.papfis.no_route_reason is None


def test_a_known_danger_is_taken_when_the_safe_way_is_barred() -> None:
    drive = on_the_way(ring(danger=1.0))
    assert drive.see("closed", ("near", "far"), 3).place == "north"
    assert any(passage["avoided"] for passage in drive.papfis.explain()["passages"])


def test_a_run_begins_without_what_the_last_one_learnt() -> None:
    drive = on_the_way(ring())
    drive.see("closed", ("near", "far"), 3)
    drive.papfis.reset()
    drive.papfis.start(ring(), [goal(9, 0, "end")])
    assert drive.go(2.9, 0) is not None
    assert drive.ahead == ["far", "end"]
    assert not drive.papfis.closed


def test_later_goals_are_planned_with_what_is_closed() -> None:
    papfis = Papfis(ROBOT)
    papfis.reset()
    papfis.start(ring(detour=False), [goal(3, 0, "near"), goal(9, 0, "end")])
    drive = Drive(ring(detour=False))
    drive.papfis = papfis
    drive.go(0, 0)
    drive.go(1.0, 0)
    router = papfis._router
    router.close(router.topo_map.passage("near", "far"))
    assert drive.go(2.9, 0).place == "far"  # the plan of before holds
    assert papfis.no_route_reason == "the only route to end is closed: near - far"


@pytest.mark.parametrize("start", [(0.0, 0.0), (2.9, 0.0)])
def test_a_silent_memory_changes_nothing(start: tuple[float, float]) -> None:
    drive = Drive(ring())
    drive.go(*start)
    before = drive.ahead
    drive.papfis.observe(PassageReport(1.0))
    drive.wait(1.0)
    assert drive.ahead == before
