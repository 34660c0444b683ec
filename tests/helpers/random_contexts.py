"""Random contexts for property tests: every value valid, most of them at an extreme."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from navfw.context import CommandGrid, Context
from navfw.localmap import Arcs, LocalGoal, Ranges
from navfw.numerics import Array
from navfw.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, Conflicts, FlowField, Percept, Pose, Twist, Waypoint
from navfw.testing.behavior_scenes import wall_flow

ROBOT = RobotModel()
COMMANDS = CommandGrid(ROBOT)
OFFIS = Offis(ROBOT)
BEARINGS = np.linspace(-math.pi, math.pi, 49)[1:]
COORDINATE = st.floats(-50.0, 50.0)
YAW = st.floats(-math.pi, math.pi)
DURATION = st.one_of(st.just(0.0), st.floats(0.0, 300.0))


@st.composite
def layers(draw: st.DrawFn, shape: tuple[int, ...], low: float, high: float) -> Array:
    """An array of ``shape`` in [low, high]: constant, random, or random between the ends."""
    if draw(st.booleans()):
        return np.full(shape, draw(st.one_of(st.sampled_from((low, high)), st.floats(low, high))))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    values = rng.uniform(low, high, shape)
    ends = rng.random(shape)
    share = draw(st.sampled_from((0.0, 0.3, 0.5)))
    values[ends < share] = low
    values[ends > 1.0 - share] = high
    return values


@st.composite
def conflicts(draw: st.DrawFn) -> Conflicts:
    """Conflicts of all commands: contact everywhere, far away, or any mixture."""
    return Conflicts(
        distance=draw(layers(COMMANDS.shape, -3.0, 50.0)),
        time=draw(layers(COMMANDS.shape, 0.0, 10.0)),
        approach=draw(layers(COMMANDS.shape, 0.0, 0.4)),
        nearest=draw(st.floats(-2.0, 50.0)),
    )


@st.composite
def flows(draw: st.DrawFn, time: float) -> FlowField:
    """The flow between walls at any distance, with noise, and with vectors that say nothing."""
    distance = st.floats(0.02, 30.0)
    flow = wall_flow(ROBOT, time, draw(distance), draw(distance), draw(distance))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    noise = draw(st.sampled_from((0.0, 1.0, 50.0)))
    known = rng.random(flow.shape) < draw(st.sampled_from((0.0, 0.5, 1.0)))
    return FlowField(
        time,
        flow.points,
        flow.vectors + noise * rng.standard_normal(flow.vectors.shape),
        flow.confidence * known,
        flow.sigma,
        flow.motion,
        derotated=True,
    )


@st.composite
def waypoints(draw: st.DrawFn) -> Waypoint:
    """A waypoint of any kind, at any place."""
    return Waypoint(
        x=draw(COORDINATE),
        y=draw(COORDINATE),
        tolerance=draw(st.floats(0.01, 2.0)),
        place=draw(st.sampled_from(("", "there"))),
        kind=draw(st.sampled_from(("door", "goal", "room", "junction"))),
        final=draw(st.booleans()),
        width=draw(st.one_of(st.just(math.inf), st.floats(0.01, 3.0))),
    )


@st.composite
def local_goals(draw: st.DrawFn) -> LocalGoal:
    """A local goal, reachable or not; it may be where the robot is."""
    reachable = draw(st.booleans())
    near = st.floats(-1.0, 1.0)
    return LocalGoal(
        x=draw(near),
        y=draw(near),
        cost=draw(st.floats(0.0, 100.0)) if reachable else math.inf,
        reachable=reachable,
        detour=draw(st.floats(1.0, 50.0)) if reachable else math.inf,
    )


@st.composite
def contexts(draw: st.DrawFn, time: float = 1.0) -> Context:
    """A context at ``time`` [s] in which any of the optional parts may be missing."""
    pose = Pose(draw(COORDINATE), draw(COORDINATE), draw(YAW))
    twist = Twist(draw(st.floats(-0.15, 0.5)), draw(st.floats(-1.6, 1.6)))
    seen = draw(st.one_of(st.none(), flows(time - draw(st.sampled_from((0.0, 0.5))))))
    waypoint = draw(st.none() | waypoints())
    reach, limit = 1.6, 3.0
    return Context(
        time=time,
        robot=ROBOT,
        commands=COMMANDS,
        twist=twist,
        pose=pose,
        belief=_belief(draw, time),
        percept=_percept(seen, twist),
        arcs=Arcs(
            draw(layers(COMMANDS.shape, 0.0, reach)),
            draw(layers(COMMANDS.shape, 0.0, reach)),
            draw(layers(COMMANDS.shape, -0.1, reach)),
            draw(st.just(np.full(COMMANDS.w.shape, math.inf)) | layers(COMMANDS.w.shape, 0.0, 0.5)),
            reach,
        ),
        ranges=Ranges(
            BEARINGS,
            draw(layers(BEARINGS.shape, 0.0, limit)),
            draw(layers(BEARINGS.shape, 0.0, limit)),
            limit,
        ),
        waypoint=waypoint,
        local_goal=None if waypoint is None else draw(local_goals()),
        previous=draw(st.none() | st.just(Command(time - 0.1, twist, "avoid", "before"))),
        stalled=draw(DURATION),
        idle=draw(DURATION),
        flow=seen,
        conflicts=draw(st.none() | conflicts()),
    )


@st.composite
def drives(draw: st.DrawFn, most: int = 4) -> list[Context]:
    """Contexts of consecutive frames that may have nothing in common."""
    times = np.cumsum(draw(st.lists(st.sampled_from((0.1, 3.0)), min_size=1, max_size=most)))
    return [draw(contexts(time)) for time in times.tolist()]


def _belief(draw: st.DrawFn, time: float) -> Belief:
    sigma = draw(st.floats(0.0, 30.0))
    return Belief(
        time,
        Pose(draw(COORDINATE), draw(COORDINATE), draw(YAW)),
        np.diag([sigma**2, sigma**2, 1.0]),
        confidence=draw(st.floats(0.0, 1.0)),
        lost=draw(st.booleans()),
    )


def _percept(flow: FlowField | None, twist: Twist) -> Percept | None:
    return None if flow is None else OFFIS.perceive(flow, twist)
