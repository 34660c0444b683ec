"""Evidence against true geometry: what was touched, what was remembered there, what is a ghost."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from navfw.missions.outcome import MissionVerdict, Outcome
from navfw.missions.runner import RunResult
from navfw.missions.session import MissionResult, Session, prepare
from navfw.plugins import default_registry
from navfw.recording.run_log import Contact, RunLog
from navfw.signals import Belief, Odometry, Pose, Twist
from navfw.sim.floorplan import FloorPlan
from navfw.sim.movers import MoverTrack
from navfw.sim.worldspec import BoxSpec, CylinderSpec, WorldSpec
from navfw.suite.failure_causes import Cause, classify
from navfw.suite.failure_symptoms import collect_symptoms


@pytest.fixture(scope="module")
def empty() -> Session:
    """Three metres straight ahead from (0, 0); things are put in its way below."""
    return prepare("empty", "straight", registry=default_registry())


def session_with(empty: Session, **things: Any) -> Session:
    world = WorldSpec(name="w", x=(-6.0, 6.0), y=(-6.0, 6.0), **things)
    return replace(empty, world=world, plan=FloorPlan.from_world(world))


def log_to(x: float, y: float, yaw: float, contact: str = "", speed: float = 0.4) -> RunLog:
    """Four seconds straight to (x, y), at the end of which ``contact`` is touched."""
    time = np.arange(240) / 60.0
    back = speed * (time[-1] - time)
    true = np.column_stack(
        [x - back * math.cos(yaw), y - back * math.sin(yaw), np.full_like(time, yaw)]
    )
    contacts = (Contact(float(time[-1]), x, y, contact),) if contact else ()
    return RunLog(
        time=time,
        true=true,
        estimate=true.copy(),
        commands=np.column_stack([np.full_like(time, speed), np.zeros_like(time)]),
        leader=np.zeros(len(time), dtype=np.int16),
        emergency=np.zeros(len(time), dtype=np.bool_),
        leaders=("go_to_xy",),
        contacts=contacts,
    )


OFFSET = Pose(0.7, -0.4, 0.3)
"""Where the map's origin lies in odom: evidence must not mix up the frames."""


def result_of(
    session: Session, outcome: Outcome, log: RunLog, things: list[tuple[float, float]]
) -> MissionResult:
    """A run that ended so; the ego map remembers things at these points of the map frame."""
    verdict = MissionVerdict(outcome, "so it ended", "go_to_xy", log.ticks, float(log.time[-1]))
    stack = session.stack
    stack.start(session.mission.start, session.mission.goals)
    now = Pose(*log.true[-1])
    odometry = Odometry(float(log.time[-1]), OFFSET.compose(now), Twist(0.3, 0.0), 0.0, False)
    stack.mofis.occupancy.move(odometry.pose, odometry.time)
    rows, columns = np.indices(stack.mofis.occupancy.evidence.shape)
    for x, y in things:
        row, column = stack.mofis.occupancy.index(*OFFSET.to_parent(x, y))
        near = np.hypot(rows - row, columns - column) <= 2
        stack.mofis.occupancy.evidence[near] = stack.mofis.occupancy.params.most
    belief = Belief(odometry.time, now, np.zeros((3, 3)))
    stack.mofis.decide(odometry, belief, [], session.mission.goals[-1])
    stack.state = replace(stack.state, time=odometry.time, odometry=odometry, belief=belief)
    return MissionResult(session, RunResult(verdict, log, 4.0, 1.0, ()))


@pytest.mark.parametrize("remembered", [True, False])
@pytest.mark.parametrize("yaw", [0.0, 2.1])
def test_what_was_driven_into_head_on(empty: Session, remembered: bool, yaw: float) -> None:
    x, y = 0.38 * math.cos(yaw), 0.38 * math.sin(yaw)  # the robot's radius is 0.18 m
    session = session_with(empty, cylinders=(CylinderSpec(name="post", at=(x, y), radius=0.2),))
    rim = (0.18 * math.cos(yaw), 0.18 * math.sin(yaw))
    log = log_to(0.0, 0.0, yaw, "post")
    evidence = collect_symptoms(
        result_of(session, Outcome.COLLIDED, log, [rim] if remembered else [])
    )
    assert evidence.touch is not None
    assert evidence.touch.bearing == pytest.approx(0.0, abs=0.01)
    assert evidence.touch.speed == pytest.approx(0.4, abs=0.01)
    assert classify(evidence) is (Cause.DROVE_INTO if remembered else Cause.UNSEEN)


