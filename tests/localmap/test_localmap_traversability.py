"""What the ego map says of the way ahead: open, closed, unknown; and where the floor is missing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.drop_map import CERTAIN, CLEAR_VOTES, INTERVAL, DropMap
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.localmap.traversability import TraversabilityCheck
from navfw.robot import RobotModel
from navfw.signals import Belief, Label, PassageQuery, Percept, Pose

ROBOT = RobotModel()
FREE, TAKEN = -1.0, 2.0
HERE = Pose(0, 0, 0)


def corridor(pose: Pose = HERE, half: float = 0.5, ahead: float = 3.0) -> OccupancyGrid:
    """A corridor along x of the pose's frame, walls at both sides, all of it seen."""
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(pose, 0.0)
    paint(occupancy, pose, (-0.5, ahead), (-half, half), FREE)
    for side in (-1, 1):
        paint(
            occupancy, pose, (-0.5, ahead), tuple(sorted((side * half, side * (half + 0.1)))), TAKEN
        )
    return occupancy


def paint(
    occupancy: OccupancyGrid, pose: Pose, x: tuple[float, ...], y: tuple[float, ...], value: float
) -> None:
    """Put evidence on a rectangle given in the pose's frame [m]."""
    for ahead in np.arange(x[0], x[1] + 1e-9, 0.02):
        for left in np.arange(y[0], y[1] + 1e-9, 0.02):
            occupancy.log_odds[occupancy.index(*pose.to_parent(float(ahead), float(left)))] = value
    occupancy._clearance = occupancy._known = None


def asked(*points: tuple[float, float], width: float = 1.0) -> list[PassageQuery]:
    """Queries for the legs between the points."""
    names = [f"p{i}" for i in range(len(points))]
    return [
        PassageQuery((names[i], names[i + 1]), points[i], points[i + 1], width)
        for i in range(len(points) - 1)
    ]


def belief(pose: Pose, sigma: float = 0.05) -> Belief:
    return Belief(0.0, pose, np.diag([sigma**2, sigma**2, 0.01]))


def states(occupancy: OccupancyGrid, queries: list[PassageQuery], sigma: float = 0.05) -> list[str]:
    here = Pose(0, 0, 0)
    outlook = TraversabilityCheck(occupancy).look(queries, here, belief(here, sigma), 1.0)
    assert outlook is not None
    return [state for _, state in outlook.passages]


def test_a_seen_corridor_is_open() -> None:
    assert states(corridor(), asked((0, 0), (2, 0))) == ["open"]


def test_something_across_it_closes_it() -> None:
    occupancy = corridor()
    paint(occupancy, Pose(0, 0, 0), (1.2, 1.4), (-0.5, 0.5), TAKEN)
    assert states(occupancy, asked((0, 0), (2, 0))) == ["closed"]


def test_something_beside_the_way_does_not() -> None:
    occupancy = corridor(half=0.8)
    paint(occupancy, Pose(0, 0, 0), (1.2, 1.4), (-0.2, 0.8), TAKEN)
    assert states(occupancy, asked((0, 0), (2, 0), width=1.6)) == ["open"]


def test_what_has_not_been_seen_is_unknown() -> None:
    occupancy = corridor(ahead=1.0)
    assert states(occupancy, asked((0, 0), (2, 0))) == ["unknown"]
    paint(occupancy, Pose(0, 0, 0), (1.2, 1.4), (-0.5, 0.0), TAKEN)  # half of a barrier
    assert states(occupancy, asked((0, 0), (2, 0))) == ["unknown"]


def test_the_closed_leg_is_named_and_the_last_one_told() -> None:
    occupancy = corridor()
    paint(occupancy, Pose(0, 0, 0), (1.6, 1.8), (-0.5, 0.5), TAKEN)
    legs = asked((0, 0), (1, 0), (2, 0), (2.4, 0))
    assert states(occupancy, legs) == ["open", "closed"]


