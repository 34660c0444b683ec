"""What the ego map says of the way ahead: open, closed, unknown; and where the floor is missing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.mofis.drops import CERTAIN, CLEAR_VOTES, INTERVAL, DropMemory
from navfw.mofis.egomap import EgoMap
from navfw.mofis.passages import PassageWatch
from navfw.robot import RobotModel
from navfw.signals import Belief, Label, PassageQuery, Percept, Pose

ROBOT = RobotModel()
FREE, TAKEN = -1.0, 2.0
HERE = Pose(0, 0, 0)


def corridor(pose: Pose = HERE, half: float = 0.5, ahead: float = 3.0) -> EgoMap:
    """A corridor along x of the pose's frame, walls at both sides, all of it seen."""
    egomap = EgoMap(ROBOT)
    egomap.move(pose, 0.0)
    paint(egomap, pose, (-0.5, ahead), (-half, half), FREE)
    for side in (-1, 1):
        paint(egomap, pose, (-0.5, ahead), tuple(sorted((side * half, side * (half + 0.1)))), TAKEN)
    return egomap


def paint(
    egomap: EgoMap, pose: Pose, x: tuple[float, ...], y: tuple[float, ...], value: float
) -> None:
    """Put evidence on a rectangle given in the pose's frame [m]."""
    for ahead in np.arange(x[0], x[1] + 1e-9, 0.02):
        for left in np.arange(y[0], y[1] + 1e-9, 0.02):
            egomap.evidence[egomap.index(*pose.to_parent(float(ahead), float(left)))] = value
    egomap._clearance = egomap._known = None


def asked(*points: tuple[float, float], width: float = 1.0) -> list[PassageQuery]:
    """Queries for the legs between the points."""
    names = [f"p{i}" for i in range(len(points))]
    return [
        PassageQuery((names[i], names[i + 1]), points[i], points[i + 1], width)
        for i in range(len(points) - 1)
    ]


def belief(pose: Pose, sigma: float = 0.05) -> Belief:
    return Belief(0.0, pose, np.diag([sigma**2, sigma**2, 0.01]))


def states(egomap: EgoMap, queries: list[PassageQuery], sigma: float = 0.05) -> list[str]:
    here = Pose(0, 0, 0)
    outlook = PassageWatch(egomap).look(queries, here, belief(here, sigma), 1.0)
    assert outlook is not None
    return [state for _, state in outlook.passages]


def test_a_seen_corridor_is_open() -> None:
    assert states(corridor(), asked((0, 0), (2, 0))) == ["open"]


def test_something_across_it_closes_it() -> None:
    egomap = corridor()
    paint(egomap, Pose(0, 0, 0), (1.2, 1.4), (-0.5, 0.5), TAKEN)
    assert states(egomap, asked((0, 0), (2, 0))) == ["closed"]


def test_something_beside_the_way_does_not() -> None:
    egomap = corridor(half=0.8)
    paint(egomap, Pose(0, 0, 0), (1.2, 1.4), (-0.2, 0.8), TAKEN)
    assert states(egomap, asked((0, 0), (2, 0), width=1.6)) == ["open"]


def test_what_has_not_been_seen_is_unknown() -> None:
    egomap = corridor(ahead=1.0)
    assert states(egomap, asked((0, 0), (2, 0))) == ["unknown"]
    paint(egomap, Pose(0, 0, 0), (1.2, 1.4), (-0.5, 0.0), TAKEN)  # half of a barrier
    assert states(egomap, asked((0, 0), (2, 0))) == ["unknown"]


def test_the_closed_leg_is_named_and_the_last_one_told() -> None:
    egomap = corridor()
    paint(egomap, Pose(0, 0, 0), (1.6, 1.8), (-0.5, 0.5), TAKEN)
    legs = asked((0, 0), (1, 0), (2, 0), (2.4, 0))
    assert states(egomap, legs) == ["open", "closed"]


def test_what_is_far_is_not_judged() -> None:
    egomap = corridor()
    paint(egomap, Pose(0, 0, 0), (2.8, 2.9), (-0.5, 0.5), TAKEN)
    assert states(egomap, asked((0, 0), (4, 0))) == ["open"]  # as far as 2.5 m
    assert states(egomap, asked((3, 0), (4, 0))) == []


def test_who_does_not_know_where_he_stands_judges_nothing() -> None:
    egomap = corridor()
    paint(egomap, Pose(0, 0, 0), (1.2, 1.4), (-0.5, 0.5), TAKEN)
    assert states(egomap, asked((0, 0), (2, 0)), sigma=0.5) == []


