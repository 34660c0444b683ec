"""No shipped behaviour, composite or fusion fails, whatever valid context it gets."""

import math
from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import REGISTRY, behavior_of, composite_of, scene
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navfw.context import CommandGrid, Context
from navfw.guard.stage_answers import check_proposal
from navfw.interfaces import Fusion
from navfw.localmap import Arcs, LocalGoal, Ranges
from navfw.numerics import Array
from navfw.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, Conflicts, FlowField, Pose, Proposal, Twist, Waypoint
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


POSES = st.builds(Pose, COORDINATE, COORDINATE, YAW)


@st.composite
def beliefs(draw: st.DrawFn, time: float) -> Belief:
    """A position estimate of any certainty, at any place."""
    sigma = draw(st.floats(0.0, 30.0))
    covariance = np.diag([sigma**2, sigma**2, 1.0])
    confidence, lost = draw(st.floats(0.0, 1.0)), draw(st.booleans())
    return Belief(time, draw(POSES), covariance, confidence=confidence, lost=lost)


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
    twist = Twist(draw(st.floats(-0.15, 0.5)), draw(st.floats(-1.6, 1.6)))
    seen = draw(st.one_of(st.none(), flows(time - draw(st.sampled_from((0.0, 0.5))))))
    waypoint = draw(st.none() | waypoints())
    reach, limit = 1.6, 3.0
    return Context(
        time=time,
        robot=ROBOT,
        commands=COMMANDS,
        twist=twist,
        pose=draw(POSES),
        belief=draw(beliefs(time)),
        percept=None if seen is None else OFFIS.perceive(seen, twist),
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


PLAIN = scene()
MANY = settings(suppress_health_check=[HealthCheck.too_slow])


def shipped(kind: str) -> list[str]:
    """All names but that of the behaviour that needs another package."""
    return [name for name in REGISTRY.names(kind) if name != "navground"]


@pytest.mark.parametrize("name", shipped("behavior"))
@settings(MANY, max_examples=8)
@given(drive=drives())
def test_every_shipped_behavior_proposes_in_every_context(name: str, drive: list[Context]) -> None:
    behavior = behavior_of(name)
    for context in drive:
        proposal = behavior.propose(context)
        check_proposal(proposal, COMMANDS.shape)
        assert len(proposal.reason.splitlines()) == 1


@pytest.mark.parametrize("name", shipped("composite"))
@settings(MANY, max_examples=8)
@given(drive=drives())
def test_every_shipped_composite_weighs_in_every_context(name: str, drive: list[Context]) -> None:
    composite = composite_of(name)
    for context in drive:
        assert all(0.0 <= weight <= 1.0 for weight in composite.weigh(context).values())
        composite.explain()


@st.composite
def proposals(draw: st.DrawFn) -> Proposal:
    """Any valid proposal, none and all commands prohibited included."""
    layer = layers(COMMANDS.shape, 0.0, 1.0)
    degree = st.sampled_from((0.0, 1e-12, 1.0)) | st.floats(0.0, 1.0)
    return Proposal(draw(degree), draw(layer), draw(layer), "any")


@pytest.mark.parametrize("name", shipped("fusion"))
@settings(MANY, max_examples=10)
@given(
    context=contexts(),
    given_=st.dictionaries(st.sampled_from(("avoid", "give_way", "go_to_xy")), proposals()),
)
def test_every_shipped_fusion_gives_a_command_for_every_proposal(
    name: str, context: Context, given_: dict[str, Proposal]
) -> None:
    fusion = REGISTRY.get("fusion", name)(ROBOT)
    assert isinstance(fusion, Fusion)
    twist = fusion.fuse(context, given_).twist
    assert COMMANDS.v[0] - 1e-9 <= twist.v <= COMMANDS.v[-1] + 1e-9
    assert abs(twist.w) <= COMMANDS.max_w + 1e-9


@settings(MANY, max_examples=100)
@given(found=conflicts())
def test_give_way_always_leaves_a_command(found: Conflicts) -> None:
    proposal = behavior_of("give_way").propose(replace(PLAIN, conflicts=found))
    check_proposal(proposal, COMMANDS.shape)
    assert proposal.prohibition.min() < 0.5


def test_what_no_command_avoids_counts_against_none() -> None:
    # the robot rolls towards an obstacle close by: braking alone approaches it by 0.05 m
    approach = np.broadcast_to(0.05 + 0.2 * np.maximum(COMMANDS.v, 0.0)[:, None], COMMANDS.shape)
    distance = np.broadcast_to(0.15 - 0.3 * np.maximum(COMMANDS.v, 0.0)[:, None], COMMANDS.shape)
    found = Conflicts(distance, np.full(COMMANDS.shape, 0.5), approach, 0.1)
    proposal = behavior_of("give_way").propose(replace(PLAIN, conflicts=found))
    fast, standing = COMMANDS.nearest(Twist(0.5, 0.0)), COMMANDS.nearest(Twist(0.0, 0.0))
    assert proposal.prohibition[fast] > 0.8
    assert proposal.prohibition[standing] < 0.2
    assert proposal.desirability[standing] > proposal.desirability[fast]