def test_what_is_far_is_not_judged() -> None:
    occupancy = corridor()
    paint(occupancy, Pose(0, 0, 0), (2.8, 2.9), (-0.5, 0.5), TAKEN)
    assert states(occupancy, asked((0, 0), (4, 0))) == ["open"]  # as far as 2.5 m
    assert states(occupancy, asked((3, 0), (4, 0))) == []


def test_who_does_not_know_where_he_stands_judges_nothing() -> None:
    occupancy = corridor()
    paint(occupancy, Pose(0, 0, 0), (1.2, 1.4), (-0.5, 0.5), TAKEN)
    assert states(occupancy, asked((0, 0), (2, 0)), sigma=0.5) == []


@settings(max_examples=25, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_map_and_odom_may_differ_by_any_motion(
    x: float, y: float, yaw: float, map_x: float, map_yaw: float
) -> None:
    """The queries are in the map; what has been seen is in odom."""
    in_odom, in_map = Pose(x, y, yaw), Pose(map_x, 2.0, map_yaw)
    occupancy = corridor(in_odom)
    queries = asked(in_map.to_parent(0, 0), in_map.to_parent(2, 0))
    watch = TraversabilityCheck(occupancy)
    outlook = watch.look(queries, in_odom, belief(in_map), 1.0)
    assert outlook is not None
    assert outlook.passages[0] == (queries[0], "open")
    paint(occupancy, in_odom, (1.2, 1.4), (-0.55, 0.55), TAKEN)
    outlook = watch.look(queries, in_odom, belief(in_map), 2.0)
    assert outlook is not None
    assert outlook.passages[0] == (queries[0], "closed")


def test_judgements_keep_their_interval() -> None:
    watch = TraversabilityCheck(corridor())
    here = Pose(0, 0, 0)
    told = [watch.look([], here, belief(here), 0.1 * k) is not None for k in range(11)]
    assert sum(told) == 3
    watch.reset()
    assert watch.look([], here, belief(here), 0.0) is not None


def floor_percept(time: float, label: Label, depth: float = 1.0) -> Percept:
    """One cell whose ray meets the floor ``depth`` [m] before the camera."""
    row = ROBOT.camera.mount_height / depth * ROBOT.camera.focal
    one = np.ones((1, 1))
    return Percept(
        time=time,
        points=np.array([[[0.0, row]]]),
        nearness=one,
        sigma=0.02 * one,
        confidence=one,
        height=0.0 * one,
        label=np.full((1, 1), label, np.int8),
        obstacles={},
        quadrants={},
        planes={},
        slopes={},
        situations={},
        floor_in_front=0.0,
        sentence="",
    )


def test_many_looks_below_the_floor_make_a_drop_where_the_rays_pass_it() -> None:
    drops = DropMap(ROBOT)
    pose = Pose(1.0, 2.0, math.pi / 2)
    for k in range(CERTAIN - 1):
        drops.enter(floor_percept(INTERVAL * k, Label.DROP), pose)
    assert drops.points() == []
    drops.enter(floor_percept(INTERVAL * CERTAIN, Label.DROP), pose)
    ((x, y),) = drops.points()
    assert math.dist((x, y), (1.0, 2.0 + ROBOT.camera.mount_forward + 1.0)) < 0.2


def test_clear_looks_make_a_drop_sooner_that_nobody_may_enter() -> None:
    drops = DropMap(ROBOT)
    clear = replace(floor_percept(0.0, Label.DROP), nearness=np.full((1, 1), 0.5))
    for k in range(CERTAIN // CLEAR_VOTES):
        assert drops.discs() == ()
        drops.enter(replace(clear, time=INTERVAL * k), Pose(0, 0, 0))
    ((x, y),) = drops.points()
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(Pose(0, 0, 0), 0.0)
    before = occupancy.occupied.copy()
    occupancy.set_obstacles(drops.discs())
    row, column = occupancy.index(x, y)
    assert occupancy.occupied[row, column]
    assert not before.any()
    assert occupancy.clearance[row, column] == 0.0
    assert occupancy.clearance[occupancy.index(x - 0.6, y)] == pytest.approx(0.45, abs=0.1)


@pytest.mark.parametrize(
    ("cells", "confidence", "looks"),
    [
        ("DDF", (1.0, 1.0, 1.0), CERTAIN),
        ("DF", (1.0, 1.0), None),
        ("DFF", (1.0, 1.0, 1.0), None),
        ("DFF", (1.0, 0.1, 0.2), CERTAIN),
        ("CCD", (1.0, 1.0, 1.0), CERTAIN // CLEAR_VOTES),
        ("CDD", (1.0, 1.0, 1.0), CERTAIN),
        ("CCFFF", (1.0, 1.0, 1.0, 1.0, 1.0), None),
    ],
)
def test_a_spot_is_what_most_of_its_sure_cells_say(
    cells: str, confidence: tuple[float, ...], looks: int | None
) -> None:
    one = floor_percept(0.0, Label.DROP)
    shape = (1, len(cells))
    percept = replace(
        one,
        # so near to each other that all of them meet the floor in one spot
        points=np.array([[[0.01 * k, one.points[0, 0, 1]] for k in range(len(cells))]]),
        label=np.array([[Label.FLOOR if c == "F" else Label.DROP for c in cells]], np.int8),
        nearness=np.array([[0.5 if c == "C" else 1.0 for c in cells]]),
        sigma=np.full(shape, 0.02),
        confidence=np.array([confidence]),
        height=np.zeros(shape),
    )
    drops = DropMap(ROBOT)
    needed = None
    for k in range(3 * CERTAIN):
        drops.enter(replace(percept, time=INTERVAL * k), Pose(0.0, 0.05, 0.0))
        if needed is None and drops.points():
            needed = k + 1
    assert needed == looks


def test_what_is_far_or_above_the_horizon_is_no_drop() -> None:
    drops = DropMap(ROBOT)
    for k in range(2 * CERTAIN):
        drops.enter(floor_percept(2 * k * INTERVAL, Label.DROP, depth=1.8), Pose(0, 0, 0))
        drops.enter(floor_percept((2 * k + 1) * INTERVAL, Label.DROP, depth=-1.0), Pose(0, 0, 0))
    assert drops.points() == []


def test_floor_seen_for_long_delays_a_drop_little() -> None:
    drops = DropMap(ROBOT)
    for k in range(50):
        drops.enter(floor_percept(INTERVAL * k, Label.FLOOR), Pose(0, 0, 0))
    clear = replace(floor_percept(0.0, Label.DROP), nearness=np.full((1, 1), 0.5))
    for k in range(3):
        drops.enter(replace(clear, time=INTERVAL * (50 + k)), Pose(0, 0, 0))
    assert drops.points()


def test_the_same_flow_seen_often_is_one_look() -> None:
    drops = DropMap(ROBOT)
    for k in range(10 * CERTAIN):
        drops.enter(floor_percept(0.001 * k, Label.DROP), Pose(0, 0, 0))
    assert drops.points() == []


@pytest.mark.parametrize("label", [Label.FLOOR, Label.OBSTACLE])
def test_looks_at_the_floor_speak_against_it_and_others_say_nothing(label: Label) -> None:
    drops = DropMap(ROBOT)
    for k in range(2 * CERTAIN):
        drops.enter(floor_percept(2 * k * INTERVAL, Label.DROP), Pose(0, 0, 0))
        other = floor_percept((2 * k + 1) * INTERVAL, label)
        drops.enter(replace(other, time=(2 * k + 1) * INTERVAL), Pose(0, 0, 0))
    assert bool(drops.points()) is (label is Label.OBSTACLE)
    drops.reset()
    assert drops.points() == []