@settings(max_examples=25, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_map_and_odom_may_differ_by_any_motion(
    x: float, y: float, yaw: float, map_x: float, map_yaw: float
) -> None:
    """The queries are in the map; what has been seen is in odom."""
    in_odom, in_map = Pose(x, y, yaw), Pose(map_x, 2.0, map_yaw)
    egomap = corridor(in_odom)
    queries = asked(in_map.to_parent(0, 0), in_map.to_parent(2, 0))
    watch = PassageWatch(egomap)
    outlook = watch.look(queries, in_odom, belief(in_map), 1.0)
    assert outlook is not None
    assert outlook.passages[0] == (queries[0], "open")
    paint(egomap, in_odom, (1.2, 1.4), (-0.55, 0.55), TAKEN)
    outlook = watch.look(queries, in_odom, belief(in_map), 2.0)
    assert outlook is not None
    assert outlook.passages[0] == (queries[0], "closed")


def test_judgements_keep_their_interval() -> None:
    watch = PassageWatch(corridor())
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
    drops = DropMemory(ROBOT)
    pose = Pose(1.0, 2.0, math.pi / 2)
    for k in range(CERTAIN - 1):
        drops.enter(floor_percept(INTERVAL * k, Label.DROP), pose)
    assert drops.points() == []
    drops.enter(floor_percept(INTERVAL * CERTAIN, Label.DROP), pose)
    ((x, y),) = drops.points()
    assert math.dist((x, y), (1.0, 2.0 + ROBOT.camera.mount_forward + 1.0)) < 0.2


def test_clear_looks_make_a_drop_sooner_that_nobody_may_enter() -> None:
    drops = DropMemory(ROBOT)
    clear = replace(floor_percept(0.0, Label.DROP), nearness=np.full((1, 1), 0.5))
    for k in range(CERTAIN // CLEAR_VOTES):
        assert drops.discs() == ()
        drops.enter(replace(clear, time=INTERVAL * k), Pose(0, 0, 0))
    ((x, y),) = drops.points()
    egomap = EgoMap(ROBOT)
    egomap.move(Pose(0, 0, 0), 0.0)
    before = egomap.occupied.copy()
    egomap.take(drops.discs())
    row, column = egomap.index(x, y)
    assert egomap.occupied[row, column]
    assert not before.any()
    assert egomap.clearance[row, column] == 0.0
    assert egomap.clearance[egomap.index(x - 0.6, y)] == pytest.approx(0.45, abs=0.1)


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
    drops = DropMemory(ROBOT)
    needed = None
    for k in range(3 * CERTAIN):
        drops.enter(replace(percept, time=INTERVAL * k), Pose(0.0, 0.05, 0.0))
        if needed is None and drops.points():
            needed = k + 1
    assert needed == looks


def test_what_is_far_or_above_the_horizon_is_no_drop() -> None:
    drops = DropMemory(ROBOT)
    for k in range(2 * CERTAIN):
        drops.enter(floor_percept(2 * k * INTERVAL, Label.DROP, depth=1.8), Pose(0, 0, 0))
        drops.enter(floor_percept((2 * k + 1) * INTERVAL, Label.DROP, depth=-1.0), Pose(0, 0, 0))
    assert drops.points() == []


def test_floor_seen_for_long_delays_a_drop_little() -> None:
    drops = DropMemory(ROBOT)
    for k in range(50):
        drops.enter(floor_percept(INTERVAL * k, Label.FLOOR), Pose(0, 0, 0))
    clear = replace(floor_percept(0.0, Label.DROP), nearness=np.full((1, 1), 0.5))
    for k in range(3):
        drops.enter(replace(clear, time=INTERVAL * (50 + k)), Pose(0, 0, 0))
    assert drops.points()


def test_the_same_flow_seen_often_is_one_look() -> None:
    drops = DropMemory(ROBOT)
    for k in range(10 * CERTAIN):
        drops.enter(floor_percept(0.001 * k, Label.DROP), Pose(0, 0, 0))
    assert drops.points() == []


@pytest.mark.parametrize("label", [Label.FLOOR, Label.OBSTACLE])
def test_looks_at_the_floor_speak_against_it_and_others_say_nothing(label: Label) -> None:
    drops = DropMemory(ROBOT)
    for k in range(2 * CERTAIN):
        drops.enter(floor_percept(2 * k * INTERVAL, Label.DROP), Pose(0, 0, 0))
        other = floor_percept((2 * k + 1) * INTERVAL, label)
        drops.enter(replace(other, time=(2 * k + 1) * INTERVAL), Pose(0, 0, 0))
    assert bool(drops.points()) is (label is Label.OBSTACLE)
    drops.reset()
    assert drops.points() == []