def test_what_was_backed_into(empty: Session) -> None:
    session = session_with(empty, boxes=(BoxSpec(name="crate", at=(-0.68, 0.1), size=(1, 1, 1)),))
    log = log_to(0.0, 0.0, 0.0, "crate", speed=-0.15)
    evidence = collect_symptoms(result_of(session, Outcome.COLLIDED, log, []))
    assert evidence.touch is not None
    assert abs(evidence.touch.bearing) == pytest.approx(math.pi, abs=0.01)
    assert classify(evidence) is Cause.REVERSED_INTO


def test_a_mover_is_met_where_it_was_then(empty: Session) -> None:
    """It walks down past the robot's left side and is touched there, 0.43 m from its centre."""
    time = np.array([0.0, 4.0])
    movers = MoverTrack(
        names=("walker",),
        radii=np.array([0.25]),
        time=time,
        points=np.array([[[0.0, 2.0]], [[0.0, 0.43]]]),
    )
    for cause, expected in (("mover", Cause.MOVER), ("robot", Cause.TURNED_INTO)):
        ended = result_of(empty, Outcome.COLLIDED, log_to(0, 0, 0, "walker"), [(0.0, 0.18)])
        evidence = collect_symptoms(replace(ended, movers=movers, collision_cause=cause))
        assert evidence.touch is not None
        assert evidence.touch.bearing == pytest.approx(0.5 * math.pi, abs=0.01)
        assert classify(evidence) is expected


WALL = [(1.0, 0.05 * i) for i in range(-75, 76)]
"""Remembered across the whole ego map, one metre ahead of the origin."""


def test_a_remembered_wall_that_is_not_there_is_a_ghost(empty: Session) -> None:
    evidence = collect_symptoms(result_of(empty, Outcome.STUCK, log_to(0.0, 0.0, 0.0), WALL))
    assert evidence.aiming is not None
    assert evidence.aiming.without_ghosts == evidence.aiming.sharp < 6.0  # 3 m of unknown floor
    assert classify(evidence) is Cause.GHOSTS


def test_a_remembered_wall_that_is_there_is_none(empty: Session) -> None:
    sides = {"east": (1, 0), "west": (-1, 0), "north": (0, 1), "south": (0, -1)}
    walls = tuple(
        BoxSpec(name=name, at=at, size=(2.0 - 1.9 * abs(at[0]), 2.0 - 1.9 * abs(at[1]), 1.0))
        for name, at in sides.items()
    )
    session = session_with(empty, boxes=walls)
    line = [-1.0 + 0.05 * i for i in range(41)]
    square = [point for a in line for point in ((a, 1.0), (a, -1.0), (1.0, a), (-1.0, a))]
    evidence = collect_symptoms(result_of(session, Outcome.STUCK, log_to(0.0, 0.0, 0.0), square))
    assert evidence.aiming is not None
    assert evidence.aiming.without_ghosts == math.inf
    assert classify(evidence) is Cause.AIM_UNREACHABLE


def test_two_posts_remembered_too_thick_leave_no_gap_but_there_is_one(empty: Session) -> None:
    """A wall with a gap 0.8 m wide; the memory has blurred its ends until nothing fits through."""
    walls = tuple(
        BoxSpec(name=f"wall {side:+d}", at=(1.0, side * 3.4), size=(0.1, 6.0, 1.0))
        for side in (1, -1)
    )
    session = session_with(empty, boxes=walls)
    line = [-4.5 + 0.05 * i for i in range(181)]
    thick = [(1.0, y) for y in line if abs(y) > 0.2]
    evidence = collect_symptoms(result_of(session, Outcome.STUCK, log_to(0.0, 0.0, 0.0), thick))
    assert evidence.aiming is not None
    assert evidence.aiming.without_ghosts > 1.5 * evidence.aiming.sharp
    assert classify(evidence) is Cause.BLURRED


def test_ground_gained_is_measured_along_the_shortest_way(empty: Session) -> None:
    """From 1.6 m behind the start to 0.5 m ahead of it; the goal is at 3 m."""
    evidence = collect_symptoms(result_of(empty, Outcome.TIMEOUT, log_to(0.5, 0.0, 0.0), []))
    assert evidence.driving is not None
    assert evidence.driving.driven == pytest.approx(1.59, abs=0.02)
    assert evidence.driving.gained == pytest.approx(0.5, abs=0.01)
    assert evidence.driving.recent_turned == pytest.approx(0.0)
    assert classify(evidence) is Cause.OSCILLATING
    slow = collect_symptoms(result_of(empty, Outcome.TIMEOUT, log_to(1.5, 0.0, 0.0), []))
    assert classify(slow) is Cause.SLOW
