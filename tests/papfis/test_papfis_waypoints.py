"""The waypoints of a route: which places become one, and its tolerance, width and passage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import get_args

import pytest
from papfis_maps import goal, joined

from navfw.papfis import (
    AT_PLACE,
    Endpoint,
    PassingTolerances,
    Route,
    distance_to_leg,
    has_passed,
    waypoints_of,
)
from navfw.signals import Pose, Waypoint
from navfw.topomap import Place, PlaceKind, TopoMap

Point = tuple[float, float]
KINDS: tuple[PlaceKind, ...] = get_args(PlaceKind)
PASSING = PassingTolerances(open=0.7, door=0.2, beside_door=0.4)


def waypoints(
    kinds: Sequence[PlaceKind],
    widths: tuple[float, ...] = (),
    *,
    start: float = -3.0,
    end: Waypoint,
) -> list[Waypoint]:
    """The waypoints of a route by way of places a, b, c, ... at x = 0, 3, 6, ... m.

    They are of these ``kinds``, joined by passages of these ``widths`` [m] (1.2 m); the route
    begins at x = ``start`` [m], off the passages, and ends at the goal ``end``, off them too.
    """
    places = [Place("abcdef"[k], 3.0 * k, 0.0, kind) for k, kind in enumerate(kinds)]
    widths = widths or (1.2,) * (len(kinds) - 1)
    passages = tuple(
        joined(a, b, width=width) for (a, b), width in zip(pairwise(places), widths, strict=True)
    )
    names = tuple(place.name for place in places)
    ends = Endpoint(start, 0.0), Endpoint(end.x, end.y)
    route = Route(*ends, names, passages, (None, *passages, None), 1.0, 1.0, 0.0, 0.0)
    return waypoints_of(route, end, TopoMap("row", places, passages), PASSING)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("beyond", "within"), [(0.1, True), (0.29, True), (0.31, False)])
def test_a_last_place_within_the_goals_tolerance_is_left_out_unless_it_is_a_door(
    kind: PlaceKind, beyond: float, within: bool
) -> None:
    way = waypoints(("room", "room", kind), end=goal(6.0 + beyond, 0.0, tolerance=0.3))
    left_out = within and kind != "door"
    assert [w.place for w in way] == ["a", "b", *([] if left_out else ["c"]), "goal"]
    # the passage that led to the place left out leads to the goal now
    assert way[-1].passage == (("b", "c") if left_out else None)
    assert [w.final for w in way] == [False] * (len(way) - 1) + [True]
    assert (way[-1].kind, way[-1].tolerance, way[-1].x) == ("goal", 0.3, 6.0 + beyond)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("away", "left_out"), [(0.9, True), (1.1, False)])
def test_a_first_place_where_the_route_starts_is_left_out(
    kind: PlaceKind, away: float, left_out: bool
) -> None:
    way = waypoints((kind, "room", "room"), start=-away * AT_PLACE, end=goal(9.0, 0.0))
    assert [w.place for w in way] == [*([] if left_out else ["a"]), "b", "c", "goal"]
    # each waypoint has the passage that leads there
    assert [w.passage for w in way][-3:] == [("a", "b"), ("b", "c"), None]
    assert [(w.x, w.y, w.kind) for w in way][-3:-1] == [(3.0, 0.0, "room"), (6.0, 0.0, "room")]


def test_one_place_at_start_and_goal_is_left_out_once() -> None:
    (way,) = waypoints(("room",), start=-0.05, end=goal(0.1, 0.0))
    assert (way.place, way.final, way.passage) == ("goal", True, None)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("widths", [(1.4, 0.9), (0.9, 1.4)])
def test_a_place_has_the_width_on_its_way_and_a_door_that_of_its_narrower_passage(
    kind: PlaceKind, widths: tuple[float, float]
) -> None:
    at_a, at_b, at_c, end = waypoints(("room", kind, "room"), widths, end=goal(9.0, 0.0))
    assert at_b.width == (min(widths) if kind == "door" else widths[0])
    assert (at_a.width, at_c.width, end.width) == (math.inf, widths[1], math.inf)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("at", [0, 1, 3, 5])
def test_tolerances_are_smaller_at_and_beside_doors_alone(kind: PlaceKind, at: int) -> None:
    kinds: list[PlaceKind] = ["room"] * 6
    kinds[at] = kind
    way = waypoints(kinds, end=goal(21.0, 0.0))
    away = {0: 0.2, 1: 0.4} if kind == "door" else {}
    assert [w.tolerance for w in way[:-1]] == [away.get(abs(k - at), 0.7) for k in range(6)]


def test_a_goal_on_a_passage_has_the_width_of_that_passage() -> None:
    a, b = Place("a", 0.0, 0.0), Place("b", 6.0, 0.0)
    passage, end = joined(a, b, width=0.8), goal(3.0, 0.0)
    ends = Endpoint(-3.0, 0.0), Endpoint(end.x, end.y)
    route = Route(*ends, ("a",), (), (None, passage), 1.0, 6.0, 0.0, 0.0)
    *_, last = waypoints_of(route, end, TopoMap("row", [a, b], [passage]), PASSING)
    assert (last.width, last.passage) == (0.8, ("a", "b"))


@pytest.mark.parametrize(
    ("body", "width", "beside"),
    [(0.18, 0.95, 0.4), (0.34, 0.95, 0.2), (0.46, 0.95, 0.12), (0.6, 0.95, 0.4), (0.34, 1.4, 0.4)],
)
def test_a_wide_robot_passes_the_places_beside_a_door_more_closely(
    body: float, width: float, beside: float
) -> None:
    """But for one that cannot turn there, and could not comply."""
    kinds = ["room", "room", "door", "room", "room"]
    tolerances = replace(PASSING, body=body).tolerances(kinds, [3.0, 3.0, width, 3.0, 3.0])
    assert tolerances == pytest.approx([0.7, beside, 0.2, beside, 0.7], abs=0.001)


# --- passing them --------------------------------------------------------------------------------

HERE, NEXT = (0.0, 0.0), (2.0, 0.0)


def waypoint(kind: str, width: float) -> Waypoint:
    return Waypoint(*NEXT, 0.3, "p", kind, final=False, width=width)


@pytest.mark.parametrize(
    ("at", "kind", "after", "passed"),
    [
        ((1.8, 0.1), "corridor", (4, 0), True),  # near
        ((1.6, 0.0), "corridor", (4, 0), False),  # not yet
        ((2.1, 0.8), "corridor", (4, 0), True),  # beyond, within reach
        ((2.1, 1.2), "corridor", (4, 0), False),  # beyond, too far aside
        ((1.9, 0.8), "corridor", (4, 0), False),  # aside, but not beyond
        ((1.7, 0.5), "corridor", (2, 4), True),  # cutting the corner
        ((1.3, 0.5), "corridor", (2, 4), False),
        ((2.1, 0.4), "door", (4, 0), True),  # through the gap
        ((2.1, 0.5), "door", (4, 0), False),  # beside the gap
        ((1.2, 0.4), "corridor", (0, 0.1), False),  # a turn back: only the distance counts
    ],
)
def test_when_a_waypoint_is_passed(at: Point, kind: str, after: Point, passed: bool) -> None:
    following = Waypoint(*after, 0.3, "q", "room", final=False)
    assert has_passed(at, HERE, waypoint(kind, 0.9), following, PassingTolerances()) is passed
    # wherever the map's origin is, and however its axes are turned
    for frame in (Pose(3.0, -2.0, 0.0), Pose(-1.0, 5.0, 2.0), Pose(0.5, 0.7, -1.2)):
        (x, y), (next_x, next_y) = frame.to_parent(*NEXT), frame.to_parent(*after)
        moved = replace(waypoint(kind, 0.9), x=x, y=y)
        beyond = replace(following, x=next_x, y=next_y)
        now, start = frame.to_parent(*at), frame.to_parent(*HERE)
        assert has_passed(now, start, moved, beyond, PassingTolerances()) is passed


def test_a_final_waypoint_must_be_reached() -> None:
    final = goal(*NEXT)
    assert not has_passed((2.4, 0.0), HERE, final, None, PassingTolerances())
    assert has_passed((2.2, 0.0), HERE, final, None, PassingTolerances())


def test_distance_to_a_leg() -> None:
    assert distance_to_leg((1.0, 0.5), HERE, NEXT) == pytest.approx(0.5)
    assert distance_to_leg((5.0, 4.0), HERE, NEXT) == pytest.approx(5.0)
    assert distance_to_leg((3.0, 4.0), HERE, HERE) == pytest.approx(5.0)


@pytest.mark.parametrize(("turn", "passed"), [(119.7, True), (120.3, False)])
def test_after_the_sharpest_turn_only_the_distance_counts(turn: float, passed: bool) -> None:
    beyond = math.radians(0.5 * turn)
    at = (NEXT[0] + 0.5 * math.cos(beyond), NEXT[1] + 0.5 * math.sin(beyond))
    after = (NEXT[0] + math.cos(2.0 * beyond), NEXT[1] + math.sin(2.0 * beyond))
    following = Waypoint(*after, 0.3, "q", "room", final=False)
    assert has_passed(at, HERE, waypoint("room", 0.9), following, PassingTolerances()) is passed
